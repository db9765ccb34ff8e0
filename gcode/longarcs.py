"""Long arcs in few blocks: the chords in the middle of an arc that is cut at its feed all the way are one block.

Grbl plans each chord by itself (gcode.md §5), and so do we, but for a stretch in which nothing can happen: where
corners, axes and the look-ahead all allow more than F, the speed is F from where it is reached to where braking may
begin. The one rule: an arc is drawn together only where that is certain; its seconds stay what they were.
"""

from dataclasses import dataclass

import numpy as np

from gcode.segments import PLANE_AXES, Bools, Floats, Ints, Segments

FEWEST_CHORDS = 12
"""An arc of fewer has nothing to gain."""

SHORTEST_MM, LONGEST_MM = 1e-6, 1e6
"""Beyond these it is no arc that a machine cuts, and numbers are not what they seem."""

_SAFE = 0.999
"""What is compared is exact to far more digits; on the safe side of them."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What bounds the speed, by row of the axes: mm/s², mm/s; `step_mm` 0 where ways are not rounded to steps."""

    acceleration: Floats
    rate: Floats
    step_mm: Floats
    deviation_mm: float
    ahead: int


def edges(segments: Segments, chords: Ints, feed_mm_s: Floats, limits: Limits) -> Ints:
    """How many chords stay single at either end of each segment; 0 where all do."""
    found = np.zeros(len(segments), np.int64)
    arcs = np.flatnonzero(chords >= FEWEST_CHORDS)
    if not len(arcs) or limits.ahead < 1:
        return found
    feed, count = feed_mm_s[arcs], chords[arcs]
    length = chord_lengths(segments, chords, arcs)
    acceleration, rate, step, plain = _least(segments, arcs, limits)
    # Ends on whole steps turn each chord by a little, and a corner by that of two.
    bend = np.abs(segments.sweep[arcs]) / count + np.sqrt(8.0) * step / length
    half_sine = np.cos(np.minimum(bend, np.pi) / 2)
    corner2 = acceleration * limits.deviation_mm * half_sine / (1.0 - half_sine)
    reach2 = 2.0 * acceleration * limits.ahead * length
    plain &= (length > SHORTEST_MM) & (length * count < LONGEST_MM) & np.isfinite(corner2)
    steady = plain & (feed * feed <= _SAFE * np.minimum(corner2, reach2)) & (feed <= rate)
    with np.errstate(all="ignore"):
        edge = np.ceil(feed * feed / (2.0 * acceleration * length)) + 1.0
    steady &= np.isfinite(edge) & (2 * edge + 2 < count)
    found[arcs[steady]] = edge[steady].astype(np.int64)
    return found


def chord_lengths(segments: Segments, chords: Ints, arcs: Ints) -> Floats:
    """The length of one chord of each of `arcs`, mm."""
    count = chords[arcs]
    flat = 2.0 * segments.radius[arcs] * np.sin(np.minimum(np.abs(segments.sweep[arcs]) / count / 2, np.pi / 2))
    length: Floats = np.hypot(flat, segments.rise(arcs) / count)
    return length


def _least(segments: Segments, arcs: Ints, limits: Limits) -> tuple[Floats, Floats, Floats, Bools]:
    """Acceleration, rate, the largest step, over the axes that move; and whether these are only the plane's three."""
    way = np.nan_to_num(segments.way[:, arcs])
    acceleration, rate = np.full(len(arcs), np.inf), np.full(len(arcs), np.inf)
    step, plain = np.zeros(len(arcs)), np.ones(len(arcs), np.bool_)
    for plane, axes in PLANE_AXES.items():
        here = segments.plane[arcs] == plane
        if not here.any():
            continue
        in_plane = [segments.row(axis) for axis in axes[:2]]
        for row in range(len(segments.axes)):
            uses = here & ((way[row] != 0.0) | (row in in_plane))
            acceleration[uses] = np.minimum(acceleration[uses], limits.acceleration[row])
            rate[uses] = np.minimum(rate[uses], limits.rate[row])
            step[uses] = np.maximum(step[uses], limits.step_mm[row])
            if row not in in_plane and row != segments.row(axes[2]):
                plain &= ~(here & (way[row] != 0.0))
    return acceleration, rate, step, plain
