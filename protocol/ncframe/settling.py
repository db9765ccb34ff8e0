"""What a new epoch inherits: batches whose end is not in the journal, told by the machine's count. Third layer.

Where the machine counts, a batch's ID is the number of its first frame, so the count tells of every open batch whether
it was executed, not at all, or up to which frame. The one rule: what a machine that has restarted could count as well
proves nothing, and without a counter nothing is proven.
"""

from dataclasses import dataclass

from protocol.commands import SendBatch
from protocol.engine import OpenWork
from protocol.events import (
    BatchDone,
    BatchFailed,
    CommandDone,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    MachineRestarted,
)
from protocol.ncframe.codec import COUNT_MODULUS, Frame
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.flights import HIGHEST_AFTER_RESTART, Flights
from protocol.ncframe.phases import Flight, Inquiry, Reason

NO_COUNTER = (
    "the machine counts no frames: whether those that were on their way were executed cannot be found out, nor where "
    "it stands"
)


@dataclass(slots=True)
class Case:
    """A batch of which some frames are counted goes on; `undone` behind it."""

    undone: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Share:
    """How the frames that were counted since an ID are shared among batches: so many of them are `done` whole, of the
    next one the first `frames` are executed."""

    done: int
    frames: int


def share(batches: tuple[SendBatch, ...], count: int) -> Share | None:
    """None where no share fits: the machine has counted less than before them, or more than all of them.

    A batch whose ID does not follow from the one before was written down and never sent.
    """
    left = (count - (batches[0].id - 1)) % COUNT_MODULUS
    done = 0
    for number, batch in enumerate(batches):
        if number and (batch.id - batches[0].id) % COUNT_MODULUS != sum(len(b.blocks) for b in batches[:number]):
            break
        if left < len(batch.blocks):
            return Share(done, left)
        left -= len(batch.blocks)
        done += 1
    return None if left else Share(done, 0)


class Settling(Flights):
    """The first contact, and the case that it opens."""

    def __init__(self, dialect: Dialect, first_id: int, baud: int, open_work: OpenWork | None) -> None:
        super().__init__(dialect, first_id, baud)
        self._open_work = open_work
        self._case: Case | None = None
        if open_work is not None and open_work.batches:
            self._emit(FateUnknown(tuple(batch.id for batch in open_work.batches)))

    def _on_greeted(self, _: Inquiry, count: int | None, now: float) -> None:
        self._counted = count
        work, self._open_work = self._open_work, None
        if work is None:
            self._tell_again(now)
            self._go_idle(now)
            return
        self._standing = work.start
        ids = tuple(batch.id for batch in work.batches)
        if count is None:
            self._emit(FateInDoubt((), ids, NO_COUNTER) if ids else FateSettled((), (), dict(work.start)))
            self._standing = {} if ids else work.start
        elif not ids:
            self._nothing_open(count, work)
        elif (shared := share(work.batches, count)) is None:
            self._unshared(count, ids)
        elif count <= HIGHEST_AFTER_RESTART:
            self._standing = {}
            self._emit(FateInDoubt((), ids, f"the machine counts {count}: it may as well have restarted since"))
        else:
            self._settle(work, shared, now)
            return
        self._go_idle(now)

    def _tell_again(self, now: float) -> None:
        """After a doubt within the epoch: the machine stands, wherever that is."""
        if self._ready:
            self._tell("idle", now)

    def _nothing_open(self, count: int, work: OpenWork) -> None:
        """All is known of the job, but not of the machine: it may have restarted, or somebody may have moved it."""
        before = work.executed
        self._standing = work.start if count == before else {}
        behind = before is not None and 0 < (before - count) % COUNT_MODULUS < COUNT_MODULUS // 2
        if count == 0 or behind:
            known = "a job had been under way" if before is None else f"{before} were executed"
            self._emit(MachineRestarted(f"it counts {count} frames, and {known}"))
        self._emit(FateSettled((), (), dict(self._standing)))

    def _unshared(self, count: int, ids: tuple[int, ...]) -> None:
        """Counted less than before the open batches, or more than they are."""
        self._standing = {}
        before = ids[0] - 1
        if count == 0 or (before - count) % COUNT_MODULUS < COUNT_MODULUS // 2:
            self._emit(MachineRestarted(f"it counts {count} frames, and {before} were executed"))
            self._emit(FateInDoubt((), ids, "the machine has restarted"))
        else:
            why = f"the machine counts {count} frames, more than were sent; somebody else has sent some"
            self._emit(FateInDoubt((), ids, why))

    def _settle(self, work: OpenWork, shared: Share, now: float) -> None:
        """Known of every frame. A batch that is half executed goes on if it may still move (elvinto §5.5)."""
        ids = tuple(batch.id for batch in work.batches)
        done, rest = ids[: shared.done], ids[shared.done :]
        if shared.done:
            self._standing = {**self._standing, **work.batches[shared.done - 1].end}
        if not shared.frames:
            self._emit(FateSettled(done, rest, dict(self._standing)))
            self._go_idle(now)
            return
        for id in done:
            self._emit(BatchDone(id, inferred=True))
        batch = work.batches[shared.done]
        frames = tuple(Frame.from_text(block) for block in batch.blocks)
        position = dict(self._standing)
        for frame in frames[: shared.frames]:
            position = self._pace.moved(frame, position)
        if now <= work.move_until:
            self._case = Case(rest[1:])
            self._flight = Flight(batch, frames, None, position, shared.frames, shared.frames)
            self._send_next(now)
            return
        self._standing = position
        why = f"the link broke behind frame {shared.frames} of {len(frames)}; the others were not executed"
        self._emit(BatchFailed(batch.id, "link", None, why, shared.frames, shared.frames, dict(position)))
        self._emit(FateSettled((), rest[1:], dict(position)))
        self._go_idle(now)

    def _report_done(self, flight: Flight) -> None:
        case, self._case = self._case, None
        if case is None:
            super()._report_done(flight)
        else:
            self._emit(FateSettled((flight.batch.id,), case.undone, dict(self._standing)))

    def _fail(self, reason: Reason, code: int | None, message: str, *, located: bool = False) -> None:
        super()._fail(reason, code, message, located=located)
        case, self._case = self._case, None
        if case is not None:
            self._emit(FateSettled((), case.undone, dict(self._standing)))

    # --- errands between batches ------------------------------------------------------------------------------------

    def _on_polled(self, _: Inquiry, count: int | None, now: float) -> None:
        """POLL: the machine is there. Is it the one that it was?"""
        if count is not None and self._counted is not None and count != self._counted:
            self._miscounted(count, now)
            return
        if self._clear_token is not None:
            self._counted, self._alarm = count, None
        token = self._clear_token if self._clear_token is not None else self._locate_token
        self._clear_token = self._locate_token = None
        if token is not None:
            self._tell(self._resting_status, now)
            self._emit(CommandDone(token))
        self._go_on(now)

    def _on_proven(self, _: Inquiry, count: int | None, now: float) -> None:
        """PROVE: nothing was counted since; now the first frame may go."""
        if count != self._counted:
            assert count is not None
            self._miscounted(count, now)
        else:
            self._send_next(now)

    def _go_on(self, now: float) -> None:
        if self._flight is not None:
            self._send_next(now)
        else:
            self._go_idle(now)

    def _break_off(self, reason: Reason, message: str) -> None:
        work, self._open_work = self._open_work, None
        if work is not None:
            self._emit(FateInDoubt((), tuple(batch.id for batch in work.batches), message))
        self._hold = False
        self._fail(reason, None, message)
        self._fail_queries(message)
        self._answer_stops()

    def _cancelled(self, now: float) -> None:
        """CAN: the machine has stopped by itself, or was stopped at its panel. Its position and its count are gone."""
        self._break_off("alarm", "the machine has aborted (CAN)")
        self._raise_alarm("the machine has aborted what it was doing; clear the alarm and set its position anew", now)
        self._go_idle(now)

    def _abort_heard(self, now: float) -> None:
        self._raise_alarm("the emergency stop was pressed; clear the alarm and set the position anew", now)
        for token in self._abort_tokens:
            self._emit(CommandDone(token))
        self._abort_tokens.clear()
        self._go_idle(now)
