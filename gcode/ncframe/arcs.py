"""Arcs for a machine that takes only their ends and R, in whole counts (ncframe §3).

Near half a turn, and near a whole one, a count more or less in R or in an end moves the centre by far more than a
count: of R 10 mm it is a tenth of a millimetre. So an arc is given out in as many pieces as it takes.
Not the words of an arc. The one rule: what the machine makes of the counts passes the middle of every piece within
TOLERANCE_COUNTS.
"""

from cmath import exp
from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, pi, sqrt

from gcode.offsetpath import Curve, arc

TOLERANCE_COUNTS = 2.0
"""Ends and R are rounded by half a count each, which is up to about one in the middle of a quarter turn."""

_ALWAYS_RAD = pi / 2
"""A piece of up to so much is never divided: its ends hold its middle."""

_HALF_TURN = pi + 1e-6
"""Over this, R is negative. Half a turn has a positive one, whichever way its last digits were rounded."""

Counts = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Piece:
    """One frame of an arc: where it ends, R, and the share of the whole arc, 0 to 1."""

    end: complex
    radius_counts: int
    share: float


class Lattice:
    """Where the machine can stand: whole counts from the host's zero."""

    def __init__(self, resolution_mm: float) -> None:
        self.resolution_mm = resolution_mm

    def counts(self, value_mm: float) -> int:
        """The nearest whole count."""
        return round(value_mm / self.resolution_mm)

    def point(self, place: complex) -> complex:
        """A place in mm to the nearest one in counts."""
        return complex(self.counts(place.real), self.counts(place.imag))


def pieces(lattice: Lattice, start: complex, end: complex, centre: complex, *, clockwise: bool) -> Iterator[Piece]:
    """The frames of an arc in its plane's first and second axis, mm; the same start and end make a full circle.

    Radii at start and end may differ by what rounding makes of them: each piece has the mean of its own. An arc that
    comes to nothing in counts has no piece.
    """
    curve = arc(start, end, centre, turn=-1 if clockwise else 1)
    whole = _Arc(lattice, curve, abs(start - centre), abs(end - centre))
    if curve.extent >= 2 * pi - 1e-9:
        yield from whole.divided(0.0, 1.0)
    else:
        yield from whole.between(0.0, 1.0)


@dataclass(frozen=True, slots=True)
class _Arc:
    lattice: Lattice
    curve: Curve
    radius: float
    end_radius: float

    def at(self, share: float) -> complex:
        """The point so far along the arc."""
        curve = self.curve
        if share in (0.0, 1.0):
            return curve.end if share else curve.start
        ray = (curve.start - curve.centre) / self.radius
        radius = self.radius + (self.end_radius - self.radius) * share
        return curve.centre + radius * ray * exp(1j * curve.turn * curve.extent * share)

    def divided(self, begin: float, end: float) -> Iterator[Piece]:
        middle = (begin + end) / 2
        yield from self.between(begin, middle)
        yield from self.between(middle, end)

    def between(self, begin: float, end: float) -> Iterator[Piece]:
        """The pieces of a part of the arc."""
        sweep = self.curve.extent * (end - begin)
        start, stop = self.lattice.point(self.at(begin)), self.lattice.point(self.at(end))
        middle = (begin + end) / 2
        radius_mm = self.radius + (self.end_radius - self.radius) * middle
        chord = abs(stop - start)
        if chord == 0.0:
            if sweep > _ALWAYS_RAD and radius_mm >= self.lattice.resolution_mm:
                yield from self.divided(begin, end)
            return
        # Ends that were rounded apart may be over 2R apart: no machine makes an arc of that.
        radius = max(self.lattice.counts(radius_mm), ceil(chord / 2 - 1e-9))
        if sweep > _ALWAYS_RAD:
            wanted = self.at(middle) / self.lattice.resolution_mm
            if abs(_middle(start, stop, radius, sweep, self.curve.turn) - wanted) > TOLERANCE_COUNTS:
                yield from self.divided(begin, end)
                return
        yield Piece(self.at(end), -radius if sweep > _HALF_TURN else radius, end - begin)


def _middle(start: complex, end: complex, radius: int, sweep: float, turn: int) -> complex:
    """Where the middle of the arc lies that a machine makes of these counts."""
    chord = end - start
    length = abs(chord)
    height = sqrt(max(0.0, radius * radius - length * length / 4))
    bulge = radius + height if sweep > _HALF_TURN else radius - height
    # A clockwise arc lies to the left of its chord.
    return (start + end) / 2 - turn * 1j * chord / length * bulge
