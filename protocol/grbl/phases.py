"""The engine's phases as a table: what each sends, what it waits for, where it goes, and what answers mean in it.

docs/grbl-phases.md is made from STEPS and OUTCOMES (`python -m protocol.grbl.phases`); a test keeps it true.
What holds back the stream while READY is no phase: a hold, a pendant, a tool change can come together (`GATES`).
"""

import sys
from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

from protocol import statepage


class Phase(Enum):
    """What an engine is doing; exactly one at a time."""

    OPENING = "waits for the banner of a board that resets when its port is opened"
    ASKING = "asks whether a controller is there"
    ATTENDING = "waits until the controller takes lines: something runs in it, is held, or sleeps"
    READING = "reads firmware, modal groups, offsets and settings"
    READY = "takes commands, streams, polls"
    STOPPING = "comes to a stand before the reset"
    RESETTING = "has sent the soft reset"
    RESTARTING = "waits for the banner of a controller that resets itself ($C off, $RST, a failed homing)"
    LOCKED = "has an alarm that leaves nothing but a reset (1, 2)"
    CLOSED = "the link is given up"


READING: Final = Phase.READING
READY: Final = Phase.READY
CLOSED: Final = Phase.CLOSED
"""What is asked for at every line: by these names it costs a tenth of what a member of an Enum does (Python 3.11)."""


@dataclass(frozen=True, slots=True)
class Step:
    """`counts`: answers to lines are counted; elsewhere every ok and error is ignored (II.3). `polls`: `?` goes out;
    `silence`: is no answer to it a lost link?"""

    sends: str
    awaits: str
    then: Phase | None
    on_silence: Phase | None
    counts: bool = False
    polls: bool = False
    silence: Literal["lost", "tolerated"] = "tolerated"


STEPS: Final[dict[Phase, Step]] = {
    Phase.OPENING: Step("", "banner", Phase.READING, Phase.ASKING),
    Phase.ASKING: Step("?", "report", Phase.READING, Phase.CLOSED, polls=True),
    Phase.ATTENDING: Step("?", "report", Phase.READING, Phase.CLOSED, polls=True, silence="lost"),
    Phase.READING: Step("$I $ $G $# $$", "answers", Phase.READY, Phase.CLOSED, counts=True, polls=True, silence="lost"),
    Phase.READY: Step("lines, ?", "", None, Phase.CLOSED, counts=True, polls=True, silence="lost"),
    Phase.STOPPING: Step("! ?", "Hold:0", Phase.RESETTING, Phase.RESETTING, counts=True, polls=True),
    Phase.RESETTING: Step("0x18", "banner", Phase.READING, Phase.CLOSED),
    Phase.RESTARTING: Step("", "banner", Phase.READING, Phase.READING),
    Phase.LOCKED: Step("", "a reset by hand", Phase.RESETTING, None),
    Phase.CLOSED: Step("", "", None, None),
}

OUTCOMES: Final[tuple[tuple[Phase, str, Phase], ...]] = (
    (Phase.ASKING, "Run, Hold, Door, Home, Jog, Sleep", Phase.ATTENDING),
    (Phase.READY, "stop", Phase.STOPPING),
    (Phase.READY, "soft reset, emergency stop, an answer is lost", Phase.RESETTING),
    (Phase.ATTENDING, "stop", Phase.STOPPING),
    (Phase.ATTENDING, "soft reset, emergency stop", Phase.RESETTING),
    (Phase.READY, "ok of $C off, of $RST; ALARM:6 to ALARM:9", Phase.RESTARTING),
    (Phase.ATTENDING, "ALARM:6 to ALARM:9", Phase.RESTARTING),
    (Phase.READY, "ALARM:1, ALARM:2", Phase.LOCKED),
)
"""The ways that STEPS does not tell. A banner leads from every phase to READING, a soft reset to RESETTING."""

GATES: Final[dict[str, str]] = {
    "alarm": "the machine is in alarm",
    "held": "it is held (Hold, Door, M0), or was asked to",
    "refused": "a line was refused and the job's policy is to hold",
    "pendant": "MPG:1: a pendant owns the stream",
    "card": "the controller reads a program from its SD card, and no lines",
    "tool": "a tool change is pending",
    "jogging": "a jog moves, or may (G-code would be refused with error:9)",
    "homing": "it homes or sleeps",
    "by hand": "a command by hand goes first",
}
"""What holds lines of a job back while READY; all of them must be open."""


def page() -> str:
    """docs/grbl-phases.md: the table and its diagram."""
    return statepage.page(
        engine="Grbl",
        module="protocol.grbl.phases",
        notes=["A banner leads from every phase to READING, a soft reset by hand to RESETTING."],
        columns=["phase", "what the engine does", "what it sends", "what it waits for", "ok and error"],
        rows=[
            (
                phase.name,
                phase.value,
                f"`{step.sends}`" if step.sends else "",
                step.awaits,
                "counted" if step.counts else "ignored",
            )
            for phase, step in STEPS.items()
        ],
        begins=["OPENING: the board resets on open", "ASKING: it does not"],
        arrows=statepage.arrows_of(STEPS, OUTCOMES),
        behind=[
            "While READY, lines of a job wait as long as any of these holds:",
            "",
            "| gate | why |",
            "| --- | --- |",
            *(f"| {name} | {why} |" for name, why in GATES.items()),
            "",
        ],
    )


if __name__ == "__main__":
    sys.stdout.write(page())
