"""Lines of a program to blocks that are ready to go: their wire text, how long they take, where they end.

Some hundred lines are worked on at once (numpy), which is what makes it cheap; what comes out is one block after the
other. Not the batches; that is batch.py. The one rule: nothing behind a barrier is executed, not even in thought,
before it is asked for, because only the machine can say where it stands then.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice
from math import inf

import numpy as np

from gcode.blocks import Blocks
from gcode.clean import clean
from gcode.columns import Columns, read_columns
from gcode.inches import InchConverter
from gcode.interpret import Reading
from gcode.motion import Motion
from gcode.planner import plan
from gcode.profile import Profile
from gcode.segments import DWELL, Segments
from gcode.state import State
from gcode.words import Block, parse_block
from gcode.writer import Writer
from jobs import ways
from jobs.barriers import Barrier, barrier_of, io_words
from jobs.toolblocks import ToolBlocks, leading, rest_of, restoring, wanted_by
from protocol.commands import Position
from protocol.errors import LocalError

STANDSTILL = "G4P0"
"""In the place of an M61 alone in its line: a block that waits until everything before it is executed."""
LINES_AT_ONCE = 1536
"""Lines of one go: ten milliseconds beside the loop (server/machine), of which three are the same for one line."""


class PlanError(LocalError):
    """A line that cannot be sent. The check before the run reports it first; here it is the last guard."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line


@dataclass(slots=True)  # not frozen: that doubles the time of making one, and there is one a block
class Upcoming:
    """A block. `cost_s` counts against the bound of a batch: without end where the length is not known.

    `end`: where the machine stands behind it, program coordinates in the order of the state's axes, NaN unknown.
    `part`, `io`, `reach_mm`: as in jobs.batch.PlannedBatch. `behind`: further blocks of the same line that go with it.
    """

    line: int
    text: str
    seconds: float
    cost_s: float
    moves: bool
    end: tuple[float, ...]
    reach_mm: float = 0.0
    barrier: Barrier | None = None
    tool: int | None = None
    part: int = 0
    io: tuple[tuple[str, int], ...] = ()
    behind: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Rules:
    """How a program is read and written. `max_block_bytes`: what one block may have at most. `tools`: what is sent in
    the place of M6 and M61; None: the codes themselves."""

    profile: Profile
    motion: Motion
    max_block_bytes: int
    compact: bool = True
    block_delete: bool = False
    convert_inches: bool = False
    encoding: str = "utf-8"
    tools: ToolBlocks | None = None


@dataclass(slots=True)
class _Piece:
    """Lines that have been read together; those before `at` are done with. `lines`: their numbers. `io`: what each row
    says to a tool changer, of the few that do."""

    lines: list[int]
    columns: Columns
    blocks: Blocks
    at: int = 0
    io: dict[int, tuple[tuple[str, int], ...]] = field(default_factory=dict)


class BlockReader:
    """Reads one program, once. `state` is that behind everything that has been given out."""

    def __init__(self, lines: Iterable[tuple[int, bytes]], rules: Rules, state: State, *, skip_to: int = 1) -> None:
        self._lines = iter(lines)
        self._rules = rules
        self._reading = Reading(rules.profile, state, laser=rules.motion.laser, skip_deleted=rules.block_delete)
        self._writer = Writer(rules.profile, self._reading.table, compact=rules.compact)
        self._inches = InchConverter() if rules.convert_inches else None
        self._skip_to = skip_to
        self._piece: _Piece | None = None
        self._behind: list[Upcoming] = []
        self._opened = False
        self.ended = False

    @property
    def state(self) -> State:
        """Where the machine stands and what it has been told, behind everything that has been given out."""
        return self._reading.state

    @property
    def in_inches(self) -> bool:
        """The program is in G20 here and being converted."""
        return self._inches is not None and self._inches.active

    @property
    def place(self) -> tuple[float, ...]:
        """Program coordinates of the state, in the order of its axes."""
        return _place(self.state)

    def relocate(self, position: Position) -> None:
        """The machine's own account of its program coordinates."""
        self.state.locate(dict(position))
        self.forget()

    def forget(self) -> None:
        """Somebody else may have been at the machine."""
        self._writer.forget()

    def skip(self) -> None:
        """Follow the lines before `skip_to` without giving them out; the lines from there on are open then."""
        if self._opened:
            return
        self._opened = True
        before: _Piece | None = None
        while self._load(LINES_AT_ONCE):
            piece = self._piece
            assert piece is not None
            first = next((row for row, line in enumerate(piece.lines) if line >= self._skip_to), None)
            self._follow(piece, len(piece.lines) if first is None else first)
            if first is not None:
                behind, row = (piece, first - 1) if first else (before, 0 if before is None else len(before.lines) - 1)
                self._after_change(behind, row)
                return
            before = piece

    def more(self, most_lines: int) -> tuple[list[Upcoming], int]:
        """The next blocks, up to a barrier, and how many lines that took: none at the end of the program.

        Raises PlanError when the very next line cannot be sent, OSError when the program cannot be read.
        """
        self.skip()
        if self._behind:
            found, self._behind = self._behind, []
            return found, 0
        loaded = 0
        if self._piece is None or self._piece.at >= len(self._piece.lines):
            loaded = self._load(min(most_lines, LINES_AT_ONCE))
            if not loaded:
                return [], 0
        piece = self._piece
        assert piece is not None
        begin = piece.at
        end, barrier = self._stop(piece)
        if barrier is not None and self._rules.tools is not None and barrier.of_tools:
            return self._change(piece, begin, barrier, self._rules.tools), max(loaded, 1)
        segments, written = self._execute(piece, begin, end)
        found = self._given_out(piece, begin, end, segments, written)
        if barrier is not None and found and found[-1].line == piece.lines[end - 1]:
            found[-1].barrier = barrier
            found[-1].tool = self.state.tool if barrier.tool_change else None
            self.forget()
        return found, max(loaded, end - begin)

    # --- reading ------------------------------------------------------------------------------------------------

    def _load(self, most_lines: int) -> int:
        """The next piece; 0 at the end."""
        taken = list(islice(self._lines, most_lines))
        if not taken:
            self.ended, self._piece = True, None
            return 0
        columns = read_columns(b"\n".join(raw for _, raw in taken) + b"\n", encoding=self._rules.encoding)
        blocks = self._reading.blocks(columns)
        self._writer.open(columns)
        said = io_words(columns, blocks, self._reading.table)
        self._piece = _Piece([line for line, _ in taken], columns, blocks, io=said)
        return len(taken)

    def _stop(self, piece: _Piece) -> tuple[int, Barrier | None]:
        """The end of what can be given out at once: behind a barrier, before a line that cannot be sent."""
        special = piece.blocks.special
        for row in special[np.searchsorted(special, piece.at) :].tolist():
            block = self._block(piece, row)
            if block.faults:
                if row > piece.at:
                    return row, None
                fault = block.faults[0]
                raise PlanError(piece.lines[row], f"column {fault.column}: {fault.message}")
            if (barrier := barrier_of(block, self._rules.profile)) is not None:
                return (row, None) if row > piece.at else (row + 1, barrier)
        return len(piece.lines), None

    def _block(self, piece: _Piece, row: int) -> Block:
        block = piece.columns.block(row)
        if self._rules.block_delete and block.deleted:
            return Block((), True, (), block.text)
        return block

    # --- executing ----------------------------------------------------------------------------------------------

    def _execute(self, piece: _Piece, begin: int, end: int) -> tuple[Segments, list[str]]:
        """The motion of these rows, `line` being their row, and their wire texts."""
        piece.at = end
        if self._inches is not None and (self._inches.active or _has_inches(piece.columns)):
            return self._execute_converted(piece, begin, end)
        numbers = np.arange(len(piece.lines), dtype=np.int64)
        segments = self._reading.read(
            piece.columns, piece.blocks, begin=begin, end=end, line=numbers, follower=self._writer
        )
        return segments, self._writer.texts(begin, end)

    def _follow(self, piece: _Piece, end: int) -> None:
        """Execute the rows before `end` without writing them."""
        piece.at = end
        if self._inches is None or not (self._inches.active or _has_inches(piece.columns)):
            self._reading.read(piece.columns, piece.blocks, end=end)
            return
        for row in range(end):
            self._reading.step(row, self._inches.convert(self._block(piece, row)))
        self._reading.take()

    def _execute_converted(self, piece: _Piece, begin: int, end: int) -> tuple[Segments, list[str]]:
        """The same block by block: every length is rewritten in mm."""
        assert self._inches is not None
        written = []
        for row in range(begin, end):
            block = self._inches.convert(self._block(piece, row))
            self._reading.step(row, block)
            written.append(self._writer.text(block))
        return self._reading.take(), written

    def _given_out(self, piece: _Piece, begin: int, end: int, segments: Segments, written: list[str]) -> list[Upcoming]:
        count = end - begin
        rows = segments.line - begin
        each_s = plan(segments, self._rules.motion)
        seconds = np.bincount(rows, weights=each_s, minlength=count)
        uncertain = np.bincount(rows, weights=ways.is_uncertain(segments, piece.blocks), minlength=count) > 0
        cost_s = np.where(uncertain, inf, seconds).tolist()
        moves = (np.bincount(rows, weights=segments.kind != DWELL, minlength=count) > 0).tolist()
        places = ways.places(segments, begin, count, self.place)
        reaches_mm = ways.reaches_mm(segments, rows, count)
        if max(map(len, written), default=0) > self._rules.max_block_bytes:
            self._refuse_too_long(piece.lines[begin:end], written)
        found = [
            Upcoming(line, text, seconds_of, cost_of, moves_axes, place, reach_mm)
            for line, text, seconds_of, cost_of, moves_axes, place, reach_mm in zip(
                piece.lines[begin:end], written, seconds.tolist(), cost_s, moves, places, reaches_mm, strict=True
            )
            if text
        ]
        if piece.io:
            said = {piece.lines[row]: words for row, words in piece.io.items() if begin <= row < end}
            for item in found:
                item.io = said.get(item.line, ())
        return found

    # --- tools that somebody else changes -------------------------------------------------------------------------

    def _change(self, piece: _Piece, row: int, barrier: Barrier, tools: ToolBlocks) -> list[Upcoming]:
        """The line of an M6 or M61 as other blocks; what restores the modes comes behind it."""
        piece.at = row + 1
        block, line, before = self._block(piece, row), piece.lines[row], self.state.copy()
        self.forget()
        if barrier.set_tool is not None:
            texts = [clean(block)] if tools.knows_m61 else [rest_of(block) or STANDSTILL]
            (item, *more) = self._stepped(line, texts)
            self.state.tool = barrier.set_tool
        else:
            (item, *more) = self._stepped(line, leading(tools, before))
            self.state.tool = self.state.selected = wanted_by(block, before)
            item.tool, item.io = self.state.tool, (("M", 9),) if before.mist or before.flood else ()
            self._behind = self._restored(line, before, rest_of(block), tools)
        item.barrier, item.behind = barrier, tuple([other.text for other in more])
        item.seconds += sum([other.seconds for other in more])
        item.moves |= any(other.moves for other in more)
        item.end = more[-1].end if more else item.end
        return [item]

    def _restored(self, line: int, modes: State, rest: str, tools: ToolBlocks) -> list[Upcoming]:
        """What makes the modes those of the program again, and what else stood in the line."""
        found = self._stepped(line, [*restoring(tools, modes, self._rules.profile), *([rest] if rest else [])])
        if found:
            found[0].io = tuple([("M", code) for code, on in ((7, modes.mist), (8, modes.flood)) if on])
        return found

    def _after_change(self, piece: _Piece | None, row: int) -> None:
        """The line before the first is an M6 that is done: its modes may not be restored yet."""
        if piece is None or self._rules.tools is None or row < 0:
            return
        block = self._block(piece, row)
        barrier = barrier_of(block, self._rules.profile)
        if barrier is not None and barrier.tool_change:
            self._behind = self._restored(piece.lines[row], self.state.copy(), "", self._rules.tools)

    def _stepped(self, line: int, texts: list[str]) -> list[Upcoming]:
        """Blocks that no line of the program has, followed as all others."""
        found = []
        for text in texts:
            if len(text) > self._rules.max_block_bytes:
                raise PlanError(line, f"{text!r} is longer than the {self._rules.max_block_bytes} bytes of a block")
            self._reading.step(0, parse_block(text))
            segments = self._reading.take()
            seconds = float(plan(segments, self._rules.motion).sum())
            moves = bool((segments.kind != DWELL).any())
            unknown = bool((np.isnan(segments.start) ^ np.isnan(segments.end)).any())
            found.append(Upcoming(line, text, seconds, inf if unknown else seconds, moves, _place(self.state)))
        return found

    def _refuse_too_long(self, lines: list[int], written: list[str]) -> None:
        most_bytes = self._rules.max_block_bytes
        line, text = next((line, text) for line, text in zip(lines, written, strict=True) if len(text) > most_bytes)
        raise PlanError(line, f"the block has {len(text)} bytes, the machine takes {most_bytes}")


def _place(state: State) -> tuple[float, ...]:
    return tuple([machine - offset for machine, offset in zip(state.position, state.frame, strict=True)])


def _has_inches(columns: Columns) -> bool:
    return bool(np.any((columns.letter == ord("G")) & (columns.value == 20.0)))
