"""Runs of plain rows to motion, all rows at once: the common case of the interpreter, without a loop over blocks.

Not the reference: interpreter.py is, and both give the same segments. The one rule: a run ends before the first row
whose meaning is not certain here; that row goes through the interpreter.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode.arcs import arcs_from_offsets, arcs_from_radius
from gcode.blocks import MOTIONS, Blocks, filled
from gcode.segments import CCW, CW, FEED, PLANE_AXES, RAPID, ROTARY_AXES, Bools, Floats, Ints, Segments
from gcode.state import State

MM_PER_INCH = 25.4
_EFFECTS = {kind: effect for effect, kind in MOTIONS.items()}
_CUTTING = frozenset(("feed", "arc_cw", "arc_ccw"))
_OFFSETS = {17: ("I", "J"), 18: ("K", "I"), 19: ("J", "K")}
"""The offsets to an arc's centre, in the order of the plane's axes (rs274 §4)."""


@dataclass(frozen=True, slots=True)
class Context:
    """What the rows do not say: their numbers, the frame in force, and whether S empties the queue of this machine."""

    line: Ints
    frame: int
    frames: list[tuple[float, ...]]
    speed_syncs: bool
    laser: bool


class Run:
    """Rows [begin, end) of `blocks` from `state`, which is changed by `execute`. `end` may come out lower."""

    def __init__(self, blocks: Blocks, begin: int, end: int, state: State) -> None:
        self._blocks, self._state = blocks, state
        self._begin = begin
        self._axes = [axis for axis in state.axes if axis in blocks.letters]
        self._cut(end)
        stops = np.flatnonzero(self._not_plain())
        self.whole = not len(stops)
        if len(stops):
            self._cut(begin + int(stops[0]))

    @property
    def end(self) -> int:
        """The first row that is not part of the run."""
        return self._begin + self._count

    def _lengths(self, axis: str) -> Floats:
        """The words of an axis in mm; X of a diameter is half of it."""
        state, values = self._state, self._values(axis)
        if state.inches and axis not in ROTARY_AXES:
            values = values * MM_PER_INCH
        return values / 2 if state.diameter_mode and axis == "X" else values

    def _cut(self, end: int) -> None:
        self._count = end - self._begin
        self._kind = self._kinds()
        self._has_axes = self._any_of(self._axes)

    def _has(self, letter: str) -> Bools:
        return self._blocks.part(letter, self._begin, self.end).has

    def _values(self, letter: str) -> Floats:
        return self._blocks.part(letter, self._begin, self.end).values

    def _kinds(self) -> NDArray[Any]:
        """The motion mode of each row; 255 where there is none that is known here."""
        own = self._blocks.motion[self._begin : self.end]
        initial = MOTIONS.get(self._state.motion or "", 254) + 1
        if not own.any():
            return np.full(self._count, initial - 1, np.uint8)
        return filled(own, own > 0, initial).astype(np.uint8) - 1

    # --- what is not plain --------------------------------------------------------------------------------------

    def _not_plain(self) -> Bools:
        """Rows whose words do not fit the mode that they meet."""
        state, kind, moves = self._state, self._kind, self._has_axes
        stops: Bools = moves & (kind > CCW)
        offsets = [letter for letter in "IJK" if letter in self._blocks.letters]
        radius, centre = self._has("R"), self._any_of(offsets)
        arcs = ((kind == CW) | (kind == CCW)) & moves
        stops |= (centre | radius) & ~arcs
        if arcs.any():
            stops |= arcs & self._odd_arcs(centre, radius)
        if state.feed_mode == 93:
            stops |= moves & (kind != RAPID) & ~self._has("F")
        return stops

    def _odd_arcs(self, centre: Bools, radius: Bools) -> Bools:
        """Arcs that want a closer look, were these rows arcs."""
        plane_axes = PLANE_AXES[self._state.plane][:2]
        if self._state.arc_absolute or not set(plane_axes) <= set(self._state.axes):
            return np.ones(self._count, np.bool_)
        foreign = self._any_of(set("IJK") - set(_OFFSETS[self._state.plane]))
        odd: Bools = (centre == radius) | foreign | ~self._any_of(plane_axes)
        return odd

    def _any_of(self, letters: Iterable[str]) -> Bools:
        found = np.zeros(self._count, np.bool_)
        for letter in letters:
            found |= self._has(letter)
        return found

    # --- execution ----------------------------------------------------------------------------------------------

    def execute(self, context: Context) -> Segments | None:
        """The motion of the run; None when it has none. The state is that behind it afterwards."""
        state = self._state
        moving = np.flatnonzero(self._has_axes)
        start, end = self._positions(moving)
        feed, dry = self._feeds(), self._runs_dry(context)
        speed = self._speeds()
        if self._blocks.motion[self._begin : self.end].any():
            state.motion = _EFFECTS[int(self._kind[-1])]
            state.motion_name = f"G{MOTIONS[state.motion]}"
            state.cycle = {}
        if not len(moving):
            state.sync |= bool(dry.any())
            return None
        kind = self._kind[moving]
        found = self._segments(context, moving, kind, start, end)
        found.feed, found.spindle = feed[moving], speed[moving] * float(state.spindle or 0)
        found.sync = self._syncs(dry, moving)
        if state.feed_mode == 95:
            found.feed = found.feed * np.abs(speed[moving])
        if state.feed_mode == 93:
            modal = nan if state.feed is None else state.feed
            found.feed = np.where(kind == RAPID, modal, found.feed * found.lengths())
        state.position = [float(value) for value in end[:, -1]]
        return found

    def _positions(self, moving: Ints) -> tuple[Floats, Floats]:
        """Where each motion begins and ends, machine coordinates, (axes, n)."""
        state = self._state
        end = np.empty((len(state.axes), len(moving)))
        for row, axis in enumerate(state.axes):
            at = state.position[row]
            if axis not in self._axes:
                end[row] = at
                continue
            has, values = self._has(axis)[moving], self._lengths(axis)[moving]
            if state.absolute:
                if state.frame[row]:
                    values = values + state.frame[row]
                end[row] = filled(values, has, at)
            else:
                # cumsum adds one after the other, as the interpreter does: the same floats.
                end[row] = np.cumsum(np.concatenate(([at], np.where(has, values, 0.0))))[1:]
        start = np.empty_like(end)
        start[:, :1] = np.array(state.position)[:, np.newaxis]
        start[:, 1:] = end[:, :-1]
        return start, end

    def _feeds(self) -> Floats:
        """mm/min in force at each row, in G93 the reciprocal of the minutes."""
        state, has = self._state, self._has("F")
        values = self._values("F")
        if state.inches and state.feed_mode != 93:
            values = values * MM_PER_INCH
        feed = filled(values, has, nan if state.feed is None else state.feed)
        if state.feed_mode != 93 and has.any():
            state.feed = float(feed[-1])
        return feed

    def _speeds(self) -> Floats:
        """rpm in force at each row, whether the spindle turns or not."""
        state, has = self._state, self._has("S")
        speed = filled(self._values("S"), has, state.speed)
        if has.any():
            state.speed = float(speed[-1])
        return speed

    def _runs_dry(self, context: Context) -> Bools:
        """Rows at which the controller waits for its queue to run dry because of S (gcode §5; Grbl's laser mode)."""
        state, has = self._state, self._has("S")
        if not (context.speed_syncs and state.spindle):
            return np.zeros(self._count, np.bool_)
        speed = filled(self._values("S"), has, state.speed)
        dry: Bools = has & (speed != np.concatenate(([state.speed], speed[:-1])))
        if context.laser:
            cuts = (self._kind >= FEED) & (self._kind <= CCW)
            cut_before = np.concatenate(([state.motion in _CUTTING], cuts[:-1]))
            if state.spindle == 1:
                dry |= cuts != cut_before
            dry &= ~self._has_axes
        return dry

    def _syncs(self, dry: Bools, moving: Ints) -> Bools:
        """The same by segment: the first motion at or behind such a row waits."""
        state = self._state
        sync: Bools = np.zeros(len(moving), np.bool_)
        places = np.searchsorted(moving, np.flatnonzero(dry))
        sync[places[places < len(moving)]] = True
        sync[0] |= state.sync
        state.sync = len(places) > 0 and bool(places[-1] >= len(moving))
        return sync

    def _segments(self, context: Context, moving: Ints, kind: NDArray[Any], start: Floats, end: Floats) -> Segments:
        count, state = len(moving), self._state
        found = Segments(
            axes=state.axes,
            line=context.line[self._begin : self.end][moving],
            kind=kind,
            start=start,
            end=end,
            feed=np.zeros(0),
            spindle=np.zeros(0),
            tool=np.full(count, -1 if state.tool is None else state.tool, np.int32),
            dwell_s=np.zeros(count),
            sync=np.zeros(0, np.bool_),
            frame=np.full(count, context.frame, np.int32),
            frames=context.frames,
            plane=np.zeros(count, np.uint8),
            centre=np.full((2, count), nan),
            radius=np.full(count, nan),
            end_radius=np.full(count, nan),
            sweep=np.full(count, nan),
        )
        arcs = np.flatnonzero(kind >= CW)
        if len(arcs):
            self._arcs(found, moving, arcs)
        return found

    def _arcs(self, found: Segments, moving: Ints, arcs: Ints) -> None:
        state, rows = self._state, moving[arcs]
        scale = MM_PER_INCH if state.inches else 1.0
        found.plane[arcs] = state.plane
        way = np.array([self._way(found, axis, rows, arcs) for axis in PLANE_AXES[state.plane][:2]])
        clockwise = found.kind[arcs] == CW
        by_radius = self._has("R")[rows]
        offsets = np.array([self._values(letter)[rows] * scale for letter in _OFFSETS[state.plane]])
        offsets = np.where(by_radius, arcs_from_radius(way, self._values("R")[rows] * scale, clockwise), offsets)
        centre, radius, end_radius, sweep = arcs_from_offsets(way, offsets, clockwise)
        found.centre[:, arcs] = centre
        found.radius[arcs], found.end_radius[arcs], found.sweep[arcs] = radius, end_radius, sweep

    def _way(self, found: Segments, axis: str, rows: Ints, arcs: Ints) -> Floats:
        """The way of an axis, known from the words of its row even where the position is not."""
        has, row = self._has(axis)[rows], found.row(axis)
        if row is None or not has.any():
            return np.zeros(len(rows))
        way = found.end[row, arcs] - found.start[row, arcs]
        if not self._state.absolute:
            step = self._lengths(axis)[rows]
            way = np.where(np.isnan(way), step, way)
        named: Floats = np.where(has, way, 0.0)
        return named
