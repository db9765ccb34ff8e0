"""Compensation as the source's example has it (ncframe §3): the radius of the tool is added to X and to Z.

Not along the contour; that is gcode/compensation.py. An axis takes the offset, and leaves it, with its next own
straight move, as with G43. The one rule: an arc is moved as a whole or it is an error, never bent.
"""

from collections.abc import Mapping

from gcode.ncframe.rules import FrameRules
from gcode.profile import Code
from gcode.segments import CCW, CW

_ON = frozenset(("compensation_left", "compensation_right"))
_AXIS_WORDS = {"X": frozenset("XU"), "Z": frozenset("ZW")}


class Offset:
    """What is added to each axis now. G41 and G42 add the same: the source names no side; a radius may be negative."""

    def __init__(self, rules: FrameRules, axes: str) -> None:
        self._rules = rules
        self._axes = axes
        self._wanted = 0.0
        self.applied = (0.0,) * len(axes)

    @property
    def settled(self) -> bool:
        """Every axis has what was said last."""
        return all(added == self._wanted for added in self.applied)

    def take(self, codes: list[Code], values: Mapping[str, float], tool: int) -> None:
        """G41, G42, G40 and the end of the program."""
        if self._rules.compensation != "offset":
            return
        for code in codes:
            if code.sets in _ON:
                # D0 is no tool, as in the standard interpreters.
                number = int(values.get("D", tool))
                no_tool = "D" in values and number == 0
                self._wanted = 0.0 if no_tool else self._rules.radius_of(number) or 0.0
            elif code.sets == "compensation_off" or code.effect == "program_end":
                self._wanted = 0.0

    def apply(self, values: Mapping[str, float], kinds: list[int]) -> bool:
        """The axes that the block names take the offset; False: it is to be taken or left along an arc."""
        if self.settled:
            return True
        if CW in kinds or CCW in kinds:
            return False
        self.applied = tuple(
            [
                self._wanted if kinds and not _AXIS_WORDS[axis].isdisjoint(values) else added
                for axis, added in zip(self._axes, self.applied, strict=True)
            ]
        )
        return True
