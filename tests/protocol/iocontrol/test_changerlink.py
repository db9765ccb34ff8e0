"""The connection of an external changer: absent, lost, back again (§2)."""

import pytest

from protocol.errors import LocalError
from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.events import ChangeFailed, FaultLatched, OperatorMessage, PrepareFailed, Snapshot, WaitingFor
from protocol.iocontrol.pins import PinError
from protocol.iocontrol.tables import State
from tests.protocol.iocontrol.scene import CLOSED, Scene, changing, external, prepared

LOST = "toolchanger error -1000: its connection is lost"


def lose(scene: Scene) -> str:
    scene.io.disconnect(scene.tick())
    return scene.sequence()


def test_lost_while_idle_latches_a_fault_and_says_so_once() -> None:
    scene = prepared(external())
    assert lose(scene) == "toolchanger-faulted^"
    assert scene.of(FaultLatched) == [FaultLatched(-1000)]
    assert scene.of(OperatorMessage) == [OperatorMessage(LOST, "error")]
    assert scene.io.start_refusal == "the tool changer is not connected"
    assert (scene.io.waiting_for.what, scene.io.waiting_for.overdue) == ("connection", True)
    assert lose(scene) == ""
    assert scene.messages == []


def test_lost_while_idle_lets_the_next_m6_abort() -> None:
    scene = prepared(external())
    lose(scene)
    scene.io.start_change(scene.tick(), line=8)
    assert scene.sequence() == "emc-reason=101, emc-abort^"
    assert scene.ends == [ChangeFailed(5, "lost", LOST, 8, reason=-1000)]
    assert scene.io.next_timer() is None  # nobody is there who could acknowledge it, and people know


def test_lost_while_preparing_aborts_it() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick(), line=7)
    scene.sequence()
    assert lose(scene) == "toolchanger-faulted^, tool-prepare_, emc-reason=101, emc-abort^"
    assert scene.ends == [PrepareFailed(5, "lost", LOST, 7, reason=-1000)]
    assert scene.io.tool == 0


def test_lost_while_changing_leaves_nobody_who_knows_the_tool() -> None:
    scene = changing(external(tool=1))
    assert lose(scene) == "toolchanger-faulted^, tool-change_, tool-number=-1, emc-reason=101, emc-abort^"
    assert scene.ends == [ChangeFailed(5, "lost", LOST, 8, reason=-1000)]
    assert scene.messages == [LOST]
    assert (scene.io.tool, scene.io.prepared) == (None, None)


def test_lost_before_tool_change_leaves_the_tool_known() -> None:
    scene = prepared(external(tool=1))
    scene.io.start_change(scene.tick())
    scene.sequence()
    assert lose(scene) == "toolchanger-faulted^, emc-reason=101, emc-abort^"
    assert (scene.io.tool, [type(end) for end in scene.ends]) == (1, [ChangeFailed])


def test_inputs_of_a_changer_that_is_gone_are_not_believed() -> None:
    scene = external()
    lose(scene)
    assert {pin.name for pin in scene.io.pins() if not pin.valid} == scene.io.drivable
    scene.io.estop("user", scene.tick())
    scene.io.estop_reset(scene.tick())
    scene.sequence()
    assert scene.io.estop_state.name == "RESETTING"  # emc-enable-in was TRUE when it went


def test_back_again_all_pins_are_told_and_the_start_is_acknowledged_again() -> None:
    scene = external()
    lose(scene)
    scene.io.connect(CLOSED, scene.tick())
    assert scene.sequence() == "emc-abort^"  # the reason is 7 since the start
    (snapshot,) = scene.of(Snapshot)
    assert len(snapshot.pins) == 24
    assert (snapshot.pins["emc-abort"], snapshot.pins["emc-reason"]) == (True, 7)
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"
    assert scene.io.faulted  # people clear it, when they have looked
    scene.io.clear_fault(scene.tick())
    assert scene.io.start_refusal is None


def test_a_job_that_cuts_meanwhile_is_left_alone() -> None:
    scene = external()
    scene.io.coolant(scene.tick(), flood=True)
    lose(scene)
    assert scene.io.motion_allowed
    scene.io.prepare(5, scene.tick())
    scene.io.connect(CLOSED, scene.tick())
    assert scene.sequence() == "emc-abort^"
    assert (scene.ends, scene.io.motion_allowed, scene.value("coolant-flood")) == ([], True, True)
    assert scene.io.start_refusal is not None
    assert scene.inputs(emc_abort_ack=True).endswith(
        "emc-abort_ | tool-prep-number=5, tool-prep-pocket=12, tool-prep-index=2, tool-prepare^"
    )


def test_the_latch_of_a_lost_connection_cannot_be_cleared_before_it_is_back() -> None:
    scene = external()
    lose(scene)
    assert not scene.io.may_clear_fault
    with pytest.raises(LocalError):
        scene.io.clear_fault(scene.tick())


def test_back_again_in_the_middle_of_an_abort_its_reason_stays_and_time_begins_anew() -> None:
    scene = changing(external())
    lose(scene)
    scene.tick(1000.0)
    scene.io.connect({**CLOSED, "tool-changed": True}, scene.tick())
    assert scene.sequence() == "tool-changed^"
    assert scene.io.tool is None
    assert scene.io.next_timer() == pytest.approx(scene.now + 5.0)
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"


def test_an_open_chain_of_a_changer_that_is_back_is_an_estop() -> None:
    scene = external()
    lose(scene)
    scene.io.connect({}, scene.tick())
    assert scene.sequence().startswith("emc-enable-in_ | emc-abort^ | emc-reason=2")
    assert scene.io.estop_state.name == "EXTERNAL"


def test_a_second_connection_takes_the_place_of_the_first() -> None:
    scene = changing(external())
    scene.io.connect(CLOSED, scene.tick())
    scene.sequence()
    assert [(end.cause) for end in scene.ends if isinstance(end, ChangeFailed)] == ["lost"]
    assert scene.io.connected


def test_a_changer_that_never_connects_is_seen() -> None:
    scene = Scene(IoConfig(kind="external", ack_timeout_s=5.0, start_in_estop=False))
    assert scene.io.waiting_for == WaitingFor("connection", None, 100.0, 105.0)
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == ""
    assert scene.io.waiting_for.what == "connection"
    scene.run_timer()
    assert scene.messages == ["The tool changer has not connected."]
    assert scene.io.waiting_for.overdue
    assert scene.io.next_timer() is None
    scene.io.connect(CLOSED, scene.tick())
    assert scene.inputs(emc_abort_ack=True).endswith("tool-prepare^")
    assert not scene.io.waiting_for.overdue


def test_without_a_timeout_it_is_seen_all_the_same() -> None:
    scene = Scene(IoConfig(kind="external", ack_timeout_s=0.0))
    assert scene.io.next_timer() is None
    assert scene.io.waiting_for.what == "connection"


def test_over_plain_http_the_first_level_is_the_connection() -> None:
    scene = Scene(IoConfig(kind="external", start_in_estop=False))
    assert scene.inputs(emc_enable_in=True) == "emc-enable-in^"
    assert scene.io.connected
    assert len(scene.of(Snapshot)) == 1


def test_single_levels_of_a_changer_that_was_lost_are_refused() -> None:
    scene = external()
    lose(scene)
    with pytest.raises(PinError, match="connected again"):
        scene.inputs(tool_changed=True)


def test_version_1_drops_what_is_pending_and_has_no_latch() -> None:
    scene = changing(external(IoConfig(kind="external", protocol_version=1, start_in_estop=False)))
    assert lose(scene) == "tool-change_, tool-number=-1"
    assert [end.cause for end in scene.ends if isinstance(end, ChangeFailed)] == ["lost"]
    assert (scene.io.faulted, scene.io.state) == (False, State.IDLE)
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == ""
    scene.io.connect(CLOSED, scene.tick())
    assert scene.sequence().endswith("tool-prepare^")


def test_only_an_external_changer_connects() -> None:
    scene = Scene(IoConfig(kind="manual"))
    with pytest.raises(LocalError, match="does not connect"):
        scene.io.connect({}, scene.tick())
    assert lose(scene) == ""


def test_an_abort_while_it_is_gone_keeps_nobody_waiting_unseen() -> None:
    scene = external()
    lose(scene)
    scene.io.abort(AbortReason.USER, scene.tick())
    assert scene.sequence() == "emc-reason=100, emc-abort^"
    assert scene.io.waiting_for.what == "connection"
    assert scene.io.next_timer() is None


@pytest.mark.parametrize(
    ("pins", "text"),
    [
        ({"tool-changed": True, "tool-number": 3}, "is an output"),
        ({"tool-changed": 1}, "is a bit"),
        ({"toolchanger-reason": True}, "whole number"),
        ({"toolchanger-reason": 2**31}, "whole number"),
        ({"toolchanger-reason": 0.5}, "whole number"),
        ({"x" * 500: True}, "no pin"),
        ({"tool-changed": None}, "is a bit"),
    ],
)
def test_a_pin_that_is_not_to_be_driven_is_refused_and_nothing_counts(pins: dict[str, object], text: str) -> None:
    scene = changing(external())
    with pytest.raises(PinError, match=text) as raised:
        scene.io.set_inputs(pins, scene.tick())
    assert len(str(raised.value)) < 150
    assert scene.sequence() == ""
    assert scene.io.state is State.CHANGING


def test_a_wired_pin_is_not_driven_from_outside() -> None:
    scene = Scene(IoConfig(kind="external", jumpers=frozenset({"emc-abort-ack", "emc-enable-in"})))
    assert {"emc-abort-ack", "emc-enable-in"}.isdisjoint(scene.io.drivable)
    with pytest.raises(PinError, match="wired to emc-abort"):
        scene.io.set_inputs({"emc-abort-ack": True}, scene.tick())
    with pytest.raises(PinError, match="version 1"):
        Scene(IoConfig(kind="external", protocol_version=1)).io.set_inputs({"emc-abort-ack": True}, 200.0)
