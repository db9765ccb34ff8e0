"""A job under way: events of the engine and wishes of people in, effects out. Pure: no clock, no wire, no database.

One batch is in flight, one more is planned and journaled while it executes. The one rule: nothing is submitted whose
row is not durable under exactly the ID that goes on the wire (elvinto §5.1).

Why at most two rows are open (elvinto §5.4.3). The journal's writer is a FIFO. Let *n* be a row.
`Journal(n+2)` is emitted only after `Mark(n, ok)`: a row is planned when the one ahead of it was submitted, that
needed the end of the row in flight, and the end was emitted as a mark before. `Submit(n+2)` needs `Journal(n+2)`
durable, so by the FIFO `Mark(n, ok)` is durable too. Whenever the process dies, the rows without a durable end are
therefore among two neighbours: one that may be executed, and one journaled ahead that may or may not have been sent.
The engine finds out by the machine's ID memory and by the position (elvinto §5.4).
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from jobs import outcome
from jobs.effects import Effect, Entry, JournalBatch, Note, RowStatus, SetHold, SetStatus, Submit
from jobs.feed import Ahead, BatchSource, Feed
from jobs.flight import Adopted, Inheritance, LinkSide, Wishes
from jobs.job import ENDED, JobError, Status
from jobs.ledger import Flight, Ledger
from jobs.outcome import CANCELLED_UNASKED, ESTOP_DEMANDED, MACHINE_GONE, Outcome
from protocol.commands import Position
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    Event,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    LinkReady,
    MachineRestarted,
    StateReported,
)


@dataclass(slots=True)
class Runner:
    """One job. `feed` yields what comes after the open rows; times in `now` are the engine's clock in seconds."""

    job_id: int
    resume_within_s: float
    feed: Feed
    ledger: Ledger = field(default_factory=Ledger)
    announced: Status = Status.CHECKING
    restarted: bool = False
    _wishes: Wishes = field(default_factory=Wishes)
    _link: LinkSide = field(default_factory=LinkSide)
    _outcome: Outcome | None = None
    _told: tuple[Any, ...] = ()
    _effects: list[Effect] = field(default_factory=list)

    def adopt(self, past: Adopted, *, last_life_at: float) -> list[Effect]:
        """Take up what a daemon before us left; the link is down."""
        self.announced = past.status
        self.restarted = past.restarted
        self._link.last_life_at = last_life_at
        self._wishes = Wishes(hold=past.hold, tool=past.tool, waiting=past.status is Status.WAITING)
        self.ledger.open = [Flight(entry) for entry in past.open]
        if any(entry.batch.ends_program for entry in past.open):
            self.feed.end = Outcome(Status.COMPLETED)
        if past.status is Status.INTERRUPTED:
            error = past.error or JobError("in_doubt", "The job was interrupted.")
            self._outcome = Outcome(Status.INTERRUPTED, error.code, error.message)
            self.ledger.inherit_doubt(error.line_from, error.line_to)
        return self._drain()

    # --- what is derived --------------------------------------------------------------------------------------

    @property
    def status(self) -> Status:
        """The job's status; derived, never stored."""
        if self._outcome is not None:
            return self._outcome.status
        if self._wishes.waiting:
            return Status.WAITING
        if self._wishes.hold and not self.ledger.open:
            return Status.PAUSED
        return Status.RUNNING

    @property
    def error(self) -> JobError | None:
        """What went wrong, with the lines that are in doubt."""
        if self._outcome is None or not self._outcome.code:
            return None
        return JobError(self._outcome.code, self._outcome.message, *self.ledger.lines_in_doubt())

    @property
    def over(self) -> bool:
        """The job has ended and nothing more will be learnt about it."""
        return self.status in ENDED and not self.ledger.open

    @property
    def linked(self) -> bool:
        """The machine takes commands; what became of everything before is settled."""
        return self._link.up

    @property
    def holding(self) -> bool:
        """A pause is demanded (the batch in flight may still be executing)."""
        return self._wishes.hold

    @property
    def cancelling(self) -> bool:
        """Its end is demanded."""
        return self._wishes.cancel

    @property
    def tool(self) -> int | None:
        """The tool it waits for."""
        return self._wishes.tool if self._wishes.waiting else None

    @property
    def flights(self) -> tuple[Flight, ...]:
        """The rows that are with the machine, or may be."""
        return tuple(self.ledger.open)

    @property
    def _goes_on(self) -> bool:
        """Would the job send by itself if it could?"""
        wishes = self._wishes
        return self._outcome is None and not (wishes.hold or wishes.cancel or wishes.waiting)

    def deadline(self) -> float | None:
        """When a break becomes too long to be bridged without asking (elvinto §5.5)."""
        if self._link.last_life_at is None or not self._goes_on:
            return None
        return self._link.last_life_at + self.resume_within_s

    def inherit(self) -> Inheritance:
        """What a new epoch is told: what is open, and until when it may move the machine to find out.

        A job that is to stand still (paused, waiting, being cancelled, interrupted) never moves by itself.
        """
        deadline = self.deadline()
        return Inheritance(
            tuple(flight.entry.command() for flight in self.ledger.open),
            dict(self.ledger.position),
            -math.inf if deadline is None else deadline,
        )

    # --- what people want -------------------------------------------------------------------------------------

    def begin(self) -> list[Effect]:
        """The machine is ours and takes commands."""
        self._link = LinkSide(up=True)
        return self._drain()

    def supply(self, source: BatchSource) -> None:
        """What comes after everything that is open: it is made aside, for reading a long program takes its time."""
        behind = [flight.entry.batch for flight in self.ledger.open]
        self.feed.supply(source, behind=behind, position=self.ledger.position)

    def unreadable(self, reason: str) -> None:
        """There will be no source: the job fails when what is open has ended."""
        self.feed.unreadable(reason)

    def pause(self) -> list[Effect]:
        """Stand still after the batch in flight."""
        if not self._wishes.hold:
            self._wishes.hold = True
            self._emit(SetHold(hold=True))
            self._shelve()
        return self._drain()

    def resume(self) -> list[Effect]:
        """Go on after a pause."""
        if self._wishes.hold:
            self._wishes.hold = False
            self._emit(SetHold(hold=False))
        return self._drain()

    def confirm_tool(self) -> list[Effect]:
        """The tool is in: go on, or stand still if a pause was demanded meanwhile."""
        self._wishes.waiting = False
        self._wishes.tool = None
        return self._drain()

    def cancel(self) -> list[Effect]:
        """End after the batch in flight; at once where the machine cannot be asked any more."""
        if not self._wishes.cancel:
            self._wishes.cancel = True
            # If the process dies before the end is durable, the job must at least not move again.
            self._emit(SetHold(hold=True))
            self._shelve()
        if self._outcome is not None and self._outcome.status is Status.INTERRUPTED:
            self._outcome = Outcome(Status.CANCELLED, self._outcome.code, self._outcome.message)
            self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        elif not self.ledger.open:
            self._stop(Outcome(Status.CANCELLED))
        elif not self._link.up:
            self._stop(CANCELLED_UNASKED)
            self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        return self._drain()

    def emergency(self) -> list[Effect]:
        """The emergency stop has gone out."""
        self._stop(ESTOP_DEMANDED)
        return self._drain()

    def forget(self) -> list[Effect]:
        """What is open will never be known: the machine is about to be told to forget."""
        self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        return self._drain()

    # --- the link ---------------------------------------------------------------------------------------------

    def link_down(self, *, last_life_at: float) -> list[Effect]:
        """The epoch is over. Of the batch in flight nothing more will be heard until the next one."""
        if self._link.last_life_at is None:
            self._link.last_life_at = last_life_at
        self._link.up = False
        self._shelve()
        if self.status in ENDED:
            self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        elif self._wishes.cancel:
            return self.cancel()
        return self._drain()

    def overdue(self, *, now: float) -> list[Effect]:
        """The time for going on without asking is over."""
        self._check_break(now)
        return self._drain()

    def handle(self, event: Event, *, now: float, at: str) -> list[Effect]:
        """What the engine reports. `at` is the time for people."""
        match event:
            case BatchSent(id=id, attempt=attempt) if flight := self.ledger.flight(id):
                self.ledger.sent(flight, attempt, at)
            case BatchReceived(id=id) if flight := self.ledger.flight(id):
                self.ledger.received(flight, at)
            case BatchDone(id=id, inferred=inferred, position=position) if flight := self.ledger.flight(id):
                self._done(flight, inferred=inferred, position=position, at=at)
            case BatchFailed() if flight := self.ledger.flight(event.id):
                self._failed(event, flight)
            case StateReported(status="alarm", alarm=alarm):
                self._stop(outcome.alarm("" if alarm is None else alarm.message))
            case MachineRestarted(evidence=evidence):
                self.restarted = True
                self._note("machine_restarted", evidence=evidence)
                self._interrupt(MACHINE_GONE)
            case FateUnknown(ids=ids):
                self._note("fate_unknown", ids=list(ids))
            case FateSettled():
                self._settled(event, now=now, at=at)
            case FateInDoubt():
                self._in_doubt(event, at=at)
            case LinkReady():
                self._link = LinkSide(up=True)
            case _:
                pass
        return self._drain()

    # --- going on ---------------------------------------------------------------------------------------------

    def advance(self, next_id: int, *, free: bool) -> list[Effect]:
        """What can be done now. Call again after carrying it out, until there is nothing.

        `next_id` is the engine's; when it has moved since the row was written, the row is written again.
        """
        ahead = self.feed.ahead
        if self.ledger.open and ahead is not None and ahead.entry is not None and ahead.entry.wire_id == next_id:
            return []  # one is with the machine, the next is written down: nothing can be done before an event
        if self._wishes.cancel and not self.ledger.open:
            self._stop(Outcome(Status.CANCELLED))
        if not self._link.up or not self._goes_on:
            return self._drain()
        ahead = self._plan()
        # The end of a program makes the machine forget its IDs (elvinto §5.6): whether a batch before it was executed
        # could then not be found out any more. So its row comes after the end of that batch is in the journal.
        if ahead is None or (ahead.batch.ends_program and self.ledger.open):
            return self._drain()
        if ahead.entry is None or ahead.entry.wire_id != next_id:
            ahead.entry = Entry(self.job_id, ahead.seq, next_id, ahead.batch)
            ahead.durable = False
            self._emit(JournalBatch(ahead.entry))
        elif free and ahead.durable and not self.ledger.open:
            self.feed.ahead = None
            self.ledger.submit(ahead.entry)
            self._emit(Submit(ahead.entry.command()))
        return self._drain()

    @property
    def reading(self) -> bool:
        """It wants to go on, and the next batch is not read to its end yet: call `advance` again soon."""
        return self._link.up and self._goes_on and not self._behind_barrier and self.feed.reading

    @property
    def _behind_barrier(self) -> bool:
        """The effect of what is open must be known before anything is planned (elvinto §7, barriers)."""
        return any(flight.entry.batch.barrier for flight in self.ledger.open)

    def _plan(self) -> Ahead | None:
        """One batch ahead, but never past a barrier."""
        if self._behind_barrier:
            return None
        ahead, end = self.feed.plan(), self.feed.end
        if ahead is not None:
            self.ledger.cursor = self.ledger.cursor.was_read(ahead.batch.last_line)
        elif end is not None and not self.ledger.open:
            self._stop(end)
        return ahead

    def _shelve(self) -> None:
        """Take the batch ahead back: its row says that it was never sent, before anything else is written."""
        entry = self.feed.shelve()
        if entry is not None:
            self._emit(self.ledger.unsent(entry))

    # --- evidence ---------------------------------------------------------------------------------------------

    def _done(self, flight: Flight, *, inferred: bool, position: Position | None, at: str) -> None:
        batch = flight.entry.batch
        self._emit(self.ledger.done(flight, inferred=inferred, position=position, at=at))
        if batch.ends_program:
            # Now, also where a pause was demanded: a daemon after us would not know that what follows is no part of it.
            self._stop(Outcome(Status.COMPLETED))
        if batch.locate_after:
            self.feed.relocate(self.ledger.position)
        if batch.tool_change:
            self._wishes.waiting = True
            self._wishes.tool = batch.tool

    def _proven(self, ids: Iterable[int], *, at: str) -> None:
        """Batches that were executed for certain; each ends where it was planned to, for all that is known."""
        for id in ids:
            if flight := self.ledger.flight(id):
                self._done(flight, inferred=True, position=None, at=at)

    def _failed(self, event: BatchFailed, flight: Flight) -> None:
        self._doubt([flight], RowStatus.FAILED)
        if event.reason == "restart":
            self.restarted = True
            self._interrupt(MACHINE_GONE)
        elif (cause := outcome.failure(event)) is not None:
            self._stop(cause)

    def _settled(self, event: FateSettled, *, now: float, at: str) -> None:
        self._proven(event.done, at=at)
        self._shelve()
        marks, undone = self.ledger.undo()
        self._emit(*marks)
        self.feed.put_back(undone)
        self._note("fate_settled", done=list(event.done), undone=list(event.undone), position=dict(event.position))
        self._check_break(now)

    def _in_doubt(self, event: FateInDoubt, *, at: str) -> None:
        self._proven(event.done, at=at)
        self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        self._note("fate_in_doubt", done=list(event.done), doubtful=list(event.doubtful), reason=event.reason)
        self._interrupt(outcome.in_doubt(event.reason))

    def _doubt(self, flights: Iterable[Flight], status: RowStatus) -> None:
        self._emit(*self.ledger.doubt(flights, status))

    # --- stopping ---------------------------------------------------------------------------------------------

    def _check_break(self, now: float) -> None:
        deadline = self.deadline()
        if deadline is not None and now >= deadline:
            self._interrupt(outcome.break_too_long(self.resume_within_s))

    def _interrupt(self, cause: Outcome) -> None:
        """Later evidence may name a graver cause, but an end stays an end and a restart the gravest."""
        if self.status not in ENDED and (self._outcome is None or self._outcome.code != MACHINE_GONE.code):
            self._outcome = cause
            self._shelve()

    def _stop(self, cause: Outcome) -> None:
        if self._outcome is None:
            self._outcome = cause
            self._shelve()

    def _note(self, kind: str, **data: Any) -> None:
        self._emit(Note(kind, data))

    def _emit(self, *effects: Effect) -> None:
        self._effects.extend(effects)

    def _drain(self) -> list[Effect]:
        status = self.status
        told = (status, self.error, self.tool, self.restarted)
        if told != self._told and not (status is self.announced and not self._told):
            _, error, tool, restarted = told
            done = self.ledger.cursor.done
            self._emit(SetStatus(self.announced, status, done, error=error, tool=tool, restarted=restarted))
            self.announced = status
        self._told = told
        effects, self._effects = self._effects, []
        return effects
