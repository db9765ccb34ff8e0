"""The motion of a piece with nothing unknown in it: lengths and times are reckoned from it where the start is not told.

Rules judge what is certain; a sum wants a number for every way, as from a controller that has just been switched on and
stands at the program's zero. The one rule: what is only assumed never leads to a finding.
"""

from math import isnan

import numpy as np

from gcode.blocks import Blocks
from gcode.columns import Columns
from gcode.interpret import Reading
from gcode.profile import Profile
from gcode.segments import Segments
from gcode.state import State


class Assumed:
    """Follows a program beside the reading that judges it, and reads only the pieces in which something is unknown."""

    def __init__(self, profile: Profile, *, laser: bool, skip_deleted: bool) -> None:
        self._profile = profile
        self._laser = laser
        self._skip_deleted = skip_deleted
        self._place: list[float] | None = None

    def read(self, columns: Columns, blocks: Blocks, before: State, certain: Segments, after: State) -> Segments:
        """The motion of a piece: `certain`, where that leaves nothing open. `before` and `after` are its states."""
        if not (self._has_strayed(before) or _is_open(certain, blocks, before, after)):
            self._place = after.assumed(self._place).position
            return certain
        reading = Reading(
            self._profile, before.assumed(self._place), laser=self._laser, skip_deleted=self._skip_deleted
        )
        found = reading.read(columns, blocks)
        self._place = [
            assumed if isnan(known) else known
            for known, assumed in zip(after.position, reading.state.position, strict=True)
        ]
        return found

    def _has_strayed(self, state: State) -> bool:
        """An axis is not known, and by what is assumed it is not at the program's zero any more."""
        place = state.frame if self._place is None else self._place
        strayed = zip(state.position, place, state.frame, strict=True)
        return any(isnan(known) and at != zero for known, at, zero in strayed)


def _is_open(segments: Segments, blocks: Blocks, before: State, after: State) -> bool:
    """Whether a coordinate is unknown that this piece names, or that becomes known or unknown in it: by a way, or by
    another coordinate system before the first or behind the last one (G55, which names no axis)."""
    lost_start, lost_end = np.isnan(segments.start), np.isnan(segments.end)
    for row, axis in enumerate(segments.axes):
        lost = lost_start[row].any() or lost_end[row].any()
        known = not isnan(before.position[row])
        if known and (lost or isnan(after.position[row])):
            return True
        if lost and (axis in blocks.letters or not (lost_start[row] & lost_end[row]).all()):
            return True
    return False
