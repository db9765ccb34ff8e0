"""The engine's phases as a table: what each sends, what it waits for, how often that must come, and where it goes.

docs/ncframe-phases.md is made from STEPS and OUTCOMES (`python -m protocol.ncframe.phases`); a test keeps it true.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, Literal

from protocol import statepage
from protocol.commands import Position, SendBatch
from protocol.ncframe.codec import Frame


class Phase(Enum):
    """What an engine is doing; exactly one at a time: there is never more than one frame on the wire."""

    GREET = "asks whether a machine is there and what it has counted"
    IDLE = "takes commands"
    POLL = "asks whether the machine is still there and has counted nothing else"
    PROVE = "asks the same before the first frame after a rest"
    SENT = "a frame is on the wire, its answer is open"
    CONFIRM = "ACK came: is the frame counted?"
    ASK = "silence or NAK: is the frame counted? (with a counter)"
    LISTEN = "NAK, or an ACK too early: how many answers follow? (without a counter)"
    HELD = "the next frame waits for XON or cycle start"
    ABORT = "everything is to stop"
    CLOSED = "the link is given up"


@dataclass(frozen=True, slots=True)
class Step:
    """One exchange. `agree`: so many answers in a row must say the same count before it is believed, where it is not
    the one that was expected (a flipped bit is not said twice). `waits`: the bytes since the last thing that was sent
    are read only when nothing has come for `gap_s`."""

    sends: str
    awaits: str
    then: Phase | None
    on_silence: Phase | None
    agree: int = 0
    waits: bool = True


STEPS: Final[dict[Phase, Step]] = {
    Phase.GREET: Step("ENQ", "answer", Phase.IDLE, Phase.CLOSED, agree=2),
    Phase.IDLE: Step("", "", None, None, waits=False),
    Phase.POLL: Step("ENQ", "the count as it was", Phase.IDLE, Phase.CLOSED, agree=2),
    Phase.PROVE: Step("ENQ", "the count as it was", Phase.SENT, Phase.CLOSED, agree=2),
    Phase.SENT: Step("the frame", "ACK", Phase.CONFIRM, Phase.ASK, waits=False),
    Phase.CONFIRM: Step("ENQ", "the frame is counted", Phase.SENT, Phase.CLOSED, agree=2),
    Phase.ASK: Step("ENQ", "the frame is counted", Phase.SENT, Phase.CLOSED, agree=2),
    Phase.LISTEN: Step("ENQ once", "ACKs and NAKs", Phase.SENT, Phase.GREET),
    Phase.HELD: Step("", "XON, cycle start", Phase.SENT, None, waits=False),
    Phase.ABORT: Step("CAN", "CAN", Phase.IDLE, Phase.CLOSED),
    Phase.CLOSED: Step("", "", None, None, waits=False),
}

OUTCOMES: Final[tuple[tuple[Phase, str, Phase], ...]] = (
    (Phase.IDLE, "submit", Phase.SENT),
    (Phase.IDLE, "submit after a rest", Phase.PROVE),
    (Phase.IDLE, "locate, clear alarm, nothing heard for poll_interval", Phase.POLL),
    (Phase.GREET, "half of an open batch is counted, and it may go on", Phase.SENT),
    (Phase.SENT, "ACK, no counter", Phase.SENT),
    (Phase.SENT, "NAK, counter", Phase.ASK),
    (Phase.SENT, "NAK, no counter", Phase.LISTEN),
    (Phase.SENT, "ACK too early, no counter", Phase.LISTEN),
    (Phase.SENT, "silence, no counter: in doubt", Phase.GREET),
    (Phase.SENT, "answered, the last frame", Phase.IDLE),
    (Phase.CONFIRM, "the last frame is counted", Phase.IDLE),
    (Phase.CONFIRM, "another count: restarted, or in doubt", Phase.IDLE),
    (Phase.ASK, "the last frame is counted", Phase.IDLE),
    (Phase.ASK, "not counted: the same frame again", Phase.SENT),
    (Phase.ASK, "another count: restarted, or in doubt", Phase.IDLE),
    (Phase.LISTEN, "NAK and one ACK: the same frame again", Phase.SENT),
    (Phase.LISTEN, "more than one reading: in doubt", Phase.GREET),
    (Phase.SENT, "executed, XOFF or feed hold came", Phase.HELD),
    (Phase.HELD, "nothing heard for poll_interval", Phase.POLL),
    (Phase.POLL, "a frame waits", Phase.HELD),
)
"""The ways that STEPS does not tell. CAN from the machine leads from every phase to IDLE, in alarm."""


@dataclass(slots=True)
class Inquiry:
    """An exchange of ENQ: the tries, the bytes that came since the last silence, the answers so far.

    `expected`: the one count that is believed when it is said once. `until`: before it nothing is given up, for the
    machine may be executing and answers only when it stands. `stragglers`: the verdict is there, but of more than one
    ENQ some answers are still to come, and must not be taken for a frame's.
    """

    began_at: float
    until: float
    expected: int | None
    once: bool = False
    tries: int = 0
    asked_at: float = 0.0
    burst: bytearray = field(default_factory=bytearray)
    last_byte_at: float = 0.0
    answers: list[int | None] = field(default_factory=list)
    acks: int = 0
    naks: int = 0
    stragglers: bool = False


@dataclass(slots=True)
class Flight:
    """Frames on their way, one at a time. `token` None: a batch of a job. The first `done` frames are executed.

    `sent`: so many frames may have reached the machine (`done`, or one more). `attempts` counts how often any frame of
    it went out again. `run_s`: how long the frame on the wire may take, `least_s`: how long it does by what it moves.
    `acked`, `refused_at`: what the machine said of it.
    """

    batch: SendBatch
    frames: Sequence[Frame]
    token: int | None = None
    position: Position = field(default_factory=dict)
    done: int = 0
    sent: int = 0
    attempts: int = 1
    naks: int = 0
    sent_at: float = 0.0
    on_wire_at: float = 0.0
    run_s: float = 0.0
    least_s: float = 0.0
    announced: bool = False
    acked: bool = False
    refused_at: float = math.inf

    @property
    def expected_end_at(self) -> float:
        return self.on_wire_at + self.run_s


Reason = Literal["error", "alarm", "estop", "restart", "stop", "link"]


READ: Final = {True: "whole, after a silence", False: "byte by byte"}


def page() -> str:
    """docs/ncframe-phases.md: the table and its diagram."""
    return statepage.page(
        engine="NC frame",
        module="protocol.ncframe.phases",
        notes=["CAN from the machine leads from every phase to IDLE, in alarm; an emergency stop leads to ABORT."],
        columns=["phase", "what the engine does", "what it sends", "what it waits for", "how answers are read"],
        rows=[(phase.name, phase.value, step.sends, step.awaits, READ[step.waits]) for phase, step in STEPS.items()],
        begins=["GREET"],
        arrows=statepage.arrows_of(STEPS, OUTCOMES),
    )


if __name__ == "__main__":
    sys.stdout.write(page())
