"""A builder of Segments: rows as the interpreter makes them, one by one, columns when somebody takes them.

No meaning of words here; arc geometry is worked out for all rows at once by gcode/arcs.py, as everywhere. The one
rule: a row says what is known of an arc from its own words, so that an arc is known even where the position is not.
"""

from collections.abc import Iterator, Sequence
from math import isnan, nan
from typing import NamedTuple

import numpy as np

from gcode.arcs import arcs_from_offsets, arcs_from_radius
from gcode.segments import CW, Segments

NO_TOOL = -1


class ArcWords(NamedTuple):
    """`way` and `centre` from the start in the plane's axes, mm; `radius` in the place of a centre where R says so."""

    plane: int
    way: tuple[float, float]
    centre: tuple[float, float]
    radius: float | None
    turns: int

    def at(self, *, clockwise: bool) -> tuple[float, float] | None:
        """The centre, also where R says it; None when no arc of these words exists."""
        if self.radius is None:
            return self.centre
        found = arcs_from_radius(np.array(self.way)[:, None], np.array([self.radius]), np.array([clockwise]))
        centre = float(found[0, 0]), float(found[1, 0])
        return None if isnan(centre[0]) else centre


class Row(NamedTuple):
    """One segment. `inverse`: `feed` is the reciprocal of the minutes that it takes (G93)."""

    line: int
    kind: int
    start: Sequence[float]
    end: Sequence[float]
    feed: float
    spindle: float
    tool: int
    sync: bool
    frame: int
    dwell_s: float = 0.0
    inverse: bool = False
    arc: ArcWords | None = None


def rows_of(segments: Segments) -> Iterator[Row]:
    """Columns as rows again."""
    columns = (
        segments.line, segments.kind, segments.start.T, segments.end.T, segments.feed, segments.spindle, segments.tool,
        segments.sync, segments.frame, segments.dwell_s, segments.plane, segments.centre.T,
    )  # fmt: skip
    for line, kind, start, end, feed, spindle, tool, sync, frame, dwell_s, plane, centre in zip(
        *(column.tolist() for column in columns), strict=True
    ):
        arc = ArcWords(plane, (nan, nan), (centre[0], centre[1]), None, 1) if plane else None
        yield Row(line, kind, start, end, feed, spindle, tool, sync, frame, dwell_s, arc=arc)


class Rows:
    """Rows of one program. `frames` only ever grows: a row's `frame` stays true through all that is taken."""

    def __init__(self, axes: str) -> None:
        self._axes = axes
        self._rows: list[Row] = []
        self.add = self._rows.append
        self.frames: list[tuple[float, ...]] = []
        self._frame_rows: dict[tuple[float, ...], int] = {}

    def __len__(self) -> int:
        return len(self._rows)

    def frame_of(self, frame: tuple[float, ...]) -> int:
        """The row of `frames` for these offsets."""
        row = self._frame_rows.get(frame)
        if row is None:
            row = self._frame_rows[frame] = len(self.frames)
            self.frames.append(frame)
        return row

    def drain(self) -> list[Row]:
        """Everything since the last take as it is, for whoever looks at moves one by one."""
        rows = list(self._rows)
        self._rows.clear()
        return rows

    def take(self) -> Segments:
        """Everything since the last take, as columns."""
        rows = self.drain()
        count = len(rows)
        columns = list(zip(*rows, strict=True)) or [()] * len(Row._fields)
        line, kind, start, end, feed, spindle, tool, sync, frame, dwell_s, inverse, _ = columns
        found = Segments(
            axes=self._axes,
            line=np.array(line, np.int64),
            kind=np.array(kind, np.uint8),
            start=np.array(start, np.float64).reshape(count, len(self._axes)).T,
            end=np.array(end, np.float64).reshape(count, len(self._axes)).T,
            feed=np.array(feed, np.float64),
            spindle=np.array(spindle, np.float64),
            tool=np.array(tool, np.int32),
            dwell_s=np.array(dwell_s, np.float64),
            sync=np.array(sync, np.bool_),
            frame=np.array(frame, np.int32),
            frames=self.frames,
            plane=np.zeros(count, np.uint8),
            centre=np.full((2, count), nan),
            radius=np.full(count, nan),
            end_radius=np.full(count, nan),
            sweep=np.full(count, nan),
        )
        _resolve_arcs(found, rows)
        inverted = np.array(inverse, np.bool_)
        if inverted.any():
            found.feed = np.where(inverted, found.feed * found.lengths(), found.feed)
        return found


def _resolve_arcs(found: Segments, rows: list[Row]) -> None:
    arcs = [(place, row.kind, row.arc) for place, row in enumerate(rows) if row.arc is not None]
    if not arcs:
        return
    places = np.array([place for place, _, _ in arcs], np.int64)
    way = np.array([arc.way for _, _, arc in arcs], np.float64).T
    centre = np.array([arc.centre for _, _, arc in arcs], np.float64).T
    radius = np.array([nan if arc.radius is None else arc.radius for _, _, arc in arcs], np.float64)
    turns = np.array([arc.turns for _, _, arc in arcs], np.int64)
    clockwise = found.kind[places] == CW
    by_radius = np.array([arc.radius is not None for _, _, arc in arcs], np.bool_)
    if by_radius.any():
        centre = np.where(by_radius, arcs_from_radius(way, radius, clockwise), centre)
    found.plane[places] = [arc.plane for _, _, arc in arcs]
    geometry = arcs_from_offsets(way, centre, clockwise, turns)
    found.centre[:, places], found.radius[places], found.end_radius[places], found.sweep[places] = geometry
