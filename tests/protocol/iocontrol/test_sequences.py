"""Every row of the sheet's order of events (§2), spelt out; faults are in test_faults.py, e-stops in test_estop.py."""

import pytest

from protocol.errors import LocalError
from protocol.iocontrol.config import AbortReason, IoConfig
from protocol.iocontrol.events import (
    AbortAcknowledged,
    AnswerIgnored,
    ChangeFailed,
    ChangeStarted,
    PinChanged,
    PrepareFailed,
    SetToolFailed,
    TableChanged,
    ToolChanged,
    ToolPrepared,
    ToolSet,
    Transition,
)
from protocol.iocontrol.tables import State
from protocol.iocontrol.tooltable import parse
from tests.protocol.iocontrol.scene import RANDOM, TABLE, Scene, changing, external, notation, prepared

PREP_5 = "tool-prep-number=5, tool-prep-pocket=12, tool-prep-index=2, tool-prepare^"
PREP_0 = "tool-prep-number=0, tool-prep-pocket=0, tool-prep-index=0"
DONE_5 = f"tool-change_, tool-number=5, {PREP_0}"
START = IoConfig(kind="external", start_in_estop=False, support_start_change=True)


# --- prepare ----------------------------------------------------------------------------------------------------


def test_prepare() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick(), line=7)
    assert scene.sequence() == PREP_5
    assert scene.value("state") == 1
    assert scene.inputs(tool_prepared=True) == "tool-prepared^ | tool-prepare_"
    assert scene.ends == [ToolPrepared(number=5, pocket=12, index=2, line=7)]
    assert scene.value("state") == 0
    assert scene.inputs(tool_prepared=False) == "tool-prepared_"


def test_a_stuck_line_completes_its_request_at_once() -> None:
    scene = external(tool_prepared=True, tool_changed=True)
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == f"{PREP_5} | tool-prepare_"
    scene.io.change(scene.tick())
    assert scene.sequence() == f"tool-change^ | {DONE_5}"
    assert scene.io.tool == 5
    assert "was TRUE before it was asked for" in scene.messages[0]


def test_a_tool_that_is_not_in_the_table_ends_the_program_with_the_line() -> None:
    scene = external()
    scene.io.prepare(6, scene.tick(), line=7)
    assert scene.sequence() == "emc-reason=1, emc-abort^"
    assert scene.ends == [PrepareFailed(6, "unknown_tool", "line 7: tool 6 is not in the tool table", 7)]


def test_a_second_t_waits_its_turn_and_a_third_takes_its_place() -> None:
    scene = external()
    for number in (5, 1, 7):
        scene.io.prepare(number, scene.tick())
    assert scene.sequence() == PREP_5
    assert scene.ends == [PrepareFailed(1, "superseded", "T7 came before T1 was begun", None, goes_on=True)]
    second = "tool-prep-number=7, tool-prep-pocket=3, tool-prep-index=3, tool-prepare^ | tool-prepare_"
    assert scene.inputs(tool_prepared=True) == f"tool-prepared^ | tool-prepare_ | {second}"
    assert scene.io.prepared == 7


# --- change -----------------------------------------------------------------------------------------------------


def test_change() -> None:
    scene = prepared(external())
    scene.io.change(scene.tick(), line=8)
    assert scene.sequence() == "tool-change^"
    assert scene.value("state") == 3
    assert not scene.io.motion_allowed
    assert scene.inputs(tool_changed=True) == f"tool-changed^ | {DONE_5}"
    assert (scene.ends, scene.messages) == ([ToolChanged(5, 8)], [])
    assert scene.io.motion_allowed
    assert scene.inputs(tool_changed=False) == "tool-changed_"
    assert not scene.of(AnswerIgnored)


def test_change_with_start_change_comes_before_everything_that_moves() -> None:
    scene = prepared(external(START))
    scene.io.start_change(scene.tick(), line=8)
    assert scene.sequence() == "start-change^"
    assert scene.value("state") == 2
    assert (scene.io.motion_allowed, scene.io.change_moves_allowed) == (False, False)
    assert scene.inputs(start_change_ack=True) == "start-change-ack^ | start-change_"
    assert scene.of(ChangeStarted) == [ChangeStarted(5, 8)]
    assert (scene.io.motion_allowed, scene.io.change_moves_allowed) == (False, True)
    assert scene.inputs(start_change_ack=False) == "start-change-ack_"
    scene.io.change(scene.tick())
    assert scene.sequence() == "tool-change^"
    assert (scene.io.motion_allowed, scene.io.change_moves_allowed) == (False, False)
    assert scene.inputs(tool_changed=True) == f"tool-changed^ | {DONE_5}"
    assert scene.ends == [ToolChanged(5, 8)]


def test_an_unasked_change_makes_its_start_change_first() -> None:
    """A program on the machine's own card says TOOL when it stands there already."""
    scene = prepared(external(START))
    scene.io.change(scene.tick())
    assert scene.sequence() == "start-change^"
    assert scene.inputs(start_change_ack=True) == "start-change-ack^ | start-change_ | tool-change^"
    assert not scene.of(ChangeStarted)


def test_the_machine_may_arrive_before_the_changer_is_ready() -> None:
    scene = prepared(external(START))
    scene.io.start_change(scene.tick())
    scene.io.change(scene.tick())
    assert scene.sequence() == "start-change^"
    assert scene.inputs(start_change_ack=True) == "start-change-ack^ | start-change_ | tool-change^"


def test_without_the_option_start_change_stays_low_and_its_ack_is_ignored() -> None:
    scene = prepared(external())
    scene.io.start_change(scene.tick(), line=8)
    assert scene.sequence() == ""
    assert scene.of(ChangeStarted) == [ChangeStarted(5, 8)]
    assert scene.inputs(start_change_ack=True) == "start-change-ack^"
    assert [event.pin for event in scene.of(AnswerIgnored)] == ["start-change-ack"]
    assert scene.io.state is State.MOVING


def test_an_m6_waits_for_the_t_before_it() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick())
    scene.io.start_change(scene.tick())
    assert scene.sequence() == PREP_5
    assert not scene.io.motion_allowed
    assert scene.inputs(tool_prepared=True) == "tool-prepared^ | tool-prepare_"
    assert [type(event) for event in scene.taken if isinstance(event, ToolPrepared | ChangeStarted)] == [
        ToolPrepared,
        ChangeStarted,
    ]


def test_each_request_is_a_step_of_its_own() -> None:
    scene = external(START)
    scene.io.prepare(5, scene.tick())
    scene.io.start_change(scene.tick())
    scene.sequence()
    assert scene.inputs(tool_prepared=True) == "tool-prepared^ | tool-prepare_ | start-change^"


def test_a_t_behind_an_m6_waits_until_it_is_over() -> None:
    scene = changing(external())
    scene.io.prepare(7, scene.tick())
    assert scene.sequence() == ""
    second = "tool-prep-number=7, tool-prep-pocket=3, tool-prep-index=3, tool-prepare^"
    assert scene.inputs(tool_changed=True) == f"tool-changed^ | {DONE_5} | {second}"


def test_a_second_m6_in_the_middle_of_one_is_a_fault_of_the_caller() -> None:
    scene = changing(external())
    with pytest.raises(LocalError, match="pending"):
        scene.io.change(scene.tick())
    with pytest.raises(LocalError, match="pending"):
        scene.io.start_change(scene.tick())
    assert scene.io.start_refusal == "a tool change is pending"
    assert scene.inputs(tool_changed=True).endswith(DONE_5)


def test_the_tool_that_is_in_the_spindle_is_prepared_and_not_changed() -> None:
    scene = external(tool=5)
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == PREP_5
    scene.inputs(tool_prepared=True)
    assert not scene.io.change_needed
    scene.io.change(scene.tick(), line=8)
    assert scene.sequence() == PREP_0
    assert scene.ends == [ToolChanged(5, 8, skipped=True)]
    assert scene.io.motion_allowed


def test_a_tool_that_is_not_known_is_always_changed() -> None:
    scene = prepared(external(tool=None))
    assert scene.value("tool-number") == -1
    assert scene.io.change_needed
    scene.io.change(scene.tick())
    assert scene.sequence() == "tool-change^"


def test_m6_without_t_names_the_line_and_nothing_moves() -> None:
    scene = external()
    scene.io.start_change(scene.tick(), line=8)
    assert scene.sequence() == "emc-reason=1, emc-abort^"
    (end,) = scene.ends
    assert isinstance(end, ChangeFailed)
    assert (end.cause, end.line, end.goes_on) == ("not_prepared", 8, False)
    assert end.message.startswith("line 8: M6 without")


def test_m6_after_a_t_that_was_aborted_is_an_m6_without_t() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick())
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.inputs(emc_abort_ack=True)
    scene.io.change(scene.tick())
    scene.sequence()
    assert [end.cause for end in scene.ends if isinstance(end, ChangeFailed)] == ["not_prepared"]


def test_a_t_that_came_to_nothing_leaves_no_earlier_one_prepared() -> None:
    scene = prepared(external(), 7)
    scene.io.prepare(5, scene.tick())
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.inputs(emc_abort_ack=True)
    assert scene.io.prepared is None
    scene.io.change(scene.tick())
    scene.sequence()
    assert [end.cause for end in scene.ends if isinstance(end, ChangeFailed)] == ["not_prepared"]


def test_a_second_m6_without_a_t_between_finds_its_tool_in_the_spindle() -> None:
    scene = changing(external())
    scene.inputs(tool_changed=True)
    scene.io.change(scene.tick(), line=9)
    assert scene.sequence() == ""
    assert scene.ends == [ToolChanged(5, 9, skipped=True)]


def test_t0_empties_the_spindle() -> None:
    scene = external(tool=5)
    scene.io.prepare(0, scene.tick())
    assert scene.sequence() == "tool-prepare^"  # number, pocket and index are 0 as they were
    scene.inputs(tool_prepared=True)
    scene.io.change(scene.tick())
    assert scene.sequence() == "tool-change^"
    assert scene.inputs(tool_changed=True) == "tool-changed^ | tool-change_, tool-number=0"
    assert scene.io.tool == 0


def test_t0_in_a_random_changer_is_a_tool_of_the_table_or_none() -> None:
    scene = external(table=RANDOM)
    scene.io.prepare(0, scene.tick())
    assert scene.sequence() == "tool-prep-pocket=4, tool-prep-index=4, tool-prepare^"
    scene = external(table=RANDOM.__class__(RANDOM.tools[:3], random=True))
    scene.io.prepare(0, scene.tick())
    scene.sequence()
    assert [end.cause for end in scene.ends if isinstance(end, PrepareFailed)] == ["unknown_tool"]


def test_a_random_changer_exchanges_two_pockets() -> None:
    scene = changing(external(table=RANDOM))
    assert scene.io.tool == 1  # pocket 0 of the table
    scene.inputs(tool_changed=True)
    (changed,) = scene.of(TableChanged)
    assert changed.table == scene.io.tool_table
    assert {tool.number: tool.pocket for tool in changed.table.tools} == {1: 12, 5: 0, 7: 3, 0: 4}


def test_without_a_table_every_number_is_a_tool_in_the_pocket_of_its_number() -> None:
    scene = external(table=None)
    scene.io.prepare(33, scene.tick())
    assert scene.sequence() == "tool-prep-number=33, tool-prep-pocket=33, tool-prep-index=33, tool-prepare^"


# --- M61 --------------------------------------------------------------------------------------------------------


def test_m61_sets_the_number_and_nothing_moves() -> None:
    scene = external()
    scene.io.set_tool(7, scene.tick())
    assert scene.sequence() == "tool-number=7"
    assert scene.ends == [ToolSet(7)]
    scene.io.set_tool(6, scene.tick())
    assert scene.sequence() == ""
    assert [end.cause for end in scene.ends if isinstance(end, SetToolFailed)] == ["unknown_tool"]


def test_m61_is_refused_in_the_middle_of_a_change() -> None:
    scene = changing(external())
    scene.io.set_tool(7, scene.tick())
    assert scene.sequence() == ""
    assert [end.cause for end in scene.ends if isinstance(end, SetToolFailed)] == ["change_pending"]
    assert scene.io.tool == 0


def test_m61_of_a_random_changer_exchanges_pockets_too() -> None:
    scene = external(table=RANDOM)
    scene.io.set_tool(7, scene.tick())
    assert scene.sequence() == "tool-number=7"
    (changed,) = scene.of(TableChanged)
    assert {tool.number: tool.pocket for tool in changed.table.tools} == {1: 3, 5: 12, 7: 0, 0: 4}


# --- the table --------------------------------------------------------------------------------------------------


def test_another_table_counts_from_the_next_t() -> None:
    scene = external(table=None)
    scene.io.set_table(TABLE, scene.tick())
    assert scene.sequence() == ""
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == PREP_5


def test_the_table_stays_while_one_of_its_tools_is_under_way() -> None:
    scene = external()
    scene.io.prepare(5, scene.tick())
    with pytest.raises(LocalError, match="cannot be changed"):
        scene.io.set_table(TABLE, scene.tick())
    scene.inputs(tool_prepared=True)
    with pytest.raises(LocalError, match="cannot be changed"):
        scene.io.set_table(parse("T5 P3")[0], scene.tick())
    scene.io.set_table(parse("T1 P1\nT5 P12 Z99")[0], scene.tick())  # its place is the same
    scene.io.change(scene.tick())
    assert scene.sequence().endswith("tool-change^")


def test_pocket_0_of_a_random_changers_table_is_the_spindle() -> None:
    scene = external(table=RANDOM)
    scene.io.set_table(parse("T1 P12\nT5 P0\nT7 P3", random=True)[0], scene.tick())
    assert scene.sequence() == "tool-number=5"
    assert scene.ends == [ToolSet(5)]


@pytest.mark.parametrize("number", [-1, 100_000, 2**40])
def test_a_number_that_no_tool_has_is_refused_without_a_table_too(number: int) -> None:
    scene = external(table=None)
    scene.io.prepare(number, scene.tick())
    scene.sequence()
    assert [end.cause for end in scene.ends if isinstance(end, PrepareFailed)] == ["unknown_tool"]


# --- abort ------------------------------------------------------------------------------------------------------


def test_abort_while_changing() -> None:
    scene = changing(external())
    scene.io.coolant(scene.tick(), flood=True, mist=True)
    assert scene.sequence() == "coolant-mist^, coolant-flood^"
    scene.io.abort(AbortReason.USER, scene.tick(), message="cancelled")
    assert scene.sequence() == "coolant-flood_, coolant-mist_, emc-reason=100, emc-abort^, tool-change_"
    assert scene.ends == [ChangeFailed(5, "aborted", "cancelled", 8)]
    assert scene.value("state") == 4
    assert scene.io.start_refusal == "the tool changer has not acknowledged the last abort"
    assert not scene.io.motion_allowed
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"
    assert scene.of(AbortAcknowledged) == [AbortAcknowledged(100)]
    assert scene.value("state") == 0
    assert scene.io.start_refusal is None
    assert scene.value("emc-reason") == 100  # keeps its value
    assert (scene.io.prepared, scene.value("tool-prep-number"), scene.io.tool) == (5, 5, 0)


@pytest.mark.parametrize(
    ("config", "pin"), [(IoConfig(kind="external", start_in_estop=False), "tool-prepare"), (START, "start-change")]
)
def test_abort_drops_whatever_is_asked(config: IoConfig, pin: str) -> None:
    scene = external(config)
    scene.io.prepare(5, scene.tick())
    if pin == "start-change":
        scene.inputs(tool_prepared=True)
        scene.io.start_change(scene.tick())
    scene.sequence()
    assert scene.value(pin) is True
    scene.io.abort(AbortReason.TASK_ABORT, scene.tick())
    assert scene.sequence() == f"emc-reason=8, emc-abort^, {pin}_"
    assert len(scene.ends) == 1


def test_a_stuck_acknowledgement_lets_the_abort_through_at_once() -> None:
    scene = changing(external())
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^"
    scene.io.abort(AbortReason.MOTION_OR_IO_ERROR, scene.tick())
    assert scene.sequence() == "emc-reason=3, emc-abort^, tool-change_ | emc-abort_"


def test_what_is_asked_for_before_the_acknowledgement_waits_for_it() -> None:
    scene = external()
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == "emc-reason=100, emc-abort^"
    assert scene.inputs(emc_abort_ack=True) == f"emc-abort-ack^ | emc-abort_ | {PREP_5}"


def test_a_change_that_came_before_the_abort_is_committed() -> None:
    scene = changing(external())
    scene.inputs(tool_changed=True)
    scene.io.abort(AbortReason.USER, scene.tick())
    assert scene.io.tool == 5
    scene.sequence()
    assert scene.ends == []


def test_a_change_that_comes_after_the_abort_is_ignored_and_told() -> None:
    scene = changing(external())
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.sequence()
    assert scene.inputs(tool_changed=True) == "tool-changed^"
    assert scene.of(AnswerIgnored) == [AnswerIgnored("tool-changed", "aborting: nothing waits for it")]
    assert "look which tool is in the spindle" in scene.messages[0]
    assert scene.io.tool == 0


def test_a_change_that_comes_even_after_the_acknowledgement_is_told_until_the_next_one() -> None:
    scene = changing(external())
    scene.io.abort(AbortReason.USER, scene.tick())
    scene.inputs(emc_abort_ack=True)
    scene.inputs(emc_abort_ack=False)
    assert scene.inputs(tool_changed=True) == "tool-changed^"
    assert "tool 5 is in" in scene.messages[0]
    scene.inputs(tool_changed=False)
    scene.io.set_tool(5, scene.tick())
    scene.inputs(tool_changed=True)
    assert scene.messages == []


def test_repeated_answers_are_ignored_and_told() -> None:
    scene = prepared(external())
    assert scene.inputs(tool_prepared=True) == "tool-prepared^"
    assert [event.pin for event in scene.of(AnswerIgnored)] == ["tool-prepared"]
    assert scene.inputs(emc_abort_ack=True, tool_changed=True) == "emc-abort-ack^, tool-changed^"
    assert [event.pin for event in scene.of(AnswerIgnored)] == ["emc-abort-ack", "tool-changed"]
    assert (scene.messages, scene.io.tool, scene.io.prepared) == ([], 0, 5)


def test_a_second_abort_before_the_acknowledgement_tells_its_reason_and_needs_no_second_one() -> None:
    scene = external()
    scene.io.abort(AbortReason.TASK_ABORT, scene.tick())
    scene.io.abort(AbortReason.STATE_OFF, scene.tick())
    assert scene.sequence() == "emc-reason=8, emc-abort^ | emc-reason=4"
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"
    assert scene.of(AbortAcknowledged) == [AbortAcknowledged(4)]


# --- start-up, kinds, versions ----------------------------------------------------------------------------------


def test_start_up_signals_an_abort_and_restores_the_tool() -> None:
    scene = Scene(IoConfig(kind="external"), tool=5)
    assert notation(scene.seen) == "tool-number=5 | emc-reason=7, emc-abort^"
    assert scene.value("user-enable-out") is False
    scene.io.connect({}, scene.tick())
    assert scene.sequence() == ""
    assert scene.inputs(emc_abort_ack=True) == "emc-abort-ack^ | emc-abort_"


def test_loopback_goes_through_everything_by_itself() -> None:
    scene = Scene(IoConfig(kind="loopback", support_start_change=True))
    assert notation(scene.seen) == (
        "user-enable-out^ | emc-reason=7, emc-abort^ | emc-abort-ack^, emc-enable-in^ | emc-abort_ | emc-abort-ack_"
    )
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == f"{PREP_5} | tool-prepared^ | tool-prepare_ | tool-prepared_"
    scene.io.change(scene.tick())
    assert scene.sequence() == (
        "start-change^ | start-change-ack^ | start-change_ | tool-change^"
        f" | start-change-ack_, tool-changed^ | {DONE_5} | tool-changed_"
    )
    assert scene.ends == [ToolChanged(5, None)]
    assert not scene.of(AnswerIgnored)


def test_manual_asks_a_person_and_only_for_the_change() -> None:
    scene = Scene(IoConfig(kind="manual"))
    scene.io.prepare(5, scene.tick())
    assert scene.sequence() == f"{PREP_5} | tool-prepared^ | tool-prepare_ | tool-prepared_"
    assert not scene.io.may_confirm
    scene.io.change(scene.tick(), line=8)
    assert scene.sequence() == "tool-change^"
    assert scene.messages == ["Put tool 5 (six mm) into the spindle, then confirm."]
    assert (scene.io.waiting_for.what, scene.io.waiting_for.tool) == ("operator", 5)
    assert scene.io.may_confirm
    scene.io.confirm(scene.tick())
    assert scene.sequence() == DONE_5
    assert scene.ends == [ToolChanged(5, 8)]
    assert not scene.io.may_confirm


def test_manual_takes_the_tool_out_for_t0_and_a_person_may_say_that_it_failed() -> None:
    scene = Scene(IoConfig(kind="manual"), tool=5)
    scene.io.prepare(0, scene.tick())
    scene.io.change(scene.tick(), line=8)
    scene.sequence()
    assert scene.messages == ["Take the tool out of the spindle, then confirm."]
    scene.io.fail(scene.tick(), message="the holder is stuck")
    assert scene.sequence() == "emc-reason=100, emc-abort^, tool-change_ | emc-abort-ack^ | emc-abort_ | emc-abort-ack_"
    assert scene.ends == [ChangeFailed(0, "operator", "the holder is stuck", 8)]
    assert (scene.io.tool, scene.io.may_fail) == (5, False)


def test_none_takes_a_t_and_refuses_an_m6() -> None:
    scene = Scene(IoConfig(kind="none"), None)
    scene.io.prepare(5, scene.tick())
    scene.io.change(scene.tick(), line=8)
    assert "tool-change" not in scene.sequence().replace("toolchanger", "")
    assert [type(end) for end in scene.ends] == [ToolPrepared, ChangeFailed]
    assert scene.ends[1] == ChangeFailed(5, "no_changer", "line 8: this machine has no tool changer", 8)


def test_version_1_has_no_pins_of_abort_fault_and_start_change() -> None:
    scene = changing(external(IoConfig(kind="external", protocol_version=1, start_in_estop=False)))
    names = {pin.name for pin in scene.io.pins()}
    assert len(names) == 14
    assert not [name for name in names if "abort" in name or "fault" in name or "start" in name or "reason" in name]
    scene.io.coolant(scene.tick(), flood=True)
    scene.io.abort(AbortReason.USER, scene.tick())
    assert scene.sequence() == "coolant-flood^ | coolant-flood_, tool-change_"
    assert [type(end) for end in scene.ends] == [ChangeFailed]
    assert (scene.io.state, scene.io.start_refusal) == (State.IDLE, None)
    scene.io.change(scene.tick())
    assert scene.sequence() == "tool-change^"  # the prepared tool stayed prepared
    assert scene.inputs(tool_changed=True) == f"tool-changed^ | {DONE_5}"


def test_every_change_of_a_pin_and_of_a_state_carries_its_time() -> None:
    scene = external()
    scene.io.prepare(5, 250.5)
    scene.sequence()
    assert {event.at for event in scene.of(PinChanged)} == {250.5}
    (transition,) = scene.of(Transition)
    assert (transition.region, transition.before, transition.after, transition.at) == (
        "handshake",
        "idle",
        "preparing",
        250.5,
    )
    assert next(pin.since_at for pin in scene.io.pins() if pin.name == "tool-prepare") == 250.5


def test_coolant_is_three_codes() -> None:
    scene = external()
    scene.io.coolant(scene.tick(), mist=True)
    scene.io.coolant(scene.tick(), flood=True)
    scene.io.coolant(scene.tick(), flood=False, mist=False)
    assert scene.sequence() == "coolant-mist^ | coolant-flood^ | coolant-mist_, coolant-flood_"
