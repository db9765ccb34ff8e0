"""Segments as blocks of the planner: length, acceleration, nominal speed, and how fast each may be entered.

Facts of Grbl's planner (gcode.md §5). Not the look-ahead over the blocks, that is lookahead.py. The one rule: what the
controller would drop as no way at all is no block, and what empties its queue lets the next block begin at rest.
"""

from dataclasses import dataclass, fields, replace
from math import inf, isfinite, nan

import numpy as np
from numpy.typing import NDArray

from gcode.chords import Cut, Ways, chord_counts, straight_ways
from gcode.longarcs import Limits, chord_lengths, edges
from gcode.motion import ASSUMED_FEED_MM_MIN, DEFAULT_ACCELERATION_MM_S2, DEFAULT_RATE_MM_MIN, Motion
from gcode.segments import DWELL, HOMING, PROBE, RAPID, Floats, Ints, Segments

LOWEST_SPEED_MM_S = 1.0 / 60.0
"""Grbl's MINIMUM_FEED_RATE, 1 mm/min: no block is planned slower, whatever F and overrides say."""

STRAIGHT = 0.999999
"""Cosine of a corner above which it is a straight line, and below whose negative it is a reversal (planner.c)."""

NO_WAY_MM = 1e-9
"""Shorter than this is rounding of coordinates, where no steps tell."""

LONGEST_STEP_S = 8 * 65535 / 16e6
"""A step never takes longer: Grbl's 16-bit timer at 16 MHz, slowed eightfold at most. Slower feeds run faster."""


STOP_S = 0.027
"""What a stop costs besides braking: at the end of motion Grbl holds the motors still for $1 (25 ms unless set) before
it goes on (stepper.c, st_go_idle), and reads and plans the next line, 1 to 2 ms. Not at the program's end."""

MOST = 1e9
"""No figure of a machine is beyond it; cut off here, so that products of them stay numbers."""


@dataclass(slots=True)
class Blocks:
    """Columns: `row` of the segment; `length` mm; `acceleration` mm/s²; `nominal` mm/s; `limit2` v² of entry at most.

    `longest_s`: a block is not slower than this, infinite where steps are not known. `pause_s`: what the stop before
    it costs, 0 where there is none. `weight`: how many of the controller's blocks it stands for (longarcs.py).
    """

    row: Ints
    length: Floats
    acceleration: Floats
    nominal: Floats
    limit2: Floats
    longest_s: Floats
    pause_s: Floats
    weight: Floats

    def __len__(self) -> int:
        return len(self.row)

    def since(self, first: int, row_shift: int) -> "Blocks":
        """The blocks from `first` on, their rows counted from a place `row_shift` further on."""
        cut = [getattr(self, field.name)[first:] for field in fields(self)]
        return Blocks(cut[0] - row_shift, *cut[1:])

    def then(self, others: "Blocks") -> "Blocks":
        """These and the others behind them."""
        return Blocks(
            *(np.concatenate((getattr(self, field.name), getattr(others, field.name))) for field in fields(self))
        )


def no_blocks() -> Blocks:
    """The empty queue."""
    return Blocks(np.zeros(0, np.int64), *(np.zeros(0) for _ in range(7)))


class BlockMaker:
    """Makes blocks of segments, piece by piece: remembers the direction and speed of the last block.

    `at_rest`: nothing is in the queue, or what has come since the last block lets it run dry.
    """

    def __init__(self, motion: Motion, axes: str, *, feed_override: float = 1.0, rapid_override: float = 1.0) -> None:
        names = [axis.lower() for axis in axes]
        self._motion = motion
        self._rates = [_positive(motion.rate_mm_min(axis), DEFAULT_RATE_MM_MIN) / 60 for axis in names]
        self._accelerations = [_positive(motion.acceleration_mm_s2(axis), DEFAULT_ACCELERATION_MM_S2) for axis in names]
        given = {row: motion.steps_per_mm.get(axis, 0.0) for row, axis in enumerate(names)}
        self._steps = {row: steps for row, steps in given.items() if isfinite(steps) and 0 < steps <= MOST}
        self._deviation = _positive(motion.junction_deviation_mm, 0.0)
        self._tolerance = _positive(motion.arc_tolerance_mm, 1e-6)
        self._feed_override = _positive(feed_override, 1.0)
        self._rapid_override = _positive(rapid_override, 1.0)
        self._limits = Limits(
            np.array(self._accelerations),
            np.array(self._rates),
            np.array([1.0 / self._steps[row] if row in self._steps else 0.0 for row in range(len(names))]),
            self._deviation,
            max(motion.planner_blocks - 2, 0),
        )
        self._unit = np.zeros(len(axes))
        self._nominal = 0.0
        self._has_moved = False
        self._seen = np.full(len(axes), nan)
        self.at_rest = True

    def cut(self, segments: Segments) -> Cut:
        """How each segment is cut into lines."""
        chords = chord_counts(segments, self._tolerance)
        edge = np.zeros(len(chords), np.int64)
        if (chords > 1).any():
            edge = edges(segments, chords, self._wanted(segments), self._limits)
        return Cut(chords, edge)

    def make(self, segments: Segments, cut: Cut) -> Blocks:
        """The blocks of these segments; `cut` is what `cut()` said of them."""
        ways = straight_ways(self._somewhere(segments), cut, self._steps)
        delta, row = ways.delta, ways.row
        length, weight, steady = self._lengths(segments, cut, ways)
        moves = length > NO_WAY_MM
        rests = self._rests(segments, row, ways.first, moves)
        longest_s = self._longest(delta)
        if not moves.all():
            delta, row, length = delta[:, moves], row[moves], length[moves]
            weight, steady, longest_s = weight[moves], steady[moves], longest_s[moves]
        if not len(row):
            return no_blocks()
        unit = delta / length
        acceleration, rapid = _by_axis(unit, self._accelerations), _by_axis(unit, self._rates)
        nominal = self._nominal_speeds(segments, row, rapid)
        limit2 = self._entry_limits(unit, nominal, steady)
        pause = np.zeros(len(row))
        if rests is not None:
            limit2[rests] = 0.0
            pause[rests] = STOP_S
        if not self._has_moved:
            pause[0] = 0.0
            self._has_moved = True
        longest_s[steady] = inf
        return Blocks(row, length, acceleration, nominal, limit2, longest_s, pause, weight)

    def _lengths(self, segments: Segments, cut: Cut, ways: Ways) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Length, weight, and which lines stand for many chords at a steady speed."""
        length = np.sqrt(np.einsum("ij,ij->j", ways.delta, ways.delta))
        weight, steady = np.ones(len(length)), np.zeros(len(length), np.bool_)
        if len(ways.whole):
            arcs = ways.row[ways.whole]
            weight[ways.whole] = cut.chords[arcs] - 2 * cut.edge[arcs]
            length[ways.whole] = weight[ways.whole] * chord_lengths(segments, cut.chords, arcs)
            steady[ways.whole] = True
        return length, weight, steady

    def _somewhere(self, segments: Segments) -> Segments:
        """Straight ways from where nobody knows reckoned from the place last known, at first the program's zero.

        An estimate has to begin somewhere, and a machine that has just been switched on stands there.
        """
        known_end = ~np.isnan(segments.end)
        unknown = np.isnan(segments.start) & known_end & ~segments.is_arc
        if not len(segments):
            return segments
        if not unknown.any() and (known_end[:, -1] | ~known_end.any(axis=1)).all():
            # The usual piece: an axis is known at its end, or, not being used, nowhere in it.
            self._seen = np.where(known_end[:, -1], segments.end[:, -1], self._seen)
            return segments
        ends = np.concatenate((self._seen[:, None], segments.end), axis=1)
        last = np.maximum.accumulate(np.where(np.isnan(ends), 0, np.arange(ends.shape[1])), axis=1)
        seen = np.take_along_axis(ends, last, axis=1)
        self._seen = seen[:, -1]
        zero = np.array(segments.frames, np.float64).reshape(-1, len(segments.axes))[segments.frame].T
        somewhere = np.where(np.isnan(seen[:, :-1]), zero, seen[:, :-1])
        return replace(segments, start=np.where(unknown, somewhere, segments.start))

    def _rests(
        self, segments: Segments, row: Ints, first: NDArray[np.bool_], moves: NDArray[np.bool_]
    ) -> NDArray[np.bool_] | None:
        """Which of the moving lines begin at rest, None where none does; `at_rest` for what comes after."""
        kind = segments.kind
        alone = (kind == DWELL) | (kind == HOMING) | (kind == PROBE)
        dry = segments.sync | alone
        if len(dry):
            dry[0] |= self.at_rest
            dry[1:] |= alone[:-1]
        events = dry[row] & first
        if self._motion.laser:
            # A way of no length with the beam at constant power waits for the queue (motion_control.c, spindle_sync).
            events |= ~moves & (segments.spindle > 0)[row]
        after = bool(len(alone) and alone[-1])
        if not events.any():
            self.at_rest = after
            return None
        number = np.cumsum(events)
        at_moves = number[moves]
        rests = np.diff(at_moves, prepend=0) > 0
        self.at_rest = after or bool(number[-1] > (at_moves[-1] if len(at_moves) else 0))
        return rests

    def _wanted(self, segments: Segments) -> Floats:
        """The speed that each segment asks for, mm/s, whatever the axes can."""
        kind = segments.kind
        feed = np.where(np.isnan(segments.feed), ASSUMED_FEED_MM_MIN, segments.feed) / 60
        # Neither homing nor a probe obeys the overrides.
        wanted = np.where(kind == PROBE, feed, feed * self._feed_override)
        wanted[(kind == RAPID) | (kind == HOMING)] = inf
        return np.maximum(wanted, LOWEST_SPEED_MM_S, out=wanted)

    def _nominal_speeds(self, segments: Segments, row: Ints, rapid: Floats) -> Floats:
        nominal = np.minimum(self._wanted(segments)[row], rapid)
        if self._rapid_override != 1.0:
            nominal[(segments.kind == RAPID)[row]] *= self._rapid_override
        return np.maximum(nominal, LOWEST_SPEED_MM_S, out=nominal)

    def _entry_limits(self, unit: Floats, nominal: Floats, steady: NDArray[np.bool_]) -> Floats:
        """v² at most between each block and the one before: by the corner, and by the slower of the two."""
        before = np.concatenate((self._unit[:, None], unit[:, :-1]), axis=1)
        slower = np.minimum(nominal, np.concatenate(([self._nominal], nominal[:-1])))
        self._unit, self._nominal = unit[:, -1].copy(), float(nominal[-1])
        cosine = np.einsum("ij,ij->j", before, unit)
        half_sine = np.sqrt(np.maximum(0.5 * (1.0 + cosine), 0.0))
        turn = unit - before
        turn_length = np.sqrt(np.einsum("ij,ij->j", turn, turn))
        acceleration = _by_axis(turn / turn_length, self._accelerations)
        corner2 = acceleration * self._deviation * half_sine / (1.0 - half_sine)
        corner2 = np.where(cosine > STRAIGHT, inf, np.where(cosine < -STRAIGHT, 0.0, corner2))
        if steady.any():
            # No corner within a long arc is slower than its feed: that is why it was drawn together.
            corner2[steady] = inf
            corner2[np.flatnonzero(steady) + 1] = inf
        limit2: Floats = np.minimum(corner2, slower * slower)
        return limit2

    def _longest(self, delta: Floats) -> Floats:
        if not self._steps:
            return np.full(delta.shape[1], inf)
        steps = np.zeros(delta.shape[1])
        for axis_row, steps_per_mm in self._steps.items():
            np.maximum(steps, np.abs(delta[axis_row]) * steps_per_mm, out=steps)
        return np.where(steps > 0, steps * LONGEST_STEP_S, inf)


def _by_axis(unit: Floats, most: list[float]) -> Floats:
    """The most along each unit vector that exceeds `most` on no axis: min of most/|u|."""
    share = np.abs(unit[0]) / most[0]
    for axis_row in range(1, len(most)):
        np.maximum(share, np.abs(unit[axis_row]) / most[axis_row], out=share)
    most_along: Floats = 1.0 / share
    return most_along


def _positive(value: float, otherwise: float) -> float:
    return min(value, MOST) if isfinite(value) and value > 0 else otherwise
