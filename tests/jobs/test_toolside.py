"""The tool side of a job by itself: what it asks of the changer, when its blocks go out, what the answers lead to."""

from collections.abc import Sequence

import pytest

from jobs.batch import PlannedBatch
from jobs.effects import Effect, JournalBatch, MarkBatch, RowStatus, SetHold, Submit, ToolAsk
from jobs.feed import Feed
from jobs.flight import Adopted
from jobs.job import Status
from jobs.runner import Runner
from protocol.events import BatchDone, BatchReceived, BatchSent
from tests.harness.fakes import ListSource, batch

AT = "2026-03-01T09:00:00.000Z"


def change(line: int, tool: int | None = 5, **others: object) -> PlannedBatch:
    return batch(line, 1, barrier=True, tool_change=True, tool=tool, blocks=("M6",), **others)


class Bench:
    """A runner with a changer; the machine executes what `execute` says, rows are durable at once."""

    def __init__(self, items: Sequence[PlannedBatch]) -> None:
        self.source = ListSource(items)
        self.runner = Runner(1, 10.0, Feed(self.source), has_changer=True)
        self.next_id, self.free = 1000, True
        self.asked: list[tuple[str, int | None]] = []
        self.sent: list[str] = []
        self.rows: dict[int, RowStatus] = {}
        self.holds: list[bool] = []

    def begin(self) -> "Bench":
        self.do(self.runner.begin())
        return self

    def do(self, effects: list[Effect]) -> None:
        todo = list(effects)
        while todo or (todo := self.runner.advance(self.next_id, free=self.free)):
            match effect := todo.pop(0):
                case JournalBatch(entry=entry):
                    self.runner.feed.journaled(entry.seq, entry.wire_id)
                case MarkBatch(entry=entry):
                    self.rows[entry.batch.first_line] = effect.status
                case Submit(command=command):
                    self.sent += command.blocks
                    self.free, self.next_id = False, self.next_id + 1
                case ToolAsk(what=what, number=number):
                    self.asked.append((what, number))
                case SetHold(hold=hold):
                    self.holds.append(hold)
                case _:
                    pass

    def execute(self) -> "Bench":
        """The batch that is with the machine is done."""
        id = self.next_id - 1
        for event in (BatchSent(id, 1), BatchReceived(id)):
            self.do(self.runner.handle(event, now=0.0, at=AT))
        self.free = True
        self.do(self.runner.handle(BatchDone(id), now=0.0, at=AT))
        return self

    @property
    def status(self) -> Status:
        return self.runner.status

    @property
    def error(self) -> str:
        return "" if self.runner.error is None else self.runner.error.code


CUT = batch(1, blocks=("X1", "X2"))
REST = batch(4, blocks=("X4", "X5"))


def test_an_m6_from_the_t_to_the_rest_of_the_program() -> None:
    bench = Bench([batch(1, io=(("T", 5),)), change(3), REST]).begin()
    assert bench.asked == [("prepare", 5)], "while the machine cuts"
    bench.execute()
    assert bench.asked[1:] == [("start", 5)]
    assert bench.sent == ["X1", "X2"], "no block of the M6 before the changer has begun"
    bench.do(bench.runner.tool_started())
    assert bench.sent[2:] == ["M6"]
    bench.execute()
    assert (bench.asked[2:], bench.status, bench.runner.tool) == ([("change", 5)], Status.WAITING, 5)
    assert bench.sent[3:] == [], "none behind it before the changer has ended"
    bench.do(bench.runner.tool_changed(by_person=False))
    assert (bench.sent[3:], bench.status) == (["X4", "X5"], Status.RUNNING)


def test_a_t_in_the_line_of_its_m6_is_prepared_first() -> None:
    bench = Bench([CUT, change(3, 7), REST]).begin().execute()
    assert bench.asked == [("prepare", 7), ("start", 7)]


def test_another_tool_than_the_last_t_is_prepared_anew() -> None:
    bench = Bench([batch(1, io=(("T", 5),)), change(3, 7), REST]).begin().execute()
    assert bench.asked == [("prepare", 5), ("prepare", 7), ("start", 7)]


def test_an_m6_without_a_t_ends_the_job_before_anything_moves() -> None:
    bench = Bench([CUT, change(3, None), REST]).begin().execute()
    assert (bench.status, bench.error, bench.asked) == (Status.FAILED, "no_tool_word", [])
    assert bench.runner.error is not None
    assert "Line 3" in bench.runner.error.message
    assert bench.sent == ["X1", "X2"]


@pytest.mark.parametrize("begun", [0, 1, 2], ids=["asked to begin", "on its way", "changing"])
def test_a_change_that_fails_ends_the_job_wherever_it_is(begun: int) -> None:
    bench = Bench([CUT, change(3), REST]).begin().execute()
    for step in (lambda: bench.do(bench.runner.tool_started()), bench.execute)[:begun]:
        step()
    bench.do(bench.runner.tool_failed("the holder is stuck", goes_on=False))
    if begun == 1:
        bench.execute()  # what is with the machine is executed all the same
    assert (bench.status, bench.error) == (Status.FAILED, "tool_change_failed")
    assert not {"X4", "X5"} & set(bench.sent)


def test_a_change_that_never_began_is_left_out_where_the_program_goes_on() -> None:
    bench = Bench([CUT, change(3, locate_after=True), REST]).begin().execute()
    bench.do(bench.runner.tool_failed("fault 7", goes_on=True))
    assert (bench.status, bench.sent) == (Status.RUNNING, ["X1", "X2", "X4", "X5"])
    assert bench.rows[3] is RowStatus.UNSENT
    assert bench.source.forgotten == 1, "what it would have set, the machine does not hold"
    assert len(bench.source.relocated) == 1
    assert bench.runner.ledger.cursor.done == 3


def test_a_change_that_failed_at_the_machine_goes_on_behind_its_block() -> None:
    bench = Bench([CUT, change(3), REST]).begin().execute()
    bench.do(bench.runner.tool_started())
    bench.execute()
    bench.do(bench.runner.tool_failed("fault 7", goes_on=True))
    assert (bench.status, bench.sent) == (Status.RUNNING, ["X1", "X2", "M6", "X4", "X5"])


def test_answers_out_of_turn_lead_to_nothing() -> None:
    bench = Bench([CUT, change(3), REST]).begin()
    bench.do(bench.runner.tool_started())
    bench.do(bench.runner.tool_changed(by_person=True))
    assert (bench.status, bench.sent) == (Status.RUNNING, ["X1", "X2"])
    bench.execute()
    bench.do(bench.runner.tool_changed(by_person=True))
    assert bench.sent == ["X1", "X2"], "a tool that is in before the M6 has begun is not this one"


def test_a_changer_that_is_late_to_begin_is_waited_for_in_sight() -> None:
    bench = Bench([CUT, change(3), REST]).begin().execute()
    bench.do(bench.runner.tool_late())
    assert (bench.status, bench.runner.tool) == (Status.WAITING, 5)
    bench.do(bench.runner.tool_started())
    assert (bench.status, bench.sent[-1]) == (Status.RUNNING, "M6")


def test_nothing_goes_out_while_the_changer_keeps_the_machine_from_moving() -> None:
    bench = Bench([CUT, batch(3, blocks=("X3", "X4")), change(5), REST]).begin()
    bench.do(bench.runner.tool_free(motion_allowed=False))
    bench.execute()
    assert bench.sent == ["X1", "X2"]
    bench.do(bench.runner.tool_free(motion_allowed=True))
    assert bench.sent[2:] == ["X3", "X4"]
    bench.do(bench.runner.tool_free(motion_allowed=False))
    bench.execute()
    assert bench.asked == [], "no change is begun either"


def test_m61_is_told_when_its_block_is_done() -> None:
    bench = Bench([batch(1, 1, blocks=("G4P0",), set_tool=9), REST]).begin()
    assert bench.asked == []
    bench.execute()
    assert bench.asked == [("set", 9)]


@pytest.mark.parametrize(
    ("said", "over", "done"),
    [
        ((("M", 8),), [("coolant", 8)], []),
        ((("M", 9),), [], [("coolant", 9)]),
        ((("M", 8), ("M", 9)), [("coolant", 8)], [("coolant", 9)]),
        ((("M", 9), ("M", 7)), [("coolant", 7)], [("coolant", -8)]),
        ((("M", 7), ("M", 8)), [("coolant", 7), ("coolant", 8)], []),
        ((("M", 9), ("M", 7), ("M", 8)), [("coolant", 7), ("coolant", 8)], []),
    ],
)
def test_coolant_is_on_before_it_is_needed_and_off_when_it_is_not(
    said: tuple[tuple[str, int], ...], over: list[tuple[str, int]], done: list[tuple[str, int]]
) -> None:
    bench = Bench([batch(1, io=said), REST]).begin()
    assert bench.asked == over
    bench.execute()
    assert bench.asked == [*over, *done]


def test_the_end_of_a_program_switches_coolant_off() -> None:
    bench = Bench([batch(1, io=(("M", 8),)), batch(3, 1, blocks=("M30",), barrier=True, ends_program=True)]).begin()
    bench.execute().execute()
    assert bench.asked == [("coolant", 8), ("coolant", 9)]


def test_a_daemon_that_finds_a_job_waiting_asks_for_its_tool_again_and_holds_it_behind() -> None:
    bench = Bench([])
    bench.do(bench.runner.adopt(Adopted(Status.WAITING, open=(), tool=5), last_life_at=0.0))
    assert (bench.asked, bench.status) == ([("again", 5)], Status.WAITING)
    bench.do(bench.runner.tool_changed(by_person=False))
    assert bench.holds == [True], "nobody may know that the machine is about to move"


def test_a_person_who_says_that_the_tool_is_in_knows_that_the_machine_moves() -> None:
    bench = Bench([])
    bench.do(bench.runner.adopt(Adopted(Status.WAITING, open=(), tool=5), last_life_at=0.0))
    bench.do(bench.runner.tool_changed(by_person=True))
    assert bench.holds == []


def test_a_job_without_a_changer_asks_nothing() -> None:
    bench = Bench([batch(1, io=(("T", 5), ("M", 8)), set_tool=3)])
    bench.runner.has_changer = False
    bench.begin().execute()
    assert bench.asked == []
