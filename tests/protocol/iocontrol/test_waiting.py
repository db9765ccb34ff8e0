"""No handshake waits for ever unseen: timeouts, what people are told, and what they may answer (§2)."""

import pytest

from protocol.errors import LocalError
from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.events import ChangeFailed, PrepareFailed, ToolChanged, ToolPrepared, Transition, WaitingFor
from protocol.iocontrol.tables import State
from tests.protocol.iocontrol.scene import Scene, changing, external, prepared

TIMES = IoConfig(
    kind="external",
    start_in_estop=False,
    support_start_change=True,
    prepare_timeout_s=10.0,
    change_timeout_s=20.0,
    ack_timeout_s=3.0,
)
NEVER = IoConfig(kind="external", start_in_estop=False, prepare_timeout_s=0.0, change_timeout_s=0.0, ack_timeout_s=0.0)


def preparing() -> Scene:
    scene = external(TIMES)
    scene.io.prepare(5, scene.tick(), line=7)
    return scene


def starting() -> Scene:
    scene = prepared(external(TIMES))
    scene.io.start_change(scene.tick(), line=8)
    return scene


def loading() -> Scene:
    scene = starting()
    scene.inputs(start_change_ack=True)
    scene.io.change(scene.tick())
    return scene


def aborting() -> Scene:
    scene = external(TIMES)
    scene.io.abort(AbortReason.USER, scene.tick())
    return scene


WAITS = [
    (preparing, "tool-prepared", 10.0, "has not prepared tool 5 in time"),
    (starting, "start-change-ack", 3.0, "does not let the change to tool 5 begin"),
    (loading, "tool-changed", 20.0, "has not put tool 5 in in time"),
    (aborting, "emc-abort-ack", 3.0, "has not acknowledged the abort in time"),
]


@pytest.mark.parametrize(("make", "what", "seconds", "text"), WAITS)
def test_a_late_changer_is_told_and_the_request_stays(make: object, what: str, seconds: float, text: str) -> None:
    scene: Scene = make()  # type: ignore[operator]
    scene.sequence()
    begun = scene.now
    state = scene.io.state
    assert scene.io.waiting_for.what == what
    assert scene.io.waiting_for.deadline_at == pytest.approx(begun + seconds)
    assert not scene.io.may_confirm
    with pytest.raises(LocalError):
        scene.io.confirm(scene.tick(0.0))
    scene.io.handle_timer(begun + seconds - 0.001)
    assert scene.sequence() == ""
    assert scene.messages == []
    assert scene.run_timer() == ""  # no pin moves: nothing is guessed
    assert text in scene.messages[0]
    assert [(e.region, e.before, e.after) for e in scene.of(Transition)] == [("waiting", "on_time", "waiting")]
    assert [(e.what, e.overdue) for e in scene.of(WaitingFor)] == [(what, True)]
    assert scene.io.state is state
    assert scene.io.next_timer() is None
    assert scene.io.may_confirm


@pytest.mark.parametrize(("make", "what", "seconds", "text"), WAITS)
def test_a_late_answer_still_counts(make: object, what: str, seconds: float, text: str) -> None:
    scene: Scene = make()  # type: ignore[operator]
    state = scene.io.state
    scene.run_timer()
    scene.inputs(**{what.replace("-", "_"): True})
    assert scene.io.state is not state
    assert not scene.io.waiting_for.overdue
    assert ("waiting", "on_time") in [(e.before, e.after) for e in scene.of(Transition) if e.region == "waiting"]


@pytest.mark.parametrize(
    ("make", "sequence"),
    [
        (preparing, "tool-prepare_"),
        (starting, "start-change_"),
        (loading, "tool-change_, tool-number=5, tool-prep-number=0, tool-prep-pocket=0, tool-prep-index=0"),
        (aborting, "emc-abort_"),
    ],
)
def test_a_person_may_answer_for_a_late_changer(make: object, sequence: str) -> None:
    scene: Scene = make()  # type: ignore[operator]
    scene.run_timer()
    scene.io.confirm(scene.tick())
    assert scene.sequence() == sequence
    assert not scene.io.waiting_for.overdue


@pytest.mark.parametrize(
    ("make", "pin", "end"),
    [
        (preparing, "tool-prepare", PrepareFailed(5, "operator", "empty pocket", 7)),
        (starting, "start-change", ChangeFailed(5, "operator", "empty pocket", 8)),
        (loading, "tool-change", ChangeFailed(5, "operator", "empty pocket", 8)),
    ],
)
def test_a_person_may_give_it_up_at_any_time(make: object, pin: str, end: object) -> None:
    scene: Scene = make()  # type: ignore[operator]
    scene.sequence()
    scene.io.fail(scene.tick(), message="empty pocket")
    assert scene.sequence() == f"emc-reason=100, emc-abort^, {pin}_"
    assert scene.ends == [end]


def test_nothing_to_give_up() -> None:
    scene = external()
    assert not scene.io.may_fail
    with pytest.raises(LocalError):
        scene.io.fail(scene.tick())


def test_without_timeouts_everything_is_visible_and_a_person_may_answer_at_once() -> None:
    scene = external(NEVER)
    scene.io.prepare(5, scene.tick())
    assert scene.io.next_timer() is None
    assert scene.io.waiting_for == WaitingFor("tool-prepared", 5, scene.now, None)
    scene.io.confirm(scene.tick())
    scene.io.change(scene.tick())
    assert scene.io.waiting_for.what == "tool-changed"
    scene.io.confirm(scene.tick())
    scene.sequence()
    assert [type(end) for end in scene.ends] == [ToolPrepared, ToolChanged]
    scene.io.abort(AbortReason.USER, scene.tick())
    assert scene.io.waiting_for.what == "emc-abort-ack"
    scene.io.confirm(scene.tick())
    assert scene.io.state is State.IDLE


def test_a_person_who_changes_tools_is_reminded() -> None:
    scene = Scene(IoConfig(kind="manual", change_timeout_s=60.0))
    scene.io.prepare(5, scene.tick())
    scene.io.change(scene.tick())
    scene.sequence()
    scene.run_timer()
    assert scene.messages == ["Tool 5 is still waited for."]
    scene.io.confirm(scene.tick())
    assert scene.io.tool == 5


def test_the_moves_to_the_change_position_are_visible_and_have_no_timeout_here() -> None:
    scene = prepared(external())
    scene.io.start_change(scene.tick())
    assert scene.io.waiting_for == WaitingFor("position", 5, scene.now, None)
    assert scene.io.next_timer() is None
    assert not scene.io.may_confirm


def test_an_aborted_change_that_was_late_is_not_late_any_more() -> None:
    scene = changing(external(TIMES.__class__(kind="external", start_in_estop=False)))
    scene.run_timer()
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.sequence()
    assert (scene.io.waiting_for.what, scene.io.waiting_for.overdue) == ("emc-abort-ack", False)


def test_what_is_waited_for_is_told_once_for_each_change() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick())
    scene.sequence()
    assert [event.what for event in scene.of(WaitingFor)] == ["tool-prepared"]
    scene.inputs(toolchanger_reason=3)
    assert scene.of(WaitingFor) == []
    scene.inputs(tool_prepared=True)
    assert scene.of(WaitingFor) == [WaitingFor(None)]
