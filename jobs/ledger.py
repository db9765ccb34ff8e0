"""What is known of a job's batches: which are with the machine, which are done, which are in doubt; and how far it is.

No decisions (runner.py) and no database (journal.py). The one rule: every batch that was handed over leaves `open`
exactly once, with a mark that says how it ended.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from jobs.batch import PlannedBatch
from jobs.cursor import Cursor
from jobs.effects import Entry, MarkBatch, RowStatus
from protocol.commands import Position


@dataclass(slots=True)
class Flight:
    """A row that is, or may be, with the machine. Times are RFC 3339."""

    entry: Entry
    attempts: int = 0
    sent_at: str | None = None
    received_at: str | None = None


@dataclass(slots=True)
class Ledger:
    """`position` is where the machine stood after the last batch that is done. `doubtful`: lines, from and to.
    `inherited_doubt`: the lines that were in doubt, for good, before this process began. `executed`: the wire ID of the
    last block that is certain (jobs.journal.Past)."""

    cursor: Cursor = field(default_factory=Cursor)
    position: Position = field(default_factory=dict)
    seconds_done: float = 0.0
    open: list[Flight] = field(default_factory=list)
    doubtful: list[tuple[int, int]] = field(default_factory=list)
    inherited_doubt: tuple[int, int] | None = None
    executed: int | None = None

    def flight(self, id: int) -> Flight | None:
        """The open row of this wire ID."""
        for flight in self.open:
            if flight.entry.wire_id == id:
                return flight
        return None

    def lines_in_doubt(self) -> tuple[int | None, int | None]:
        """From the first to the last line that may have been executed wholly, partly or not at all."""
        spans = [*self.doubtful, *((batch.first_line, batch.last_line) for batch in self._open_batches)]
        if self.inherited_doubt is not None:
            spans.append(self.inherited_doubt)
        if not spans:
            return None, None
        return min(first for first, _ in spans), max(last for _, last in spans)

    @property
    def _open_batches(self) -> list[PlannedBatch]:
        return [flight.entry.batch for flight in self.open]

    def inherit_doubt(self, line_from: int | None, line_to: int | None) -> None:
        """Lines that were in doubt before; those of rows that are still open may yet be settled."""
        first_open = min((flight.entry.batch.first_line for flight in self.open), default=None)
        if line_from is None or line_to is None or first_open == line_from:
            return
        self.inherited_doubt = (line_from, line_to if first_open is None else first_open - 1)

    def submit(self, entry: Entry) -> None:
        """It is about to be handed to the engine."""
        self.open.append(Flight(entry))
        self.cursor.was_sent(entry.batch.last_line)

    def sent(self, flight: Flight, attempt: int, at: str) -> None:
        """Its bytes are on the wire."""
        flight.attempts = attempt
        flight.sent_at = flight.sent_at or at

    def received(self, flight: Flight, at: str) -> None:
        """The machine has accepted it."""
        flight.received_at = flight.received_at or at
        self.cursor.was_received(flight.entry.batch.last_line)

    def done(self, flight: Flight, *, inferred: bool, position: Position | None, at: str) -> MarkBatch:
        """It was executed; the machine stands at `position`, where it was asked for that, else where it was planned."""
        batch = flight.entry.batch
        self.open.remove(flight)
        self.cursor.was_done(batch.line_behind(len(batch.blocks) - 1))
        self.executed = flight.entry.wire_id + len(batch.blocks) - 1
        self.seconds_done += batch.seconds
        self.position = dict(batch.end if position is None else position)
        return self._mark(flight, RowStatus.OK, inferred=inferred, ok_at=at, end=self.position)

    def doubt(self, flights: Iterable[Flight], status: RowStatus) -> list[MarkBatch]:
        """Nothing more will be learnt about these."""
        marks = []
        for flight in tuple(flights):
            self.open.remove(flight)
            self.doubtful.append((flight.entry.batch.first_line, flight.entry.batch.last_line))
            marks.append(self._mark(flight, status))
        return marks

    def failed(self, flight: Flight, lines_done: int | None, lines_touched: int | None) -> MarkBatch:
        """It did not run to its end. Its first `lines_done` blocks are done, and those from `lines_touched` on are not,
        where that is known (protocol.events.BatchFailed); what lies between is in doubt."""
        batch, done = flight.entry.batch, lines_done or 0
        touched = len(batch.blocks) if lines_touched is None else lines_touched
        self.open.remove(flight)
        if done:
            self.cursor.was_done(batch.line_behind(done - 1))
        if touched > done:
            self.doubtful.append((batch.line_of(done), batch.line_of(touched - 1)))
        return self._mark(flight, RowStatus.FAILED if touched else RowStatus.UNSENT)

    def cut(self, flight: Flight, blocks: int, position: Position, at: str) -> tuple[MarkBatch, PlannedBatch]:
        """Its first `blocks` blocks are executed, behind which the machine stands at `position`, and no other: the
        mark, and the rest, which was never sent."""
        first, rest = flight.entry.batch.cut(blocks, position)
        self.open.remove(flight)
        self.cursor.was_done(first.line_behind(blocks - 1))
        self.cursor.fell_back(first.last_line)
        self.executed = flight.entry.wire_id + blocks - 1
        self.seconds_done += first.seconds
        self.position = dict(position)
        return self._mark(flight, RowStatus.OK, ok_at=at, end=self.position, cut=first), rest

    def undo(self) -> tuple[list[MarkBatch], list[PlannedBatch]]:
        """Whatever is open never arrived: the marks, and the batches to be sent again, in order."""
        undone, self.open = self.open, []
        self.cursor.fell_back(self.cursor.done)
        return [self._mark(flight, RowStatus.UNDONE) for flight in undone], [flight.entry.batch for flight in undone]

    def left_out(self, entry: Entry) -> MarkBatch:
        """A row that never goes out, for there is nothing left to do for its line."""
        self.cursor.was_done(entry.batch.line_behind(len(entry.batch.blocks) - 1))
        return self._mark(Flight(entry), RowStatus.UNSENT)

    def unsent(self, entry: Entry) -> MarkBatch:
        """A row that never went out."""
        return self._mark(Flight(entry), RowStatus.UNSENT)

    def _mark(
        self,
        flight: Flight,
        status: RowStatus,
        *,
        inferred: bool = False,
        ok_at: str | None = None,
        end: Position | None = None,
        cut: PlannedBatch | None = None,
    ) -> MarkBatch:
        return MarkBatch(
            flight.entry,
            status,
            self.cursor.done,
            attempts=flight.attempts,
            inferred=inferred,
            sent_at=flight.sent_at,
            received_at=flight.received_at,
            ok_at=ok_at,
            end=end,
            cut=cut,
        )
