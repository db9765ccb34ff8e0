"""Lines of a program to batches: what goes out as one command (elvinto §7). Not the journal, not the wire.

The one rule: every block is in exactly one batch, in order. A batch obeys all bounds, a barrier travels alone, and
where there is a choice a batch ends where it can be told, after a crash, from the places where it and the batch
before it began (elvinto §5.4).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isnan
from typing import Protocol, Self

from gcode.held import Held, state_of
from gcode.interpreter import power_on
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.state import State
from jobs.stretch import Ahead, Stretch, Upcoming
from jobs.toolblocks import ToolBlocks
from jobs.upcoming import LINES_AT_ONCE, BlockReader, PlanError, Rules
from protocol.commands import Position
from protocol.errors import LocalError

Place = tuple[float, ...]
"""Program coordinates in the order of the state's axes, NaN where one is not known."""


@dataclass(frozen=True, slots=True)
class BatchLimits:
    """`max_batch_bytes` bounds the joined text `a|b|c`. The seconds are the latency of a pause (elvinto §7).

    `position_tolerance_mm` is how well the machine's own account of its position can be compared (elvinto §5.4); None:
    it is no evidence, and a batch may end anywhere. `max_block_bytes`: of one block; None: only those of the batch.
    """

    max_batch_bytes: int = 512
    max_batch_blocks: int = 32
    max_batch_seconds: float = 1.0
    position_tolerance_mm: float | None = 0.01
    max_block_bytes: int | None = None

    @property
    def longest_block_bytes(self) -> int:
        """What one block may have at most."""
        return min(self.max_batch_bytes, self.max_block_bytes or self.max_batch_bytes)


@dataclass(slots=True)  # not frozen, as nobody changes one: the making would take four times as long
class PlannedBatch:
    """Consecutive blocks that go out as one command; lines are those of the file, from 1, both inclusive.

    `seconds` is estimated. `start` and `end` hold the known axes. `barrier`: one block that travels alone.
    `tool_change`: its block has M6; `tool` is then the tool that is wanted, None where the program named none.
    `motion`: at least one block moves an axis. `lines`: that of each block; empty where they follow one another.
    `reach_mm`: as in protocol.commands.SendBatch.
    `parts`: of a line that becomes several blocks, for each block behind which it goes on, how far it is
    (jobs/frames.py), and 0 where the line ends; empty where every line is one block. `pauses`: behind it the job stands
    still until somebody resumes it. `io`: words for the tool changer in their order, as ("T", 3), ("M", 8). `set_tool`:
    the block stands for an M61 with this tool.
    """

    first_line: int
    last_line: int
    blocks: tuple[str, ...]
    seconds: float
    start: Position
    end: Position
    barrier: bool
    locate_after: bool
    ends_program: bool
    tool: int | None
    motion: bool
    tool_change: bool = False
    lines: tuple[int, ...] = ()
    parts: tuple[int, ...] = ()
    pauses: bool = False
    io: tuple[tuple[str, int], ...] = ()
    set_tool: int | None = None
    reach_mm: tuple[float, ...] = ()

    def line_of(self, block: int) -> int:
        """The line of a block, which is counted from 0."""
        return self.lines[block] if self.lines else self.first_line + block

    def line_behind(self, block: int) -> int:
        """The last line that is executed to its end when this block is."""
        return self.line_of(block) - bool(self.parts and self.parts[block])

    @property
    def part(self) -> int:
        """How far its last line is behind it, 0 where it ends there."""
        return self.parts[-1] if self.parts else 0

    def cut(self, blocks: int, position: Position) -> tuple["PlannedBatch", "PlannedBatch"]:
        """Its first `blocks` blocks, behind which the machine stands at `position`, and the rest."""
        each = [self.line_of(block) for block in range(len(self.blocks))]
        share = blocks / len(self.blocks)
        first = replace(
            self,
            last_line=each[blocks - 1],
            blocks=self.blocks[:blocks],
            seconds=self.seconds * share,
            end=position,
            lines=tuple(each[:blocks]),
            parts=self.parts[:blocks],
            reach_mm=self.reach_mm[:blocks],
        )
        rest = replace(
            self,
            first_line=each[blocks],
            blocks=self.blocks[blocks:],
            seconds=self.seconds * (1 - share),
            start=position,
            lines=tuple(each[blocks:]),
            parts=self.parts[blocks:],
            reach_mm=self.reach_mm[blocks:],
        )
        return first, rest


class Reader(Protocol):
    """Where blocks come from: jobs.upcoming.BlockReader, or jobs.frames.FrameBlocks."""

    @property
    def state(self) -> State:
        """Where the machine stands and what it has been told, behind everything that has been given out."""

    @property
    def in_inches(self) -> bool:
        """The program is in G20 here and being converted."""

    @property
    def ended(self) -> bool:
        """Everything has been given out."""

    @property
    def place(self) -> tuple[float, ...]:
        """Where the machine stands behind everything that has been given out, in the order of the state's axes."""

    def relocate(self, position: Position) -> None:
        """The machine's own account of where it stands."""

    def forget(self) -> None:
        """The machine may not hold what it was told."""

    def skip(self) -> None:
        """Follow what comes before the first line that is to go out."""

    def more(self, most_lines: int) -> Stretch:
        """The next blocks, up to a barrier, of at most so many lines: there may be none. Raises PlanError, OSError."""


class BatchPlanner:
    """Plans one program, once, from its lines, given as to jobs.upcoming.BlockReader. Nothing is read beyond a barrier
    before the batch after it is wanted.

    `position` is where the machine stands before the first of `lines`, `absolute` its G90/G91 then. With `skip_to`
    the lines before it are not sent, but followed, so that the modal state is that of a machine that has executed
    them; `relocate` then says where it really stands. `held`: what the controller says that it holds, where it can be
    asked; its modes go before `absolute`.
    """

    def __init__(
        self,
        lines: Iterable[tuple[int, bytes]],
        profile: Profile,
        motion: Motion,
        limits: BatchLimits,
        *,
        compact: bool = True,
        block_delete: bool = False,
        convert_inches: bool = False,
        position: Position | None = None,
        absolute: bool | None = True,
        skip_to: int = 1,
        encoding: str = "utf-8",
        held: Held | None = None,
        tools: ToolBlocks | None = None,
    ) -> None:
        longest = limits.longest_block_bytes
        rules = Rules(profile, motion, longest, compact, block_delete, convert_inches, encoding, tools)
        state = power_on(profile) if held is None else state_of(held, profile)
        if held is None or not held.modal:
            state.absolute = absolute
        state.locate(dict(position or {}))
        self._begin(BlockReader(lines, rules, state, skip_to=skip_to), limits)

    @classmethod
    def over(cls, reader: Reader, limits: BatchLimits) -> Self:
        """Of blocks that another reader makes."""
        planner = cls.__new__(cls)
        planner._begin(reader, limits)  # noqa: SLF001 - its own
        return planner

    def _begin(self, reader: Reader, limits: BatchLimits) -> None:
        self._reader = reader
        self._axes = reader.state.axes.lower()
        self._limits = limits
        self._ahead = Ahead()
        self._fitting = 0
        self._before: Place | None = None
        self._start: Position | None = None  # the same, once a batch has ended there
        self._previous_start: Place | None = None
        self._broken: PlanError | OSError | None = None
        self.reading = False

    @property
    def position(self) -> Position:
        """Where the machine will stand after everything that has been planned and read ahead."""
        self._reader.skip()
        return self._position(self._reader.place)

    @property
    def state(self) -> State:
        """The state there."""
        self._reader.skip()
        return self._reader.state

    @property
    def in_inches(self) -> bool:
        """Whether the program is in G20 there and being converted; `state` and all that is planned is in mm."""
        self._reader.skip()
        return self._reader.in_inches

    def relocate(self, position: Position) -> None:
        """The machine's own account of its position: before the first batch, or after a barrier.

        Raises LocalError anywhere else, as blocks have been read ahead from another position.
        """
        self._reader.skip()
        if self._ahead.left or self._ahead.blocks.alone is not None:
            raise LocalError("relocate in the middle of blocks that are already planned")
        self._reader.relocate(position)
        self._before = self._start = None

    def forget(self) -> None:
        """What was planned last is not sent: what comes behind it says anew what it needs."""
        self._reader.forget()

    def next(self, *, aside: bool = False) -> PlannedBatch | None:
        """The next batch; None at the end of the program.

        `aside`: whoever asks must not wait. Where lines have to be read first None comes too, and `reading` is True
        until somebody has called `read`.
        Raises PlanError for a line that cannot be sent and OSError when the program cannot be read; from then on
        always, so that nothing behind the gap ever goes out.
        """
        if aside and self.reading:
            return None
        while self._broken is None and not self._full:
            self.reading = True
            if aside:
                return None
            self.read()
        if self._broken is not None:
            raise self._broken
        if self._ahead.left:
            return self._emit(self._choose())
        alone, self._ahead.blocks.alone = self._ahead.blocks.alone, None
        return None if alone is None else self._emit_alone(alone)

    # --- reading ------------------------------------------------------------------------------------------------

    def read(self) -> None:
        """Some lines, for `next`; in any thread: `next(aside=True)` touches nothing while `reading` is True."""
        try:
            if self._before is None:
                self._before = self._reader.place
            self._ahead.add(self._reader.more(LINES_AT_ONCE))
        except (PlanError, OSError) as error:
            self._broken = error
        finally:
            self.reading = False

    @property
    def _full(self) -> bool:
        """A bound is passed, a barrier stands there, or the program ends; else there is more to read."""
        ahead, limits = self._ahead, self._limits
        self._fitting = ahead.fitting(limits.max_batch_blocks, limits.max_batch_bytes, limits.max_batch_seconds)
        return self._fitting < ahead.left or ahead.blocks.alone is not None or self._reader.ended

    # --- choosing where to end ----------------------------------------------------------------------------------

    def _choose(self) -> int:
        """How many of the blocks ahead make the next batch."""
        ahead, count = self._ahead, self._fitting
        if count < ahead.left:
            # Blocks that move nothing go with the motion that follows them, not at the end of a batch.
            count = ahead.up_to_motion(count) or count
        if self._limits.position_tolerance_mm is None or self._is_told_apart(ahead.end(count)):
            return count
        return self._earlier(count)

    def _earlier(self, count: int) -> int:
        """An earlier end that can be told apart; `count` when there is none.

        Leaving a single motion over would only pass the same trouble on to the next batch, so that comes last.
        """
        moves = self._ahead.blocks.moves[self._ahead.at :][:count]
        ends = [n for n in range(count - 1, 0, -1) if moves[n - 1]]
        told_apart = [n for n in ends if self._is_told_apart(self._ahead.end(n))]
        if not told_apart:
            return count
        several_left = [n for n in told_apart if moves.count(1, n) > 1]
        return (several_left or told_apart)[0]

    def _is_told_apart(self, end: Place) -> bool:
        # Two places, each known to within the tolerance, are apart beyond twice of it.
        apart_mm = 2 * (self._limits.position_tolerance_mm or 0.0)
        starts = (self._before, self._previous_start)
        return all(start is None or _differs(end, start, apart_mm) for start in starts)

    # --- batches ------------------------------------------------------------------------------------------------

    def _emit(self, count: int) -> PlannedBatch:
        ahead, blocks = self._ahead, self._ahead.blocks
        begin, end = ahead.at, ahead.at + count
        parts = [blocks.parts.get(place, 0) for place in range(begin, end)] if blocks.parts else []
        lines = ahead.lines(count)
        ahead.at = end
        starts_at, ends_at = self._goes_to(blocks.end(end - 1))
        return PlannedBatch(
            first_line=int(blocks.lines[begin]),
            last_line=int(blocks.lines[end - 1]),
            blocks=tuple(blocks.texts[begin:end]),
            seconds=sum(blocks.seconds[begin:end].tolist()),
            start=starts_at,
            end=ends_at,
            barrier=False,
            locate_after=False,
            ends_program=False,
            tool=None,
            motion=blocks.moves.find(1, begin, end) >= 0,
            lines=lines,
            parts=tuple(parts) if any(parts) else (),
            io=tuple([word for place in range(begin, end) for word in blocks.io.get(place, ())]) if blocks.io else (),
            reach_mm=tuple(blocks.reach_mm[begin:end].tolist()),
        )

    def _emit_alone(self, block: Upcoming) -> PlannedBatch:
        barrier = block.barrier
        assert barrier is not None
        start, end = self._goes_to(block.end)
        return PlannedBatch(
            first_line=block.line,
            last_line=block.line,
            blocks=(block.text, *block.behind),
            seconds=block.seconds,
            start=start,
            end=end,
            barrier=True,
            locate_after=barrier.locate,
            ends_program=barrier.ends_program,
            tool=block.tool,
            motion=block.moves,
            tool_change=barrier.tool_change,
            lines=(block.line,) * (1 + len(block.behind)) if block.behind else (),
            parts=(block.part,) if block.part else (),
            pauses=barrier.pauses,
            io=block.io,
            set_tool=barrier.set_tool,
            reach_mm=(block.reach_mm, *[0.0] * len(block.behind)),
        )

    def _goes_to(self, end: Place) -> tuple[Position, Position]:
        """Start and end of the next batch, which ends at this place."""
        assert self._before is not None
        start = self._position(self._before) if self._start is None else self._start
        self._previous_start, self._before = self._before, end
        self._start = self._position(end)
        return start, self._start

    def _position(self, place: Place) -> Position:
        return {axis: value for axis, value in zip(self._axes, place, strict=True) if not isnan(value)}


def _differs(one: Place, other: Place, apart_mm: float) -> bool:
    """Surely two places: a coordinate that is known of both differs. (A difference with NaN is never larger.)"""
    return any(abs(value - before) > apart_mm for value, before in zip(one, other, strict=True))
