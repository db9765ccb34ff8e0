"""Every row of the sheet about faults (§2) and what a fault means (§3), spelt out."""

import pytest

from protocol.errors import LocalError
from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.events import (
    AbortAcknowledged,
    ChangeFailed,
    FaultCleared,
    FaultLatched,
    OperatorMessage,
    PrepareFailed,
    ToolChanged,
    ToolPrepared,
)
from protocol.iocontrol.tables import State
from tests.protocol.iocontrol.scene import RANDOM, Scene, changing, external, prepared

SEEN = "toolchanger-fault-ack^, toolchanger-faulted^"
START = IoConfig(kind="external", start_in_estop=False, support_start_change=True)


def fault(scene: Scene, reason: int) -> str:
    return scene.inputs(toolchanger_fault=True, toolchanger_reason=reason)


# --- when it comes ----------------------------------------------------------------------------------------------


def test_fault_while_idle_lets_the_next_m6_abort() -> None:
    scene = prepared(external())
    assert fault(scene, -3) == f"toolchanger-fault^, toolchanger-reason=-3 | {SEEN}"
    assert scene.of(FaultLatched) == [FaultLatched(-3)]
    assert scene.io.motion_allowed
    assert scene.inputs(toolchanger_fault=False) == "toolchanger-fault_ | toolchanger-fault-ack_"
    assert scene.io.faulted
    scene.io.start_change(scene.tick(), line=8)
    assert scene.sequence() == "emc-reason=101, emc-abort^"
    assert scene.ends == [ChangeFailed(5, "fault", "toolchanger error -3", 8, reason=-3)]
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"


def test_the_abort_of_the_next_m6_is_a_step_of_its_own() -> None:
    scene = prepared(external())
    scene.io.set_inputs({"toolchanger-fault": True}, scene.tick())
    scene.io.change(scene.tick())
    assert scene.sequence() == f"toolchanger-fault^ | {SEEN} | emc-reason=101, emc-abort^"


def test_the_reason_is_latched_with_the_fault() -> None:
    scene = prepared(external())
    fault(scene, 4)
    scene.inputs(toolchanger_reason=-9)
    scene.io.change(scene.tick())
    scene.sequence()
    (end,) = scene.ends
    assert isinstance(end, ChangeFailed)
    assert (end.reason, end.goes_on) == (4, True)


def test_fault_while_preparing_leaves_the_request_up() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick())
    scene.sequence()
    assert fault(scene, -1) == f"toolchanger-fault^, toolchanger-reason=-1 | {SEEN}"
    assert scene.value("tool-prepare") is True
    assert scene.inputs(tool_prepared=True) == "tool-prepared^ | tool-prepare_"
    assert [type(end) for end in scene.ends] == [ToolPrepared]
    scene.io.change(scene.tick())
    assert scene.sequence() == "emc-reason=101, emc-abort^"


def test_an_m6_aborts_a_prepare_that_a_fault_has_stopped() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick(), line=7)
    fault(scene, -1)
    scene.io.change(scene.tick(), line=8)
    assert scene.sequence() == "tool-prepare_, emc-reason=101, emc-abort^"
    assert [(type(end), end.line) for end in scene.ends if isinstance(end, PrepareFailed | ChangeFailed)] == [
        (PrepareFailed, 7),
        (ChangeFailed, 8),
    ]


def test_a_prepare_that_cannot_finish_is_aborted_at_its_timeout() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick(), line=7)
    fault(scene, -1)
    assert scene.run_timer() == "tool-prepare_, emc-reason=101, emc-abort^"
    assert scene.ends == [PrepareFailed(5, "fault", "toolchanger error -1", 7, reason=-1)]
    assert scene.messages == ["toolchanger error -1"]


def test_a_fault_after_the_timeout_aborts_at_once() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick())
    scene.sequence()
    assert scene.run_timer() == ""
    assert scene.io.waiting_for.overdue
    assert (
        fault(scene, 6)
        == f"toolchanger-fault^, toolchanger-reason=6 | {SEEN}, tool-prepare_, emc-reason=101, emc-abort^"
    )
    (end,) = scene.ends
    assert isinstance(end, PrepareFailed)
    assert end.goes_on


def test_fault_while_changing_is_one_step() -> None:
    scene = changing(external())
    assert fault(scene, -2) == (
        f"toolchanger-fault^, toolchanger-reason=-2 | {SEEN}, tool-change_, emc-reason=101, emc-abort^"
    )
    assert scene.io.state is State.ABORTING
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"
    assert scene.of(AbortAcknowledged) == [AbortAcknowledged(101)]
    assert (scene.value("tool-prep-number"), scene.value("tool-number")) == (5, 0)


def test_fault_before_the_changer_is_ready() -> None:
    scene = prepared(external(START))
    scene.io.start_change(scene.tick())
    scene.sequence()
    assert fault(scene, -2).endswith(f"{SEEN}, start-change_, emc-reason=101, emc-abort^")


def test_fault_on_the_way_to_the_change_position_ends_the_m6() -> None:
    scene = prepared(external())
    scene.io.start_change(scene.tick())
    scene.sequence()
    assert fault(scene, -2).endswith(f"{SEEN}, emc-reason=101, emc-abort^")
    assert [type(end) for end in scene.ends] == [ChangeFailed]


def test_101_stays_until_it_is_acknowledged() -> None:
    scene = changing(external())
    fault(scene, -2)
    scene.io.abort(AbortReason.MOTION_OR_IO_ERROR, scene.tick())
    assert scene.sequence() == ""
    assert scene.value("emc-reason") == 101
    scene.inputs(emc_abort_ack=True)
    scene.io.abort(AbortReason.MOTION_OR_IO_ERROR, scene.tick())
    assert scene.sequence() == "emc-reason=3, emc-abort^ | emc-abort_"


# --- fault and changed in the same step -------------------------------------------------------------------------


def in_doubt(reason: int = 4) -> Scene:
    scene = changing(external())
    sequence = scene.inputs(toolchanger_fault=True, toolchanger_reason=reason, tool_changed=True)
    assert sequence == (
        f"toolchanger-fault^, toolchanger-reason={reason}, tool-changed^"
        f" | {SEEN}, tool-change_, tool-number=-1, emc-reason=101, emc-abort^"
    )
    return scene


def test_who_says_both_is_not_believed_and_the_job_waits_for_a_person() -> None:
    scene = in_doubt()
    assert (scene.io.tool, scene.ends) == (None, [])
    assert "look into the spindle" in scene.messages[0]
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"
    assert (scene.io.state, scene.io.waiting_for.what, scene.value("state")) == (State.DOUBTING, "verdict", 3)
    assert scene.io.next_timer() is None
    assert not scene.io.motion_allowed
    assert scene.io.start_refusal == "it is not known which tool is in the spindle"
    scene.io.confirm(scene.tick())
    assert scene.sequence() == "tool-number=5, tool-prep-number=0, tool-prep-pocket=0, tool-prep-index=0"
    assert scene.ends == [ToolChanged(5, 8)]
    assert (scene.io.tool, scene.io.state) == (5, State.IDLE)


def test_the_person_may_answer_before_the_acknowledgement() -> None:
    scene = in_doubt()
    scene.io.confirm(scene.tick())
    scene.sequence()
    assert scene.ends == [ToolChanged(5, 8)]
    assert scene.io.state is State.ABORTING
    scene.inputs(emc_abort_ack=True)
    assert scene.io.state is State.IDLE


def test_the_person_may_say_that_it_failed_and_then_which_tool_it_is() -> None:
    scene = in_doubt()
    scene.inputs(emc_abort_ack=True)
    scene.io.fail(scene.tick())
    scene.sequence()
    (end,) = scene.ends
    assert isinstance(end, ChangeFailed)
    assert (end.cause, end.number, end.goes_on) == ("operator", 5, False)
    assert (scene.io.tool, scene.io.prepared) == (None, None)
    assert scene.io.start_refusal == "it is not known which tool is in the spindle"
    scene.io.set_tool(7, scene.tick())
    assert scene.io.tool == 7
    assert scene.io.start_refusal is None


def test_an_abort_ends_the_doubt_but_not_the_ignorance() -> None:
    scene = in_doubt()
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.sequence()
    assert [type(end) for end in scene.ends] == [ChangeFailed]
    assert scene.io.tool is None
    assert not scene.io.may_fail


def test_a_random_changer_exchanges_its_pockets_only_with_the_verdict() -> None:
    scene = changing(external(table=RANDOM))
    scene.inputs(toolchanger_fault=True, tool_changed=True, emc_abort_ack=True)
    assert scene.io.tool_table == RANDOM
    scene.io.confirm(scene.tick())
    assert scene.io.tool_table is not None
    assert scene.io.tool_table.in_spindle == 5


# --- what it means (§3) -----------------------------------------------------------------------------------------


def test_a_reason_above_0_lets_the_program_go_on_with_the_old_tool() -> None:
    scene = changing(external(tool=1))
    scene.io.coolant(scene.tick(), flood=True)
    fault(scene, 7)
    message = "toolchanger error 7: the tool was not changed, the program goes on with tool 1"
    assert scene.ends == [ChangeFailed(5, "fault", message, 8, reason=7, goes_on=True)]
    assert scene.of(OperatorMessage) == [OperatorMessage(message, "notice")]
    assert scene.io.parameters == {5060: 1.0, 5600: 1.0, 5601: 7.0}
    assert (scene.io.tool, scene.value("coolant-flood")) == (1, True)
    assert not scene.io.motion_allowed  # not before the changer knows
    scene.inputs(emc_abort_ack=True)
    assert scene.io.motion_allowed


def test_a_t_behind_the_m6_is_still_wanted_by_a_program_that_goes_on() -> None:
    scene = changing(external())
    scene.io.prepare(7, scene.tick())
    fault(scene, 7)
    assert [type(end) for end in scene.ends] == [ChangeFailed]
    assert scene.inputs(emc_abort_ack=True).endswith(
        "emc-abort_ | tool-prep-number=7, tool-prep-pocket=3, tool-prep-index=3, tool-prepare^"
    )


def test_a_reason_of_0_aborts_without_a_message() -> None:
    scene = changing(external())
    fault(scene, 0)
    assert scene.ends == [ChangeFailed(5, "fault", "toolchanger error 0", 8, reason=0)]
    assert scene.messages == []
    assert scene.io.parameters == {5060: 1.0, 5600: 1.0, 5601: 0.0}


def test_a_reason_below_0_aborts_with_a_message_from_the_template() -> None:
    scene = changing(external(IoConfig(kind="external", start_in_estop=False, io_error="100%% sure: fault %d")))
    scene.io.coolant(scene.tick(), flood=True)
    scene.io.prepare(7, scene.tick())
    fault(scene, -7)
    assert scene.of(OperatorMessage) == [OperatorMessage("100% sure: fault -7", "error")]
    assert [(type(end), end.goes_on) for end in scene.ends if isinstance(end, ChangeFailed | PrepareFailed)] == [
        (ChangeFailed, False),
        (PrepareFailed, False),
    ]
    assert scene.io.parameters == {5060: 1.0, 5600: 1.0, 5601: -7.0}
    assert scene.value("coolant-flood") is False


# --- the latch --------------------------------------------------------------------------------------------------


def test_the_latch_is_cleared_only_while_the_fault_line_is_false() -> None:
    scene = external()
    fault(scene, 7)
    assert scene.inputs(toolchanger_clear_fault=True) == "toolchanger-clear-fault^"
    assert scene.io.faulted
    assert scene.inputs(toolchanger_fault=False) == "toolchanger-fault_ | toolchanger-fault-ack_ | toolchanger-faulted_"
    assert scene.of(FaultCleared) == [FaultCleared("pin")]
    assert scene.io.parameters == {5060: 0.0, 5600: 0.0, 5601: 0.0}


def test_a_person_clears_it_under_the_same_rule() -> None:
    scene = external()
    fault(scene, 7)
    assert not scene.io.may_clear_fault
    with pytest.raises(LocalError, match="still has it"):
        scene.io.clear_fault(scene.tick())
    scene.inputs(toolchanger_fault=False)
    scene.io.clear_fault(scene.tick())
    assert scene.sequence() == "toolchanger-faulted_"
    assert scene.of(FaultCleared) == [FaultCleared("operator")]
    with pytest.raises(LocalError):
        scene.io.clear_fault(scene.tick())


def test_an_m6_goes_again_after_the_latch_is_cleared() -> None:
    scene = prepared(external())
    fault(scene, 7)
    scene.inputs(toolchanger_fault=False, toolchanger_clear_fault=True)
    scene.io.change(scene.tick())
    assert scene.sequence() == "tool-change^"


def test_a_second_fault_is_latched_with_its_own_reason() -> None:
    scene = external()
    fault(scene, 7)
    scene.inputs(toolchanger_fault=False)
    assert fault(scene, -8) == "toolchanger-fault^, toolchanger-reason=-8 | toolchanger-fault-ack^"
    assert scene.of(FaultLatched) == [FaultLatched(-8)]
    assert scene.io.parameters[5601] == -8.0


def test_a_fault_while_an_abort_waits_is_latched_and_nothing_else() -> None:
    scene = external()
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.sequence()
    assert fault(scene, 7).endswith(SEEN)
    assert scene.value("emc-reason") == 100
