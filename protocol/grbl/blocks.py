"""Does an acknowledged line certainly stand, or has it stood, in the planner's queue? Counts blocks from below.

Grbl makes no block of a move that is shorter than a step, so acknowledged lines say nothing of how far the machine
has come; certain blocks behind a line do: when as many have been planned as the planner holds, the line has left it.
The one rule: when in doubt there is no block; to count one too few only delays `BatchDone`.
"""

from collections.abc import Iterable
from typing import Final

from protocol.grbl.lines import Line, Words

_MOTIONS: Final = frozenset({0.0, 1.0, 2.0, 3.0})
_HARMLESS: Final = frozenset({17.0, 18.0, 19.0, 20.0, 21.0, 40.0, 61.0, 90.0, 91.0, 91.1, 94.0})
_LINEAR: Final = "XYZ"
_STEPS: Final = 2.0
"""Steps that a target must differ by: the controller computes in single precision and rounds."""
_MM_PER_INCH: Final = 25.4


class BlockCounter:
    """Follows just enough modal state: motion mode, distance mode, units, the last word of each axis."""

    def __init__(self) -> None:
        self._steps_per_mm: dict[str, float] = {}
        self._steps: dict[str, float] = {}  # per unit of the program
        self._motion = False
        self._absolute: bool | None = None
        self._mm: bool | None = None
        self._last: dict[str, float] = {}

    def learn_steps(self, axis_number: int, steps_per_mm: float) -> None:
        """From `$100` and its neighbours."""
        if axis_number < len(_LINEAR):
            self._steps_per_mm[_LINEAR[axis_number]] = steps_per_mm
            self._weigh()

    def learn_modal(self, words: Iterable[str]) -> None:
        """From `$G`."""
        self.forget()
        groups = set(words)
        self._motion = bool(groups & {"G0", "G1", "G2", "G3"})
        self._absolute = True if "G90" in groups else False if "G91" in groups else None
        if groups & {"G20", "G21"}:
            self._count_in(mm="G21" in groups)

    def forget(self) -> None:
        """Nothing is known any more."""
        self._motion, self._absolute, self._mm = False, None, None
        self._last.clear()

    def certain(self, line: Line) -> bool:
        """Take an acknowledged line; whether it has certainly put a block into the planner."""
        words = line.words
        if words is None:
            self.forget()
            return False
        if line.move:
            if words[0][0] == "G":
                self._motion = True
            return self._moved(words)
        gcodes = [value for letter, value in words if letter == "G"]
        if any(letter == "M" and value in (2.0, 30.0, 99.0) for letter, value in words):
            self.forget()
            return False
        self._follow(gcodes)
        if any(code not in _MOTIONS and code not in _HARMLESS for code in gcodes):
            self._last.clear()
            return False
        return self._moved(words)

    def _follow(self, gcodes: Iterable[float]) -> None:
        for code in gcodes:
            if code in _MOTIONS:
                self._motion = True
            elif code in (90.0, 91.0):
                self._absolute = code == 90.0
            elif code in (20.0, 21.0):
                self._count_in(mm=code == 21.0)
            elif code not in _HARMLESS and code != 4.0:
                self._motion = self._motion and code != 80.0 and not 38.0 <= code < 39.0 and code < 70.0

    def _count_in(self, *, mm: bool) -> None:
        if self._mm is not mm:
            scale = 0.0 if self._mm is None else _MM_PER_INCH if self._mm else 1 / _MM_PER_INCH
            self._last = {letter: value / scale for letter, value in self._last.items()} if scale else {}
            self._mm = mm
            self._weigh()

    def _weigh(self) -> None:
        scale = 1.0 if self._mm else _MM_PER_INCH
        self._steps = {letter: steps * scale for letter, steps in self._steps_per_mm.items()}

    def _moved(self, words: Words) -> bool:
        """Whether one axis goes far enough; `_last` may hold other words too, nobody looks for them."""
        last, steps = self._last, self._steps
        if self._absolute is None or self._mm is None or not self._motion:
            last.clear()
            return False
        if not self._absolute:
            last.clear()
            return any(abs(value) * steps.get(letter, 0.0) >= _STEPS for letter, value in words)
        moved = False
        for letter, value in words:
            if letter in steps and letter in last and abs(value - last[letter]) * steps[letter] >= _STEPS:
                moved = True
                break
        last.update(words)
        return moved
