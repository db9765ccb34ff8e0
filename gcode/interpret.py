"""A program, piece by piece, to motion: runs of plain rows all at once, everything else block by block.

The public face of interpreting. The one rule: whether a row goes the fast way or the careful one never changes what
comes out.
"""

from collections.abc import Iterable, Iterator
from typing import Protocol

import numpy as np

from gcode.blocks import Blocks, CodeTable, blocks_of
from gcode.columns import Columns, read_columns
from gcode.executor import Note
from gcode.interpreter import NO_COMPENSATION, Interpreter
from gcode.profile import Profile
from gcode.rows import rows_of
from gcode.runs import Context, Run
from gcode.segments import Ints, Segments, joined
from gcode.state import State
from gcode.words import Block, Word

SHORTEST_RUN = 12
"""Rows below which the fast way is the slower one."""

FIRST_WINDOW = 512
"""Rows that are tried at first; where runs are short, looking far ahead again and again would cost."""


class Follower(Protocol):
    """Goes through the rows in the same steps: what it says of a row may hang on those before."""

    def run(self, columns: Columns, blocks: Blocks, begin: int, end: int) -> None:
        """These rows were plain, and their modal codes changed nothing."""

    def block(self, row: int, block: Block) -> None:
        """This row was interpreted by itself."""


class Reading:
    """Follows one program. `state` is that behind everything that has been read."""

    def __init__(
        self, profile: Profile, state: State | None = None, *, laser: bool = False, skip_deleted: bool = False
    ) -> None:
        self._profile = profile
        self._laser = laser
        self._skip_deleted = skip_deleted
        self._interpreter = Interpreter(profile, state, laser=laser)
        self._speed_syncs = "S" in profile.sync_letters
        self._window = FIRST_WINDOW
        self._tried: dict[tuple[object, ...], bool] = {}
        self.table = CodeTable(profile)

    @property
    def state(self) -> State:
        """The state behind everything that has been read."""
        return self._interpreter.state

    @property
    def notes(self) -> list[Note]:
        """What was found wrong with blocks, so far."""
        return self._interpreter.notes

    def blocks(self, columns: Columns) -> Blocks:
        """The words of a piece by row."""
        return blocks_of(columns, self.table, skip_deleted=self._skip_deleted)

    def step(self, line: int, block: Block) -> None:
        """One block by itself; its motion comes with the next `read` or `take`."""
        self._interpreter.step(line, block)

    def take(self) -> Segments:
        """The motion of the blocks that went by themselves."""
        return self._interpreter.take()

    def finish(self) -> Segments:
        """The program is over: what compensation has held back."""
        self._interpreter.finish()
        return self._interpreter.take()

    def read(
        self,
        columns: Columns,
        blocks: Blocks | None = None,
        *,
        begin: int = 0,
        end: int | None = None,
        line: Ints | None = None,
        follower: Follower | None = None,
    ) -> Segments:
        """The motion of the rows [begin, end), in order. `line`: the number of each row, if not those of the file."""
        blocks = self.blocks(columns) if blocks is None else blocks
        end = columns.lines if end is None else end
        if line is None:
            line = np.arange(columns.first_line, columns.first_line + columns.lines, dtype=np.int64)
        parts: list[Segments] = []
        at = begin
        while at < end:
            stop = self._plain_until(blocks, at, end)
            careful_end = max(stop, at + 1)
            if stop - at >= SHORTEST_RUN and self._can_run():
                run = Run(blocks, at, min(stop, at + self._window), self.state)
                if run.end - at >= SHORTEST_RUN:
                    self._window = self._window * 4 if run.whole else FIRST_WINDOW
                    self._execute(run, line, parts)
                    if follower is not None:
                        follower.run(columns, blocks, at, run.end)
                    at = run.end
                    continue
                self._window = FIRST_WINDOW
                careful_end = run.end + 1
            for row in range(at, careful_end):
                self._single(columns, row, int(line[row]), follower)
            at = careful_end
        parts.append(self._interpreter.take())
        return joined([part for part in parts if len(part)] or parts[-1:])

    def _single(self, columns: Columns, row: int, line: int, follower: Follower | None) -> None:
        block = columns.block(row)
        if self._skip_deleted and block.deleted:
            block = Block((), True, (), block.text)
        if block.words:
            self._interpreter.step(line, block)
        if follower is not None:
            follower.block(row, block)

    def _execute(self, run: Run, line: Ints, parts: list[Segments]) -> None:
        rows = self._interpreter.rows
        if len(rows):
            parts.append(self._interpreter.take())
        found = run.execute(Context(line, rows.frame_of(self.state.frame), rows.frames, self._speed_syncs, self._laser))
        if found is not None and self._interpreter.executor.cutting:
            self._interpreter.executor.guide(rows_of(found))
        elif found is not None:
            parts.append(found)

    def _can_run(self) -> bool:
        state = self.state
        if self._interpreter.compensating or state.compensation != NO_COMPENSATION:
            return state.absolute is not None and self._interpreter.executor.cutting
        return state.absolute is not None

    # --- modal codes that change nothing --------------------------------------------------------------------------

    def _plain_until(self, blocks: Blocks, begin: int, end: int) -> int:
        """The first row that is not plain, or whose modal codes change something."""
        end = _next(blocks.special, begin, end)
        for number, rows in blocks.settings.items():
            following = _next(rows, begin, end)
            if following < end and not self._changes_nothing(number):
                end = following
        return end

    def _changes_nothing(self, number: int) -> bool:
        """Whether this code alone leaves the state as it is: tried on a copy, once for each state of the modes."""
        state = self.state
        key = (number, state.modes())
        found = self._tried.get(key)
        if found is None:
            name = self.table.codes[number].name
            block = Block((Word(name[0], float(name[1:]), name[1:], 1),), False, (), name)
            trial = Interpreter(self._profile, state.copy(), laser=self._laser)
            trial.step(0, block)
            found = trial.state == state and not trial.notes and not len(trial.rows)
            self._tried[key] = found
        return found


def segments_of(
    pieces: Iterable[bytes], profile: Profile, state: State | None = None, *, encoding: str = "utf-8"
) -> Iterator[Segments]:
    """The motion of a whole program, from pieces of whole lines (gcode.lines.pieces)."""
    reading = Reading(profile, state)
    first_line = 1
    for piece in pieces:
        columns = read_columns(piece, first_line, encoding)
        first_line += columns.lines
        yield reading.read(columns)
    yield reading.finish()


def _next(rows: Ints, begin: int, end: int) -> int:
    """The first of `rows`, ascending, from `begin` on; `end` when there is none before."""
    at = int(np.searchsorted(rows, begin))
    return min(end, int(rows[at])) if at < len(rows) else end
