"""What the segments of some hundred lines say of each: is its length known, how far does it go, where does it end.

Not the motion (gcode/) and not the blocks (upcoming.py). The one rule: what is not certain of a line is told as
unknown, as going nowhere, or as NaN.
"""

import numpy as np

from gcode.blocks import Blocks
from gcode.segments import DWELL, HOMING, PROBE, Bools, Floats, Ints, Segments


def is_uncertain(segments: Segments, blocks: Blocks) -> Bools:
    """Segments whose length is not known: an axis that is known at one end only, or that is named and known at none."""
    lost_start, lost_end = np.isnan(segments.start), np.isnan(segments.end)
    uncertain: Bools = np.any(lost_start ^ lost_end, axis=0) | (segments.kind == HOMING)
    for row, axis in enumerate(segments.axes):
        named = blocks.letters.get(axis)
        if named is not None:
            uncertain |= lost_end[row] & named.has[segments.line]
    return uncertain


def reaches_mm(segments: Segments, rows: Ints, count: int) -> Floats:
    """How far the last segment of each row takes one of X, Y, Z; 0 where that is not known, or may come otherwise."""
    linear = [row for axis in "XYZ" if (row := segments.row(axis)) is not None]
    way = np.nan_to_num(np.abs(segments.way[linear]))
    way[:, (segments.kind == DWELL) | (segments.kind == HOMING) | (segments.kind == PROBE)] = 0.0
    found = np.zeros(count)
    if linear:
        found[rows] = way.max(axis=0)
    return found


def places(segments: Segments, rows: Ints, wanted: Ints, behind: tuple[float, ...]) -> Floats:
    """Program coordinates behind each of the `wanted` rows, (rows, axes); `behind` the last row of all.

    Where the next segment starts, and not where the one before ended: a cycle may leave the tool somewhere else.
    """
    frames: Floats = np.array(segments.frames, np.float64).reshape(-1, len(segments.axes))
    # Most programs stay in one frame.
    offsets = frames if len(frames) == 1 else frames[segments.frame]
    starts = np.concatenate((segments.start.T - offsets, [behind]))
    upto = np.cumsum(np.bincount(rows, minlength=int(wanted[-1]) + 1 if len(wanted) else 0))
    found: Floats = starts[upto[wanted]]
    return found
