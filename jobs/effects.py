"""What the runner wants done: rows of the journal, commands for the engine, changes of a job. Nothing is done here.

The one rule: whoever carries them out keeps their order. The journal's writer is a FIFO, and what may be concluded
after a crash (runner.py) hangs on it. What is made for each batch is a NamedTuple: a frozen dataclass takes three times
as long to make.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal, NamedTuple

from jobs.batch import PlannedBatch
from jobs.delivery import Policy
from jobs.job import JobError, Status
from protocol.commands import Position, SendBatch


class RowStatus(StrEnum):
    """A row of the journal."""

    PLANNED = "planned"
    """Open: it may be on the wire, it may have been executed. Every other status is a durable end."""
    UNSENT = "unsent"
    """Its bytes never went out, or the machine has dropped them unread."""
    OK = "ok"
    FAILED = "failed"
    """It did not run to its end; its lines are in doubt."""
    UNDONE = "undone"
    """Proven never to have arrived; its lines went out again under another ID."""
    DOUBTFUL = "doubtful"
    """It cannot be known whether it was executed."""


class Entry(NamedTuple):
    """A row of the journal: `seq` counts the batches of a job, `wire_id` is the ID on the wire."""

    job_id: int
    seq: int
    wire_id: int
    batch: PlannedBatch

    def command(self, policy: Policy = Policy()) -> SendBatch:  # noqa: B008 - frozen
        """What the engine is given for it, today and after a crash: always the same bytes."""
        batch = self.batch
        return SendBatch(
            id=self.wire_id,
            blocks=batch.blocks,
            expected_s=batch.seconds,
            end=batch.end,
            locate_after=batch.locate_after,
            ends_program=batch.ends_program,
            on_error=policy.on_error,
            ignored_errors=policy.ignored_errors,
            check=policy.check,
            reach_mm=batch.reach_mm,
        )


class JournalBatch(NamedTuple):
    """Make the row durable, then call `Runner.journaled`. The same `seq` again replaces the row's ID."""

    entry: Entry


class Submit(NamedTuple):
    """Hand it to the engine. Its row is durable."""

    command: SendBatch


class MarkBatch(NamedTuple):
    """The end of a row. Times are RFC 3339; `end` replaces the planned position where the true one is known, `cut` the
    batch of the row where only its first blocks were executed, and the others certainly not."""

    entry: Entry
    status: RowStatus
    line_done: int
    attempts: int = 0
    inferred: bool = False
    sent_at: str | None = None
    received_at: str | None = None
    ok_at: str | None = None
    end: Position | None = None
    cut: PlannedBatch | None = None


@dataclass(frozen=True, slots=True)
class SetStatus:
    """The job's status, its error or the tool it waits for has changed. `before` may equal `after`."""

    before: Status
    after: Status
    line_done: int
    error: JobError | None = None
    tool: int | None = None
    restarted: bool = False


@dataclass(frozen=True, slots=True)
class SetHold:
    """Whether the job is to stand still after the batch in flight; it outlives a crash."""

    hold: bool


@dataclass(frozen=True, slots=True)
class Note:
    """An entry of the job's history."""

    kind: str
    data: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ToolAsk:
    """Ask the tool changer. `number`: the tool; of `coolant` the code, 7, 8 or 9, and -7, -8 for one of both off.
    `again`: a tool that a daemon before us has asked for, and nobody has seen the end of it. The answer may come at
    once."""

    what: Literal["prepare", "start", "change", "set", "again", "coolant"]
    number: int | None = None
    line: int | None = None


OF_THE_JOURNAL = (JournalBatch, MarkBatch)
"""Nothing for the engine follows from these, and nothing for those who wait for it."""

Effect = JournalBatch | Submit | MarkBatch | SetStatus | SetHold | Note | ToolAsk
