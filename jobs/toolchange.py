"""The dialogue of a job with the tool changer of its machine, as a table. What is asked is an effect (effects.py).

Not the handshake with the changer (protocol/iocontrol), and not who changes the tool: a person is a changer too.
The one rule: the dialogue goes on only along an entry of the table; what comes out of turn changes nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final


class Phase(Enum):
    """Where a tool change stands."""

    NONE = "no change is under way"
    STARTING = "the changer was asked to begin: nothing has moved for it"
    READY = "the changer is ready: the machine may go to where tools are changed"
    CHANGING = "the machine stands there: the changer was asked for the tool"


class Step(Enum):
    """What takes it on."""

    ASKED = "the M6 is next, everything before it is done"
    STARTED = "the changer says that the change has begun"
    ARRIVED = "the block of the M6 is done"
    FOUND = "a change that somebody else began is taken up"
    ENDED = "the tool is in, or it is not and never will be"


TABLE: Final[Mapping[tuple[Phase, Step], Phase]] = {
    (Phase.NONE, Step.ASKED): Phase.STARTING,
    (Phase.STARTING, Step.STARTED): Phase.READY,
    (Phase.READY, Step.ARRIVED): Phase.CHANGING,
    (Phase.NONE, Step.ARRIVED): Phase.CHANGING,  # proven after a break that a daemon before us did not outlive
    (Phase.NONE, Step.FOUND): Phase.CHANGING,
    (Phase.STARTING, Step.ENDED): Phase.NONE,
    (Phase.READY, Step.ENDED): Phase.NONE,
    (Phase.CHANGING, Step.ENDED): Phase.NONE,
}


@dataclass(slots=True)
class ToolChange:
    """`asked`: the tool that the changer was last told to prepare for this job. `taken_up`: the daemon before us did
    not see the end of the change. `motion_allowed`: the changer does not keep the machine from moving."""

    phase: Phase = Phase.NONE
    asked: int | None = None
    taken_up: bool = False
    motion_allowed: bool = True

    def go(self, step: Step) -> bool:
        """Go on. False: out of turn, nothing has changed."""
        after = TABLE.get((self.phase, step))
        if after is None:
            return False
        self.phase = after
        return True
