"""Where the program leads: the box it needs, and where that leaves the travel of the machine. Not how fast.

The one rule: what leaves the travel is an error where the coordinates are the machine's own (homed, or the envelope
control on), and a warning where the program may stand anywhere; what is said in machine coordinates (G53, G28, G30)
is told apart.
"""

from dataclasses import dataclass

import numpy as np

from gcode.check.moves import Moves
from gcode.check.piece import MACHINE_CODES, Piece, Reporter
from gcode.findings import Level
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.segments import Bools, Floats

ENVELOPE_ON, ENVELOPE_OFF = "W72", "W73"
"""ElVinto's envelope control; there G28 and G29 switch it on too (elvinto §6)."""

TRAVEL_SLACK_MM = 1e-6
"""Sums of G91 moves have rounding errors of this order."""

MOST_PART_MM = 3000.0
"""A part of this size and more, on a machine whose travel nobody told, is likely mm read as inches."""

LEAST_PART_MM = 0.5
"""A part that is smaller than this both ways is likely inches, or metres, read as mm."""

MOST_TRAVELS = 2.0
"""A part so many times the travel is no part for another machine, but in other units."""


@dataclass(slots=True)
class _Outside:
    """Everything outside on one axis: the first line, the worst coordinate, how often."""

    line: int
    worst: float
    beyond_mm: float
    count: int = 0


class TravelRules:
    """Bounds and travel. `bounds` are in program coordinates, by lower-case axis name."""

    def __init__(self, profile: Profile, motion: Motion, reporter: Reporter, *, envelope: bool) -> None:
        self._motion = motion
        self._reporter = reporter
        self._envelope = envelope
        self._has_control = ENVELOPE_ON in profile.codes
        self._homing = tuple(code.name for code in profile.codes.values() if code.effect in ("home", "home_and_back"))
        self._outside: dict[tuple[str, Level, str], _Outside] = {}
        self.bounds: dict[str, tuple[float, float]] = {}
        self._cut_bounds: dict[str, tuple[float, float]] = {}

    def look(self, piece: Piece, moves: Moves) -> None:
        """One piece of the program."""
        known = self._known(piece, moves)
        if not len(moves):
            return
        if self._has_control and not known.all():
            first = np.flatnonzero(moves.is_way & ~known)
            if len(first):
                text = "the envelope control is off here: G28, G29 or W72 switch it on"
                self._reporter.once("warning", piece.line(int(moves.rows[first[0]])), 1, "envelope_off", text)
        self._extend(moves)
        if self._motion.travel:
            self._travel(piece, moves, known)

    def close(self) -> None:
        """At the end of the program: what left the travel, and whether the part can be meant."""
        for (axis, level, code), outside in self._outside.items():
            lowest, highest = self._motion.travel[axis]
            where = " in machine coordinates" if code == "outside_travel_machine" else ""
            travel = f"the travel of {lowest:g} to {highest:g} mm{where}"
            message = f"{axis.upper()} leaves {travel}, as far as {outside.worst:.3f}"
            self._reporter.found.add(level, outside.line, 1, code, message, subject=axis, count=outside.count)
        self._size()

    # --- bounds -------------------------------------------------------------------------------------------------

    def _extend(self, moves: Moves) -> None:
        segments = moves.segments
        ways = moves.is_way
        whole = bool(ways.all())
        cuts = moves.is_cut
        low, high = moves.reach
        for row, axis in enumerate(segments.axes.lower()):
            offset = moves.offset(row)
            lowest, highest = low[row] - offset, high[row] - offset
            _widen(self.bounds, axis, lowest if whole else lowest[ways], highest if whole else highest[ways])
            if axis in "xy":
                moving = cuts & (moves.way(row) != 0.0)
                start = moves.work_start(row)
                _widen(self._cut_bounds, axis, np.fmin(lowest, start)[moving], np.fmax(highest, start)[moving])

    def _size(self) -> None:
        """Parts of a size that cannot be meant. Only X and Y of what cuts: Z and the way there say nothing."""
        spans = {axis: high - low for axis, (low, high) in self._cut_bounds.items()}
        for axis, span in spans.items():
            lowest, highest = self._motion.travel.get(axis, (0.0, MOST_PART_MM / MOST_TRAVELS))
            if span > MOST_TRAVELS * (highest - lowest):
                text = f"the part is {span:.0f} mm long in {axis.upper()}: are the units right?"
                self._reporter.found.add("warning", 1, 0, "size_implausible", text, subject=axis)
        if spans and 0.0 < max(spans.values()) < LEAST_PART_MM:
            text = f"the part is only {max(spans.values()):.3f} mm large: are the units right?"
            self._reporter.found.add("warning", 1, 0, "size_implausible", text, subject="small")

    # --- travel -------------------------------------------------------------------------------------------------

    def _known(self, piece: Piece, moves: Moves) -> Bools:
        """For each segment, whether its coordinates are the machine's own."""
        always: Bools = np.full(len(moves), self._envelope)
        if not self._has_control:
            return always
        on = piece.rows_of(ENVELOPE_ON, *self._homing)
        off = piece.rows_of(ENVELOPE_OFF)
        if not len(on) and not len(off):
            return always
        rows = np.concatenate((on, off))
        order = np.argsort(rows, kind="stable")
        states = np.concatenate(([self._envelope], np.arange(len(rows))[order] < len(on)))
        self._envelope = bool(states[-1])
        found: Bools = states[np.searchsorted(rows[order], moves.rows, side="right")]
        return found

    def _travel(self, piece: Piece, moves: Moves, known: Bools) -> None:
        segments = moves.segments
        low, high = moves.reach
        for axis, (lowest, highest) in self._motion.travel.items():
            row = segments.row(axis.upper())
            if row is None:
                continue
            outside = (low[row] < lowest - TRAVEL_SLACK_MM) | (high[row] > highest + TRAVEL_SLACK_MM)
            outside &= moves.is_way
            if not outside.any():
                continue
            own = np.isin(moves.rows, piece.rows_of(*MACHINE_CODES))
            for code, which in (("outside_travel", outside & ~own), ("outside_travel_machine", outside & own)):
                for level, here in (("error", which & known), ("warning", which & ~known)):
                    self._note(piece, moves, axis, level, code, here)

    def _note(self, piece: Piece, moves: Moves, axis: str, level: str, code: str, here: Bools) -> None:
        places = np.flatnonzero(here)
        if not len(places):
            return
        row = moves.segments.axes.index(axis.upper())
        lowest, highest = self._motion.travel[axis]
        low, high = moves.reach[0][row, places], moves.reach[1][row, places]
        under, over = lowest - low, high - highest
        worst = int(np.argmax(np.maximum(under, over)))
        beyond = max(float(under[worst]), float(over[worst]))
        coordinate = float(low[worst] if under[worst] > over[worst] else high[worst])
        key: tuple[str, Level, str] = (axis, "error" if level == "error" else "warning", code)
        line = piece.line(int(moves.rows[places[0]]))
        outside = self._outside.setdefault(key, _Outside(line, coordinate, beyond))
        outside.count += len(places)
        if beyond > outside.beyond_mm:
            outside.worst, outside.beyond_mm = coordinate, beyond


def _widen(bounds: dict[str, tuple[float, float]], axis: str, low: Floats, high: Floats) -> None:
    if not len(low):
        return
    lowest, highest = float(np.fmin.reduce(low)), float(np.fmax.reduce(high))
    if np.isnan(lowest):
        return
    before = bounds.get(axis, (lowest, highest))
    bounds[axis] = min(before[0], lowest), max(before[1], highest)
