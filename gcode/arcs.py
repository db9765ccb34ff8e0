"""Geometry of arcs in a plane: centre, radius, sweep, extremes. Lengths in mm, angles in rad, pure arithmetic.

Everything is relative to the arc's start, so that an arc is known even where the machine's position is not. The
functions work on columns of arcs: one geometry for both ways through a program.
The one rule: an arc that cannot be is NaN, never a straight line in its place.
"""

from math import nan, pi

import numpy as np

from gcode.segments import PLANE_AXES, Bools, Floats, Ints, Segments

COINCIDENT_MM = 1e-9
"""Ends closer than this are the same point: a full circle."""

_R_SLACK = 1e-4
"""How far a chord may be over the diameter, relatively: programs round their numbers (rs274 §4: 0.00005 in)."""

ANGLE_FUZZ_RAD = 5e-7
"""A turn of less than this from ray to ray is a full circle whose ends were rounded (Grbl's and LinuxCNC's limit)."""

_QUARTER = pi / 2
_TURN = 2 * pi

Geometry = tuple[Floats, Floats, Floats, Floats]
"""Columns of n arcs: centre (2, n), radius, end radius, sweep; as in `Segments`."""


def arcs_from_offsets(way: Floats, centre: Floats, clockwise: Bools, turns: Ints | None = None) -> Geometry:
    """Arcs by their centres; `way` and `centre` (2, n) from the start, `turns` more than one where P says so.

    The same start and end make a full circle. Where something is NaN or the centre is the start, all is NaN.
    """
    radius = np.hypot(centre[0], centre[1])
    end_radius = np.hypot(way[0] - centre[0], way[1] - centre[1])
    before = np.arctan2(-centre[1], -centre[0])
    after = np.arctan2(way[1] - centre[1], way[0] - centre[0])
    sweep = np.where(clockwise, before - after, after - before) % _TURN
    # Both ends on one ray from the centre: a full turn, as in the standard interpreters.
    whole = (np.hypot(way[0], way[1]) <= COINCIDENT_MM) | (sweep <= ANGLE_FUZZ_RAD)
    sweep = np.where(whole, _TURN, sweep)
    if turns is not None:
        sweep = sweep + _TURN * (np.maximum(turns, 1) - 1)
    known = (radius > COINCIDENT_MM) & ~np.isnan(end_radius)
    sweep = np.where(known, np.where(clockwise, -sweep, sweep), nan)
    return np.where(known, centre, nan), np.where(known, radius, nan), np.where(known, end_radius, nan), sweep


def arcs_from_radius(way: Floats, radius: Floats, clockwise: Bools) -> Floats:
    """The centres (2, n) of arcs by R: up to half a turn for R > 0, more for R < 0.

    NaN where the chord is nothing or over 2R.
    """
    chord = np.hypot(way[0], way[1])
    possible = (chord > COINCIDENT_MM) & (chord <= 2 * np.abs(radius) * (1 + _R_SLACK))
    height = np.sqrt(np.maximum(0.0, radius * radius - chord * chord / 4))
    # The centre lies to the left of the way for a short counter-clockwise arc.
    side = np.where(possible, np.where(clockwise == (radius < 0), height, -height), nan)
    length = np.where(possible, chord, 1.0)
    return np.stack((way[0] / 2 - way[1] / length * side, way[1] / 2 + way[0] / length * side))


def extremes_of(centre: Floats, radius: Floats, sweep: Floats, way: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest corner (2, n) of the boxes around these arcs, from their starts; NaN where an arc is."""
    begin = np.arctan2(-centre[1], -centre[0])
    low_angle, high_angle = np.minimum(begin, begin + sweep), np.maximum(begin, begin + sweep)
    low, high = np.minimum(way, 0.0), np.maximum(way, 0.0)
    # The box is touched where the circle crosses an axis through its centre: at whole quarters.
    for quarter, (axis, sign) in enumerate(((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))):
        angle = quarter * _QUARTER
        turned = (angle - low_angle) % _TURN
        crossed = (turned > 0.0) & (turned < high_angle - low_angle)
        reach = centre[axis] + sign * radius
        if sign > 0:
            high[axis] = np.where(crossed, np.maximum(high[axis], reach), high[axis])
        else:
            low[axis] = np.where(crossed, np.minimum(low[axis], reach), low[axis])
    unknown = np.isnan(sweep)
    return np.where(unknown, nan, low), np.where(unknown, nan, high)


def reach(segments: Segments) -> tuple[Floats, Floats]:
    """The lowest and highest machine coordinate of each axis in each segment, both (axes, n); arcs by their bulge.

    An end that is not known does not count; NaN where neither is. An arc that cannot be counts as its ends.
    """
    low, high = np.fmin(segments.start, segments.end), np.fmax(segments.start, segments.end)
    arcs = np.flatnonzero(segments.is_arc & ~np.isnan(segments.sweep))
    for plane, (first, second, _) in PLANE_AXES.items():
        rows = [row for row in (segments.row(first), segments.row(second)) if row is not None]
        here = arcs[segments.plane[arcs] == plane]
        if not len(here) or len(rows) < 2:
            continue
        start = segments.start[rows][:, here]
        way = np.where(np.isnan(segments.way[rows][:, here]), 0.0, segments.way[rows][:, here])
        lowest, highest = extremes_of(segments.centre[:, here], segments.radius[here], segments.sweep[here], way)
        for place, row in enumerate(rows):
            low[row, here] = np.fmin(low[row, here], start[place] + lowest[place])
            high[row, here] = np.fmax(high[row, here], start[place] + highest[place])
    return low, high
