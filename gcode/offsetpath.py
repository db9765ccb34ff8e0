"""Straights and arcs in a plane, their parallels, and where parallels cross. No modes, no lines, no machine.

Points and directions are complex numbers (first axis real, second imaginary), lengths mm, angles rad. A parallel is
named by its signed distance, positive to the left of the direction of travel.
The one rule: what does not exist (a parallel inside a radius that is too small, a crossing) is None or nothing at
all, never the nearest thing that would.
"""

from cmath import phase
from math import inf, pi, sqrt
from typing import NamedTuple

from gcode.arcs import COINCIDENT_MM

TANGENT_RAD = 0.05
"""A corner up to this angle is taken as none: programs round their numbers, so that what is meant to be tangent never
is, and parallels nearly tangent to each other cross anywhere or nowhere. The reference has the same angle (measured).
Where the corner lies inside, the tool cuts in by up to 1.25e-3 of its radius."""

REVERSAL_RAD = 1e-3
"""So near to straight back, the way back is the same way. The reference takes TANGENT_RAD here too, and so cuts into
the side of a narrow wedge."""

_ROUNDING_RAD = 1e-9
"""An angle so little under a full turn is a small negative one."""


_LEAST_SWING = 1e-4
"""Cosine of the angle between the chord of a way in along an arc and the radius at its end; with less, or beyond a
right angle, there is no arc that would get there in the right direction."""

_EVEN_BEND = 1e-9
"""1/mm; two bends that differ by less run along each other."""


class Curve(NamedTuple):
    """A straight from `start` to `end` (`turn` 0), or an arc around `centre`, `turn` 1 counter-clockwise, -1 clockwise.

    `extent` is the length of a straight in mm, the angle of an arc in rad, full turns included. The radius of an arc
    that does not quite close is that of its end, as in the reference. Headings are directions of travel, of length 1.
    """

    start: complex
    end: complex
    extent: float
    turn: int
    centre: complex
    heading_at_start: complex
    heading_at_end: complex

    @property
    def radius(self) -> float:
        """mm; of an arc only."""
        return abs(self.end - self.centre)

    @property
    def length(self) -> float:
        """mm."""
        return self.extent * self.radius if self.turn else self.extent

    @property
    def curvature(self) -> float:
        """1/mm, positive where it bends to the left."""
        return self.turn / self.radius if self.turn else 0.0

    def parallel(self, distance: float) -> "Curve | None":
        """The curve at this distance to the left; None where the inside of an arc has no room for it."""
        start, end, extent, turn, centre, at_start, at_end = self
        if turn and self.radius - turn * distance <= COINCIDENT_MM:
            return None
        aside = 1j * distance
        return Curve(start + aside * at_start, end + aside * at_end, extent, turn, centre, at_start, at_end)

    def before_end(self, point: complex) -> float:
        """How far a point of the curve lies before its end, in the measure of `extent`; beyond an end < 0."""
        if not self.turn:
            return _dot(self.end - point, self.heading_at_end)
        return _angle(point - self.centre, self.end - self.centre, self.turn)

    def after_start(self, point: complex) -> float:
        """How far a point of the curve lies after its start, in the measure of `extent`; before a start < 0."""
        if not self.turn:
            return _dot(point - self.start, self.heading_at_start)
        return _angle(self.start - self.centre, point - self.centre, self.turn)

    def millimetres(self, extent: float) -> float:
        """A part of `extent` as a length."""
        return extent * self.radius if self.turn else extent


def straight(start: complex, end: complex) -> Curve:
    """From here to there; they are not the same point."""
    way = end - start
    length = abs(way)
    heading = way / length
    return Curve(start, end, length, 0, 0j, heading, heading)


def arc(start: complex, end: complex, centre: complex, *, turn: int, turns: int = 1) -> Curve:
    """An arc; the same start and end make a full circle, each of `turns` over 1 adds another."""
    extent = _angle(start - centre, end - centre, turn)
    if abs(end - start) <= COINCIDENT_MM or extent <= _ROUNDING_RAD:
        extent = 2 * pi
    across = turn * 1j
    headings = across * _unit(start - centre), across * _unit(end - centre)
    return Curve(start, end, extent + 2 * pi * (turns - 1), turn, centre, *headings)


def swing(path: Curve, start: complex) -> Curve | None:
    """The arc from `start` that ends as `path` does, in place and direction, with the same turn; None: there is none.

    Its centre lies on the radius through its end, as far from the one as from the other.
    """
    inward = path.turn * 1j * path.heading_at_end
    chord = start - path.end
    depth = _dot(chord, inward)
    if depth <= _LEAST_SWING * abs(chord):
        return None
    return arc(start, path.end, path.end + inward * (abs(chord) ** 2 / (2 * depth)), turn=path.turn)


def bend(first: Curve, second: Curve) -> float:
    """Angle of the corner between two curves, rad, positive to the left; a reversal is pi or -pi."""
    return phase(second.heading_at_start * first.heading_at_end.conjugate())


def is_inside(first: Curve, second: Curve, side: int) -> bool | None:
    """Whether the corner lies inside, seen from `side` (1 left, -1 right); None: there is no corner."""
    angle = bend(first, second) * side
    if abs(angle) <= TANGENT_RAD:
        return None
    if abs(angle) >= pi - REVERSAL_RAD:
        # There and back again: which of the two ways lies on the tool's side of the other is told by their bends
        # alone. Over the same straight, the tool goes round the end.
        return (first.curvature + second.curvature) * side < -_EVEN_BEND
    return angle > 0


def crossing(first: Curve, second: Curve) -> complex | None:
    """Where the way back from the end of `first` meets the (prolonged) `second` first; None where it never does."""
    if first.turn:
        meets = _circle_meets(first, second)
    elif second.turn:
        meets = _straight_meets_circle(first, second)
    else:
        meets = _straights_meet(first, second)
    best, best_back = None, inf
    for point in meets:
        back = first.before_end(point)
        if -COINCIDENT_MM <= back < best_back:
            best, best_back = point, back
    return best


def _circle_meets(first: Curve, second: Curve) -> tuple[complex, ...]:
    if second.turn:
        return _circles_meet(first, second)
    return _straight_meets_circle(second, first)


def _straights_meet(first: Curve, second: Curve) -> tuple[complex, ...]:
    heading, across = first.heading_at_end, second.heading_at_start
    sine = _cross(heading, across)
    if sine == 0.0:
        return ()
    return (first.end + heading * (_cross(second.start - first.end, across) / sine),)


def _straight_meets_circle(line: Curve, circle: Curve) -> tuple[complex, ...]:
    heading = line.heading_at_start
    to_foot = _dot(circle.centre - line.start, heading)
    foot = line.start + heading * to_foot
    square = circle.radius**2 - abs(circle.centre - foot) ** 2
    if square < 0.0:
        return ()
    half = sqrt(square)
    return (foot - heading * half, foot + heading * half)


def _circles_meet(first: Curve, second: Curve) -> tuple[complex, ...]:
    between = second.centre - first.centre
    distance = abs(between)
    if distance <= COINCIDENT_MM:
        return ()
    along = (first.radius**2 - second.radius**2 + distance**2) / (2 * distance)
    square = first.radius**2 - along**2
    if square < 0.0:
        return ()
    heading = between / distance
    foot = first.centre + heading * along
    height = 1j * heading * sqrt(square)
    return (foot - height, foot + height)


def _unit(way: complex) -> complex:
    return way / abs(way)


def _dot(first: complex, second: complex) -> float:
    return first.real * second.real + first.imag * second.imag


def _cross(first: complex, second: complex) -> float:
    return first.real * second.imag - first.imag * second.real


def _angle(start: complex, end: complex, turn: int) -> float:
    """From one direction to another the way of `turn`, 0 to 2 pi."""
    angle = (turn * phase(end * start.conjugate())) % (2 * pi)
    return angle - 2 * pi if angle > 2 * pi - _ROUNDING_RAD else angle
