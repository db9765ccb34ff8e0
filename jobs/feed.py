"""The next batch: from the planner, or one that has to go out again; planned one ahead and given a row in the journal.

Not when it may go out (runner.py). The one rule: lines come in order, so what was taken back goes before what is new.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from jobs.batch import PlannedBatch
from jobs.effects import Entry
from jobs.job import Status
from jobs.outcome import Outcome
from protocol.commands import Position
from protocol.errors import LocalError


class BatchSource(Protocol):
    """Where batches come from: jobs.batch.BatchPlanner."""

    reading: bool
    """The last `next` has answered None because lines have to be read, not because the program is at its end."""

    def next(self, *, aside: bool = False) -> PlannedBatch | None:
        """The next batch, None at the end. Raises LocalError for a line that cannot be sent, OSError for the file.
        `aside`: nothing is read here."""

    def read(self) -> None:
        """Some lines, where `reading` says so: milliseconds, and longer where the disk is slow. Nothing else of the
        source is used meanwhile."""

    def relocate(self, position: Position) -> None:
        """The true position after a batch whose effect could not be computed."""

    def forget(self) -> None:
        """What was planned last is not sent: the machine does not hold what that would have set."""


@dataclass(slots=True)
class Ahead:
    """The next batch. `entry` once its row was emitted, `durable` once that row is."""

    batch: PlannedBatch
    seq: int
    entry: Entry | None = None
    durable: bool = False


@dataclass(slots=True)
class Feed:
    """`source` may be supplied later. `end`: how the job ends once nothing is left; None while that is not known."""

    source: BatchSource | None = None
    next_seq: int = 1
    ahead: Ahead | None = None
    end: Outcome | None = None
    _backlog: deque[PlannedBatch] = field(default_factory=deque)

    def supply(self, source: BatchSource, *, behind: Sequence[PlannedBatch], position: Position) -> None:
        """What comes after the batches `behind` which the machine stands, or will stand, and after what is planned."""
        batches = [*behind, *([] if self.ahead is None else [self.ahead.batch]), *self._backlog]
        source.relocate(batches[-1].end if batches else position)
        self.source = source

    @property
    def reading(self) -> bool:
        """There is no batch ahead because its lines have to be read: that is for somebody who has the time."""
        return self.ahead is None and self.end is None and self.source is not None and self.source.reading

    def relocate(self, position: Position) -> None:
        """The true position after a barrier; nothing has been planned beyond it."""
        if self.source is not None:
            self.source.relocate(position)

    def forget(self) -> None:
        """The batch that was planned last is left out; nothing has been planned beyond it."""
        if self.source is not None:
            self.source.forget()

    def plan(self) -> Ahead | None:
        """The batch ahead, planned now if there is none yet."""
        if self.ahead is None:
            batch = self._backlog.popleft() if self._backlog else self._read()
            if batch is not None:
                self.ahead = Ahead(batch, self.next_seq)
                self.next_seq += 1
        return self.ahead

    def journaled(self, seq: int, wire_id: int) -> None:
        """The row is durable under this ID."""
        ahead = self.ahead
        if ahead is not None and ahead.seq == seq and ahead.entry is not None and ahead.entry.wire_id == wire_id:
            ahead.durable = True

    def shelve(self) -> Entry | None:
        """Take the batch ahead back; its row, if there is one, which was never sent."""
        ahead, self.ahead = self.ahead, None
        if ahead is None:
            return None
        self._backlog.appendleft(ahead.batch)
        return ahead.entry

    def put_back(self, batches: Sequence[PlannedBatch]) -> None:
        """These go out again, in order, before everything else. The batch ahead has been shelved."""
        assert self.ahead is None
        self._backlog.extendleft(reversed(batches))

    def unreadable(self, reason: str) -> None:
        """There will be no source."""
        self.end = self.end or Outcome(Status.FAILED, "program_missing", f"The program cannot be read: {reason}")

    def broken(self, reason: str) -> None:
        """Nothing more comes out of the source: a fault of ours."""
        self.end = self.end or Outcome(
            Status.FAILED, "internal", f"The daemon could not read on: {reason}. See its log"
        )

    def _read(self) -> PlannedBatch | None:
        if self.end is not None or self.source is None:
            return None
        try:
            batch = self.source.next(aside=True)
        except LocalError as error:
            self.end = Outcome(Status.FAILED, "not_plannable", str(error))
            return None
        except OSError as error:
            self.unreadable(str(error))
            return None
        if batch is None and self.source.reading:
            return None
        if batch is None or batch.ends_program:
            # What stands behind the end of a program (M30, M99) is not part of it.
            self.end = Outcome(Status.COMPLETED)
        return batch
