"""Segments to the corners of a drawing: whole microns, arcs with their centres. Neither levels of detail nor bytes.

The chords of an arc are the reader's affair; those that a controller makes are in chords.py. The one rule: every vertex
is rounded by itself from the segment's own numbers, so no error adds up along the path.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from math import inf, nan, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode.arcs import reach
from gcode.segments import CUTS, DWELL, FEED, Bools, Floats, Ints, Segments

UNIT = 0.001
"""mm (degrees) of one count."""

START = 0x80
"""Bit of `kind`: nothing leads from the vertex before to this one."""

PIECE_SEGMENTS = 65_536
"""Are made at once: bounds the memory, whatever comes in one piece."""

_COUNTS = 1000.0
"""In one mm: a product is one rounding fewer than a quotient by UNIT."""

_LIMIT = 2_147_483_000.0
"""Counts. Farther out a coordinate is as good as unknown: 2.1 km, 5,965 turns."""

_ROUNDING = 3.0
"""Counts by which ends and centre of an arc, rounded, may bend it."""

_IS_CUT = np.isin(np.arange(256), CUTS)


@dataclass(slots=True)
class Arcs:
    """Columns of m arcs. `at`: the vertex that each leads to, ascending.

    `centre` (2, m) in counts from the vertex before, in the first and second axis of `plane` (17, 18, 19); `sweep` in
    rad, positive counter-clockwise; `bulge` counts that the arc is away from its chord at most.
    """

    at: Ints
    centre: NDArray[np.int32]
    sweep: NDArray[np.float32]
    plane: NDArray[np.uint8]
    bulge: Floats

    @classmethod
    def none(cls) -> "Arcs":
        """No arcs."""
        return cls(
            np.empty(0, np.int64),
            np.empty((2, 0), np.int32),
            np.empty(0, np.float32),
            np.empty(0, np.uint8),
            np.empty(0),
        )

    def __len__(self) -> int:
        return len(self.at)

    def picked(self, where: Any, at: Ints) -> "Arcs":
        """Some of them, in order, that lead to the vertices `at`."""
        return Arcs(at, self.centre[:, where], self.sweep[where], self.plane[where], self.bulge[where])


@dataclass(slots=True)
class Vertices:
    """Columns of n corners; the way to each is described by its own row.

    `position` (axes, n) in counts of UNIT; `unknown` has a bit for each axis whose coordinate is not certain, which
    then is held as it was last. `kind` as in Segments; CW and CCW without START are in `arcs`. `feed` mm/min, -1 where
    there is none; `frame` as in Segments.
    """

    position: NDArray[np.int32]
    line: NDArray[np.int32]
    kind: NDArray[np.uint8]
    feed: NDArray[np.float32]
    tool: NDArray[np.int32]
    frame: NDArray[np.int32]
    unknown: NDArray[np.uint16]
    arcs: Arcs

    def __len__(self) -> int:
        return len(self.line)


def joined(parts: Sequence[Vertices]) -> Vertices:
    """One after the other."""
    if len(parts) == 1:
        return parts[0]
    before = np.cumsum([0, *(len(part) for part in parts)])
    columns = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts], axis=-1)
        for field in fields(Vertices)
        if field.name != "arcs"
    }
    arcs = Arcs(
        np.concatenate([part.arcs.at + first for part, first in zip(parts, before[:-1], strict=True)]),
        *(
            np.concatenate([getattr(part.arcs, name) for part in parts], axis=-1)
            for name in ("centre", "sweep", "plane", "bulge")
        ),
    )
    return Vertices(**columns, arcs=arcs)


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

    def reach(self, low: Floats, high: Floats) -> None:
        """Grow around boxes (axes, m); NaN in them is not certain."""
        lowest = np.where(np.isnan(low), inf, low).min(axis=1, initial=inf)
        highest = np.where(np.isnan(high), -inf, high).max(axis=1, initial=-inf)
        self.low = np.fmin(self.low, np.where(lowest < inf, lowest, nan))
        self.high = np.fmax(self.high, np.where(highest > -inf, highest, nan))


class VertexMaker:
    """Makes the vertices of consecutive segments.

    `segments` so many were drawn; `out_of_range`, `straightened`: some coordinates, some arcs were too far out.
    """

    def __init__(self, axes: str) -> None:
        count = len(axes)
        self._end = np.full(count, nan)
        self._held = np.zeros(count, np.int32)
        self._begun = False
        self.segments = 0
        self.out_of_range = False
        self.straightened = False
        self.known = 0
        self.box = Box.empty(count)
        self.cuts = Box.empty(count)

    def vertices(self, segments: Segments) -> Iterator[Vertices]:
        """In pieces of moderate size. Segments that draw nothing, DWELL, are gone."""
        drawn = segments.kind != DWELL
        if not drawn.all():
            segments = _picked(segments, np.flatnonzero(drawn))
        self.segments += len(segments)
        for begin in range(0, len(segments), PIECE_SEGMENTS):
            piece = segments.take(slice(begin, begin + PIECE_SEGMENTS))
            yield self._piece(piece, self._breaks(piece))

    def _breaks(self, segments: Segments) -> Ints:
        """The segments that do not begin at the end of the one before, rounded: a vertex of its own starts there."""
        start, end = segments.start, segments.end
        broken = np.zeros(len(segments), np.bool_)
        for axis in range(len(start)):
            before = np.empty(len(segments))
            before[0] = self._end[axis]
            before[1:] = end[axis, :-1]
            rows = np.flatnonzero(start[axis] != before)
            if len(rows):
                here, there = start[axis, rows], before[rows]
                differs = np.rint(here * _COUNTS) != np.rint(there * _COUNTS)
                broken[rows[differs & ~(np.isnan(here) & np.isnan(there))]] = True
        if not self._begun:
            broken[0] = True
            self._begun = True
        self._end = end[:, -1].copy()
        return np.flatnonzero(broken)

    def _piece(self, segments: Segments, broken: Ints) -> Vertices:
        kind, arcs = self._arcs(segments)
        columns: list[Any] = [segments.line, kind, segments.feed, segments.tool, segments.frame]
        place = segments.end
        if len(broken):
            # A vertex more before each of those, with the start of the way for its place.
            starts = broken + np.arange(len(broken))
            columns = [np.insert(column, broken, column[broken]) for column in columns]
            columns[1][starts] = segments.kind[broken] | START
            place = np.insert(place, broken, segments.start[:, broken], axis=1)
            arcs.at += np.searchsorted(broken, arcs.at, "right")
        line, kind, feed, tool, frame = columns
        position, unknown = self._rounded(place)
        feed = feed.astype(np.float32)
        made = Vertices(
            position,
            line.astype(np.int32),
            kind,
            np.where(np.isfinite(feed), feed, np.float32(-1.0)),
            tool.astype(np.int32, copy=False),
            frame.astype(np.int32, copy=False),
            unknown,
            arcs,
        )
        self.box.include(made)
        cuts = _IS_CUT[kind]
        self.cuts.include(made, None if cuts.all() else cuts)
        return made

    def _arcs(self, segments: Segments) -> tuple[NDArray[np.uint8], Arcs]:
        """The kinds, and the arcs with `at` the row of their segment."""
        rows = np.flatnonzero(segments.is_arc)
        if not len(rows):
            return segments.kind, Arcs.none()
        centre = np.rint(segments.centre[:, rows] * _COUNTS)
        exists = ~np.isnan(segments.radius[rows])
        near = (np.abs(centre) <= _LIMIT).all(axis=0) & np.isfinite(segments.sweep[rows])
        kind = segments.kind.copy()
        kind[rows[~exists]] |= START
        kind[rows[exists & ~near]] = FEED
        self.straightened |= bool(np.any(exists & ~near))
        kept = exists & near
        if not kept.all():
            rows, centre = rows[kept], centre[:, kept]
        sweep = segments.sweep[rows]
        self._include_bulges(_picked(segments, rows))
        return kind, Arcs(
            rows,
            centre.astype(np.int32),
            sweep.astype(np.float32),
            segments.plane[rows],
            _bulges(segments.radius[rows], segments.end_radius[rows], sweep),
        )

    def _include_bulges(self, arcs: Segments) -> None:
        if not len(arcs):
            return
        low, high = (np.rint(bound * _COUNTS) for bound in reach(arcs))
        far = ~(np.abs(low) <= _LIMIT) | ~(np.abs(high) <= _LIMIT)
        low[far] = high[far] = nan
        self.box.reach(low, high)
        self.cuts.reach(low, high)

    def _rounded(self, place: Floats) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
        """Counts, and which of them are not certain."""
        axes, total = place.shape
        position = np.empty((axes, total), np.int32)
        unknown = np.zeros(total, np.uint16)
        for axis in range(axes):
            counts = place[axis] * _COUNTS
            np.rint(counts, out=counts)
            # False with any NaN among them.
            if counts.min() >= -_LIMIT and counts.max() <= _LIMIT:
                self.known |= 1 << axis
            else:
                good = np.abs(counts) <= _LIMIT
                self._hold(axis, counts, good)
                unknown |= ((~good) << axis).astype(np.uint16)
            position[axis] = counts
            self._held[axis] = position[axis, -1]
        return position, unknown

    def _hold(self, axis: int, counts: Floats, good: Bools) -> None:
        """In the place of what is not certain, the last that was."""
        self.out_of_range |= bool(np.any(~good & ~np.isnan(counts)))
        if not good.any():
            counts[:] = self._held[axis]
            return
        self.known |= 1 << axis
        last = np.maximum.accumulate(np.where(good, np.arange(len(counts)), -1))
        counts[:] = np.where(last < 0, self._held[axis], counts[last])


def _bulges(radius: Floats, end_radius: Floats, sweep: Floats) -> Floats:
    """Counts that arcs are away from their chords at most, however far they rise.

    Both gone through evenly, arc and chord are farthest apart in the middle up to half a turn; beyond, never more than
    a diameter. An arc that does not close is off its neighbour that does by what its radii differ, and so is its chord.
    """
    largest = np.fmax(radius, end_radius)
    away = np.where(np.abs(sweep) <= pi, 1.0 - np.cos(sweep / 2.0), 2.0) * largest
    found: Floats = (away + 2.0 * np.abs(np.nan_to_num(end_radius - radius))) * _COUNTS + _ROUNDING
    return found


def _picked(segments: Segments, rows: Ints) -> Segments:
    columns: dict[str, Any] = {}
    for field in fields(segments):
        value = getattr(segments, field.name)
        columns[field.name] = value[..., rows] if isinstance(value, np.ndarray) else value
    return Segments(**columns)
