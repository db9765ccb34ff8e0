"""Does an acknowledged line certainly stand, or has it stood, in the planner's queue?

Grbl makes no block of a move that is shorter than a step, so acknowledged lines say nothing of how far the machine
has come; certain blocks behind a line do: when as many have been planned as the planner holds, the line has left it.
How far each line goes, whoever planned the batch says (`SendBatch.reach_mm`); the numbers are not read here again.
The one rule: when in doubt there is no block; to count one too few only delays `BatchDone`.
"""

from math import inf
from typing import Final

from protocol.grbl.lines import words_of

_LINEAR: Final = 3
_STEPS: Final = 2.0
"""Steps that a line must go: the controller computes in single precision and rounds."""
_ROUNDED_MM: Final = 0.002
"""And at least so far: a word may have been rounded to thousandths on its way to the wire."""
DISPLACED_BLOCKS: Final = _LINEAR
"""The controller may stand elsewhere than the plan believes: where a job begins, where somebody has moved it by hand,
behind a line that was refused or that sets an origin. Then the first line that takes an axis somewhere may go nowhere,
once for each axis."""
_MEANINGS: Final = {20.0: "units", 21.0: "units", 90.0: "distance", 91.0: "distance"}
"""What numbers mean. Where plan and controller differ in these, no line goes as far as it was planned to."""


class BlockCounter:
    """What a line must reach. Without the steps of all linear axes nothing is certain."""

    def __init__(self) -> None:
        self._steps_per_mm: dict[int, float] = {}
        self._doubted: set[str] = set()
        self.least_mm = inf

    def learn_steps(self, axis_number: int, steps_per_mm: float) -> None:
        """From `$100` and its neighbours."""
        if axis_number < _LINEAR:
            self._steps_per_mm[axis_number] = steps_per_mm
        self._measure()

    def doubt(self, text: str) -> None:
        """This line of a job was refused, or typed in the middle of one: the numbers behind it may not mean what they
        were planned to, until a line says it again."""
        self._doubted |= _meanings(text)
        self._measure()

    def heed(self, text: str) -> None:
        """This line of a job was taken."""
        if self._doubted:
            self._doubted -= _meanings(text)
            self._measure()

    def trust(self) -> None:
        """The controller was reset: what runs from here on is planned from what it holds."""
        self._doubted.clear()
        self._measure()

    def _measure(self) -> None:
        coarsest = min(self._steps_per_mm.values()) if len(self._steps_per_mm) == _LINEAR else 0.0
        known = coarsest > 0.0 and not self._doubted
        self.least_mm = max(_STEPS / coarsest, _ROUNDED_MM) if known else inf


def _meanings(text: str) -> set[str]:
    """Which of them a line sets; both where it is not understood."""
    words = words_of(text.upper().replace(" ", ""))
    if words is None:
        return set(_MEANINGS.values())
    return {_MEANINGS[value] for letter, value in words if letter == "G" and value in _MEANINGS}
