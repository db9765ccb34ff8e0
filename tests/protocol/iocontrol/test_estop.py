"""The e-stop: every row of §2 about it, and that nothing but a reset leads out."""

from protocol.iocontrol.config import IoConfig
from protocol.iocontrol.estop import CHAIN_WITHIN_S
from protocol.iocontrol.events import (
    ChangeFailed,
    EStopCleared,
    EStopped,
    FaultCleared,
    FaultLatched,
    PrepareFailed,
    RequestIgnored,
    ToolChanged,
)
from protocol.iocontrol.tables import EStop
from tests.protocol.iocontrol.scene import Scene, changing, external, prepared

PREP_0 = "tool-prep-number=0, tool-prep-pocket=0, tool-prep-index=0"


def test_user_estop() -> None:
    scene = changing(external())
    scene.io.coolant(scene.tick(), flood=True)
    scene.sequence()
    scene.io.estop("user", scene.tick())
    assert scene.sequence() == (f"user-enable-out_, coolant-flood_, tool-change_, {PREP_0} | emc-reason=6, emc-abort^")
    assert scene.of(EStopped) == [EStopped("user")]
    assert scene.ends == [ChangeFailed(5, "estop", "e-stop by a user", 8)]
    assert (scene.io.prepared, scene.io.tool, scene.io.motion_allowed) == (None, 0, False)
    assert scene.io.start_refusal == "the e-stop is not reset"
    scene.io.estop("user", scene.tick())
    assert scene.sequence() == ""


def test_user_estop_clears_the_latch_and_a_fault_that_is_still_there_is_latched_again() -> None:
    scene = external()
    scene.inputs(toolchanger_fault=True, toolchanger_reason=-4)
    scene.io.estop("user", scene.tick())
    assert scene.sequence() == "user-enable-out_, toolchanger-faulted_ | emc-reason=6, emc-abort^"
    assert scene.of(FaultCleared) == [FaultCleared("estop")]
    assert scene.value("toolchanger-fault-ack") is True
    scene.inputs(emc_abort_ack=True)
    scene.io.estop_reset(scene.tick())
    assert scene.sequence().startswith("user-enable-out^, user-request-enable^, toolchanger-faulted^, emc-reason=5")
    assert scene.of(FaultLatched) == [FaultLatched(-4)]


def test_external_estop() -> None:
    scene = changing(external())
    scene.io.coolant(scene.tick(), mist=True)
    scene.sequence()
    assert scene.inputs(emc_enable_in=False) == (
        f"emc-enable-in_ | coolant-mist_, emc-reason=2, emc-abort^, tool-change_, {PREP_0}"
    )
    assert scene.of(EStopped) == [EStopped("external")]
    assert scene.ends == [ChangeFailed(5, "estop", "external e-stop", 8)]
    assert scene.value("user-enable-out") is True
    assert scene.inputs(emc_enable_in=True) == "emc-enable-in^"
    assert scene.io.estop_state is EStop.EXTERNAL  # the line's return does not switch on
    assert not scene.of(EStopCleared)


def test_a_tool_that_is_in_counts_even_with_an_estop_in_the_same_step() -> None:
    scene = changing(external())
    scene.inputs(emc_enable_in=False, tool_changed=True)
    assert scene.ends == [ToolChanged(5, 8)]
    assert scene.io.tool == 5
    assert scene.of(EStopped) == [EStopped("external")]


def test_reset() -> None:
    scene = external()
    scene.io.estop("user", scene.tick())
    scene.inputs(emc_abort_ack=True)
    scene.inputs(emc_abort_ack=False)
    scene.io.estop_reset(scene.tick())
    assert scene.sequence() == "user-enable-out^, user-request-enable^, emc-reason=5, emc-abort^"
    assert scene.of(EStopCleared) == [EStopCleared()]
    before = scene.now
    assert scene.run_timer() == "user-request-enable_"
    assert round(scene.now - before, 6) == 0.02
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"
    assert scene.io.start_refusal is None
    assert scene.io.next_timer() is None


def test_press_reset_and_the_end_of_the_pulse_are_steps_of_their_own() -> None:
    scene = Scene(IoConfig(kind="external", start_in_estop=False, ack_timeout_s=0.0))
    scene.io.coolant(scene.tick(), flood=True)
    scene.io.estop("user", scene.tick())
    scene.io.estop_reset(scene.tick())
    assert scene.run_timer() == (
        "coolant-flood^ | user-enable-out_, coolant-flood_ | emc-reason=6"
        " | user-enable-out^, user-request-enable^, emc-reason=5 | user-request-enable_"
    )


def test_reset_waits_for_the_chain() -> None:
    """An external latch closes its chain when it sees the pulse."""
    scene = external()
    scene.inputs(emc_enable_in=False)
    scene.io.estop_reset(scene.tick())
    scene.sequence()
    assert scene.io.estop_state is EStop.RESETTING
    scene.now += 0.01
    scene.io.set_inputs({"emc-enable-in": True}, scene.now)
    scene.sequence()
    assert scene.of(EStopCleared) == [EStopCleared()]
    assert scene.run_timer() == "user-request-enable_"
    assert scene.io.estop_state is EStop.ENABLED


def test_a_chain_behind_a_network_closes_after_the_pulse() -> None:
    scene = external()
    scene.inputs(emc_enable_in=False)
    scene.inputs(emc_abort_ack=True)
    scene.inputs(emc_abort_ack=False)
    scene.io.estop_reset(scene.tick())
    assert scene.run_timer() == "user-request-enable^, emc-reason=5, emc-abort^ | user-request-enable_"
    assert (scene.io.estop_state, scene.messages) == (EStop.RESETTING, [])
    scene.now += 0.5
    scene.io.set_inputs({"emc-enable-in": True}, scene.now)
    scene.inputs(emc_abort_ack=True)
    assert scene.of(EStopCleared) == [EStopCleared()]
    assert scene.io.estop_state is EStop.ENABLED
    assert scene.io.next_timer() is None


def test_reset_with_an_open_chain_stays_stopped_and_says_why() -> None:
    scene = external()
    scene.inputs(emc_enable_in=False)
    scene.io.estop_reset(scene.tick())
    began = scene.now
    scene.sequence()
    assert scene.run_timer() == "user-request-enable_"
    assert scene.io.estop_state is EStop.RESETTING
    assert scene.run_timer() == ""
    assert round(scene.now - began, 6) == CHAIN_WITHIN_S
    assert scene.io.estop_state is EStop.EXTERNAL
    assert scene.messages == ["The e-stop stays: the external chain is open (emc-enable-in is FALSE)."]
    assert scene.inputs(emc_enable_in=True) == "emc-enable-in^"
    assert scene.io.estop_state is EStop.EXTERNAL


def test_reset_while_nobody_can_say_whether_the_chain_is_closed() -> None:
    scene = Scene(IoConfig(kind="external"))
    scene.io.estop_reset(scene.tick())
    scene.sequence()
    scene.run_timer()
    assert scene.messages == [
        "The e-stop stays: whether the external chain is closed is not known: the tool changer is not connected."
    ]


def test_reset_without_an_estop_does_nothing() -> None:
    scene = changing(external())
    scene.io.estop_reset(scene.tick())
    assert scene.sequence() == ""
    assert scene.of(RequestIgnored) == [RequestIgnored("e-stop reset", "there is no e-stop")]


def test_estop_in_the_middle_of_a_reset() -> None:
    scene = external()
    scene.inputs(emc_enable_in=False)
    scene.io.estop_reset(scene.tick())
    scene.sequence()
    scene.io.estop("user", scene.tick())
    assert scene.sequence() == "user-enable-out_, user-request-enable_ | emc-reason=6"
    assert scene.io.waiting_for.deadline_at == scene.io.next_timer()  # the pulse is over, no timer of it is left
    scene.io.estop_reset(scene.tick())
    scene.io.estop("external", scene.tick())
    assert scene.io.estop_state is EStop.EXTERNAL


def test_an_estop_of_the_machine_itself_is_an_external_one() -> None:
    scene = prepared(external())
    scene.io.estop("external", scene.tick())
    assert scene.sequence() == f"emc-reason=2, emc-abort^, {PREP_0}"
    assert scene.of(EStopped) == [EStopped("external")]


def test_nothing_is_asked_of_a_changer_in_an_estop() -> None:
    scene = external()
    scene.io.estop("user", scene.tick())
    scene.inputs(emc_abort_ack=True)
    scene.io.prepare(5, scene.tick(), line=7)
    scene.io.change(scene.tick(), line=8)
    scene.io.coolant(scene.tick(), flood=True)
    assert scene.sequence() == ""
    assert [(type(end), end.cause) for end in scene.ends if isinstance(end, PrepareFailed | ChangeFailed)] == [
        (PrepareFailed, "estop"),
        (ChangeFailed, "estop"),
    ]
    assert scene.of(RequestIgnored) == [RequestIgnored("coolant", "the e-stop is not reset")]


def test_with_a_jumper_for_the_chain_a_reset_is_enough() -> None:
    scene = Scene(IoConfig(kind="loopback"))
    scene.io.estop("user", scene.tick())
    assert scene.sequence() == (
        "user-enable-out_ | emc-reason=6, emc-abort^ | emc-abort-ack^, emc-enable-in_ | emc-abort_ | emc-abort-ack_"
    )
    assert scene.of(EStopped) == [EStopped("user")]  # the jumper's opening is not a second one
    scene.io.estop_reset(scene.tick())
    assert scene.sequence() == (
        "user-enable-out^, user-request-enable^, emc-reason=5, emc-abort^"
        " | emc-abort-ack^, emc-enable-in^ | emc-abort_ | emc-abort-ack_"
    )
    assert scene.of(EStopCleared) == [EStopCleared()]


def test_version_1_stops_without_abort_pins() -> None:
    scene = changing(external(IoConfig(kind="external", protocol_version=1, start_in_estop=False)))
    scene.io.estop("user", scene.tick())
    assert scene.sequence() == f"user-enable-out_, tool-change_, {PREP_0}"
    assert [type(end) for end in scene.ends] == [ChangeFailed]


def test_an_external_changer_starts_in_an_estop_and_a_person_does_not() -> None:
    assert Scene(IoConfig(kind="external")).io.estop_state is EStop.USER
    assert Scene(IoConfig(kind="manual")).io.estop_state is EStop.ENABLED
    assert Scene(IoConfig(kind="manual", start_in_estop=True)).io.estop_state is EStop.USER
