"""Lines of a program to batches: what goes out as one command (elvinto §7). Not the journal, not the wire.

The one rule: every block is in exactly one batch, in order. A batch obeys all bounds, a barrier travels alone, and
where there is a choice a batch ends where it can be told, after a crash, from the places where it and the batch
before it began (elvinto §5.4).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice
from math import isnan
from typing import Protocol, Self

from gcode.held import Held, state_of
from gcode.interpreter import power_on
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.state import State
from jobs.toolblocks import ToolBlocks
from jobs.upcoming import LINES_AT_ONCE, BlockReader, PlanError, Rules, Upcoming
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


@dataclass(frozen=True, slots=True)
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

    def more(self, most_lines: int) -> tuple[list[Upcoming], int]:
        """The next blocks, up to a barrier, and how many lines that took. Raises PlanError, OSError."""


class BatchPlanner:
    """Plans one program, once, from its lines. Nothing is read beyond a barrier before the batch after it is wanted.

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
        self._limits = limits
        self._ahead: list[Upcoming] = []
        self._fitting = 0
        self._before: Place | None = None
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
        if self._ahead:
            raise LocalError("relocate in the middle of blocks that are already planned")
        self._reader.relocate(position)
        self._before = None

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
        return self._emit(self._choose()) if self._ahead else None

    # --- reading ------------------------------------------------------------------------------------------------

    def read(self) -> None:
        """Some lines, for `next`; in any thread: `next(aside=True)` touches nothing while `reading` is True."""
        try:
            if self._before is None:
                self._before = self._reader.place
            found, _ = self._reader.more(LINES_AT_ONCE)
            self._ahead += found
        except (PlanError, OSError) as error:
            self._broken = error
        finally:
            self.reading = False

    @property
    def _full(self) -> bool:
        """A bound is passed, a barrier stands there, or the program ends; else there is more to read."""
        ahead = self._ahead
        self._fitting = _fitting(ahead, self._limits)
        return self._fitting < len(ahead) or bool(ahead and ahead[-1].barrier) or self._reader.ended

    # --- choosing where to end ----------------------------------------------------------------------------------

    def _choose(self) -> int:
        """How many of the blocks ahead make the next batch."""
        ahead = self._ahead
        if ahead[0].barrier:
            return 1
        count = self._fitting
        # A barrier is the last that has been read, always; it does not go with the others.
        if count == len(ahead) and ahead[-1].barrier:
            count -= 1
        elif count < len(ahead) and not ahead[count].barrier:
            count = self._without_still_tail(count)
        if self._limits.position_tolerance_mm is None or self._is_told_apart(ahead[count - 1].end):
            return count
        return self._earlier(count)

    def _without_still_tail(self, count: int) -> int:
        """Blocks that move nothing go with the motion that follows them, not at the end of a batch."""
        for shorter in range(count, 0, -1):
            if self._ahead[shorter - 1].moves:
                return shorter
        return count

    def _earlier(self, count: int) -> int:
        """An earlier end that can be told apart; `count` when there is none.

        Leaving a single motion over would only pass the same trouble on to the next batch, so that comes last.
        """
        ends = [n for n in range(count - 1, 0, -1) if self._ahead[n - 1].moves]
        told_apart = [n for n in ends if self._is_told_apart(self._ahead[n - 1].end)]
        if not told_apart:
            return count
        several_left = [n for n in told_apart if sum(item.moves for item in self._ahead[n:count]) > 1]
        return (several_left or told_apart)[0]

    def _is_told_apart(self, end: Place) -> bool:
        # Two places, each known to within the tolerance, are apart beyond twice of it.
        apart_mm = 2 * (self._limits.position_tolerance_mm or 0.0)
        starts = (self._before, self._previous_start)
        return all(start is None or _differs(end, start, apart_mm) for start in starts)

    def _emit(self, count: int) -> PlannedBatch:
        items = self._ahead[:count]
        del self._ahead[:count]
        first, last = items[0], items[-1]
        start, barrier = self._before, first.barrier
        assert start is not None
        self._previous_start, self._before = start, last.end
        lines = [item.line for item in items]
        if first.behind:
            lines += [first.line] * len(first.behind)
        plain = not any(item.part or item.io for item in items)  # nearly all are: one look at each is enough
        return PlannedBatch(
            first_line=first.line,
            last_line=last.line,
            blocks=(*[item.text for item in items], *first.behind),
            seconds=sum([item.seconds for item in items]),
            start=self._position(start),
            end=self._position(last.end),
            barrier=barrier is not None,
            locate_after=barrier is not None and barrier.locate,
            ends_program=barrier is not None and barrier.ends_program,
            tool=first.tool,
            motion=any(item.moves for item in items),
            tool_change=barrier is not None and barrier.tool_change,
            lines=() if lines == [*range(first.line, first.line + len(lines))] else tuple(lines),
            parts=tuple([item.part for item in items]) if not plain and any(item.part for item in items) else (),
            pauses=barrier is not None and barrier.pauses,
            io=() if plain else tuple([word for item in items for word in item.io]),
            set_tool=None if barrier is None else barrier.set_tool,
            reach_mm=(*[item.reach_mm for item in items], *[0.0] * len(first.behind)),
        )

    def _position(self, place: Place) -> Position:
        axes = self._reader.state.axes.lower()
        return {axis: value for axis, value in zip(axes, place, strict=True) if not isnan(value)}


def _fitting(items: Iterable[Upcoming], limits: BatchLimits) -> int:
    """How many of these blocks fit into one batch. One motion alone may be too long: it cannot be divided."""
    most_s, most_bytes = limits.max_batch_seconds, limits.max_batch_bytes
    size_bytes = -1  # one separator less than blocks
    cost_s = 0.0
    timed = 0
    count = 0
    for item in islice(items, limits.max_batch_blocks):
        size_bytes += len(item.text) + 1
        if item.cost_s > 0.0:
            cost_s += item.cost_s
            timed += 1
        if size_bytes > most_bytes or (cost_s > most_s and timed > 1):
            break
        count += 1
    return count


def _differs(one: Place, other: Place, apart_mm: float) -> bool:
    """Surely two places: a coordinate that is known of both differs. (A difference with NaN is never larger.)"""
    return any(abs(value - before) > apart_mm for value, before in zip(one, other, strict=True))
