"""A job under way: events of the engine and wishes of people in, effects out. Pure: no clock, no wire, no database.

As many batches are in flight as the machine's delivery is deep, one more is planned and journaled while they execute.
The one rule: nothing is submitted whose row is not durable under exactly the ID that goes on the wire (elvinto §5.1).

Why with a depth of one at most two rows are open (elvinto §5.4.3). The journal's writer is a FIFO. Let *n* be a row.
`Journal(n+2)` is emitted only after `Mark(n, ok)`: a row is planned when the one ahead of it was submitted, that
needed the end of the row in flight, and the end was emitted as a mark before. `Submit(n+2)` needs `Journal(n+2)`
durable, so by the FIFO `Mark(n, ok)` is durable too. Whenever the process dies, the rows without a durable end are
therefore among two neighbours: one that may be executed, and one journaled ahead that may or may not have been sent.
The engine finds out by the machine's ID memory and by the position (elvinto §5.4). A machine without a memory (Grbl) is
given more at once, and of what is open after a break nothing can be found out.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from jobs import outcome
from jobs.effects import Effect, Entry, JournalBatch, RowStatus, SetHold, Submit
from jobs.feed import Ahead, BatchSource
from jobs.flight import Adopted, LinkSide, Wishes
from jobs.job import ENDED, JobError, Status
from jobs.ledger import Flight
from jobs.outcome import CANCELLED_UNASKED, ESTOP_DEMANDED, MACHINE_GONE, MACHINE_RESET, Outcome
from jobs.toolside import ToolSide
from protocol.commands import Position
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    ControllerReset,
    Event,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    LineRefused,
    LinkReady,
    MachineRestarted,
    StateReported,
    ToolRequested,
)


@dataclass(slots=True)
class Runner(ToolSide):
    """See the head of this file."""

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
        elif self.delivery.forgets:
            self._lost()
        elif past.status is Status.WAITING and self.has_changer:
            self._take_up_change()
        return self._drain()

    # --- what people want -------------------------------------------------------------------------------------

    def begin(self, *, hold: bool = False) -> list[Effect]:
        """The machine is ours and takes commands. `hold`: a pause was asked while the program was read; its row says so
        already."""
        self._link = LinkSide(up=True)
        self._wishes.hold = hold
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
        """Go on after a pause; a line that was refused is left out."""
        self._refusal = None
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
        """End after the batch in flight, or where the machine drops what it has; at once where it cannot be asked."""
        if not self._wishes.cancel:
            self._wishes.cancel = True
            # If the process dies before the end is durable, the job must at least not move again.
            self._emit(SetHold(hold=True))
            self._shelve()
        if self._outcome is not None and self._outcome.status is Status.INTERRUPTED:
            self._outcome = Outcome(Status.CANCELLED, self._outcome.code, self._outcome.message)
            self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        elif not self.ledger.open:
            self._stop(self._cancelled)
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
        self._link.up, self._reported = False, None
        self._shelve()
        if self.status in ENDED:
            self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
        elif self._wishes.cancel:
            return self.cancel()
        elif not self.delivery.remembers:
            self._lost()
        return self._drain()

    def _lost(self) -> None:
        """The link is gone from a machine that cannot be asked afterwards what it has executed."""
        if self.ledger.open:
            self._doubt(self.ledger.open, RowStatus.DOUBTFUL)
            located = self.delivery.locates
            self._interrupt(outcome.LOST_WITH_LINES_INSIDE if located else outcome.LOST_WITHOUT_A_COUNT)
        elif self.delivery.forgets:
            self._interrupt(outcome.LOST_STANDING)

    def overdue(self, *, now: float) -> list[Effect]:
        """The time for going on without asking is over."""
        self._check_break(now)
        return self._drain()

    def heeds(self, event: Event) -> bool:
        """Whether it says anything new: a machine tells ten times a second that it runs."""
        return not (isinstance(event, StateReported) and event.status == self._reported)

    def handle(self, event: Event, *, now: float, at: str) -> list[Effect]:
        """What the engine reports. `at` is the time for people."""
        match event:
            case BatchSent(id=id, attempt=attempt) if flight := self.ledger.flight(id):
                self.ledger.sent(flight, attempt, at)
                return []  # it changes nothing of what the job is doing
            case BatchReceived(id=id) if flight := self.ledger.flight(id):
                self.ledger.received(flight, at)
                return []
            case BatchDone(id=id, inferred=inferred, position=position) if flight := self.ledger.flight(id):
                self._done(flight, inferred=inferred, position=position, at=at)
            case BatchFailed() if flight := self.ledger.flight(event.id):
                self._failed(event, flight, at=at)
            case StateReported():
                self._state(event)
            case LineRefused() if flight := self.ledger.flight(event.id):
                self._line_refused(event, flight)
            case ToolRequested(number=number) if self.delivery.holds:
                self._wishes.waiting, self._wishes.tool = True, number
            case MachineRestarted() | ControllerReset():
                self._reset(event)
            case FateUnknown() | FateSettled() | FateInDoubt():
                self._fate(event, now=now, at=at)
            case LinkReady():
                self._link = LinkSide(up=True)
            case _:
                pass
        return self._drain()

    def _state(self, report: StateReported) -> None:
        """In alarm a job is over; in the wrong mode it moves what must not be, or moves nothing."""
        self._reported, alarm = report.status, report.alarm
        if report.status == "alarm":
            self._stop(outcome.alarm("" if alarm is None else alarm.message))
        elif self._outcome is None and self.delivery.forgets and self.policy.check != (report.status == "check"):
            self._interrupt(outcome.CHECK_MODE_LOST if self.policy.check else outcome.CHECK_MODE_FOUND)

    def _reset(self, event: MachineRestarted | ControllerReset) -> None:
        """With lines inside their end has said so already; without, what stands still must not go on either."""
        if isinstance(event, MachineRestarted):
            self.restarted = True
            self._note("machine_restarted", evidence=event.evidence)
            self._interrupt(MACHINE_GONE)
        elif self.delivery.forgets and self._outcome is None:
            self._interrupt(MACHINE_RESET)

    def _fate(self, event: FateUnknown | FateSettled | FateInDoubt, *, now: float, at: str) -> None:
        """What became of the batches of an epoch before."""
        match event:
            case FateUnknown(ids=ids):
                self._note("fate_unknown", ids=list(ids))
            case FateSettled():
                self._settled(event, now=now, at=at)
            case FateInDoubt():
                self._in_doubt(event, at=at)

    # --- going on ---------------------------------------------------------------------------------------------

    def advance(self, next_id: int, *, free: bool) -> list[Effect]:
        """What can be done now. Call again after carrying it out, until there is nothing.

        `next_id` is the engine's; when it has moved since the row was written, the row is written again.
        """
        if self.waits(next_id, free):
            return []
        if self._wishes.cancel and not self.ledger.open:
            self._stop(self._cancelled)
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
        elif free and ahead.durable and self.has_room and self._may_go(ahead.batch):
            self.feed.ahead = None
            self.ledger.submit(ahead.entry)
            self._handed_over(ahead.batch)
            self._emit(Submit(ahead.entry.command(self.policy)))
        return self._drain()

    def waits(self, next_id: int, free: int) -> bool:
        """The next batch is written down and cannot go out: nothing can be done before an event."""
        ahead = self.feed.ahead
        written = ahead is not None and ahead.entry is not None and ahead.entry.wire_id == next_id
        return written and not (free and self.has_room)

    @property
    def reading(self) -> bool:
        """It wants to go on, and the lines of the next batch are not read: `feed.source.read()`, then `advance`."""
        return self.feed.reading and self._link.up and self._goes_on and not self._behind_barrier

    @property
    def _behind_barrier(self) -> bool:
        """The effect of what is open must be known before anything is planned (elvinto §7, barriers): so nothing is
        ever open behind a barrier."""
        flights = self.ledger.open
        return bool(flights) and flights[-1].entry.batch.barrier

    def _plan(self) -> Ahead | None:
        """One batch ahead, but never past a barrier."""
        if self._behind_barrier:
            return None
        ahead, end = self.feed.plan(), self.feed.end
        if ahead is not None:
            self.ledger.cursor.was_read(ahead.batch.last_line)
        elif end is not None and not self.ledger.open:
            self._end(end)
        return ahead

    # --- evidence ---------------------------------------------------------------------------------------------

    def _done(self, flight: Flight, *, inferred: bool, position: Position | None, at: str) -> None:
        batch = flight.entry.batch
        self._emit(self.ledger.done(flight, inferred=inferred, position=position, at=at))
        if batch.ends_program:
            # Now, also where a pause was demanded: a daemon after us would not know that what follows is no part of it.
            self._end(Outcome(Status.COMPLETED))
        if batch.locate_after:
            self.feed.relocate(self.ledger.position)
        if batch.pauses and not self._wishes.hold:
            self._wishes.hold = True
            self._emit(SetHold(hold=True))
        self._arrived(batch)

    def _proven(self, ids: Iterable[int], *, at: str) -> None:
        """Batches that were executed for certain; each ends where it was planned to, for all that is known."""
        for id in ids:
            if flight := self.ledger.flight(id):
                self._done(flight, inferred=True, position=None, at=at)

    def _failed(self, event: BatchFailed, flight: Flight, *, at: str) -> None:
        done, blocks = event.lines_done or 0, len(flight.entry.batch.blocks)
        if event.position is not None and event.lines_touched == done and 0 < done < blocks:
            mark, rest = self.ledger.cut(flight, done, event.position, at)
            self._emit(mark)
            if event.reason == "link":
                # Nothing is in doubt: what was sent behind it never ran. Whether it may go on FateSettled will show.
                marks, undone = self.ledger.undo()
                self._emit(*marks)
                self.feed.put_back([rest, *undone])
                return
        else:
            self._emit(self.ledger.failed(flight, event.lines_done, event.lines_touched))
        if event.reason == "restart":
            self.restarted = True
            self._interrupt(MACHINE_GONE)
        elif self._wishes.cancel and event.reason == "stop":
            if not self.ledger.open:
                self._stop(self._cancelled)
        else:
            cause = outcome.failure(event)
            (self._interrupt if cause.status is Status.INTERRUPTED else self._stop)(cause)

    def _line_refused(self, event: LineRefused, flight: Flight) -> None:
        """grbl II.4: those behind it that are inside are executed all the same, if nothing holds the machine."""
        line = flight.entry.batch.line_of(event.index)
        inside = [
            other.entry.batch.line_of(index)
            for id, index in event.inside
            if (other := self.ledger.flight(id)) is not None
        ]
        said = f"Line {line}, {event.block}: {event.message}"
        self.refused += 1
        self._first_refusal = self._first_refusal or said
        self._note("line_refused", line=line, block=event.block, code=event.code, action=event.action, inside=inside)
        if event.action == "held":
            self._refusal = outcome.held_for(said, inside)
            if not self._wishes.hold:
                self._wishes.hold = True
                self._emit(SetHold(hold=True))
            self._shelve()

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
