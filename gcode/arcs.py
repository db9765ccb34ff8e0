"""Geometry of arcs in a plane: centre, radius, sweep, extremes. Lengths in mm, angles in rad, pure arithmetic.

Everything is relative to the arc's start, so that an arc is known even where the machine's position is not.
The one rule: an arc that cannot be is None, never a straight line in its place.
"""

from dataclasses import dataclass
from math import atan2, cos, floor, hypot, pi, sin, sqrt

Pair = tuple[float, ...]
"""Two lengths in the plane."""

COINCIDENT_MM = 1e-9
"""Ends closer than this are the same point: a full circle."""

_R_SLACK = 1e-4
"""How far a chord may be over the diameter, relatively: programs round their numbers (rs274 §4: 0.00005 in)."""

_QUARTER = pi / 2


@dataclass(frozen=True, slots=True)
class Arc:
    """`way` from start to end, `centre` from the start; `sweep` in rad, positive counter-clockwise.

    `end_radius` is the distance of the end from the centre: where it is not `radius`, the arc does not close.
    """

    way: Pair
    centre: Pair
    radius: float
    end_radius: float
    sweep: float

    @property
    def length(self) -> float:
        """Length in the plane."""
        return abs(self.sweep) * self.radius

    def extremes(self) -> tuple[Pair, Pair]:
        """Lowest and highest corner of the box around the arc, from its start."""
        from_angle = atan2(-self.centre[1], -self.centre[0])
        low_angle, high_angle = sorted((from_angle, from_angle + self.sweep))
        xs, ys = [0.0, self.way[0]], [0.0, self.way[1]]
        # The box is touched where the circle crosses an axis through its centre.
        quarter = floor(low_angle / _QUARTER) + 1
        while quarter * _QUARTER < high_angle:
            xs.append(self.centre[0] + self.radius * cos(quarter * _QUARTER))
            ys.append(self.centre[1] + self.radius * sin(quarter * _QUARTER))
            quarter += 1
        return (min(xs), min(ys)), (max(xs), max(ys))


def arc_from_offsets(way: Pair, centre: Pair, *, clockwise: bool) -> Arc | None:
    """An arc by its centre (I, J from the start). The same start and end make a full circle."""
    radius = hypot(*centre)
    end_radius = hypot(way[0] - centre[0], way[1] - centre[1])
    if radius <= COINCIDENT_MM:
        return None
    if hypot(*way) <= COINCIDENT_MM:
        sweep = 2 * pi
    else:
        before = atan2(-centre[1], -centre[0])
        after = atan2(way[1] - centre[1], way[0] - centre[0])
        sweep = (before - after if clockwise else after - before) % (2 * pi)
        # Both ends on one ray from the centre: a full turn, as in the standard interpreters.
        sweep = sweep or 2 * pi
    return Arc(way, centre, radius, end_radius, -sweep if clockwise else sweep)


def arc_from_radius(way: Pair, radius: float, *, clockwise: bool) -> Arc | None:
    """An arc by R: up to half a turn for R > 0, more for R < 0. None when the chord is nothing or over 2R."""
    chord = hypot(*way)
    if chord <= COINCIDENT_MM or chord > 2 * abs(radius) * (1 + _R_SLACK):
        return None
    height = sqrt(max(0.0, radius * radius - chord * chord / 4))
    # The centre lies to the left of the way for a short counter-clockwise arc.
    side = height if clockwise == (radius < 0) else -height
    centre = (way[0] / 2 - way[1] / chord * side, way[1] / 2 + way[0] / chord * side)
    return arc_from_offsets(way, centre, clockwise=clockwise)
