"""The motion of one piece as the rules see it: kinds, ways, lengths, program coordinates, each worked out once.

Not a rule. The one rule: what is not known (NaN) is never taken for 0, but that an unknown way adds nothing to a
length.
"""

from functools import cached_property

import numpy as np

from gcode.arcs import extremes_of
from gcode.segments import CUTS, LINEAR_AXES, PLANE_AXES, RAPID, ROTARY_AXES, Bools, Floats, Ints, Segments

_IS_CUT = np.zeros(256, np.bool_)
_IS_CUT[list(CUTS)] = True
_IS_WAY = _IS_CUT.copy()
_IS_WAY[RAPID] = True


class Moves:
    """`rows`: the row of the piece that each segment comes from."""

    def __init__(self, segments: Segments, rows: Ints) -> None:
        self.segments = segments
        self.rows = rows
        self._ways: dict[int, Floats] = {}

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def is_cut(self) -> Bools:
        """Feed moves, arcs and probing."""
        return _IS_CUT[self.segments.kind]

    @cached_property
    def is_rapid(self) -> Bools:
        """Rapids."""
        rapid: Bools = self.segments.kind == RAPID
        return rapid

    @cached_property
    def is_way(self) -> Bools:
        """Rapids and everything that cuts: what is neither a dwell nor a way of the controller's own."""
        return _IS_WAY[self.segments.kind]

    @cached_property
    def arcs(self) -> Ints:
        """Which segments are arcs, those that cannot be included."""
        return np.flatnonzero(self.segments.is_arc)

    # --- ways ---------------------------------------------------------------------------------------------------

    def way(self, row: int) -> Floats:
        """End minus start of the axis in `row` of the segments; NaN where either is not known."""
        if row not in self._ways:
            self._ways[row] = self.segments.end[row] - self.segments.start[row]
        return self._ways[row]

    def moves_in(self, *axes: str) -> Bools:
        """Segments that move any of these axes, or may: a way that is not known counts where the end is known."""
        moving: Bools = np.zeros(len(self), np.bool_)
        for axis in axes:
            row = self.segments.row(axis)
            if row is not None:
                moving |= (self.way(row) != 0.0) & ~np.isnan(self.segments.end[row])
        return moving

    @cached_property
    def lengths(self) -> Floats:
        """As `Segments.lengths`, with less work for axes that stand still."""
        segments = self.segments
        squares = self._squares(LINEAR_AXES)
        length: Floats = np.sqrt(squares)
        if len(still := np.flatnonzero(squares == 0.0)):
            turns = self._squares(ROTARY_AXES)[still]
            length[still] = np.sqrt(turns)
        arcs = self.arcs[~np.isnan(segments.radius[self.arcs])]
        if len(arcs):
            length[arcs] = np.hypot(np.abs(segments.sweep[arcs]) * segments.radius[arcs], segments.rise(arcs))
        return length

    def _squares(self, axes: str) -> Floats:
        squares = np.zeros(len(self))
        for row, axis in enumerate(self.segments.axes):
            if axis in axes:
                way = self.way(row)
                if np.isnan(way.sum()):
                    way = np.nan_to_num(way)
                squares += way * way
        return squares

    # --- where --------------------------------------------------------------------------------------------------

    @cached_property
    def _frames(self) -> tuple[Floats, Ints | None]:
        """The offsets in force here, (frames, axes); the frame of each segment, None where there is one only."""
        frame = self.segments.frame
        if len(frame) and frame.min() == frame.max():
            return np.array([self.segments.frames[int(frame[0])]]), None
        numbers, places = np.unique(frame, return_inverse=True)
        offsets = [self.segments.frames[number] for number in numbers.tolist()]
        return np.array(offsets or [[0.0] * len(self.segments.axes)]), places

    def offset(self, row: int) -> Floats | float:
        """Of the axis in `row`, machine minus program coordinate: one number, or one a segment."""
        offsets, places = self._frames
        return float(offsets[0, row]) if places is None else offsets[places, row]

    def work_start(self, row: int) -> Floats:
        """Program coordinates of the starts."""
        start: Floats = self.segments.start[row] - self.offset(row)
        return start

    def work_end(self, row: int) -> Floats:
        """Program coordinates of the ends."""
        end: Floats = self.segments.end[row] - self.offset(row)
        return end

    @cached_property
    def reach(self) -> tuple[Floats, Floats]:
        """Lowest and highest machine coordinate of every axis in each segment, (axes, n): the end, and an arc's bulge.

        The starts do not count: a program is not to blame for where it begins.
        """
        segments = self.segments
        bulging = self.arcs[~np.isnan(segments.sweep[self.arcs])]
        if not len(bulging):
            return segments.end, segments.end
        low, high = segments.end.copy(), segments.end.copy()
        for plane, (first, second, _) in PLANE_AXES.items():
            here = bulging[segments.plane[bulging] == plane]
            rows = [row for axis in (first, second) if (row := segments.row(axis)) is not None]
            if not len(here) or len(rows) < 2:
                continue
            way = np.nan_to_num(segments.end[rows][:, here] - segments.start[rows][:, here])
            lowest, highest = extremes_of(segments.centre[:, here], segments.radius[here], segments.sweep[here], way)
            start = segments.start[rows][:, here]
            for place, row in enumerate(rows):
                low[row, here] = np.fmin(low[row, here], start[place] + lowest[place])
                high[row, here] = np.fmax(high[row, here], start[place] + highest[place])
        return low, high
