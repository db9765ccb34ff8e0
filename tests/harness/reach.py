"""How far each block of a program goes (`SendBatch.reach_mm`), worked out in the plainest way: for tests of the engine.

Not the planner (jobs/upcoming.py). The one rule: what is not a plain move makes every place unknown.
"""

import re
from collections.abc import Sequence

PLAIN = frozenset({0.0, 1.0, 2.0, 3.0, 4.0, 17.0, 21.0, 90.0, 91.0, 94.0})


class Reaches:
    """Follows one program."""

    def __init__(self) -> None:
        self._places: dict[str, float] = {}
        self._relative = False

    def of(self, blocks: Sequence[str]) -> tuple[float, ...]:
        """Of the next blocks, in mm."""
        return tuple([self._next(block) for block in blocks])

    def _next(self, block: str) -> float:
        words = [(letter, float(value)) for letter, value in re.findall(r"([A-Z])([-+.0-9]+)", block)]
        codes = {value for letter, value in words if letter == "G"}
        if not codes <= PLAIN or block.startswith("$"):
            self._places.clear()
            return 0.0
        self._relative = (self._relative or 91.0 in codes) and 90.0 not in codes
        reach_mm = 0.0
        for letter, value in words:
            if letter in "XYZ" and not self._relative:
                reach_mm = max(reach_mm, abs(value - self._places.get(letter, value)))
                self._places[letter] = value
            elif letter in "XYZ":
                reach_mm = max(reach_mm, abs(value))
        if self._relative:
            self._places.clear()
        return reach_mm
