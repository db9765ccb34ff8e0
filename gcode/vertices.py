"""Segments to the corners of a drawing: whole microns, arcs as chords. Not levels of detail, and not the bytes.

Chords here are for the eye; those that a controller makes of an arc are in chords.py. The one rule: every vertex is
rounded by itself from the segment's own numbers, so no error adds up along the path.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode.segments import CUTS, DWELL, PLANE_AXES, Bools, Floats, Ints, Segments

UNIT = 0.001
"""mm (degrees) of one count."""

START = 0x80
"""Bit of `kind`: nothing leads from the vertex before to this one."""

CHORD_TOLERANCE_MM = 0.01
"""How far a chord may run beside its arc: nothing that a screen shows of a whole part."""

FEWEST_A_TURN = 8
"""A circle stays one, however small it is."""

MOST_CHORDS = 4096
"""Of one arc. A turn of 2 m radius needs 993; without a limit one hostile line could fill the memory."""

CHORD_BUDGET = 16_000_000
"""Of one program; arcs after that have COARSE_CHORDS at most. A million circles would make gigabytes otherwise."""

COARSE_CHORDS = 8

PIECE_VERTICES = 131_072
"""About how many vertices are made at once: bounds the memory, whatever comes in one piece."""

_LIMIT = 2_147_483_000.0
"""Counts. Farther out a coordinate is as good as unknown: 2.1 km, 5,965 turns."""


@dataclass(slots=True)
class Vertices:
    """Columns of n corners; the way to each is described by its own row.

    `position` (axes, n) in counts of UNIT; `unknown` has a bit for each axis whose coordinate is not certain, which
    then is held as it was last. `feed` mm/min, -1 where there is none; `frame` as in Segments.
    """

    position: NDArray[np.int32]
    line: Ints
    kind: NDArray[np.uint8]
    feed: Floats
    tool: Ints
    frame: Ints
    unknown: NDArray[np.uint16]

    def __len__(self) -> int:
        return len(self.line)

    def picked(self, where: Any) -> "Vertices":
        """Some of them, in order."""
        return Vertices(*(getattr(self, field.name)[..., where] for field in fields(self)))


@dataclass(slots=True)
class Box:
    """Lowest and highest count by axis; NaN before the first."""

    low: Floats
    high: Floats

    @classmethod
    def empty(cls, axes: int) -> "Box":
        return cls(np.full(axes, nan), np.full(axes, nan))

    def include(self, vertices: Vertices, where: Bools | None = None) -> None:
        """Grow around the certain coordinates of the vertices `where`."""
        somewhere = bool(vertices.unknown.any())
        for axis, row in enumerate(vertices.position):
            chosen = where
            if somewhere:
                known = (vertices.unknown >> axis & 1) == 0
                chosen = known if where is None else known & where
            found = row if chosen is None else row[chosen]
            if len(found):
                self.low[axis] = np.fmin(self.low[axis], found.min())
                self.high[axis] = np.fmax(self.high[axis], found.max())


class VertexMaker:
    """Makes the vertices of consecutive segments. `flags` what had to be left out or made coarser."""

    def __init__(self, axes: str, *, chord_tolerance_mm: float = CHORD_TOLERANCE_MM) -> None:
        count = len(axes)
        self._tolerance_mm = chord_tolerance_mm
        self._end = np.full(count, nan)
        self._held = np.zeros(count, np.int32)
        self._begun = False
        self._chords_left = CHORD_BUDGET
        self.segments = 0
        self.out_of_range = False
        self.coarse = False
        self.known = 0
        self.box = Box.empty(count)
        self.cuts = Box.empty(count)

    def vertices(self, segments: Segments) -> Iterator[Vertices]:
        """In pieces of moderate size. Segments that draw nothing, DWELL, are gone."""
        drawn = segments.kind != DWELL
        if not drawn.all():
            segments = _picked(segments, np.flatnonzero(drawn))
        self.segments += len(segments)
        if not len(segments):
            return
        counts = self._chord_counts(segments)
        broken = self._breaks(segments)
        many = np.cumsum(counts + broken)
        begin = 0
        while begin < len(segments):
            before = int(many[begin - 1]) if begin else 0
            end = max(begin + 1, int(np.searchsorted(many, before + PIECE_VERTICES, "right")))
            piece = slice(begin, end)
            yield self._piece(segments.take(piece), counts[piece], broken[piece])
            begin = end

    def _chord_counts(self, segments: Segments) -> Ints:
        """How many edges each segment becomes: the sagitta r·(1 - cos(step / 2)) stays below the tolerance."""
        counts = np.ones(len(segments), np.int64)
        arcs = np.flatnonzero(segments.is_arc & np.isfinite(segments.sweep) & np.isfinite(segments.radius))
        if not len(arcs):
            return counts
        radius = np.fmax(segments.radius[arcs], segments.end_radius[arcs])
        step = 4.0 * np.arcsin(np.sqrt(np.minimum(self._tolerance_mm / (2.0 * np.maximum(radius, 1e-9)), 1.0)))
        wanted = np.ceil(np.abs(segments.sweep[arcs]) / np.minimum(step, 2.0 * np.pi / FEWEST_A_TURN))
        if np.any(wanted > MOST_CHORDS) or self._chords_left <= 0:
            self.coarse = True
        most = MOST_CHORDS if self._chords_left > 0 else COARSE_CHORDS
        counts[arcs] = np.clip(wanted, 1, most).astype(np.int64)
        self._chords_left -= int(counts[arcs].sum())
        return counts

    def _breaks(self, segments: Segments) -> Bools:
        """Where a segment does not begin at the end of the one before, rounded: a vertex of its own starts there."""
        start, end = segments.start, segments.end
        broken = np.zeros(len(segments), np.bool_)
        for axis in range(len(start)):
            before = np.empty(len(segments))
            before[0] = self._end[axis]
            before[1:] = end[axis, :-1]
            differs = start[axis] != before
            differs &= ~(np.isnan(start[axis]) & np.isnan(before))
            rows = np.flatnonzero(differs)
            broken[rows[np.rint(start[axis, rows] / UNIT) != np.rint(before[rows] / UNIT)]] = True
        if not self._begun:
            broken[0] = True
            self._begun = True
        self._end = end[:, -1].copy()
        return broken

    def _piece(self, segments: Segments, counts: Ints, broken: Bools) -> Vertices:
        repeats = counts + broken
        kind = np.where(segments.is_arc & np.isnan(segments.radius), segments.kind | START, segments.kind)
        total = int(repeats.sum())
        if total == len(segments):
            row, place = np.arange(total), segments.end
        else:
            row = np.repeat(np.arange(len(segments)), repeats)
            number = np.arange(total) - (np.cumsum(repeats) - repeats)[row] - broken[row] + 1
            place = _places(segments, row, number, counts)
            kind = np.where(number == 0, segments.kind[row] | START, kind[row])
        position, unknown = self._rounded(place)
        feed = segments.feed[row]
        made = Vertices(
            position,
            segments.line[row].astype(np.int64),
            kind.astype(np.uint8),
            np.where(np.isfinite(feed), feed, -1.0),
            segments.tool[row].astype(np.int64),
            segments.frame[row].astype(np.int64),
            unknown,
        )
        self.box.include(made)
        self.cuts.include(made, np.isin(made.kind, CUTS))
        return made

    def _rounded(self, place: Floats) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
        """Counts, and which of them are not certain."""
        axes, total = place.shape
        position = np.empty((axes, total), np.int32)
        unknown = np.zeros(total, np.uint16)
        for axis in range(axes):
            counts = place[axis] / UNIT
            np.rint(counts, out=counts)
            good = np.abs(counts) <= _LIMIT
            if good.all():
                self.known |= 1 << axis
            else:
                self._hold(axis, counts, good)
                unknown |= ((~good) << axis).astype(np.uint16)
            position[axis] = counts
            self._held[axis] = position[axis, -1]
        return position, unknown

    def _hold(self, axis: int, counts: Floats, good: Bools) -> None:
        """In the place of what is not certain, the last that was."""
        self.out_of_range |= bool(np.any(~good & ~np.isnan(counts)))
        if good.any():
            self.known |= 1 << axis
        last = np.maximum.accumulate(np.where(good, np.arange(len(counts)), -1))
        counts[:] = np.where(last < 0, self._held[axis], counts[last])


def _picked(segments: Segments, rows: Ints) -> Segments:
    columns: dict[str, Any] = {}
    for field in fields(segments):
        value = getattr(segments, field.name)
        columns[field.name] = value[..., rows] if isinstance(value, np.ndarray) else value
    return Segments(**columns)


def _places(segments: Segments, row: Ints, number: Ints, counts: Ints) -> Floats:
    """(axes, m) mm of the corner `number` of each `row`: 0 its start, `counts` its end, between them on the arc."""
    place = segments.end[:, row]
    starts = np.flatnonzero(number == 0)
    place[:, starts] = segments.start[:, row[starts]]
    inner = np.flatnonzero((number > 0) & (number < counts[row]))
    if not len(inner):
        return place
    rows = row[inner]
    share = number[inner] / counts[rows]
    start = segments.start[:, rows]
    points = start + (segments.end[:, rows] - start) * share
    across, up = segments.centre[:, rows]
    angle = np.arctan2(-up, -across) + segments.sweep[rows] * share
    # The radius grows along an arc that does not close, so that it ends where the block says.
    first, last = segments.radius[rows], segments.end_radius[rows]
    radius = first + (np.where(np.isfinite(last), last, first) - first) * share
    on_circle = (across + radius * np.cos(angle), up + radius * np.sin(angle))
    for plane, axes in PLANE_AXES.items():
        here = segments.plane[rows] == plane
        if here.any():
            for axis, way in zip(axes, on_circle, strict=False):
                axis_row = segments.row(axis)
                if axis_row is not None:
                    points[axis_row, here] = start[axis_row, here] + way[here]
    place[:, inner] = points
    return place
