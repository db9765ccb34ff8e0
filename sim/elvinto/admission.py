"""May this be executed or answered now? What the machine makes of a command before it looks at its blocks (§4, §6, §7).

It answers nothing and changes nothing, the machine does. The one rule: what is neither promised by the standard nor
switched on in the settings is refused.
"""

from dataclasses import dataclass
from typing import Literal

from sim.elvinto.commands import Command, only_queries
from sim.elvinto.settings import SimSettings

Refusal = Literal["alarm", "busy"]
"""A key of `VirtualElvinto.dropped`."""

Verdict = Literal["execute", "interrupt", "acknowledged", "answered"] | Refusal
"""`interrupt`: instead of what is executing. `acknowledged`, `answered`: it came before, and had got that far."""


@dataclass(frozen=True, slots=True)
class Situation:
    """What the machine is at: the command that it executes, whether an alarm stands, the last ID that it accepted."""

    running: Command | None
    alarm: bool
    last_id: int


def judge_command(settings: SimSettings, now: Situation, name: str, wire_id: int, blocks: list[str]) -> Verdict:
    """A command with an ID. An alarm lets RESETALERT through; what executes, nothing but W98 (§4)."""
    if now.alarm and name != "RESETALERT" and not (settings.init_in_alarm and blocks and only_queries(blocks)):
        return "alarm"
    if now.running is None:
        return "execute" if wire_id > now.last_id else "answered"
    if wire_id == now.running.id and settings.repeat == "reack":
        return "acknowledged"
    stops = wire_id > now.last_id and settings.estop_while_running and blocks == ["W98"]
    return "interrupt" if stops else "busy"


def judge_question(settings: SimSettings, now: Situation) -> Refusal | None:
    """INIT, READY and the like, which need no new ID; None: it is answered."""
    if now.running is not None:
        return "busy"
    return "alarm" if now.alarm and not settings.init_in_alarm else None
