"""The translation of a whole program for its errors alone: stretches of plain moves at once, the rest by blocks.

Not a second translation: what a row does is worked out by gcode/runs.py, as for every other machine, and here only
whether its frames could hold it. The one rule: a stretch ends before the first row of which that is not certain; the
row goes through the translator, which says what is wrong with it, or that nothing is.
"""

from collections.abc import Iterable, Mapping
from dataclasses import fields

import numpy as np

from gcode.blocks import Blocks, Letter
from gcode.check.source import gather_numbered
from gcode.columns import Columns, read_columns
from gcode.executor import Note
from gcode.interpret import FIRST_WINDOW, SHORTEST_RUN, Reading
from gcode.ncframe.blockwriter import GAP_MM, GAP_SHARE, SMALL_GAP_MM
from gcode.ncframe.items import THREE_BYTES
from gcode.ncframe.rates import feeds_have_bytes
from gcode.ncframe.rules import FrameRules
from gcode.ncframe.source import blocks_of_lines
from gcode.ncframe.translate import Translator
from gcode.profile import Profile
from gcode.rows import Row, Rows, rows_of
from gcode.runs import MM_PER_INCH, Context, Run
from gcode.segments import CW, RAPID, Bools, Floats, Ints, Segments
from gcode.state import State

CAREFUL_ROWS = 32
"""Rows that go one by one behind a fault: a file of nothing but faults is not tried as a stretch at each of them."""

CAREFUL_LETTERS = ("S", "J")
"""Letters that a stretch does not have: S has a byte of its own, J is no word of a lathe."""


def first_error(
    lines: Iterable[tuple[int, bytes]], profile: Profile, rules: FrameRules, position: Mapping[str, float]
) -> Note | None:
    """What would stop a job of these lines first, from a machine that stands at `position`; None: nothing. What comes
    behind the end of the program is not looked at. Raises only what `lines` raises."""
    translator = Translator(profile, rules, position)
    stretches = Stretches(translator, rules, to_its_end=True)
    row = 1
    for piece in gather_numbered(blocks_of_lines(lines, rules.semicolon)):
        assert piece.numbers is not None
        columns = read_columns(piece.text, row, rules.encoding)
        row += columns.lines
        stretches.look(columns, piece.numbers)
        if piece.too_long and not translator.errors and not translator.state.ended:
            return Note(int(piece.numbers[piece.too_long[0]]), 1, "line_too_long", "no line is so long")
        if translator.errors or translator.state.ended:
            break
    translator.finish()
    return translator.errors[0] if translator.errors else None


class Stretches(Reading):
    """One program, piece by piece, through `translator`, whose `errors` are what comes of it. `to_its_end`: nothing
    behind the first error or the end of the program."""

    def __init__(self, translator: Translator, rules: FrameRules, *, to_its_end: bool = False) -> None:
        super().__init__(translator.profile, skip_deleted=rules.block_delete)
        self._interpreter = translator.interpreter
        self._translator = translator
        self._rules = rules
        self._to_its_end = to_its_end

    def look(self, columns: Columns, line: Ints) -> None:
        """The rows of a piece. `line`: the number of each."""
        blocks = self.blocks(columns)
        careful = [np.flatnonzero(blocks.letters[name].has) for name in CAREFUL_LETTERS if name in blocks.letters]
        blocks.special = np.unique(np.concatenate([blocks.special, *careful]))
        at = 0
        while at < columns.lines:
            behind = self._leap(blocks, at, columns, line)
            if behind == at:
                behind = self._careful_until(blocks, at)
                for row in range(at, behind):
                    self._translator.step(int(line[row]), columns.block(row))
                    if self._to_its_end and (self._translator.errors or self.state.ended):
                        return
            at = behind

    def _careful_until(self, blocks: Blocks, at: int) -> int:
        if not self._may_leap():
            return at + 1
        stop = max(at + 1, self._plain_until(blocks, at, blocks.count))
        return min(stop, at + CAREFUL_ROWS)

    def _may_leap(self) -> bool:
        return (self._translator.is_plain or self._translator.is_cut) and self._can_run()

    def _leap(self, blocks: Blocks, at: int, columns: Columns, line: Ints) -> int:
        """Behind a stretch that begins here; `at` where there is none."""
        if not self._may_leap():
            return at
        stop = self._plain_until(blocks, at, min(blocks.count, at + self._window))
        if stop - at < SHORTEST_RUN:
            return at
        run = Run(blocks, at, stop, self.state)
        if run.end - at < SHORTEST_RUN:
            self._window = FIRST_WINDOW
            return at
        before = self.state.copy()
        segments = run.execute(self._context(blocks))
        if self._translator.is_cut:
            if segments is not None and self._leap_along(segments, columns, line, blocks.part("F", at, run.end)):
                self._window *= 4
                return run.end
            self._window = FIRST_WINDOW
            _restore(self.state, before)
            return at
        moved = segments is not None
        good = self._good_until(segments, blocks, at, run.end)
        if good < run.end:
            self._window = FIRST_WINDOW
            _restore(self.state, before)
            if good - at < SHORTEST_RUN:
                return at
            moved = Run(blocks, at, good, self.state).execute(self._context(blocks)) is not None
        else:
            self._window *= 4
        if moved:
            self._translator.leap()
        return good

    def _leap_along(self, contour: Segments, columns: Columns, line: Ints, feeds: Letter) -> bool:
        """Whether a stretch of a compensated contour is nothing but frames; the state has gone on through it."""
        if self._odd_feeds(feeds).any():
            return False
        row = int(contour.line[-1])
        return self._translator.leap_along(list(rows_of(contour)), int(line[row]), columns.block(row), self._fit)

    def _fit(self, rows: list[Row]) -> bool:
        """Whether frames can hold these moves of the tool."""
        if not rows:
            return True
        moves = Rows(self.state.axes)
        for row in rows:
            moves.add(row)
        start = np.rint(np.array(rows[0].start, np.float64) / self._rules.resolution_mm)
        return not self._odd_moves(moves.take(), start[:, None]).any()

    def _context(self, blocks: Blocks) -> Context:
        """With rows in the place of lines."""
        return Context(np.arange(blocks.count, dtype=np.int64), 0, [tuple(self.state.frame)], False, False)

    # --- what is certain --------------------------------------------------------------------------------------------

    def _good_until(self, segments: Segments | None, blocks: Blocks, at: int, end: int) -> int:
        """The first row that a frame might not hold. The state is that behind all rows."""
        odd = [np.flatnonzero(self._odd_feeds(blocks.part("F", at, end))) + at]
        if segments is not None:
            start = np.array(self._translator.counts, np.float64)[:, None]
            odd.append(segments.line[self._odd_moves(segments, start)])
        return min([end, *(int(rows.min()) for rows in odd if len(rows))])

    def _odd_feeds(self, part: Letter) -> Bools:
        """Rows with an F that has no byte."""
        state = self.state
        feed = part.values * (MM_PER_INCH if state.inches else 1.0)
        if state.feed_mode == 95:
            feed = feed * abs(state.speed)
        odd: Bools = part.has & ~feeds_have_bytes(feed, self._rules)
        return odd

    def _odd_moves(self, segments: Segments, start: Floats) -> Bools:
        """`start`: where the first begins, counts."""
        low, high = THREE_BYTES
        counts = np.rint((segments.end + np.array(self._translator.added)[:, None]) / self._rules.resolution_mm)
        steps = np.diff(counts, axis=1, prepend=start)
        odd: Bools = ~((steps >= low) & (steps <= high)).all(axis=0)
        cuts = segments.kind != RAPID
        odd |= cuts & ~feeds_have_bytes(segments.feed, self._rules)
        if self.state.feed_mode == 95 and self._rules.speed_unit_rpm is None:
            odd |= cuts
        arcs = segments.kind >= CW
        if arcs.any():
            odd |= arcs & self._odd_arcs(segments, high)
        return odd

    def _odd_arcs(self, segments: Segments, high: int) -> Bools:
        """Arcs that do not close, that are nothing, or so large that a piece of them might not fit."""
        radius, end_radius = segments.radius, segments.end_radius
        with np.errstate(invalid="ignore"):
            gap = np.abs(radius - end_radius)
            closes = (gap <= GAP_MM) & ((gap <= SMALL_GAP_MM) | (gap <= GAP_SHARE * radius))
            fits = 2 * np.maximum(radius, end_radius) / self._rules.resolution_mm + 2 < high
            sound: Bools = (segments.plane == 18) & (radius > 0) & closes & fits & np.isfinite(segments.sweep)
        return ~sound


def _restore(state: State, before: State) -> None:
    """In place, for others hold the same state."""
    for one in fields(State):
        setattr(state, one.name, getattr(before, one.name))
