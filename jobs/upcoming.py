"""Lines of a program to blocks that are ready to go: their wire text, how long they take, where they end.

Some thousand lines are worked on at once (numpy), which is what makes it cheap; what comes out are columns
(stretch.py). Not the batches; that is batch.py. The one rule: nothing behind a barrier is executed, not even in
thought, before it is asked for, because only the machine can say where it stands then.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
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
from gcode.segments import DWELL, Ints, Segments
from gcode.state import State
from gcode.words import Block, parse_block
from gcode.writer import Writer
from jobs import ways
from jobs.barriers import Barrier, barrier_of, io_words
from jobs.stretch import IoWords, Stretch, Upcoming
from jobs.toolblocks import ToolBlocks, leading, rest_of, restoring, wanted_by
from protocol.commands import Position
from protocol.errors import LocalError

STANDSTILL = "G4P0"
"""In the place of an M61 alone in its line: a block that waits until everything before it is executed."""
LINES_AT_ONCE = 2048
"""Lines of one go, about: four milliseconds beside the loop (server/machine), of which one is the same for one line."""


class PlanError(LocalError):
    """A line that cannot be sent. The check before the run reports it first; here it is the last guard."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line


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

    lines: Ints
    columns: Columns
    blocks: Blocks
    at: int = 0
    io: dict[int, IoWords] = field(default_factory=dict)


class BlockReader:
    r"""Reads one program, once. `state` is that behind everything that has been given out.

    `lines`: each with its number, or several with that of the first, each with `\n` behind it (ProgramStore.runs).
    """

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
            wanted = np.flatnonzero(piece.lines >= self._skip_to)
            first = int(wanted[0]) if len(wanted) else len(piece.lines)
            self._follow(piece, first)
            if first < len(piece.lines):
                behind, row = (piece, first - 1) if first else (before, 0 if before is None else len(before.lines) - 1)
                self._after_change(behind, row)
                return
            before = piece

    def more(self, most_lines: int) -> Stretch:
        """The next blocks, up to a barrier, of at most so many lines: there may be none.

        Raises PlanError when the very next line cannot be sent, OSError when the program cannot be read.
        """
        self.skip()
        if self._behind:
            found, self._behind = self._behind, []
            return Stretch.of(found)
        if (self._piece is None or self._piece.at >= len(self._piece.lines)) and not self._load(most_lines):
            return Stretch.of(())
        piece = self._piece
        assert piece is not None
        begin = piece.at
        end, barrier = self._stop(piece)
        if barrier is None:
            return self._given_out(piece, begin, end)
        if self._rules.tools is not None and barrier.of_tools:
            return Stretch.of((), self._change(piece, begin, barrier, self._rules.tools))
        return self._given_out_alone(piece, begin, barrier)

    # --- reading ------------------------------------------------------------------------------------------------

    def _load(self, most_lines: int) -> int:
        """The next piece; 0 at the end."""
        firsts: list[int] = []
        texts: list[bytes] = []
        counts: list[int] = []
        lines = 0
        for first, text in self._lines:
            firsts.append(first)
            texts.append(text if text.endswith(b"\n") else text + b"\n")
            counts.append(texts[-1].count(b"\n"))
            lines += counts[-1]
            if lines >= most_lines:
                break
        if not lines:
            self.ended, self._piece = True, None
            return 0
        columns = read_columns(b"".join(texts), encoding=self._rules.encoding)
        blocks = self._reading.blocks(columns)
        self._writer.open(columns)
        said = io_words(columns, blocks, self._reading.table)
        self._piece = _Piece(_numbered(firsts, counts), columns, blocks, io=said)
        return lines

    def _stop(self, piece: _Piece) -> tuple[int, Barrier | None]:
        """The end of what can be given out at once: behind a barrier, before a line that cannot be sent."""
        special = piece.blocks.special
        for row in special[np.searchsorted(special, piece.at) :].tolist():
            block = self._block(piece, row)
            if block.faults:
                if row > piece.at:
                    return row, None
                fault = block.faults[0]
                raise PlanError(int(piece.lines[row]), f"column {fault.column}: {fault.message}")
            if (barrier := barrier_of(block, self._rules.profile)) is not None:
                return (row, None) if row > piece.at else (row + 1, barrier)
        return len(piece.lines), None

    def _block(self, piece: _Piece, row: int) -> Block:
        block = piece.columns.block(row)
        if self._rules.block_delete and block.deleted:
            return Block((), True, (), block.text)
        return block

    # --- executing ----------------------------------------------------------------------------------------------

    def _execute(self, piece: _Piece, begin: int, end: int) -> tuple[Segments, list[str], Ints]:
        """The motion of these rows, `line` being their row, their wire texts, and the bytes of these."""
        piece.at = end
        if self._inches is not None and (self._inches.active or _has_inches(piece.columns)):
            return self._execute_converted(piece, begin, end)
        numbers = np.arange(len(piece.lines), dtype=np.int64)
        segments = self._reading.read(
            piece.columns, piece.blocks, begin=begin, end=end, line=numbers, follower=self._writer
        )
        return segments, *self._writer.texts(begin, end)

    def _follow(self, piece: _Piece, end: int) -> None:
        """Execute the rows before `end` without writing them."""
        piece.at = end
        if self._inches is None or not (self._inches.active or _has_inches(piece.columns)):
            self._reading.read(piece.columns, piece.blocks, end=end)
            return
        for row in range(end):
            self._reading.step(row, self._inches.convert(self._block(piece, row)))
        self._reading.take()

    def _execute_converted(self, piece: _Piece, begin: int, end: int) -> tuple[Segments, list[str], Ints]:
        """The same block by block: every length is rewritten in mm."""
        assert self._inches is not None
        written = []
        for row in range(begin, end):
            block = self._inches.convert(self._block(piece, row))
            self._reading.step(row, block)
            written.append(self._writer.text(block))
        return self._reading.take(), written, np.array([*map(len, written)], np.int64)

    def _given_out(self, piece: _Piece, begin: int, end: int) -> Stretch:
        """These rows as blocks, without those that have nothing to send."""
        segments, written, sizes = self._execute(piece, begin, end)
        count = end - begin
        if sizes.max() > self._rules.max_block_bytes:
            row = int(np.flatnonzero(sizes > self._rules.max_block_bytes)[0])
            most = f"the block has {sizes[row]} bytes, the machine takes {self._rules.max_block_bytes}"
            raise PlanError(int(piece.lines[begin + row]), most)
        rows = segments.line - begin
        seconds = np.bincount(rows, weights=plan(segments, self._rules.motion), minlength=count).astype(np.float64)
        uncertain = np.bincount(rows, weights=ways.is_uncertain(segments, piece.blocks), minlength=count) > 0
        # What is no number counts nothing.
        cost_s = np.where(uncertain, inf, np.fmax(seconds, 0.0))
        moves = np.bincount(rows, weights=segments.kind != DWELL, minlength=count) > 0
        sent = np.flatnonzero(sizes)
        return Stretch(
            lines=piece.lines[begin:end][sent],
            texts=written if len(sent) == count else [*filter(None, written)],
            sizes=sizes[sent],
            seconds=seconds[sent],
            cost_s=cost_s[sent],
            moves=moves[sent].tobytes(),
            ends=ways.places(segments, rows, sent, self.place),
            reach_mm=ways.reaches_mm(segments, rows, count)[sent],
            io={
                int(np.searchsorted(sent, row - begin)): words
                for row, words in piece.io.items()
                if begin <= row < end and written[row - begin]
            },
        )

    def _given_out_alone(self, piece: _Piece, row: int, barrier: Barrier) -> Stretch:
        """A barrier; nothing, where there is nothing of it to send."""
        found = self._given_out(piece, row, row + 1)
        if not found.texts:
            return found
        alone = found.one(0)
        alone.barrier, alone.tool = barrier, self.state.tool if barrier.tool_change else None
        self.forget()
        return Stretch.of((), alone)

    # --- tools that somebody else changes -------------------------------------------------------------------------

    def _change(self, piece: _Piece, row: int, barrier: Barrier, tools: ToolBlocks) -> Upcoming:
        """The line of an M6 or M61 as other blocks; what restores the modes comes behind it."""
        piece.at = row + 1
        block, line, before = self._block(piece, row), int(piece.lines[row]), self.state.copy()
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
        return item

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
            self._behind = self._restored(int(piece.lines[row]), self.state.copy(), "", self._rules.tools)

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


def _numbered(firsts: list[int], counts: list[int]) -> Ints:
    """Numbers of lines: of so many behind one another, each run from its first one on."""
    behind = np.cumsum(counts)
    numbers: Ints = np.arange(behind[-1]) + np.repeat(np.array(firsts) - behind + counts, counts)
    return numbers


def _place(state: State) -> tuple[float, ...]:
    return tuple([machine - offset for machine, offset in zip(state.position, state.frame, strict=True)])


def _has_inches(columns: Columns) -> bool:
    return bool(np.any((columns.letter == ord("G")) & (columns.value == 20.0)))
