"""The engine's phases as a table: what each sends, under which ID, what it waits for, and where it goes.

docs/elvinto-phases.md is made from STEPS and OUTCOMES (`python -m protocol.elvinto.phases`); a test keeps it true.
"""

import sys
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, Literal

from protocol import statepage
from protocol.commands import Position, SendBatch
from protocol.elvinto.codec import encode_gcode, encode_message
from protocol.events import StateReported


class Phase(Enum):
    """What an engine is doing; exactly one at a time, since the protocol is stop-and-wait."""

    INIT = "initialises the machine"
    GREET = "exchanges READY"
    REPORT = "asks for STATE during moves"
    LOCATE = "asks for the first position"
    IDLE = "takes commands"
    SENT = "a command is sent, RECEIVED is open"
    RUNNING = "RECEIVED came, OK is open"
    SYNC = "proves the machine's ID memory and position"
    PROBE = "finds out whether the machine has restarted"
    ASK = "asks where the machine stands"
    LIST = "reads the SD card's folder"
    TOOLCHECK = "asks whether a tool change is pending"
    FILE = "a program runs from the SD card"
    CHECK = "finds out whether a machine that executes nothing is there at all"
    CLOSED = "the link is given up"


@dataclass(frozen=True, slots=True)
class Step:
    """One exchange.

    `ids`: `fresh` takes a new ID for each try, since the repetition does no harm and a machine that has executed the
    try before would not answer to its ID again; `probe` counts up from 1 among the IDs that only a machine without
    memory accepts. (Commands that must not run twice are no Step: `flights.py` repeats their bytes under their ID.)
    `tries` None: the dialect's `max_retries`; 0: the phase has its own end.
    """

    message: bytes
    ids: Literal["fresh", "probe"]
    awaits: Literal["ack", "ready", "position", "answer"]
    then: Phase
    on_silence: Phase
    tries: int | None = None


QUERY_POSITION = encode_gcode(("W95",))

STEPS: dict[Phase, Step] = {
    Phase.INIT: Step(encode_message("INIT"), "fresh", "ack", Phase.GREET, Phase.CLOSED),
    Phase.GREET: Step(encode_message("READY"), "fresh", "ready", Phase.REPORT, Phase.CLOSED),
    Phase.REPORT: Step(encode_gcode(("W90",)), "fresh", "ack", Phase.LOCATE, Phase.CHECK),
    Phase.LOCATE: Step(QUERY_POSITION, "fresh", "position", Phase.IDLE, Phase.CHECK),
    Phase.SYNC: Step(QUERY_POSITION, "fresh", "position", Phase.IDLE, Phase.CHECK),
    Phase.PROBE: Step(QUERY_POSITION, "probe", "answer", Phase.ASK, Phase.ASK, tries=0),
    Phase.ASK: Step(QUERY_POSITION, "fresh", "position", Phase.IDLE, Phase.CHECK, tries=0),
    Phase.LIST: Step(encode_message("READDIR"), "fresh", "answer", Phase.IDLE, Phase.IDLE),
    Phase.TOOLCHECK: Step(encode_message("CHECKCHANGETOOL"), "fresh", "answer", Phase.IDLE, Phase.IDLE, tries=2),
    Phase.CHECK: Step(encode_message("READY"), "fresh", "ready", Phase.IDLE, Phase.CLOSED, tries=3),
}

EMERGENCY = encode_gcode(("W98",))

OUTCOMES: tuple[tuple[Phase, str, Phase], ...] = (
    (Phase.IDLE, "submit", Phase.SENT),
    (Phase.IDLE, "memory unproven, or nothing heard for a while", Phase.SYNC),
    (Phase.IDLE, "list files", Phase.LIST),
    (Phase.IDLE, "ask for a tool change", Phase.TOOLCHECK),
    (Phase.SENT, "RECEIVED", Phase.RUNNING),
    (Phase.SENT, "OK, ERROR, alarm", Phase.IDLE),
    (Phase.SENT, "RECEIVED of an SD program", Phase.FILE),
    (Phase.SENT, "no RECEIVED after max_retries, or a sign of a restart", Phase.PROBE),
    (Phase.RUNNING, "OK, ERROR, alarm, two idle reports", Phase.IDLE),
    (Phase.RUNNING, "silence", Phase.PROBE),
    (Phase.PROBE, "restarted", Phase.INIT),
    (Phase.PROBE, "kept its memory, may repeat", Phase.SENT),
    (Phase.PROBE, "kept its memory, may not repeat", Phase.ASK),
    (Phase.FILE, "PROGRAM_END, idle", Phase.IDLE),
)
"""The ways out of phases that STEPS does not tell. From every phase an unasked READY leads to INIT."""


@dataclass(slots=True)
class Turn:
    """The exchange of a phase: the tries so far and what came back to the last of them."""

    step: Step
    began_at: float = 0.0
    rounds: int = 1
    ids: list[int] = field(default_factory=list)
    asked_at: float = 0.0
    in_vain: int = 0
    received: bool = False
    ended: bool = False
    state: StateReported | None = None

    @property
    def located(self) -> bool:
        """W95 was executed: acknowledged *and* answered. (One that is only acknowledged again is not executed.)"""
        return self.step.awaits == "position" and self.received and self.state is not None


@dataclass(frozen=True, slots=True)
class Unproven:
    """A batch whose OK came and whose report waits for W95.

    `locate`: because its effect cannot be computed. `repeated`: because its bytes went out more than once; if the
    machine turns out to have restarted in between, it may have executed them twice.
    """

    id: int
    inferred: bool
    locate: bool
    repeated: bool


@dataclass(slots=True)
class Flight:
    """A command on its way. `token` None: a batch of a job."""

    batch: SendBatch
    message: bytes
    start: Position
    token: int | None = None
    kind: Literal["gcode", "alarm", "file"] = "gcode"
    attempts: int = 0
    sent_at: float = 0.0
    received_at: float | None = None
    probed: bool = False
    seen_running: bool = False  # STATE `run` without RECEIVED: something executes, and nothing else is under way
    idle_reports: int = 0

    @property
    def id(self) -> int:
        return self.batch.id

    @property
    def repeatable(self) -> bool:
        """Whether its repetition needs no care: the end of a program (§5.6), clearing an alarm."""
        return self.batch.ends_program or self.kind == "alarm"


EMERGENCY_TRIES: Final = 30
"""How often W98 goes out again before nobody can be reached."""
HANDSHAKE: Final = frozenset({Phase.INIT, Phase.GREET, Phase.REPORT, Phase.LOCATE})
"""Before the machine takes commands."""


def page() -> str:
    """docs/elvinto-phases.md: the table and its diagram."""
    arrows = [(phase, f"answered ({step.awaits})", step.then) for phase, step in STEPS.items() if step.then != phase]
    arrows += [(phase, "silence", step.on_silence) for phase, step in STEPS.items()]
    return statepage.page(
        engine="ElVinto",
        module="protocol.elvinto.phases",
        notes=["An emergency stop leads from every phase to IDLE (in alarm), an unasked READY to INIT."],
        columns=["phase", "what the engine does", "what it sends"],
        rows=[(phase.name, phase.value, _sends(phase)) for phase in Phase],
        begins=["INIT: no job is open", "PROBE: a job is open"],
        arrows=[*arrows, *OUTCOMES],
    )


def _sends(phase: Phase) -> str:
    step = STEPS.get(phase)
    if step is None:
        return ""
    ids = "a new ID each time" if step.ids == "fresh" else "IDs from 1, which only a machine without memory accepts"
    return f"`{step.message.decode()}` under {ids}"


if __name__ == "__main__":
    sys.stdout.write(page())
