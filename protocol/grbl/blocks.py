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
_AXES: Final = frozenset("XYZABCUVW")
_STEPS: Final = 2.0
"""Steps that a target must differ by: the controller computes in single precision and rounds."""
_MM_PER_INCH: Final = 25.4


class BlockCounter:
    """Follows just enough modal state: motion mode, distance mode, units, the last word of each axis."""

    def __init__(self) -> None:
        self._steps_per_mm: dict[str, float] = {}
        self._motion = False
        self._absolute: bool | None = None
        self._mm: bool | None = None
        self._last: dict[str, float] = {}

    def learn_steps(self, axis_number: int, steps_per_mm: float) -> None:
        """From `$100` and its neighbours."""
        if axis_number < len(_LINEAR):
            self._steps_per_mm[_LINEAR[axis_number]] = steps_per_mm

    def learn_modal(self, words: Iterable[str]) -> None:
        """From `$G`."""
        self.forget()
        groups = set(words)
        self._motion = bool(groups & {"G0", "G1", "G2", "G3"})
        self._absolute = True if "G90" in groups else False if "G91" in groups else None
        self._mm = True if "G21" in groups else False if "G20" in groups else None

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
            self._motion = self._motion or words[0][0] == "G"
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
                self._mm = code == 21.0
            elif code not in _HARMLESS and code != 4.0:
                self._motion = self._motion and code != 80.0 and not 38.0 <= code < 39.0 and code < 70.0

    def _moved(self, words: Words) -> bool:
        last = self._last
        if self._absolute is None or self._mm is None or not self._motion:
            last.clear()
            return False
        moved = False
        for letter, value in words:
            if letter not in _AXES:
                continue
            place_mm = value if self._mm else value * _MM_PER_INCH
            if not self._absolute:
                last.pop(letter, None)
                moved = moved or abs(place_mm) * self._steps_per_mm.get(letter, 0.0) >= _STEPS
                continue
            if not moved and letter in last:
                moved = abs(place_mm - last[letter]) * self._steps_per_mm.get(letter, 0.0) >= _STEPS
            last[letter] = place_mm
        return moved
