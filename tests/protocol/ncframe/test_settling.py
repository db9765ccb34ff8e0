"""A new epoch: what the count tells of the batches that were open."""

import math
from collections.abc import Sequence

import pytest

from protocol.commands import EmergencyStop, SendBatch
from protocol.engine import OpenWork
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchSent,
    Event,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    LinkReady,
    MachineRestarted,
)
from protocol.ncframe.codec import Frame
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.settling import Share, share
from tests.protocol.ncframe.scene import Scene, batch

FIRST = batch(8, "X1", "X2", "X3", end={"x": 0.006})
SECOND = batch(11, "X4", "X5", end={"x": 0.015})
BOTH = (FIRST, SECOND)
DIALECT = Dialect(check="none", poll_interval_s=0)


def settle(
    batches: Sequence[SendBatch],
    count: int,
    *,
    move_until: float = -math.inf,
    start: float = 0.0,
    executed: int | None = None,
) -> tuple[Scene, list[Event]]:
    scene = Scene(DIALECT, OpenWork(tuple(batches), {"x": start}, move_until, executed))
    scene.greet(count)
    return scene, scene.news()


@pytest.mark.parametrize(
    ("count", "shared"),
    [
        (6, None),
        (7, Share(0, 0)),
        (8, Share(0, 1)),
        (9, Share(0, 2)),
        (10, Share(1, 0)),
        (11, Share(1, 1)),
        (12, Share(2, 0)),
        (13, None),
        (0, None),
    ],
)
def test_the_count_is_shared_among_the_open_batches(count: int, shared: Share | None) -> None:
    assert share(BOTH, count) == shared


def test_over_the_wrap_of_the_count() -> None:
    last = batch(2**32, "X1", "X2")
    assert share((last,), 2**32 - 1) == Share(0, 0)
    assert share((last,), 1) == Share(1, 0)
    assert share((last,), 0) == Share(0, 1)
    assert share((last,), 2) is None


def test_a_row_that_was_never_sent_counts_for_nothing() -> None:
    """Its ID does not follow: something else went out after it was written."""
    stray = batch(9, "X4")
    assert share((FIRST, stray), 10) == Share(1, 0)
    assert share((FIRST, stray), 11) is None


@pytest.mark.parametrize(
    ("count", "done", "undone", "x"),
    [(7, (), (8, 11), 0.0), (10, (8,), (11,), 0.006), (12, (8, 11), (), 0.015)],
)
def test_whole_batches_are_done_or_undone(count: int, done: tuple[int, ...], undone: tuple[int, ...], x: float) -> None:
    scene, news = settle(BOTH, count)
    assert news == [FateUnknown((8, 11)), FateSettled(done, undone, {"x": x}), LinkReady()]
    assert scene.engine.next_id == count + 1


def test_a_half_executed_batch_goes_on_where_it_may() -> None:
    scene, news = settle(BOTH, 9, move_until=5.0)
    assert news == [FateUnknown((8, 11)), BatchSent(8, 1)]
    assert not scene.engine.free()
    scene.executes(10)
    assert scene.news() == [FateSettled((8,), (11,), {"x": 0.006}), LinkReady()]
    assert [frame.data for frame in scene.engine.recent_frames() if len(frame.data) == 4] == [Frame(x=3).to_bytes()]
    assert scene.engine.next_id == 11


def test_a_half_executed_batch_that_may_not_move_is_told_to_the_frame() -> None:
    scene, news = settle(BOTH, 9, move_until=-1.0)
    assert isinstance(news[1], BatchFailed)
    assert (news[1].reason, news[1].lines_done, news[1].lines_touched) == ("link", 2, 2)
    assert news[2:] == [FateSettled((), (11,), {"x": 0.003}), LinkReady()]
    assert scene.engine.free() == 1


@pytest.mark.parametrize("count", [0, 3])
def test_a_count_behind_is_a_restart(count: int) -> None:
    _, news = settle(BOTH, count)
    assert isinstance(news[1], MachineRestarted)
    assert news[2:] == [FateInDoubt((), (8, 11), "the machine has restarted"), LinkReady()]


def test_a_count_ahead_is_a_doubt() -> None:
    _, news = settle(BOTH, 13)
    assert isinstance(news[1], FateInDoubt)
    assert news[1].doubtful == (8, 11)


@pytest.mark.parametrize(("id", "count"), [(1, 0), (1, 1), (2, 1), (2**32, 0), (2**32, 1)])
def test_what_a_restarted_machine_could_count_as_well_proves_nothing(id: int, count: int) -> None:
    """0, and 1 where the frame on its way came behind the restart: whichever frame that was."""
    _, news = settle([batch(id, "X1", "X2", "X3")], count, move_until=5.0)
    assert isinstance(news[1], FateInDoubt)
    assert news[1].doubtful == (id,)
    assert not any(isinstance(event, MachineRestarted) for event in news)
    assert settle([batch(1, "X1", "X2")], 2)[1][1] == FateSettled((1,), (), {"x": 0.0})


def test_nothing_was_open_and_the_machine_has_executed_nothing_else() -> None:
    assert settle([], 7, executed=7)[1] == [FateSettled((), (), {"x": 0.0}), LinkReady()]


@pytest.mark.parametrize("executed", [6, None])
def test_frames_of_somebody_else_have_moved_it_meanwhile(executed: int | None) -> None:
    assert settle([], 7, executed=executed)[1] == [FateSettled((), (), {}), LinkReady()]


@pytest.mark.parametrize("executed", [7, None])
def test_nothing_was_open_and_the_machine_has_restarted(executed: int | None) -> None:
    news = settle([], 0, executed=executed)[1]
    assert isinstance(news[0], MachineRestarted)
    assert news[1:] == [FateSettled((), (), {}), LinkReady()]


def test_without_a_counter_nothing_is_known() -> None:
    dialect = Dialect(check="none", poll_interval_s=0, counter=False)
    scene = Scene(dialect, OpenWork(BOTH, {"x": 0.0}))
    news = scene.greet().news()
    assert isinstance(news[1], FateInDoubt)
    assert news[1].doubtful == (8, 11)
    assert Scene(dialect, OpenWork((), {"x": 1.0})).greet().news() == [FateSettled((), (), {"x": 1.0}), LinkReady()]


def test_the_rest_of_a_half_executed_batch_can_fail_too() -> None:
    scene, _ = settle(BOTH, 9, move_until=5.0)
    scene.wait(3.1)
    for _ in range(2):
        scene.say("ACK 0")
        scene.hush()
    news = scene.news()
    failed = next(event for event in news if isinstance(event, BatchFailed))
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("restart", 2, 3)
    assert FateSettled((), (11,), {}) in news
    assert LinkReady() in news


def test_an_emergency_stop_before_anything_is_settled() -> None:
    scene = Scene(DIALECT, OpenWork(BOTH, {"x": 0.0}))
    scene.press(EmergencyStop(1))
    scene.say("CAN")
    scene.hush()
    news = scene.news()
    assert news[1] == FateInDoubt((), (8, 11), "the emergency stop was pressed")
    assert LinkReady() in news


def test_a_can_before_anything_is_settled() -> None:
    scene = Scene(DIALECT, OpenWork(BOTH, {"x": 0.0}))
    scene.sent()
    scene.say("CAN")
    scene.hush()
    assert [type(event) for event in scene.news()] == [FateUnknown, FateInDoubt, LinkReady]


def test_done_by_the_usual_way_afterwards() -> None:
    scene, _ = settle([], 7)
    scene.batch("X1")
    scene.executes(8)
    assert scene.news()[-1] == BatchDone(8)
