"""The engine against a controller played by hand: the rules of grbl Part I and the traps of Part II as short scenes."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.commands import (
    AskToolChange,
    CheckMode,
    ClearAlarm,
    Command,
    CoolantToggle,
    CycleStart,
    EmergencyStop,
    FeedHold,
    Home,
    Jog,
    JogCancel,
    ListFiles,
    Locate,
    Override,
    ReadModal,
    ReadOffsets,
    ReadSettings,
    RealtimeCommand,
    Restore,
    RunBlock,
    RunFile,
    SafetyDoor,
    SendBatch,
    SoftReset,
    SpindleStopToggle,
    Stop,
    ToggleOption,
    ToolAck,
    WriteInfo,
)
from protocol.engine import Engine, OpenWork
from protocol.errors import LocalError, MessageTooLongError
from protocol.events import (
    AccessoriesChanged,
    Announced,
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    ControllerReset,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    FirmwareRead,
    Homed,
    LineRefused,
    LinkLost,
    LinkReady,
    MachineRestarted,
    MessagesSeen,
    OffsetsRead,
    OverridesChanged,
    PendantChanged,
    PinsChanged,
    ProbeReported,
    ProtocolFault,
    SettingsRead,
    StartupBlockRun,
    StateReported,
    ToolRequested,
)
from protocol.grbl.dialect import Dialect
from protocol.grbl.engine import TELL_WITHIN_S, GrblEngine
from protocol.grbl.phases import Phase
from tests.protocol.grbl.scene import BANNER, Scene, ready

IDLE = "<Idle|MPos:0.000,0.000,0.000|FS:0,0>"
RUN = "<Run|MPos:0.000,0.000,0.000|FS:0,0>"
HOLD = "<Hold:0|MPos:0.000,0.000,0.000|FS:0,0>"
SLOWING = "<Hold:1|MPos:0.000,0.000,0.000|FS:0,0>"
JOGGING = "<Jog|MPos:0.000,0.000,0.000|FS:0,0>"
ALARM = "<Alarm|MPos:0.000,0.000,0.000|FS:0,0>"
TOOL = "<Tool|MPos:0.000,0.000,0.000|FS:0,0>"


def test_the_engine_is_what_the_contract_asks_for() -> None:
    engine: Engine = GrblEngine(Dialect(), first_id=1, now=0.0)
    assert engine.free() == 0
    assert engine.recent_frames() == ()


class TestHandshake:
    def test_a_board_that_resets_is_waited_for(self) -> None:
        scene = Scene(Dialect())
        assert scene.wait(2.0) == b""
        assert scene.say("", BANNER) == b""
        assert scene.wait(0.0) == b"?"
        assert scene.say(IDLE) == b"$I\n"
        scene.shake_hands()
        assert scene.take(LinkReady)
        assert scene.take(MachineRestarted) == []
        assert scene.take(FirmwareRead)[0].rx_bytes == 128
        assert scene.take(SettingsRead)[0].values[13] == "0"
        assert "G54" in scene.take(OffsetsRead)[0].offsets

    def test_one_without_a_banner_is_asked(self) -> None:
        scene = Scene(Dialect(banner_wait_s=3))
        assert scene.wait(3.0) == b"?"
        assert scene.say(IDLE) == b"$I\n"

    def test_nobody_there(self) -> None:
        scene = Scene()
        assert scene.wait(20) == b"?????"
        assert "nobody answers" in scene.take(LinkLost)[0].reason
        assert scene.engine.next_timer() is None
        assert scene.say(IDLE) == b""
        scene.engine.realtime(SoftReset(9), scene.now)
        scene.sent()
        assert scene.take(CommandFailed)[0].token == 9

    def test_what_runs_already_is_waited_for_and_can_be_stopped(self) -> None:
        scene = Scene()
        scene.wait(0)
        assert scene.say(RUN, "ok", "ok") == b""
        assert scene.take(LinkReady)
        assert scene.engine.free() == 0
        assert b"$I\n" in scene.poll(IDLE)
        scene.shake_hands()
        assert scene.take(LinkReady) == []
        assert scene.engine.free() > 0

    def test_oks_of_lines_from_before_are_no_answers(self) -> None:
        scene = Scene()
        scene.wait(0)
        scene.say(IDLE)
        assert scene.say("ok", "ok") == b""
        assert scene.say("[OPT:V,15,128]", "ok") == b"$\n"

    def test_half_a_line_from_before_spoils_one_question(self) -> None:
        scene = Scene()
        scene.wait(0)
        scene.say(IDLE)
        assert scene.say("error:1") == b"$I\n"
        assert scene.say("error:1") == b"$I\n"
        assert scene.say("error:3") == b"$G\n"  # then it has none

    def test_a_question_without_an_answer_is_repeated_then_left_out(self) -> None:
        scene = Scene()
        scene.wait(0)
        scene.say(IDLE)
        scene.say("[OPT:V,15,128]", "ok")
        scene.say("[HLP:]", "ok")
        asked = 0
        for _ in range(400):
            asked += scene.wait(0.1).count(b"$G\n")
            if scene.say(IDLE).startswith(b"$#"):
                break
        assert asked == 2

    def test_reports_but_no_answers(self) -> None:
        scene = Scene()
        scene.wait(0)
        for _ in range(400):
            scene.say(IDLE)
            scene.wait(0.1)
        assert "answers no line" in scene.take(LinkLost)[0].reason

    def test_open_work_ends_in_doubt_and_never_goes_on_by_itself(self) -> None:
        work = OpenWork((SendBatch(7, ("G1X1",), 1.0), SendBatch(8, ("G1X2",), 1.0)))
        scene = Scene(Dialect(), work)
        scene.sent()
        assert scene.take(FateUnknown) == [FateUnknown((7, 8))]
        scene.say(BANNER)
        scene.shake_hands()
        assert scene.take(MachineRestarted)
        assert scene.take(FateInDoubt) == [FateInDoubt((), (7, 8), "the controller was reset")]
        assert scene.take(LinkReady)

    def test_open_work_without_lines_is_settled_unless_the_board_was_reset(self) -> None:
        scene = Scene(open_work=OpenWork(()))
        scene.shake_hands()
        assert scene.take(FateSettled) == [FateSettled((), ())]
        scene = Scene(open_work=OpenWork((SendBatch(7, ("G1X1",), 1.0),)))
        scene.shake_hands()
        assert "link broke" in scene.take(FateInDoubt)[0].reason

    def test_a_controller_that_parses_no_lines_after_its_banner_is_attended(self) -> None:
        scene = Scene(Dialect())
        scene.say(BANNER)
        assert scene.poll("<Door:1|MPos:0,0,0>") == b""
        assert scene.take(LinkReady)
        assert b"$I\n" in scene.poll(IDLE)


class TestStreaming:
    def test_exact_bytes_up_to_the_window(self) -> None:
        scene = ready()
        scene.batch(*[f"G1X{n}.000Y0.000F500" for n in range(10, 30)])
        first = scene.sent()
        assert len(first) <= 127
        assert first.endswith(b"\n")
        assert b"\r" not in first
        assert len(scene.say("ok")) == len(b"G1X10.000Y0.000F500\n")

    def test_the_empty_buffer_tells_how_many_bytes_it_takes(self) -> None:
        scene = ready()
        scene.poll("<Idle|MPos:0.000,0.000,0.000|Bf:15,128|FS:0,0>")
        scene.batch("X" + "1" * 62, "X" + "2" * 62)
        assert len(scene.sent()) == 128
        assert scene.engine._window.capacity == 128
        scene = ready(opt="[OPT:VN,100,1024,3,0]")
        assert scene.engine._window.capacity == 1023
        scene = ready(opt="[OPT:V]")
        assert scene.engine._window.capacity == 127

    def test_sent_received_done_are_three(self) -> None:
        scene = ready()
        id = scene.batch("G1X1F500", "G1X2")
        scene.sent()
        assert scene.take(BatchSent) == [BatchSent(id, 1)]
        scene.say("ok", "ok")
        assert scene.take(BatchReceived) == [BatchReceived(id, begins=False)]
        scene.poll(RUN)
        assert scene.take(BatchDone) == []
        scene.poll(IDLE)
        assert scene.take(BatchDone) == [BatchDone(id)]

    def test_idle_that_was_asked_for_before_the_ok_proves_nothing(self) -> None:
        """II.4: auto-start only happens when the ring runs dry; before that a full planner is Idle."""
        scene = ready()
        scene.batch("G1X1F500")
        while b"?" not in scene.wait(0.05):
            pass
        scene.say("ok", IDLE)
        assert scene.take(BatchDone) == []
        scene.poll(IDLE)
        assert scene.take(BatchDone)

    def test_idle_with_blocks_in_the_planner_proves_nothing(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.sent()
        scene.say("ok")
        scene.poll("<Idle|MPos:0.000,0.000,0.000|Bf:14,128|FS:0,0>")
        assert scene.take(BatchDone) == []
        scene.poll("<Idle|MPos:0.000,0.000,0.000|Bf:15,128|FS:0,0>")
        assert scene.take(BatchDone)

    def test_a_planner_that_never_is_as_empty_as_it_says_is_believed_the_second_time(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.sent()
        scene.say("ok")
        for _ in range(2):
            scene.poll("<Idle|MPos:0.000,0.000,0.000|Bf:14,128|FS:0,0>")
        assert scene.take(BatchDone)

    def test_a_sync_point_proves_what_is_before_it(self) -> None:
        scene = ready()
        scene.batch("G1X1F500", "G4P0.01")
        scene.sent()
        scene.say("ok")
        assert scene.take(BatchDone) == []
        scene.say("ok")
        assert scene.take(BatchDone)

    def test_blocks_behind_it_push_a_line_out_of_the_planner(self) -> None:
        scene = ready()
        first = scene.batch("G1X1F500", "G1X2")
        scene.batch(*[f"G1X{n}" for n in range(3, 50)])
        scene.sent()
        for _ in range(28):
            scene.say("ok")
        scene.say("[MSG:nothing]")
        assert scene.take(BatchDone) == []
        for at, news in ((scene.now, False), (scene.now + TELL_WITHIN_S, True)):
            scene.engine.receive_data(b"ok\r\n", at)  # 15 blocks and 12 segments behind the second line
            scene.engine.data_to_send(at)
            assert scene.engine.news is news, "nobody is told for a single ok"
        scene.sent()
        assert scene.take(BatchDone) == [BatchDone(first)]

    def test_room_in_the_planner_tells_earlier(self) -> None:
        scene = ready()
        first = scene.batch("G1X1F500", "G1X2")
        scene.batch(*[f"G1X{n}" for n in range(3, 50)])
        scene.sent()
        for _ in range(20):
            scene.say("ok")
        scene.poll("<Run|MPos:0.000,0.000,0.000|Bf:8,10|FS:0,0>")
        assert scene.take(BatchDone) == []
        scene.poll("<Run|MPos:0.000,0.000,0.000|Bf:9,10|FS:0,0>")
        assert scene.take(BatchDone) == [BatchDone(first)]

    @pytest.mark.parametrize("says_it_again", [False, True])
    def test_behind_a_refused_g91_no_block_is_certain_until_it_is_said_again(self, says_it_again: bool) -> None:
        scene = ready()
        first = scene.batch("G1X100F10", on_error="ignore")
        scene.batch("G91", "M8", *["X1"] * 40, on_error="ignore")  # to the controller all of these are one place
        scene.sent()
        scene.say("ok", "error:20", "ok", *["ok"] * 40)
        assert scene.take(BatchDone) == []
        if says_it_again:
            scene.batch("G91", *["X1"] * 40, on_error="ignore")
            scene.sent()
            scene.say(*["ok"] * 41, "[MSG:nothing]")
            assert scene.take(BatchDone)[0] == BatchDone(first)

    def test_eeprom_lines_travel_alone(self) -> None:
        scene = ready()
        scene.batch("G1X1F500", "G10L2P1X0", "G1X2")
        assert b"G10" not in scene.sent()
        assert scene.say("ok") == b"G10L2P1X0\n"
        assert scene.say("ok") == b"G1X2\n"

    def test_line_by_line(self) -> None:
        scene = ready(Dialect(resets_on_open=False, streaming="line"))
        scene.batch("G1X1F500", "G1X2")
        assert scene.sent() == b"G1X1F500\n"
        assert scene.say("ok") == b"G1X2\n"

    def test_what_the_caller_may_not_do(self) -> None:
        scene = ready()
        with pytest.raises(LocalError, match="out of turn"):
            scene.engine.submit(SendBatch(99, ("G1X1",), 1.0), 0.0)
        with pytest.raises(LocalError, match="without a line"):
            scene.batch()
        with pytest.raises(LocalError, match="may not hold"):
            scene.batch("G1X1 (was?)")
        with pytest.raises(MessageTooLongError):
            scene.batch("G1" * 50)
        with pytest.raises(MessageTooLongError):
            scene.engine.submit(RunBlock(1, ("G1" * 50,)), 0.0)
        with pytest.raises(MessageTooLongError):
            scene.engine.submit(WriteInfo(1, "x" * 80), 0.0)
        while scene.engine.free():
            scene.batch("G1X1")
        with pytest.raises(LocalError, match="takes no command"):
            scene.batch("G1X1")

    def test_an_ok_that_nobody_asked_for_is_a_fault(self) -> None:
        scene = ready()
        scene.say("ok", "error:9", "<Idle|MPos:>")
        assert [fault.kind for fault in scene.take(ProtocolFault)] == ["unasked_answer", "unasked_answer", "malformed"]

    def test_a_lost_ok_ends_in_doubt_and_a_reset_at_rest(self) -> None:
        scene = ready()
        id = scene.batch("G1X1F500", "G1X2")
        scene.sent()
        scene.say("ok")
        out = b""
        for _ in range(300):
            out += scene.poll(IDLE)
            if b"\x18" in out or scene.engine._phase is Phase.RESETTING:
                break
        assert [fault.kind for fault in scene.take(ProtocolFault)] == ["lost_answer"]
        failed = scene.take(BatchFailed)[0]
        assert (failed.id, failed.reason, failed.lines_done, failed.lines_touched) == (id, "link", 0, 2)

    def test_a_dwell_may_stay_without_an_answer_in_idle(self) -> None:
        scene = ready()
        scene.batch("G4P60")
        scene.sent()
        for _ in range(200):
            scene.poll(IDLE)
        assert scene.take(ProtocolFault) == []

    def test_a_long_motion_is_no_lost_answer(self) -> None:
        scene = ready()
        scene.batch("G10L2P1X0")
        scene.sent()
        for _ in range(200):
            scene.poll(RUN)
        scene.poll(IDLE)
        assert scene.take(ProtocolFault) == []

    def test_lines_that_wait_in_its_buffer_are_not_lost(self) -> None:
        scene = ready()
        scene.batch("M3S1000", "G1X1F500")
        scene.sent()
        for _ in range(80):
            scene.poll("<Idle|MPos:0.000,0.000,0.000|Bf:15,100|FS:0,0>")
        assert scene.take(ProtocolFault) == []


class TestRefused:
    def test_hold_names_the_line_and_those_inside(self) -> None:
        scene = ready()
        id = scene.batch("G1X1F500", "G1X2X3", "G1X4")
        scene.sent()
        assert scene.say("ok", "error:25") == b"!"
        refused = scene.take(LineRefused)[0]
        assert (refused.id, refused.index, refused.block, refused.code, refused.action) == (id, 1, "G1X2X3", 25, "held")
        assert refused.inside == ((id, 2),)
        scene.batch("G1X9")
        assert scene.sent() == b""
        scene.poll(HOLD)
        scene.engine.realtime(CycleStart(5), scene.now)
        assert scene.sent() == b"~"
        scene.poll(RUN)
        scene.say("ok", "ok")
        scene.poll(IDLE)
        assert [event.id for event in scene.take(BatchDone)] == [id, id + 1]

    def test_a_hold_that_was_not_heeded_keeps_the_stream_shut_all_the_same(self) -> None:
        scene = ready()
        scene.batch("G1X1X2", "G1X4")
        scene.sent()
        scene.say("error:25", "ok")
        scene.batch("G1X9")
        assert b"G1X9" not in scene.poll(IDLE) + scene.poll(IDLE)

    def test_stop(self) -> None:
        scene = ready()
        id = scene.batch("G1X1F500", "G1X2X3", "G1X4", on_error="stop")
        scene.sent()
        assert b"!" in scene.say("ok", "error:25")
        assert b"\x18" in scene.poll(HOLD)
        failed = scene.take(BatchFailed)[0]
        assert (failed.id, failed.reason, failed.code) == (id, "error", 25)
        assert (failed.lines_done, failed.lines_touched) == (0, 3)

    def test_ignored_codes(self) -> None:
        scene = ready()
        scene.batch("G1X1F500", "G99", "M6", on_error="ignore", ignored_errors=frozenset({20}))
        scene.sent()
        assert scene.say("ok", "error:20") == b""
        assert scene.take(LineRefused)[0].action == "ignored"
        assert scene.say("error:21") == b"!"
        assert scene.take(LineRefused)[0].action == "held"

    def test_a_block_by_hand(self) -> None:
        scene = ready()
        scene.engine.submit(RunBlock(5, ("G1X1X2", "G1X3")), scene.now)
        scene.sent()
        scene.say("error:25", "ok")
        failed = scene.take(CommandFailed)[0]
        assert (failed.token, failed.code) == (5, 25)
        assert "block 1" in failed.message


class TestResets:
    def test_stop_waits_for_a_stand_then_for_the_banner(self) -> None:
        scene = ready()
        id = scene.batch("G1X1F500", "G1X2", "G1X3", "G1X4")
        scene.sent()
        scene.say("ok", "ok")
        scene.poll(RUN)
        scene.engine.realtime(Stop(7), scene.now)
        assert scene.sent().startswith(b"!")
        assert b"!" in scene.poll(RUN)
        assert scene.poll(SLOWING) == b""
        assert scene.poll(HOLD) == b"\x18"
        failed = scene.take(BatchFailed)[0]
        assert (failed.id, failed.reason, failed.lines_done, failed.lines_touched) == (id, "stop", 0, 3)
        assert scene.say("ok", "error:9") == b""  # II.3: ignored until the banner
        assert scene.take(ProtocolFault) == []
        assert scene.say("", BANNER) == b""
        assert b"$I\n" in scene.poll(IDLE)
        assert scene.take(ControllerReset) == [ControllerReset(position_kept=True)]
        assert scene.take(CommandDone) == [CommandDone(7)]
        scene.shake_hands()
        assert scene.engine.free() > 0

    @pytest.mark.parametrize("report", [IDLE, ALARM, TOOL, "<Door:1|MPos:0,0,0>", "<Check|MPos:0,0,0>"])
    def test_stop_where_nothing_moves(self, report: str) -> None:
        scene = ready()
        scene.engine.realtime(Stop(7), scene.now)
        scene.sent()
        assert b"\x18" in scene.poll(report)

    def test_a_stop_that_takes_too_long_resets_all_the_same(self) -> None:
        scene = ready()
        scene.poll(RUN)
        scene.engine.realtime(Stop(7), scene.now)
        out = b""
        for _ in range(100):
            out += scene.wait(0.2) + scene.say("<Door:2|MPos:0,0,0>")
        assert out.count(b"\x18") >= 1

    def test_a_second_stop_changes_nothing(self) -> None:
        scene = ready()
        scene.engine.realtime(Stop(7), scene.now)
        scene.engine.realtime(Stop(8), scene.now)
        scene.sent()
        scene.poll(HOLD)
        scene.say(BANNER)
        assert [event.token for event in scene.take(CommandDone)] == [7, 8]

    def test_stop_while_homing_resets_at_once(self) -> None:
        scene = ready()
        scene.poll("<Home|MPos:0,0,0>")
        scene.engine.realtime(Stop(7), scene.now)
        assert scene.sent() == b"\x18"

    def test_an_emergency_stop_goes_before_everything(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.engine.realtime(EmergencyStop(7), scene.now)
        assert scene.sent() == b"\x18"
        scene.say("ALARM:3", "ok", "", BANNER)
        assert scene.take(BatchFailed)[0].reason == "estop"
        assert scene.take(ControllerReset) == [ControllerReset(position_kept=False)]

    def test_a_reset_without_a_banner_is_repeated_then_the_link_is_lost(self) -> None:
        scene = ready()
        scene.engine.realtime(SoftReset(7), scene.now)
        assert scene.sent() + scene.wait(20) == b"\x18\x18\x18"
        assert scene.take(LinkLost)
        assert scene.take(CommandFailed)[0].token == 7

    def test_a_report_from_before_the_reset_means_nothing(self) -> None:
        scene = ready()
        scene.engine.realtime(SoftReset(7), scene.now)
        scene.sent()
        scene.take(StateReported)
        scene.say(RUN)
        assert scene.take(StateReported) == []

    def test_a_banner_out_of_the_blue(self) -> None:
        scene = ready()
        id = scene.batch("G1X1F500", "G1X2")
        scene.engine.submit(ReadModal(4), scene.now)
        scene.sent()
        scene.say("ok")
        scene.say("", "GrblHAL 1.1f ['$' or '$HELP' for help]", ">G21:ok", ">G99:error:20")
        assert scene.take(MachineRestarted)
        failed = scene.take(BatchFailed)[0]
        assert (failed.id, failed.reason, failed.lines_done) == (id, "restart", 0)
        assert [event.token for event in scene.take(CommandFailed)] == [4]
        assert scene.take(StartupBlockRun) == [StartupBlockRun("G21", None), StartupBlockRun("G99", 20)]

    def test_check_mode_off_awaits_the_reset(self) -> None:
        scene = ready()
        scene.poll("<Check|MPos:0,0,0>")
        scene.engine.submit(CheckMode(4, on=True), scene.now)
        scene.engine.submit(CheckMode(5, on=False), scene.now)
        assert scene.sent() == b"$C\n"
        scene.say("[MSG:Disabled]", "ok")
        assert scene.take(Announced) == [Announced("Disabled")]
        assert [event.token for event in scene.take(CommandDone)] == [4, 5]
        assert scene.engine.free() == 0
        scene.say(BANNER)
        assert b"$I\n" in scene.poll(ALARM)

    def test_a_restart_without_a_banner(self) -> None:
        scene = ready()
        scene.engine.submit(Restore(5, "settings"), scene.now)
        assert scene.sent() == b"$RST=$\n"
        scene.say("[MSG:Restoring defaults]", "ok")
        assert b"$I\n" in scene.wait(2.5)

    def test_in_check_mode_ok_is_all_there_is(self) -> None:
        scene = ready()
        scene.poll("<Check|MPos:0,0,0>")
        scene.batch("G1X1F500", check=True)
        scene.sent()
        scene.say("ok")
        assert scene.take(BatchDone)

    @pytest.mark.parametrize("check", [True, False])
    def test_a_check_goes_into_check_mode_and_nothing_else_does(self, check: bool) -> None:
        scene = ready()
        scene.poll(IDLE if check else "<Check|MPos:0,0,0>")
        scene.batch("G1X1F500", check=check)
        assert scene.sent() == b""
        (failed,) = scene.take(BatchFailed)
        assert (failed.reason, failed.lines_done, failed.lines_touched) == ("link", 0, 0)
        assert "check mode" in failed.message

    @pytest.mark.parametrize("check", [True, False])
    def test_a_mode_that_somebody_else_switches_is_a_reset(self, check: bool) -> None:
        scene = ready()
        scene.poll("<Check|MPos:0,0,0>" if check else IDLE)
        scene.batch("G1X1F500", "G1X2", check=check)
        scene.sent()
        scene.take(BatchFailed)
        assert scene.poll(IDLE if check else "<Check|MPos:0,0,0>") == b"\x18"
        (failed,) = scene.take(BatchFailed)
        assert (failed.reason, failed.lines_done, failed.lines_touched) == ("link", 0, 2)

    def test_check_mode_is_told_at_once_and_not_switched_twice(self) -> None:
        scene = ready()
        scene.engine.submit(CheckMode(3, on=True), scene.now)
        scene.engine.submit(CheckMode(4, on=True), scene.now)
        assert scene.sent() == b"$C\n"
        assert [event.token for event in scene.take(CommandFailed)] == [4]
        scene.say("[MSG:Enabled]", "ok")
        assert scene.take(StateReported)[-1].status == "check"
        assert scene.take(CommandDone) == [CommandDone(3)]

    def test_a_reset_pressed_twice_does_not_give_the_position_back(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.sent()
        scene.engine.realtime(EmergencyStop(5), scene.now)
        scene.say("ALARM:3")
        scene.engine.realtime(EmergencyStop(6), scene.now)
        scene.say("Grbl 1.1h ['$' for help]")
        assert [event.position_kept for event in scene.take(ControllerReset)] == [False]

    def test_a_machine_that_is_being_stopped_does_not_go_on(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.sent()
        scene.poll("<Hold:0|MPos:0,0,0>")
        scene.engine.realtime(Stop(5), scene.now)
        scene.sent()
        scene.engine.realtime(CycleStart(6), scene.now)
        assert b"~" not in scene.sent()
        assert [event.token for event in scene.take(CommandFailed)] == [6]


class TestAlarms:
    def test_one_and_two_lock_everything_but_a_reset(self) -> None:
        scene = ready()
        scene.batch("G1X1F500", "G1X2", "G1X3")
        scene.engine.submit(ReadModal(4), scene.now)
        scene.sent()
        scene.say("[GC:G0]", "ok", "ok")
        scene.say("ALARM:2", "[MSG:Reset to continue]")
        failed = scene.take(BatchFailed)[0]
        assert (failed.reason, failed.code, failed.lines_done, failed.lines_touched) == ("alarm", 2, 0, 2)
        assert scene.engine.free() == 0
        assert scene.wait(100) == b""  # no question, no lost link
        scene.engine.realtime(Stop(7), scene.now)
        assert scene.sent() == b"\x18"
        scene.say("ok", "", BANNER, "[MSG:'$H'|'$X' to unlock]")
        assert scene.take(ControllerReset) == [ControllerReset(position_kept=True)]

    def test_a_hard_limit_loses_the_position(self) -> None:
        scene = ready()
        scene.say("ALARM:1")
        scene.engine.realtime(SoftReset(7), scene.now)
        scene.sent()
        scene.say(BANNER)
        assert scene.take(ControllerReset) == [ControllerReset(position_kept=False)]

    def test_a_locked_controller_that_somebody_has_reset(self) -> None:
        scene = ready()
        scene.say("ALARM:1")
        assert b"$I" not in scene.say(ALARM)
        assert b"$I" in scene.say(IDLE)

    def test_an_alarm_while_stopping_resets(self) -> None:
        scene = ready()
        scene.poll(RUN)
        scene.engine.realtime(Stop(7), scene.now)
        scene.sent()
        assert scene.say("ALARM:1") == b"\x18"

    def test_other_alarms_are_cleared_by_hand(self) -> None:
        scene = ready()
        scene.batch("G38.2Z-5F10", "G1X1")
        scene.engine.submit(RunBlock(3, ("G1X1",)), scene.now)
        scene.sent()
        scene.take(CommandFailed)
        scene.say("ALARM:5", "[PRB:0.000,0.000,-5.000:0]", "ok", "error:9")
        assert scene.take(BatchFailed)[0].code == 5
        assert scene.take(ProbeReported)[0].succeeded is False
        assert scene.take(ProtocolFault) == []
        scene.poll(ALARM)
        assert scene.take(StateReported)[-1].alarm.code == 5  # type: ignore[union-attr]
        scene.batch("G1X1")
        assert scene.sent() == b""
        (failed,) = scene.take(BatchFailed)
        assert (failed.reason, failed.code, failed.lines_done, failed.lines_touched) == ("alarm", 5, 0, 0)
        for command in (RunBlock(8, ("G1X1",)), Jog(9, {"x": 1}, 100)):
            scene.engine.submit(command, scene.now)
        scene.engine.submit(ClearAlarm(10), scene.now)
        assert scene.sent() == b"$X\n"
        assert [event.token for event in scene.take(CommandFailed)] == [8, 9]
        scene.say("[MSG:Caution: Unlocked]", "ok")
        assert scene.take(CommandDone) == [CommandDone(10)]
        scene.poll(IDLE)
        assert scene.take(StateReported)[-1].alarm is None

    def test_an_alarm_whose_line_was_lost_is_one_all_the_same(self) -> None:
        scene = ready()
        scene.batch("G1X1F500", *[f"G1X{x}" for x in range(2, 60)], on_error="ignore")
        scene.engine.submit(RunBlock(3, ("G1X1",)), scene.now)
        scene.sent()
        scene.poll(ALARM)
        (failed,) = scene.take(BatchFailed)
        assert (failed.reason, failed.lines_done, failed.lines_touched) == ("alarm", 0, 1)
        assert [event.token for event in scene.take(CommandFailed)] == [3]
        scene.say("error:9")
        assert scene.take(LineRefused) == []
        scene.poll(IDLE)
        assert b"G1" not in scene.sent(), "nothing of it goes on after the unlock"

    def test_an_alarm_ends_commands_by_hand(self) -> None:
        scene = ready()
        scene.engine.submit(Home(3), scene.now)
        scene.sent()
        scene.say("ALARM:9")
        assert scene.take(CommandFailed)[0].token == 3

    @pytest.mark.parametrize("code", [6, 7, 8, 9])
    def test_a_failed_homing_is_over_with_the_banner(self, code: int) -> None:
        scene = ready()
        scene.engine.submit(Home(3), scene.now)
        scene.sent()
        scene.say(f"ALARM:{code}")
        assert scene.take(StateReported)[-1].alarm.code == code  # type: ignore[union-attr]
        assert scene.engine.free() == 0, "$X would be lost in the reset that follows, or executed behind our back"
        scene.say("ok", "", BANNER)
        assert [event.position_kept for event in scene.take(ControllerReset)] == [False]
        assert scene.take(MachineRestarted) == [], "it did not restart on its own"

    def test_an_alarm_before_this_epoch_has_no_number_or_tells_it_as_substate(self) -> None:
        scene = ready()
        scene.poll(ALARM)
        assert scene.take(StateReported)[-1].alarm.code is None  # type: ignore[union-attr]
        scene.poll("<Alarm:11|MPos:0,0,0>")
        assert scene.take(StateReported)[-1].alarm.code == 11  # type: ignore[union-attr]

    def test_grblhal_in_emergency_stop(self) -> None:
        scene = ready()
        scene.say("[FIRMWARE:grblHAL]", "[AXS:3:XYZ]")
        scene.say("ALARM:10")
        assert "emergency" in scene.take(StateReported)[-1].alarm.message  # type: ignore[union-attr]


class TestPolls:
    def test_five_hertz_idle_ten_running_and_one_outstanding(self) -> None:
        scene = ready()
        scene.poll(IDLE)
        assert scene.wait(0.19) == b""
        assert scene.wait(0.02) == b"?"
        assert scene.wait(0.5) == b""
        scene.say(RUN)
        assert scene.wait(0.09) == b""
        assert scene.wait(0.02) == b"?"

    def test_silence_is_a_lost_link(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.engine.submit(ReadModal(4), scene.now)
        scene.engine.realtime(JogCancel(5), scene.now)
        scene.wait(10)
        assert "no word" in scene.take(LinkLost)[0].reason
        assert {event.token for event in scene.take(CommandFailed)} == {4, 5}
        assert scene.take(BatchFailed) == []  # the next epoch tells

    def test_homing_is_silent(self) -> None:
        scene = ready()
        scene.poll(IDLE)
        scene.engine.submit(Home(4), scene.now)
        assert b"$H\n" in scene.sent()
        scene.wait(120)
        assert scene.take(LinkLost) == []
        scene.say("<Home|MPos:0,0,0>", ">G21:ok", "ok")
        assert scene.take(Homed)
        assert scene.take(CommandDone) == [CommandDone(4)]


class TestReports:
    def test_what_a_report_tells(self) -> None:
        scene = ready()
        scene.take(StateReported)
        report = "<Run|WPos:1.000,2.000,3.000|FS:100,2000|Pn:XP|WCO:1.000,0.000,0.000|Ov:50,25,120|A:SF|H:1|T:4>"
        scene.say(report, report)
        told = scene.take(StateReported)[0]
        assert (told.frame, told.position, told.work_offset) == (
            "work", {"x": 1.0, "y": 2.0, "z": 3.0}, {"x": 1.0, "y": 0.0, "z": 0.0}
        )  # fmt: skip
        assert (told.feed_mm_min, told.spindle_rpm, told.tool, told.homed) == (100, 2000, 4, True)
        assert scene.take(PinsChanged) == [PinsChanged(frozenset({"limit_x", "probe"}))]
        assert scene.take(OverridesChanged) == [OverridesChanged(50, 25, 120)]
        assert scene.take(AccessoriesChanged) == [AccessoriesChanged(frozenset({"spindle_cw", "flood"}))]

    def test_a_pendant_owns_the_stream(self) -> None:
        scene = ready()
        scene.say("<Idle|MPos:0,0,0|MPG:1>")
        assert scene.take(PendantChanged) == [PendantChanged(active=True)]
        scene.batch("G1X1F500")
        scene.engine.submit(ReadModal(4), scene.now)
        assert b"G" not in scene.wait(20)  # and its silence is no lost link
        assert scene.take(CommandFailed)[0].token == 4
        assert scene.take(LinkLost) == []
        assert scene.say("<Idle|MPos:0,0,0|MPG:0>") == b"G1X1F500\n"


class TestHolds:
    def test_nothing_is_fed_while_held(self) -> None:
        scene = ready()
        scene.poll(RUN)
        scene.engine.realtime(FeedHold(3), scene.now)
        scene.batch("G1X1F500")
        assert scene.sent() == b"!"
        assert scene.take(CommandDone) == [CommandDone(3)]
        assert scene.poll(HOLD) == b""
        scene.engine.realtime(CycleStart(4), scene.now)
        assert scene.sent() == b"~"
        assert b"G1X1F500\n" in scene.poll(RUN)

    def test_a_hold_whose_byte_was_lost_is_asked_for_again(self) -> None:
        """II.4: incoming bytes may be lost while the EEPROM is written."""
        scene = ready()
        scene.batch("G1X1F500")
        scene.sent()
        scene.engine.realtime(FeedHold(3), scene.now)
        assert scene.sent() == b"!"
        assert scene.poll(RUN) == b"!"
        scene.say("ok")
        assert scene.poll(HOLD) == b""
        assert scene.poll(HOLD) == b""

    def test_a_hold_that_was_not_heeded_ends(self) -> None:
        scene = ready()
        scene.poll("<Check|MPos:0,0,0>")
        scene.engine.realtime(FeedHold(3), scene.now)
        scene.batch("G1X1F500", check=True)
        scene.sent()
        assert b"G1X1F500\n" in scene.poll("<Check|MPos:0,0,0>")


class TestJogs:
    def test_jogs_are_counted_and_keep_programs_out(self) -> None:
        scene = ready()
        for token in range(1, 4):
            scene.engine.submit(Jog(token, {"x": 1.0}, 600.0), scene.now)
        assert scene.sent() == b"$J=G91G21X1.000F600.0\n" * 3
        scene.say("ok")
        assert scene.take(CommandDone) == [CommandDone(1)]
        scene.say("error:15", "ok")
        assert "beyond the travel" in scene.take(CommandFailed)[0].message
        scene.batch("G1X1F500")
        assert b"G1X1" not in scene.poll(JOGGING)
        assert b"G1X1" in scene.poll(IDLE)

    def test_cancel_is_repeated_while_jog_persists(self) -> None:
        """II.7: jogs without an answer run after the cancel, as new ones."""
        scene = ready()
        scene.engine.submit(Jog(1, {"x": 1.0}, 600.0), scene.now)
        scene.sent()
        for token in range(2, 7):
            scene.engine.submit(Jog(token, {"x": 1.0}, 600.0), scene.now)
        scene.engine.realtime(JogCancel(9), scene.now)
        assert scene.sent().startswith(b"\x85")
        assert scene.engine.free() == 0
        failed = {event.token for event in scene.take(CommandFailed)}
        assert failed
        assert scene.poll(JOGGING) == b"\x85"
        assert scene.poll(IDLE) == b""
        scene.say(*["ok"] * (6 - len(failed)))
        assert 9 not in {event.token for event in scene.take(CommandDone)}
        scene.poll(IDLE)
        assert scene.take(CommandDone) == [CommandDone(9)]
        assert scene.engine.free() > 0

    def test_not_while_a_job_is_under_way(self) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.engine.submit(Jog(1, {"x": 1.0}, 600.0), scene.now)
        scene.engine.submit(ReadOffsets(2), scene.now)
        scene.sent()
        assert [event.token for event in scene.take(CommandFailed)] == [1, 2]


class TestTools:
    def test_a_tool_change_of_grblhal(self) -> None:
        scene = ready()
        scene.say("[FIRMWARE:grblHAL]")
        id = scene.batch("T3M6", "G1X1F500")
        scene.sent()
        scene.say("ok")
        scene.poll(TOOL)
        assert scene.take(ToolRequested) == [ToolRequested(3)]
        scene.batch("G1X2")
        scene.engine.submit(ReadSettings(4), scene.now)  # refused: the job waits, and nothing was acknowledged
        assert scene.sent() == b""
        assert scene.take(CommandFailed)[0].token == 4
        scene.engine.realtime(ToolAck(5), scene.now)
        assert scene.sent() == b"\xa3"
        scene.engine.submit(Jog(6, {"z": 5.0}, 100.0), scene.now)
        assert scene.sent() == b"$J=G91G21Z5.000F100.0\n"
        scene.say("ok")  # the jog's, not that of G1X1
        assert {event.token for event in scene.take(CommandDone)} == {5, 6}
        scene.engine.submit(RunBlock(7, ("G38.2Z-5F10",)), scene.now)
        scene.sent()
        scene.engine.realtime(CycleStart(8), scene.now)
        assert b"~" in scene.sent()
        assert 7 in {event.token for event in scene.take(CommandFailed)}
        scene.poll(RUN)
        scene.say("ok", "ok")
        scene.poll(IDLE)
        scene.poll(IDLE)
        assert id in {event.id for event in scene.take(BatchDone)}

    def test_the_second_buffer_ends_with_idle(self) -> None:
        scene = ready()
        scene.poll(TOOL)
        scene.engine.realtime(ToolAck(5), scene.now)
        scene.sent()
        scene.poll(IDLE)
        scene.batch("G1X2F100")
        assert b"G1X2" in scene.sent() + scene.poll(IDLE)


class TestByHand:
    def test_blocks_by_hand_are_done_when_executed(self) -> None:
        scene = ready()
        scene.engine.submit(RunBlock(5, ("G1X1F500",)), scene.now)
        scene.sent()
        scene.say("ok")
        assert scene.take(CommandDone) == []
        scene.poll(IDLE)
        assert scene.take(CommandDone) == [CommandDone(5)]

    def test_a_reader_waits_for_rest(self) -> None:
        scene = ready()
        scene.engine.submit(RunBlock(5, ("G1X1F500",)), scene.now)
        scene.engine.submit(ReadOffsets(6), scene.now)
        scene.sent()
        assert b"$#" not in scene.say("ok")
        assert b"$#\n" in scene.poll(IDLE)

    def test_what_cannot_be(self) -> None:
        scene = ready()
        commands: list[Command] = [
            ListFiles(1),
            RunFile(2, "a"),
            AskToolChange(3),
            RunBlock(4, ("G1?",)),
            RunBlock(5, ()),
            WriteInfo(6, "x" * 81),
        ]
        for command in commands:
            scene.engine.submit(command, scene.now)
        scene.sent()
        assert [event.token for event in scene.take(CommandFailed)] == [1, 2, 3, 4, 5, 6]
        scene.poll("<Sleep|MPos:0,0,0>")
        scene.engine.submit(ReadModal(7), scene.now)
        scene.sent()
        assert "sleeps" in scene.take(CommandFailed)[0].message

    def test_locate_asks_at_once(self) -> None:
        scene = ready()
        scene.poll(IDLE)
        scene.engine.submit(Locate(5), scene.now)
        assert scene.wait(0.0) == b"?"
        scene.say(IDLE)
        assert scene.take(CommandDone) == [CommandDone(5)]

    def test_only_hand_commands_are_submitted(self) -> None:
        scene = ready()
        with pytest.raises(AssertionError):
            scene.engine.submit(FeedHold(1), 0.0)  # type: ignore[arg-type]
        with pytest.raises(AssertionError):
            scene.engine.realtime(Locate(1), 0.0)  # type: ignore[arg-type]

    @pytest.mark.parametrize(
        ("command", "byte"),
        [
            (SafetyDoor(1), b"\x84"),
            (Override(1, "feed", "+10"), b"\x91"),
            (Override(1, "rapid", "25"), b"\x97"),
            (Override(1, "spindle", "-1"), b"\x9d"),
            (CoolantToggle(1, "flood"), b"\xa0"),
            (CoolantToggle(1, "mist"), b"\xa1"),
            (SpindleStopToggle(1), b"\x9e"),
        ],
    )
    def test_keys_go_before_lines(self, command: RealtimeCommand, byte: bytes) -> None:
        scene = ready()
        scene.batch("G1X1F500")
        scene.engine.realtime(command, scene.now)
        assert scene.sent() == byte + b"G1X1F500\n"
        assert scene.take(CommandDone) == [CommandDone(1)]

    def test_keys_that_are_not_there(self) -> None:
        scene = ready()
        scene.engine.realtime(Override(1, "rapid", "+10"), scene.now)
        scene.engine.realtime(ToggleOption(2, "fan"), scene.now)
        assert scene.sent() == b""
        assert [event.token for event in scene.take(CommandFailed)] == [1, 2]
        scene.say("[FIRMWARE:grblHAL]")
        scene.engine.realtime(ToggleOption(3, "fan"), scene.now)
        assert scene.sent() == b"\x8a"


class TestAnything:
    @settings(deadline=None)
    @given(st.lists(st.binary(max_size=60) | st.sampled_from([b"ok\r\n", b"error:9\r\n", b"ALARM:1\r\n"]), max_size=30))
    def test_any_bytes_raise_nothing(self, pieces: list[bytes]) -> None:
        scene = ready()
        scene.batch("G1X1F500", "G1X2")
        for piece in pieces:
            scene.engine.receive_data(piece, scene.now)
            scene.wait(0.05)

    @settings(deadline=None)
    @given(
        st.lists(
            st.sampled_from(
                [IDLE, RUN, HOLD, ALARM, TOOL, JOGGING, "ok", "error:20", "ALARM:1", "ALARM:3", BANNER, "[MSG:x]",
                 "[OPT:V,15,128]", "[GC:G0]", "$1=1", "<Idle|MPG:1>", "<Idle|MPG:0>", "<Sleep>", "<Home>"]
            ), max_size=40
        ),
        st.integers(0, 2**30),
    )  # fmt: skip
    def test_any_story_raises_nothing_and_fits_the_window(self, lines: list[str], seed: int) -> None:
        from random import Random

        random = Random(seed)
        scene = ready()
        keys = [FeedHold, CycleStart, Stop, SoftReset, EmergencyStop, JogCancel, ToolAck]
        for token, line in enumerate(lines):
            choice = random.random()
            if choice < 0.2:
                scene.engine.realtime(random.choice(keys)(token), scene.now)
            elif choice < 0.5 and scene.engine.free():
                scene.engine.submit(RunBlock(token, ("G1X1F500",)), scene.now)
            elif choice < 0.7 and scene.engine.free():
                scene.engine.submit(Jog(token, {"x": 1.0}, 100.0), scene.now)
            scene.wait(random.choice((0.0, 0.1, 1.0, 4.0)))
            scene.say(line)
            assert scene.engine._window.used_bytes <= 128
        ended = [event.token for event in scene.take(CommandDone)] + [
            event.token for event in scene.take(CommandFailed)
        ]
        assert len(ended) == len(set(ended)), "a command has ended twice"

    def test_what_was_said_is_kept_and_shown(self) -> None:
        scene = ready()
        assert {direction for seen in scene.take(MessagesSeen) for _, direction, _ in seen.messages} == {"<", ">"}
        assert any(b"[OPT" in frame.data for frame in scene.engine.recent_frames())


class TestQuickWay:
    """An ok that comes alone is taken without the decoder: what follows from it is the same."""

    @settings(deadline=None, max_examples=60)
    @given(
        st.lists(st.sampled_from([*["G1X1F500", "X2", "X2.001Y5"] * 3, "M8", "G4P0", "G10L2P1X0", "T3"]), min_size=1),
        st.integers(1, 9),
        st.lists(st.sampled_from([*["ok"] * 9, "error:20", RUN, IDLE, "!", "<Run|Bf:3,9>"]), max_size=90),
        st.booleans(),
    )
    def test_however_the_answers_are_cut(self, lines: list[str], size: int, said: list[str], by_bytes: bool) -> None:
        alone, cut = ready(), ready()
        for scene in (alone, cut):
            for start in range(0, len(lines), size):
                scene.batch(*lines[start : start + size], on_error="ignore")
        sent = [alone.sent()], [cut.sent()]
        for line in [*said, "[MSG:the end]"]:
            if line == "!":
                for scene in (alone, cut):
                    scene.engine.realtime(FeedHold(99), scene.now)
                    scene.wait(0.02)
            sent[0].append(alone.say(line))
            data = line.encode() + b"\r\n"
            for piece in (data[at : at + 1] for at in range(len(data))) if by_bytes else (data[:3], data[3:]):
                cut.engine.receive_data(piece, cut.now)
            sent[1].append(cut.sent())
        assert sent[0] == sent[1]
        for kind in {type(event) for event in cut.log} - {MessagesSeen}:  # what is done may be told a little later
            assert alone.take(kind) == cut.take(kind)
        assert [m for e in alone.log for m in e.messages] == [m for e in cut.log for m in e.messages]
        assert alone.engine.recent_frames() == cut.engine.recent_frames()
