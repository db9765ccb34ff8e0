"""The one reading of what a machine is doing."""

from protocol.events import (
    AccessoriesChanged,
    Alarm,
    BatchDone,
    BatchReceived,
    ControllerReset,
    Homed,
    LinkLost,
    LinkReady,
    MachineRestarted,
    ModalRead,
    OverridesChanged,
    PendantChanged,
    PinsChanged,
    StateReported,
    ToolRequested,
)
from protocol.machine import MachineState, reduce, tool_confirmed

IDLE = MachineState(status="idle", position={"x": 1.0, "y": 2.0}, tool=3)


def test_an_event_that_says_nothing_of_the_state_changes_nothing():
    assert reduce(IDLE, BatchDone(1)) is IDLE


def test_a_link_makes_offline_idle_and_the_other_way_round():
    assert reduce(MachineState(), LinkReady()).status == "idle"
    assert reduce(IDLE, LinkReady()) is IDLE
    assert reduce(IDLE, LinkLost("pulled")).status == "offline"


def test_whether_it_is_homed_is_known_for_an_epoch_only():
    """Who switched it off while nobody listened, or moved it, has told nobody."""
    homed = reduce(IDLE, Homed(()))
    assert homed.homed is True
    assert reduce(homed, LinkLost("pulled")).homed is None
    assert reduce(IDLE, Homed(("x",))).homed is None
    assert reduce(homed, Homed(("x",))).homed is True


def test_an_alarm_outlives_the_handshake_and_ends_with_the_next_report():
    alarm = reduce(IDLE, StateReported("alarm", {"x": 9.0}, alarm=Alarm(6, "x", "soft limit")))
    assert reduce(alarm, LinkReady()).status == "alarm"
    clear = reduce(alarm, StateReported("idle", {}))
    assert (clear.status, clear.alarm) == ("idle", None)


def test_a_report_replaces_what_it_says_and_keeps_the_rest():
    state = reduce(IDLE, StateReported("run", {"x": 5.0}, feed_mm_min=100.0, absolute=True))
    state = reduce(state, StateReported("run", {"x": 6.0}, spindle_rpm=9000.0))
    assert state.position == {"x": 6.0, "y": 2.0}
    assert (state.feed_mm_min, state.spindle_rpm, state.absolute, state.tool) == (100.0, 9000.0, True, 3)


def test_a_restarted_machine_has_no_position_and_no_tool():
    state = reduce(IDLE, MachineRestarted("READY"))
    assert (state.position, state.tool, state.status) == ({}, None, "idle")


def test_received_means_running():
    assert reduce(IDLE, BatchReceived(1)).status == "run"


def test_a_tool_request_outlives_idle_reports_until_it_is_confirmed():
    state = reduce(IDLE, ToolRequested(7))
    assert state.status == "tool"
    state = reduce(state, StateReported("idle", {"z": 30.0}))
    assert (state.status, state.tool_requested) == ("tool", 7)
    confirmed = tool_confirmed(state)
    assert (confirmed.status, confirmed.tool, confirmed.tool_requested) == ("idle", 7, None)
    assert tool_confirmed(confirmed) is confirmed


def test_a_new_run_or_an_alarm_ends_a_tool_request():
    state = reduce(reduce(IDLE, ToolRequested(7)), StateReported("run", {}))
    assert (state.status, state.tool_requested) == ("run", None)


def test_a_tool_confirmed_while_it_is_running_changes_no_status():
    state = MachineState(status="run", tool_requested=2)
    assert tool_confirmed(state).status == "run"


class TestGrbl:
    """Machine and work position where a controller tells one of them and now and then their difference (grbl II.5)."""

    def test_work_is_machine_less_offset(self):
        state = reduce(MachineState(), StateReported("idle", {"x": 5.0, "y": 1.0}, frame="machine"))
        assert state.work_position == {}
        state = reduce(state, StateReported("idle", {}, frame="machine", work_offset={"x": 2.0}))
        assert (state.position, state.work_position) == ({"x": 5.0, "y": 1.0}, {"x": 3.0})
        state = reduce(state, StateReported("run", {"x": 6.0, "y": 1.0}, frame="machine"))
        assert state.work_position == {"x": 4.0}

    def test_machine_is_work_plus_offset(self):
        state = reduce(MachineState(), StateReported("idle", {"x": 5.0}, frame="work"))
        assert (state.position, state.work_position) == ({}, {"x": 5.0})
        state = reduce(state, StateReported("idle", {}, frame="work", work_offset={"x": 2.0}))
        assert (state.position, state.work_position) == ({"x": 7.0}, {"x": 5.0})

    def test_a_reset_keeps_the_position_or_loses_it(self):
        state = reduce(MachineState(), StateReported("hold", {"x": 5.0}, frame="machine", work_offset={"x": 1.0}))
        state = reduce(reduce(state, OverridesChanged(50, 25, 120)), Homed(()))
        kept = reduce(state, ControllerReset(position_kept=True))
        assert (kept.position, kept.work_position, kept.homed) == ({"x": 5.0}, {"x": 4.0}, True)
        assert kept.overrides == {"feed": 100, "rapid": 100, "spindle": 100}
        lost = reduce(state, ControllerReset(position_kept=False))
        assert (lost.position, lost.work_position, lost.homed) == ({}, {}, False)

    def test_inputs_that_are_not_named_are_inactive(self):
        state = reduce(MachineState(), PinsChanged(frozenset({"probe"})))
        state = reduce(state, PinsChanged(frozenset({"limit_x"})))
        assert state.inputs == {"probe": False, "limit_x": True}

    def test_modal_accessories_pendant(self):
        state = reduce(MachineState(), ModalRead(None, ("G0", "G54")))
        state = reduce(reduce(state, AccessoriesChanged(frozenset({"flood"}))), PendantChanged(active=True))
        assert (state.modal, state.accessories, state.pendant) == (("G0", "G54"), {"flood"}, True)

    def test_its_own_tool_state_ends_a_tool_request(self):
        state = reduce(MachineState(), ToolRequested(2))
        state = reduce(state, StateReported("tool", {}, frame="machine"))
        assert state.tool_requested == 2
        assert reduce(state, StateReported("idle", {}, frame="machine", tool=2)).tool_requested is None


def test_a_complete_report_forgets_the_axes_that_it_does_not_name():
    state = reduce(MachineState(), StateReported("idle", {"x": 1.0, "z": 2.0}))
    assert reduce(state, StateReported("idle", {"x": 3.0})).position == {"x": 3.0, "z": 2.0}
    assert reduce(state, StateReported("alarm", {}, complete=True)).work_position == {}
