"""The runner by itself: a source of batches, events as a test tells them, and the effects that come out."""

import math
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jobs.batch import PlannedBatch
from jobs.effects import Effect, Entry, JournalBatch, MarkBatch, Note, RowStatus, SetHold, SetStatus, Submit
from jobs.feed import Feed
from jobs.flight import Adopted
from jobs.job import JobError, Status, check_transition
from jobs.runner import Runner
from protocol.commands import Position
from protocol.errors import LocalError
from protocol.events import (
    Alarm,
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    LinkReady,
    MachineRestarted,
    StateReported,
)
from tests.harness.fakes import ListSource, batch

AT = "2026-03-01T09:00:00.000Z"
LIMIT_S = 10.0


class Bench:
    """A runner and what its effects led to. Journal rows are durable when the test says so."""

    def __init__(self, items: Sequence[PlannedBatch | Exception], *, durable: bool = True) -> None:
        self.source = ListSource(items)
        self.runner = Runner(1, LIMIT_S, Feed(self.source))
        self.next_id = 1000
        self.free = True
        self.now = 0.0
        self.auto = durable
        self.seen: list[Effect] = []
        self.rows: dict[int, RowStatus] = {}
        self.statuses: list[Status] = []
        self.sent: list[int] = []
        self.durable_ids: set[int] = set()
        self.do(self.runner.begin())

    def do(self, effects: list[Effect]) -> None:
        todo = list(effects)
        while True:
            while todo:
                effect = todo.pop(0)
                self.seen.append(effect)
                self.carry_out(effect)
            todo = self.runner.advance(self.next_id, free=self.free)
            if not todo:
                return

    def carry_out(self, effect: Effect) -> None:
        match effect:
            case JournalBatch(entry=entry):
                self.rows[entry.seq] = RowStatus.PLANNED
                if self.auto:
                    self.make_durable(entry)
            case MarkBatch(entry=entry, status=status):
                assert self.rows[entry.seq] is RowStatus.PLANNED, "a row ends once"
                self.rows[entry.seq] = status
            case Submit(command=command):
                assert command.id in self.durable_ids, "submitted before its row was durable"
                assert command.id == self.next_id
                assert self.free
                self.free = False
                self.next_id += 1
                self.sent.append(command.id)
            case SetStatus():
                if effect.before is not effect.after:
                    check_transition(effect.before, effect.after)
                self.statuses.append(effect.after)
            case _:
                pass
        opened = [seq for seq, status in self.rows.items() if status is RowStatus.PLANNED]
        assert len(opened) <= 2

    def make_durable(self, entry: Entry) -> None:
        self.durable_ids.add(entry.wire_id)
        self.runner.feed.journaled(entry.seq, entry.wire_id)

    def tell(self, *events: Any, free: bool | None = None) -> None:
        for event in events:
            if free is not None:
                self.free = free
            self.do(self.runner.handle(event, now=self.now, at=AT))

    def finish(self, id: int) -> None:
        self.tell(BatchSent(id, 1), BatchReceived(id))
        self.tell(BatchDone(id), free=True)

    @property
    def errors(self) -> tuple[str, int | None, int | None]:
        error = self.runner.error
        assert error is not None
        return error.code, error.line_from, error.line_to


def test_batches_go_out_one_by_one_and_the_next_row_is_written_while_the_present_executes() -> None:
    bench = Bench([batch(1), batch(3), batch(5)])
    assert bench.sent == [1000]
    assert bench.rows == {1: RowStatus.PLANNED, 2: RowStatus.PLANNED}
    bench.finish(1000)
    assert bench.sent == [1000, 1001]
    bench.finish(1001)
    bench.finish(1002)
    assert bench.statuses == [Status.RUNNING, Status.COMPLETED]
    assert set(bench.rows.values()) == {RowStatus.OK}
    assert bench.runner.over
    assert bench.runner.ledger.cursor.done == 6


def test_nothing_is_submitted_before_its_row_is_durable() -> None:
    bench = Bench([batch(1)], durable=False)
    assert bench.sent == []
    (entry,) = [effect.entry for effect in bench.seen if isinstance(effect, JournalBatch)]
    bench.do([])
    assert bench.sent == []
    bench.make_durable(entry)
    bench.do([])
    assert bench.sent == [1000]


def test_a_row_is_written_anew_when_the_id_has_moved() -> None:
    bench = Bench([batch(1)], durable=False)
    bench.next_id = 1005
    (old,) = [effect.entry for effect in bench.seen if isinstance(effect, JournalBatch)]
    bench.make_durable(old)
    bench.do([])
    assert bench.sent == []
    new = [effect.entry for effect in bench.seen if isinstance(effect, JournalBatch)][-1]
    assert (new.seq, new.wire_id) == (old.seq, 1005)
    bench.make_durable(new)
    bench.do([])
    assert bench.sent == [1005]


def test_nothing_is_planned_beyond_a_barrier_before_its_effect_is_known() -> None:
    bench = Bench([batch(1, 1, barrier=True, locate_after=True), batch(2)])
    assert list(bench.rows) == [1]
    bench.tell(BatchDone(1000, position={"x": 7.0}), free=True)
    assert bench.source.relocated == [{"x": 7.0}]
    assert bench.sent == [1000, 1001]


def test_the_end_of_the_program_is_journaled_after_the_end_of_the_batch_before_it() -> None:
    bench = Bench([batch(1), batch(3, 1, barrier=True, ends_program=True), batch(4)])
    assert list(bench.rows) == [1]
    bench.finish(1000)
    kinds = [type(effect).__name__ for effect in bench.seen[-3:]]
    assert kinds == ["MarkBatch", "JournalBatch", "Submit"]
    bench.finish(1001)
    assert bench.runner.status is Status.COMPLETED, "what stands behind M30 is not part of the program"
    assert bench.sent == [1000, 1001]


def test_pause_takes_the_row_ahead_back_and_resume_sends_its_batch_under_a_new_row() -> None:
    bench = Bench([batch(1), batch(3), batch(5)])
    bench.do(bench.runner.pause())
    assert bench.runner.status is Status.RUNNING
    assert bench.rows[2] is RowStatus.UNSENT
    bench.finish(1000)
    assert bench.runner.status is Status.PAUSED
    assert bench.sent == [1000]
    bench.do(bench.runner.resume())
    assert bench.sent == [1000, 1001]
    bench.finish(1001)
    bench.finish(1002)
    assert bench.statuses == [Status.RUNNING, Status.PAUSED, Status.RUNNING, Status.COMPLETED]
    assert [type(effect) for effect in bench.seen].count(SetHold) == 2


def test_cancel_waits_for_the_batch_in_flight() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.cancel())
    assert bench.runner.status is Status.RUNNING
    assert SetHold(hold=True) in bench.seen, "a crash must not make it go on"
    bench.finish(1000)
    assert bench.runner.status is Status.CANCELLED
    assert bench.runner.error is None
    assert bench.sent == [1000]


def test_cancel_while_the_machine_cannot_be_asked_names_the_lines() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.link_down(last_life_at=0.0))
    bench.do(bench.runner.cancel())
    assert bench.runner.status is Status.CANCELLED
    assert bench.errors == ("cancelled_in_doubt", 1, 2)
    assert bench.rows[1] is RowStatus.DOUBTFUL


@pytest.mark.parametrize(
    ("failure", "code"),
    [
        (BatchFailed(1001, "error", 5, "unknown code"), "machine_error"),
        (BatchFailed(1001, "alarm", 2, "end limit switch"), "alarm"),
        (BatchFailed(1001, "estop", None, ""), "estop"),
    ],
)
def test_a_failed_batch_ends_the_job_and_names_its_lines(failure: BatchFailed, code: str) -> None:
    bench = Bench([batch(1), batch(3), batch(5)])
    bench.finish(1000)
    bench.tell(failure, free=True)
    assert bench.runner.status is Status.FAILED
    assert bench.errors == (code, 3, 4)
    assert bench.runner.ledger.cursor.done == 2
    assert bench.rows == {1: RowStatus.OK, 2: RowStatus.FAILED, 3: RowStatus.UNSENT}
    assert bench.sent == [1000, 1001]
    assert bench.runner.over


def test_a_report_says_something_new_only_when_the_status_is_another() -> None:
    bench = Bench([batch(1)])
    for status in ("idle", "run", "alarm", "run"):
        report = StateReported(status=status, position={})
        assert bench.runner.heeds(report)
        bench.runner.handle(report, now=0.0, at=AT)
        assert not bench.runner.heeds(StateReported(status=status, position={"x": 1.0}))
    assert bench.runner.heeds(BatchDone(1000))


def test_an_alarm_state_alone_fails_the_job_too() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.pause())
    bench.finish(1000)
    bench.tell(StateReported("alarm", {}, alarm=Alarm(100, None, "Emergency pressed")))
    assert bench.runner.status is Status.FAILED
    assert bench.errors == ("alarm", None, None)


def test_an_emergency_stop_leaves_the_lines_in_doubt_until_something_else_is_known() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.emergency())
    assert bench.errors == ("estop", 1, 2)
    assert not bench.runner.over
    bench.tell(BatchDone(1000))
    assert bench.errors == ("estop", None, None)
    assert bench.runner.over


def test_a_restart_interrupts_and_not_one_batch_more_goes_out() -> None:
    bench = Bench([batch(1), batch(3), batch(5)])
    bench.finish(1000)
    bench.tell(MachineRestarted("READY"), BatchFailed(1001, "restart", None, ""), LinkReady(), free=True)
    assert bench.runner.status is Status.INTERRUPTED
    assert bench.errors == ("machine_restarted", 3, 4)
    assert bench.sent == [1000, 1001]
    bench.tell(FateInDoubt((), (), "moved"))
    assert bench.errors == ("machine_restarted", 3, 4), "a restart stays the gravest cause"


def test_m06_waits_for_the_operator_and_a_pause_meanwhile_holds_afterwards() -> None:
    bench = Bench([batch(1, 1, barrier=True, tool=7, tool_change=True), batch(2)])
    bench.finish(1000)
    assert (bench.runner.status, bench.runner.tool) == (Status.WAITING, 7)
    assert bench.sent == [1000]
    bench.do(bench.runner.pause())
    bench.do(bench.runner.confirm_tool())
    assert bench.runner.status is Status.PAUSED
    bench.do(bench.runner.resume())
    assert bench.sent == [1000, 1001]


def test_a_tool_change_without_a_number_waits_as_well() -> None:
    bench = Bench([batch(1, 1, barrier=True, tool_change=True), batch(2)])
    bench.finish(1000)
    assert (bench.runner.status, bench.runner.tool) == (Status.WAITING, None)


def test_a_line_that_cannot_be_sent_fails_the_job_after_what_is_in_flight() -> None:
    bench = Bench([batch(1), LocalError("line 3: too long"), batch(4)])
    assert bench.runner.status is Status.RUNNING
    bench.finish(1000)
    assert bench.runner.status is Status.FAILED
    assert bench.errors == ("not_plannable", None, None)
    assert bench.sent == [1000], "the source is not asked for what stands behind the gap"


def test_a_file_that_cannot_be_read_fails_the_job() -> None:
    bench = Bench([OSError("gone")])
    assert bench.errors == ("program_missing", None, None)


# --- breaks -----------------------------------------------------------------------------------------------------


def broken(items: Sequence[PlannedBatch | Exception] = (batch(1), batch(3), batch(5))) -> Bench:
    """The first batch is done, the second in flight, and the link goes down."""
    bench = Bench(items)
    bench.finish(1000)
    bench.tell(BatchSent(1001, 1), BatchReceived(1001))
    bench.now = 100.0
    bench.do(bench.runner.link_down(last_life_at=99.0))
    assert bench.rows[3] is RowStatus.UNSENT, "in this process it is certain that the row ahead never went out"
    return bench


def test_the_next_epoch_inherits_the_batch_in_flight_and_may_move_until_the_deadline() -> None:
    bench = broken()
    past = bench.runner.inherit()
    assert [(command.id, command.blocks) for command in past.batches] == [(1001, ("X3", "X4"))]
    assert past.start == {"x": 2.0}
    assert past.move_until == 99.0 + LIMIT_S


@pytest.mark.parametrize("wish", [Runner.pause, Runner.cancel])
def test_a_job_that_is_to_stand_still_never_moves_to_find_out(wish: Callable[[Runner], list[Effect]]) -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(wish(bench.runner))
    bench.runner.link_down(last_life_at=99.0)
    assert bench.runner.inherit().move_until == -math.inf


def test_a_settled_fate_within_the_time_goes_on_under_fresh_ids() -> None:
    bench = broken()
    bench.next_id = 3000
    bench.now = 105.0
    bench.tell(FateSettled((), (1001,), {"x": 2.0}), LinkReady(), free=True)
    assert bench.rows[2] is RowStatus.UNDONE
    assert bench.sent == [1000, 1001, 3000]
    redone = [effect.command for effect in bench.seen if isinstance(effect, Submit)][-1]
    assert redone.blocks == ("X3", "X4")
    bench.finish(3000)
    bench.finish(3001)
    assert bench.runner.status is Status.COMPLETED
    assert bench.runner.ledger.cursor.done == 6


def test_a_settled_fate_that_was_done_goes_on_behind_it() -> None:
    bench = broken()
    bench.next_id = 3000
    bench.now = 105.0
    bench.tell(FateSettled((1001,), (), {"x": 4.0}), LinkReady(), free=True)
    (mark,) = [e for e in bench.seen if isinstance(e, MarkBatch) and e.entry.wire_id == 1001]
    assert mark.inferred
    assert [effect.command.blocks for effect in bench.seen if isinstance(effect, Submit)][-1] == ("X5", "X6")


def test_a_break_that_is_too_long_interrupts_at_the_deadline_and_later_evidence_clears_the_doubt() -> None:
    bench = broken()
    bench.do(bench.runner.overdue(now=108.9))
    assert bench.runner.status is Status.RUNNING
    bench.do(bench.runner.overdue(now=109.0))
    assert bench.errors == ("break_too_long", 3, 4)
    bench.now = 500.0
    bench.tell(FateSettled((1001,), (), {"x": 4.0}), LinkReady(), free=True)
    assert bench.errors == ("break_too_long", None, None)
    assert bench.runner.ledger.cursor.done == 4
    assert bench.sent == [1000, 1001]


def test_a_fate_that_is_settled_too_late_interrupts() -> None:
    bench = broken()
    bench.now = 109.5
    bench.tell(FateSettled((), (1001,), {"x": 2.0}), LinkReady(), free=True)
    assert bench.errors == ("break_too_long", None, None)
    assert bench.sent == [1000, 1001]


def test_a_fate_in_doubt_names_the_lines_that_are_and_keeps_those_that_are_certain() -> None:
    bench = broken()
    bench.now = 101.0
    bench.tell(FateInDoubt((), (1001,), "two places fit"), LinkReady(), free=True)
    assert bench.runner.status is Status.INTERRUPTED
    assert bench.errors == ("in_doubt", 3, 4)
    assert bench.runner.ledger.cursor.done == 2
    assert bench.rows[2] is RowStatus.DOUBTFUL


def test_a_break_while_paused_has_no_time_limit() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.pause())
    bench.finish(1000)
    bench.do(bench.runner.link_down(last_life_at=10.0))
    bench.do(bench.runner.overdue(now=1e9))
    bench.now = 1e9
    bench.tell(FateSettled((), (), {"x": 2.0}), LinkReady(), free=True)
    assert bench.runner.status is Status.PAUSED


# --- adopted after a crash ---------------------------------------------------------------------------------------


def adopted(past: Adopted, items: Sequence[PlannedBatch] = ()) -> Bench:
    bench = Bench.__new__(Bench)
    Bench.__init__(bench, [])
    bench.source = ListSource(items)
    bench.runner = Runner(1, LIMIT_S, Feed(next_seq=10))
    bench.rows = {entry.seq: RowStatus.PLANNED for entry in past.open}
    bench.statuses, bench.seen = [], []
    bench.do(bench.runner.adopt(past, last_life_at=50.0))
    return bench


OPEN = (Entry(1, 3, 1003, batch(5)), Entry(1, 4, 1004, batch(7)))


def test_two_open_rows_are_inherited_in_order() -> None:
    bench = adopted(Adopted(Status.RUNNING, OPEN))
    assert [command.id for command in bench.runner.inherit().batches] == [1003, 1004]
    assert bench.statuses == []


def test_an_adopted_job_waits_for_its_source_and_then_goes_on() -> None:
    bench = adopted(Adopted(Status.RUNNING, OPEN), [batch(9)])
    bench.now = 52.0
    bench.next_id = 3000
    bench.tell(FateSettled((1003,), (1004,), {"x": 6.0}), LinkReady(), free=True)
    assert bench.sent == [3000]
    bench.finish(3000)
    assert bench.runner.status is Status.RUNNING, "nobody knows yet whether there is more"
    bench.runner.supply(bench.source)
    assert bench.source.relocated == [{"x": 8.0}]
    bench.do([])
    assert bench.sent == [3000, 3001]


def test_a_source_that_comes_early_begins_where_the_open_rows_end() -> None:
    bench = adopted(Adopted(Status.RUNNING, OPEN), [batch(9)])
    bench.runner.supply(bench.source)
    assert bench.source.relocated == [{"x": 8.0}]


def test_doubt_of_an_earlier_process_is_not_forgotten() -> None:
    error = JobError("in_doubt", "two places fit", 5, 8)
    bench = adopted(Adopted(Status.INTERRUPTED, error=error))
    bench.tell(MachineRestarted("READY"), FateInDoubt((), (), "restarted"), LinkReady())
    assert bench.errors == ("machine_restarted", 5, 8)


def test_doubt_about_rows_that_are_still_open_can_be_cleared() -> None:
    error = JobError("break_too_long", "", 5, 8)
    bench = adopted(Adopted(Status.INTERRUPTED, OPEN, error=error))
    assert bench.errors == ("break_too_long", 5, 8)
    bench.now = 1000.0
    bench.tell(FateSettled((1003, 1004), (), {"x": 8.0}), LinkReady())
    assert bench.errors == ("break_too_long", None, None)


def test_a_job_whose_program_is_gone_fails_when_what_was_open_has_ended() -> None:
    bench = adopted(Adopted(Status.RUNNING, OPEN))
    bench.runner.unreadable("no such file")
    bench.now = 51.0
    bench.tell(FateSettled((1003, 1004), (), {"x": 8.0}), LinkReady(), free=True)
    assert bench.runner.status is Status.FAILED
    assert bench.errors == ("program_missing", None, None)


# --- whatever happens ---------------------------------------------------------------------------------------------


class Machine:
    """Executes what it is sent; the judge of a random run."""

    def __init__(self) -> None:
        self.executed: list[str] = []
        self.highest = 0

    def take(self, id: int, blocks: tuple[str, ...]) -> None:
        if id > self.highest:
            self.highest = id
            self.executed.extend(blocks)


@given(st.integers(0, 2**32))
def test_whatever_happens_every_block_once_in_order_or_a_named_doubt(seed: int) -> None:
    random = Random(seed)
    items = [batch(line) for line in range(1, 21, 2)]
    bench, machine = Bench(items), Machine()
    for _ in range(200):
        if bench.runner.status in (Status.COMPLETED, Status.FAILED, Status.CANCELLED, Status.INTERRUPTED):
            break
        _stir(bench, machine, random)
    wanted = [block for item in items for block in item.blocks]
    done = bench.runner.ledger.cursor.done
    assert machine.executed == wanted[: len(machine.executed)]
    error = bench.runner.error
    last_certain = done if error is None or error.line_to is None else error.line_to
    if not bench.runner.flights:
        assert done <= len(machine.executed) <= last_certain
    if bench.runner.status is Status.COMPLETED:
        assert machine.executed == wanted


def _stir(bench: Bench, machine: Machine, random: Random) -> None:
    bench.now += 0.1
    runner = bench.runner
    flights = runner.flights
    roll = random.random()
    if roll < 0.05:
        bench.do(runner.pause() if random.random() < 0.9 else runner.cancel())
    elif roll < 0.2 and runner.holding and runner._link.up:
        bench.do(runner.resume())
    elif roll < 0.25 and runner._link.up:
        if flights and random.random() < 0.5:
            machine.take(flights[0].entry.wire_id, flights[0].entry.batch.blocks)
        bench.do(runner.link_down(last_life_at=bench.now))
    elif not runner._link.up:
        _reconnect(bench, machine, random)
    elif flights:
        machine.take(flights[0].entry.wire_id, flights[0].entry.batch.blocks)
        bench.finish(flights[0].entry.wire_id)
    else:
        bench.do([])


def _reconnect(bench: Bench, machine: Machine, random: Random) -> None:
    bench.next_id += random.randrange(1, 1000)
    ids = [command.id for command in bench.runner.inherit().batches]
    done = tuple(id for id in ids if id <= machine.highest)
    undone = tuple(id for id in ids if id > machine.highest)
    bench.now += random.choice([0.0, 1.0, 20.0])
    bench.do(bench.runner.overdue(now=bench.now))
    if random.random() < 0.8:
        event: FateSettled | FateInDoubt = FateSettled(done, undone)
    else:
        event = FateInDoubt((), tuple(ids), "who knows")
    bench.tell(event, LinkReady(), free=True)


def test_notes_say_what_was_found_out() -> None:
    bench = broken()
    bench.tell(FateSettled((1001,), (), {"x": 4.0}), LinkReady(), free=True)
    (note,) = [effect for effect in bench.seen if isinstance(effect, Note)]
    assert (note.kind, note.data["done"]) == ("fate_settled", [1001])


def test_positions_are_copied() -> None:
    position: Position = {"x": 1.0}
    bench = Bench([batch(1, 1, barrier=True, locate_after=True)])
    bench.tell(BatchDone(1000, position=position), free=True)
    assert bench.runner.ledger.position == {"x": 1.0}
    assert bench.runner.ledger.position is not position


def test_the_end_of_a_program_that_was_open_is_sent_again_and_then_the_job_is_complete() -> None:
    bench = adopted(Adopted(Status.RUNNING, (Entry(1, 3, 1003, batch(5, 1, barrier=True, ends_program=True)),)))
    bench.now = 51.0
    bench.next_id = 3000
    bench.tell(FateSettled((), (1003,), {"x": 4.0}), LinkReady(), free=True)
    bench.finish(3000)
    assert bench.runner.status is Status.COMPLETED


def test_a_job_that_failed_learns_nothing_more_when_the_link_breaks() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.emergency())
    bench.do(bench.runner.link_down(last_life_at=0.0))
    assert bench.runner.over
    assert bench.errors == ("estop", 1, 2)
    assert bench.rows[1] is RowStatus.DOUBTFUL


def test_a_cancelled_job_ends_when_the_link_breaks_before_its_batch_did() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.do(bench.runner.cancel())
    bench.do(bench.runner.link_down(last_life_at=0.0))
    assert bench.errors == ("cancelled_in_doubt", 1, 2)
    assert bench.runner.over


def test_a_fate_that_is_being_found_out_is_noted_and_nothing_goes_out_meanwhile() -> None:
    bench = Bench([batch(1), batch(3)])
    bench.tell(FateUnknown((1000,)))
    assert [effect.kind for effect in bench.seen if isinstance(effect, Note)] == ["fate_unknown"]
    assert bench.sent == [1000]
    bench.tell(FateSettled((), (1000,), {"x": 0.0}), free=True)
    assert bench.sent == [1000, 1001], "the same lines under a fresh ID"
    assert bench.runner.ledger.cursor.sent == 2


def test_behind_a_program_stop_it_stands_still_until_somebody_resumes() -> None:
    bench = Bench([batch(1, pauses=True, barrier=True), batch(3)])
    bench.finish(1000)
    assert bench.runner.status is Status.PAUSED
    assert SetHold(hold=True) in bench.seen
    assert bench.sent == [1000]
    bench.do(bench.runner.resume())
    assert bench.sent == [1000, 1001]


def broken_off(now: float) -> Bench:
    """A break in the middle of three frames; the new epoch's machine has counted the first of them."""
    bench = Bench([batch(1, blocks=("X1", "X2", "X3"), last_line=3), batch(5)])
    bench.tell(BatchSent(1000, 1))
    bench.do(bench.runner.link_down(last_life_at=0.0))
    bench.now, bench.next_id, bench.free = now, 2000, True
    bench.tell(BatchFailed(1000, "link", None, "broke off", 1, 1, {"x": 1.0}))
    bench.tell(FateSettled((), (), {"x": 1.0}), LinkReady())
    return bench


def test_a_batch_that_broke_off_between_frames_goes_on_with_the_rest_of_it() -> None:
    bench = broken_off(1.0)
    assert bench.rows[1] is RowStatus.OK
    assert bench.runner.ledger.cursor.done == 1
    commands = [effect.command for effect in bench.seen if isinstance(effect, Submit)]
    assert commands[-1].blocks == ("X2", "X3")
    assert bench.runner.status is Status.RUNNING


def test_after_a_long_break_it_does_not_but_nothing_is_in_doubt() -> None:
    bench = broken_off(100.0)
    assert bench.sent == [1000]
    assert bench.errors == ("break_too_long", None, None)
    assert bench.runner.inherit().start == {"x": 1.0}
