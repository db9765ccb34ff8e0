"""Ways as a controller of Grbl's kind cuts them up: arcs into chords, ends onto whole steps. Not how fast they go.

An arc is as many straight lines as its tolerance asks for, each a planner block of its own (gcode.md §5); a target is
rounded to the motors' steps before its length is taken. The one rule: a coordinate that is not certain is no way.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcode.segments import PLANE_AXES, Floats, Ints, Segments

MOST_CHORDS = 65_535
"""Of one arc: Grbl counts them in 16 bits. Bounds the memory that a single hostile arc can ask for."""

FARTHEST_MM = 1e9
"""A way longer than this is no machine's; it is cut off here so that its square stays a number."""


@dataclass(frozen=True, slots=True)
class Cut:
    """Into how many `chords` each segment is cut; all between the first and last `edge` of them are one line, but
    where `edge` is 0 (longarcs.py)."""

    chords: Ints
    edge: Ints

    @property
    def lines(self) -> Ints:
        """How many lines each segment becomes."""
        return np.where(self.edge > 0, 2 * self.edge + 1, self.chords)

    def take(self, where: slice) -> "Cut":
        """That of consecutive segments."""
        return Cut(self.chords[where], self.edge[where])


@dataclass(slots=True)
class Ways:
    """`delta` (axes, m) in mm of each straight line; `row` of the segment that it belongs to, ascending.

    `first`: the line is the first of its segment. Every segment has at least one line, if only of no length. `whole`:
    the lines that stand for many chords; their `delta` leads across and is not the length of the way.
    """

    delta: Floats
    row: Ints
    first: NDArray[np.bool_]
    whole: Ints


def chord_counts(segments: Segments, tolerance_mm: float) -> Ints:
    """How many lines each segment becomes: n = ⌊|θ·r/2| / √(tol·(2r - tol))⌋ for an arc (gcode.md §5), else 1."""
    counts = np.ones(len(segments), np.int64)
    arcs = np.flatnonzero(segments.is_arc)
    if len(arcs):
        radius, sweep = segments.radius[arcs], segments.sweep[arcs]
        wanted = np.abs(sweep * radius / 2) / np.sqrt(tolerance_mm * (2 * radius - tolerance_mm))
        # Not a number where no arc of these words exists, or where it is smaller than the tolerance: one line.
        wanted = np.where(np.isfinite(wanted), wanted, np.where(wanted > 0, float(MOST_CHORDS), 1.0))
        counts[arcs] = np.clip(wanted, 1.0, float(MOST_CHORDS)).astype(np.int64)
    return counts


def straight_ways(segments: Segments, cut: Cut, steps_per_mm: Mapping[int, float]) -> Ways:
    """Every segment as lines. `steps_per_mm` by row of the axes; an axis that is not in it is not rounded."""
    start, end, counts = segments.start, segments.end, cut.lines
    total = int(counts.sum())
    if total == len(counts):
        row = np.arange(total, dtype=np.int64)
        whole = np.zeros(0, np.int64)
        return Ways(_difference(start, end, steps_per_mm), row, np.ones(total, np.bool_), whole)
    row = np.repeat(np.arange(len(counts), dtype=np.int64), counts)
    first_line = np.cumsum(counts) - counts
    start, end = start[:, row], end[:, row]
    first = np.zeros(total, np.bool_)
    first[first_line] = True
    arcs = np.flatnonzero(counts > 1)
    inside = np.flatnonzero((counts > 1)[row])
    number = inside - first_line[row[inside]] + 1
    edge, skipped = cut.edge[row[inside]], (cut.chords - counts)[row[inside]]
    points = _points(segments, row[inside], np.where(number > edge, number + skipped, number), cut.chords)
    last = np.zeros(total, np.bool_)
    last[first_line[arcs] + counts[arcs] - 1] = True
    # Relative to an unknown start the points are of another origin than a known end: the arc alone counts then.
    known_end = last[inside] & ~np.isnan(end[:, inside]) & ~np.isnan(segments.start[:, row[inside]])
    end[:, inside] = np.where(known_end, end[:, inside], points)
    follows = inside[~first[inside]]
    start[:, follows] = end[:, follows - 1]
    begins = inside[first[inside]]
    # Where the machine stands is not known, but how the arc goes on from there is (segments: centre from the start).
    start[:, begins] = _or_zero(start[:, begins])
    return Ways(_difference(start, end, steps_per_mm), row, first, inside[(edge > 0) & (number == edge + 1)])


def _points(segments: Segments, row: Ints, number: Ints, counts: Ints) -> Floats:
    """(axes, m) ends of the chords `number` (from 1) of the arcs `row`, all axes, from the rotation alone."""
    begin = _or_zero(segments.start[:, row])
    share = number / counts[row]
    points = begin + _or_zero(segments.end[:, row] - segments.start[:, row]) * share
    angle = segments.sweep[row] * share
    cosine, sine = np.cos(angle), np.sin(angle)
    across, up = segments.centre[0, row], segments.centre[1, row]
    sideways = (across - across * cosine + up * sine, up - across * sine - up * cosine)
    for plane, axes in PLANE_AXES.items():
        here = segments.plane[row] == plane
        if here.any():
            for axis, way in zip(axes, sideways, strict=False):
                axis_row = segments.row(axis)
                if axis_row is not None:
                    points[axis_row, here] = begin[axis_row, here] + way[here]
    return points


def _difference(start: Floats, end: Floats, steps_per_mm: Mapping[int, float]) -> Floats:
    """End minus start, each on the nearest step, halves away from zero as C's lround; nothing where not certain."""
    delta = end - start
    for axis_row, steps in steps_per_mm.items():
        delta[axis_row] = (_rounded(end[axis_row] * steps) - _rounded(start[axis_row] * steps)) / steps
    certain = np.isfinite(delta)
    if not certain.all():
        delta[~certain] = 0.0
    return np.clip(delta, -FARTHEST_MM, FARTHEST_MM, out=delta)


def _or_zero(lengths: Floats) -> Floats:
    return np.where(np.isfinite(lengths), lengths, 0.0)


def _rounded(steps: Floats) -> Floats:
    return np.trunc(steps + np.copysign(0.5, steps))
