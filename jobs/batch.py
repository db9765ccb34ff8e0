"""Lines of a program to batches: what goes out as one command (elvinto §7). Not the journal, not the wire.

The one rule: every block is in exactly one batch, in order. A batch obeys all bounds, a barrier travels alone, and
where there is a choice a batch ends where it can be told, after a crash, from the places where it and the batch
before it began (elvinto §5.4).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf

from gcode.clean import clean
from gcode.compact import Compactor
from gcode.inches import InchConverter
from gcode.modal import Modal, Tracker
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.words import Block, code_name, decode_line, parse_block
from protocol.commands import Position
from protocol.errors import LocalError


class PlanError(LocalError):
    """A line that cannot be sent. The check before the run reports it first; here it is the last guard."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line


@dataclass(frozen=True, slots=True)
class BatchLimits:
    """`max_batch_bytes` bounds the joined text `a|b|c`. The seconds are the latency of a pause (elvinto §7).

    `position_tolerance_mm` is how well the machine's own account of its position can be compared (elvinto §5.4).
    """

    max_batch_bytes: int = 512
    max_batch_blocks: int = 32
    max_batch_seconds: float = 1.0
    position_tolerance_mm: float = 0.01


@dataclass(frozen=True, slots=True)
class PlannedBatch:
    """Consecutive blocks that go out as one command; lines are those of the file, from 1, both inclusive.

    `seconds` is estimated. `start` and `end` hold the known axes. `barrier`: one block that travels alone.
    `tool_change`: its block has M6; `tool` is then the tool that is wanted, None where the program named none.
    `motion`: at least one block moves an axis.
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


@dataclass(slots=True)  # not frozen: that doubles the time of making one, and there is one a block
class _Item:
    """A block that is ready to go. `cost_s` counts against the bound: without end where its length is unknown."""

    line: int
    text: str
    seconds: float
    cost_s: float
    moves: bool
    start: Position
    end: Position
    barrier: "_Barrier | None"
    tool: int | None


@dataclass(frozen=True, slots=True)
class _Barrier:
    locate: bool = False
    ends_program: bool = False
    tool_change: bool = False


class BatchPlanner:
    """Plans one program, once, from its lines. Nothing is read beyond a barrier before the batch after it is wanted.

    `position` is where the machine stands before the first of `lines`, `absolute` its G90/G91 then. With `skip_to`
    the lines before it are not sent, but followed, so that the modal state is that of a machine that has executed
    them; `relocate` then says where it really stands.
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
    ) -> None:
        self._lines = iter(lines)
        self._profile = profile
        self._limits = limits
        self._tracker = Tracker(profile, motion, position, absolute=absolute)
        self._compactor = Compactor(profile) if compact else None
        self._inches = InchConverter() if convert_inches else None
        self._block_delete = block_delete
        self._encoding = encoding
        self._skip_to = skip_to
        self._unread: tuple[int, bytes] | None = None
        self._skipped = False
        self._ahead: list[_Item] = []
        self._ended = False
        self.reading = False
        self._broken: PlanError | OSError | None = None
        self._previous_start: Position | None = None

    @property
    def position(self) -> Position:
        """Where the machine will stand after everything that has been planned and read ahead."""
        self._skip()
        return self._tracker.position

    @property
    def modal(self) -> Modal:
        """The modal state there."""
        self._skip()
        return self._tracker.modal

    @property
    def in_inches(self) -> bool:
        """Whether the program is in G20 there and being converted; `modal` and all that is planned is in mm."""
        self._skip()
        return self._inches is not None and self._inches.active

    def relocate(self, position: Position) -> None:
        """The machine's own account of its position: before the first batch, or after a barrier.

        Raises LocalError anywhere else, as blocks have been read ahead from another position.
        """
        self._skip()
        if self._ahead:
            raise LocalError("relocate in the middle of blocks that are already planned")
        self._tracker.position = dict(position)
        if self._compactor:
            self._compactor.forget()

    def next(self, most_lines: int | None = None) -> PlannedBatch | None:
        """The next batch; None at the end of the program.

        Whoever must not wait gives `most_lines`: after reading so many None comes too, and `reading` is True.
        Raises PlanError for a line that cannot be sent and OSError when the program cannot be read; from then on
        always, so that nothing behind the gap ever goes out.
        """
        if self._broken is not None:
            raise self._broken
        try:
            self.reading = not self._fill(most_lines)
        except (PlanError, OSError) as error:
            self._broken = error
            raise
        if self.reading or not self._ahead:
            return None
        return self._emit(self._choose())

    # --- reading ------------------------------------------------------------------------------------------------

    def _skip(self) -> None:
        if self._skipped:
            return
        self._skipped = True
        for line, raw in self._lines:
            if line >= self._skip_to:
                self._unread = (line, raw)
                return
            block = self._read(raw)
            if block.words:
                self._tracker.step(block)

    def _read(self, raw: bytes) -> Block:
        block = parse_block(decode_line(raw, self._encoding))
        if self._block_delete and block.deleted:
            return Block((), True, (), block.text)
        return self._inches.convert(block) if self._inches else block

    def _blocks(self) -> Iterator[tuple[int, Block]]:
        self._skip()
        if self._unread is not None:
            (line, raw), self._unread = self._unread, None
            yield line, self._read(raw)
        for line, raw in self._lines:
            yield line, self._read(raw)

    def _fill(self, most_lines: int | None) -> bool:
        """Reads until a bound is passed, a barrier stands there, or the program ends; False: there is more to read."""
        ahead = self._ahead
        if self._ended or (ahead and ahead[-1].barrier):
            return True
        load = _Load(self._limits)
        for item in ahead:
            load.add(item)
        if not load.fits:
            return True
        for count, (line, block) in enumerate(self._blocks(), 1):
            if (found := self._item(line, block)) is not None:
                ahead.append(found)
                load.add(found)
                if found.barrier or not load.fits:
                    return True
            if count == most_lines:
                return False
        self._ended = True
        return True

    def _item(self, line: int, block: Block) -> _Item | None:
        if block.faults:
            fault = block.faults[0]
            raise PlanError(line, f"column {fault.column}: {fault.message}")
        text = self._compactor.compact(block) if self._compactor else clean(block)
        if not text:
            return None
        if len(text) > self._limits.max_batch_bytes:
            raise PlanError(line, f"the block has {len(text)} bytes, the machine takes {self._limits.max_batch_bytes}")
        tracker = self._tracker
        start = tracker.position
        step = tracker.step(block)
        barrier = _barrier(block, self._profile)
        tool = tracker.modal.tool if barrier and barrier.tool_change else None
        cost_s = step.seconds if step.exact else inf
        return _Item(line, text, step.seconds, cost_s, step.moves, start, tracker.position, barrier, tool)

    # --- choosing where to end ----------------------------------------------------------------------------------

    def _choose(self) -> int:
        """How many of the blocks ahead make the next batch."""
        ahead = self._ahead
        if ahead[0].barrier:
            return 1
        load = _Load(self._limits)
        count = 0
        for item in ahead:
            load.add(item)
            if item.barrier or not load.fits:
                break
            count += 1
        if count < len(ahead) and not ahead[count].barrier:
            count = self._without_still_tail(count)
        if self._is_told_apart(ahead[count - 1].end):
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

    def _is_told_apart(self, end: Position) -> bool:
        # Two places, each known to within the tolerance, are apart beyond twice of it.
        apart_mm = 2 * self._limits.position_tolerance_mm
        starts = (self._ahead[0].start, self._previous_start)
        return all(start is None or _differs(end, start, apart_mm) for start in starts)

    def _emit(self, count: int) -> PlannedBatch:
        items = self._ahead[:count]
        del self._ahead[:count]
        first, last = items[0], items[-1]
        self._previous_start = first.start
        barrier = first.barrier
        if barrier and self._compactor:
            # A person may have been at the machine during it, and its modes are what the next block says.
            self._compactor.forget()
        return PlannedBatch(
            first_line=first.line,
            last_line=last.line,
            blocks=tuple([item.text for item in items]),
            seconds=sum([item.seconds for item in items]),
            start=first.start,
            end=last.end,
            barrier=barrier is not None,
            locate_after=barrier is not None and barrier.locate,
            ends_program=barrier is not None and barrier.ends_program,
            tool=first.tool,
            motion=any(item.moves for item in items),
            tool_change=barrier is not None and barrier.tool_change,
        )


class _Load:
    """What the blocks of a batch add up to."""

    __slots__ = ("_blocks", "_bytes", "_cost_s", "_limits", "_timed")

    def __init__(self, limits: BatchLimits) -> None:
        self._limits = limits
        self._blocks = 0
        self._bytes = -1  # one separator less than blocks
        self._cost_s = 0.0
        self._timed = 0

    def add(self, item: _Item) -> None:
        self._blocks += 1
        self._bytes += len(item.text) + 1
        if item.cost_s > 0.0:
            self._cost_s += item.cost_s
            self._timed += 1

    @property
    def fits(self) -> bool:
        """One motion alone may be longer than the bound: it cannot be divided."""
        limits = self._limits
        return (
            self._blocks <= limits.max_batch_blocks
            and self._bytes <= limits.max_batch_bytes
            and (self._cost_s <= limits.max_batch_seconds or self._timed <= 1)
        )


def _barrier(block: Block, profile: Profile) -> _Barrier | None:
    """What makes `block` travel alone (elvinto §7); None for the many that do not."""
    found = locate = ends_program = tool_change = False
    code_letters, barrier_letters, codes = profile.code_letters, profile.barrier_letters, profile.codes
    for letter, _, text, _ in block.words:
        if letter in barrier_letters:
            found = True
        if letter not in code_letters:
            continue
        code = codes.get(code_name(letter, text))
        if code is None:
            # Nobody knows what it does, so nothing else may hang on it.
            found = locate = True
        elif code.barrier:
            found = True
            locate |= code.locate
            ends_program |= code.effect == "program_end"
            tool_change |= code.effect == "tool_change"
    return _Barrier(locate, ends_program, tool_change) if found else None


def _differs(one: Position, other: Position, apart_mm: float) -> bool:
    """Surely two places: a coordinate that is known of both differs."""
    return any(axis in other and abs(value - other[axis]) > apart_mm for axis, value in one.items())
