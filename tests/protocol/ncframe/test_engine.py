"""The engine scene by scene, where the machine counts: each way an answer can be wrong, late, early or missing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.commands import (
    ClearAlarm,
    CycleStart,
    EmergencyStop,
    FeedHold,
    JogCancel,
    ListFiles,
    Locate,
    SendBatch,
    SetPosition,
    Stop,
)
from protocol.errors import LocalError
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    FateInDoubt,
    LinkLost,
    LinkReady,
    MachineRestarted,
    ProtocolFault,
    StateReported,
)
from protocol.ncframe.codec import Frame
from protocol.ncframe.dialect import Dialect
from tests.protocol.ncframe.scene import ASKED, STOP, Scene, ready

X1, X2, X3 = (Frame(x=n).to_bytes() for n in (1, 2, 3))


# --- first contact ----------------------------------------------------------------------------------------------------


def test_the_count_is_asked_for_twice_before_it_is_believed() -> None:
    scene = Scene()
    assert scene.sent() == ASKED
    scene.say("ACK 7")
    assert scene.hush() == ASKED
    assert not scene.engine.free()
    scene.say("ACK 7")
    assert scene.hush() == b""
    assert scene.news() == [LinkReady()]
    assert scene.engine.next_id == 8


def test_a_flipped_count_is_not_believed() -> None:
    scene = Scene()
    for words, more in (("ACK 6", ASKED), ("ACK 7", ASKED), ("ACK 7", b"")):
        scene.say(words)
        assert scene.hush().endswith(more)
    assert scene.engine.next_id == 8


def test_nobody_answers() -> None:
    scene = Scene()
    sent = scene.wait(60)
    assert sent == ASKED * scene.dialect.enq_tries
    assert scene.news() == [LinkLost("the machine does not answer")]
    assert scene.engine.next_timer() is None
    scene.say("ACK 7")
    assert scene.press(EmergencyStop(5)) == b""
    assert [event.token for event in scene.take(CommandFailed)] == [5]


def test_a_bad_answer_is_a_fault_and_asked_for_again() -> None:
    scene = Scene()
    scene.sent()
    scene.say("ACK 00 00")
    scene.hush()
    assert [fault.kind for fault in scene.take(ProtocolFault)] == ["malformed"]
    assert scene.wait(0.5) == ASKED


# --- frames -----------------------------------------------------------------------------------------------------------


def test_frames_go_out_one_at_a_time_each_confirmed_by_the_count() -> None:
    scene = ready(7)
    assert scene.batch("X1", "X2") == X1
    assert scene.news() == [BatchSent(8, 1)]
    assert scene.say("ACK") == ASKED
    assert scene.say("ACK 8") == X2
    assert scene.news() == [BatchReceived(8)]
    assert scene.executes(9) == b""
    assert scene.news() == [BatchDone(8)]
    assert scene.engine.free() == 1


def test_the_id_of_a_batch_is_the_number_of_its_first_frame() -> None:
    scene = ready(7)
    assert scene.engine.next_id == 8
    scene.batch("X1", "X2")
    assert scene.engine.next_id == 10  # while they are on their way too: the next row is written meanwhile
    scene.executes(8)
    assert scene.engine.next_id == 10
    scene.executes(9)
    assert scene.engine.next_id == 10


def test_the_count_wraps() -> None:
    scene = ready(2**32 - 2)
    assert scene.engine.next_id == 2**32 - 1
    scene.batch("X1", "X2", "X3")
    assert scene.executes(2**32 - 1) == X2
    assert scene.executes(0) == X3
    assert scene.executes(1) == b""
    assert scene.take(BatchDone) == [BatchDone(2**32 - 1)]
    assert scene.engine.next_id == 2


def test_nak_and_the_same_count_twice_the_frame_again() -> None:
    scene = ready(7)
    scene.batch("X1")
    assert scene.say("NAK") == b""
    assert scene.hush() == ASKED
    scene.say("ACK 7")
    assert scene.hush() == ASKED
    scene.say("ACK 7")
    assert scene.hush() == X1
    assert scene.take(BatchSent)[-1] == BatchSent(8, 2)
    scene.executes(8)
    assert scene.take(BatchDone) == [BatchDone(8)]


def test_a_nak_that_is_noise_does_not_repeat_a_frame() -> None:
    """The machine executes, answers when it stands: its own ACK, then the count."""
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.say("NAK")
    assert scene.hush() == ASKED
    scene.say("ACK ACK 8")
    assert scene.hush() == ASKED  # said once, and a bit may have flipped
    scene.say("ACK 8")
    assert scene.hush() == X2


def test_a_flipped_count_does_not_repeat_a_frame() -> None:
    scene = ready(7)
    scene.batch("X1")
    scene.wait(3.0)
    scene.say("ACK 7")  # 8, with a bit flipped
    assert scene.hush() == ASKED
    scene.say("ACK 8")
    assert scene.hush() == ASKED
    scene.say("ACK 8")
    assert X1 not in scene.hush()
    assert scene.take(BatchDone) == [BatchDone(8)]


def test_a_frame_that_is_refused_again_and_again_fails_the_batch() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.executes(8)
    sent = b""
    for _ in range(scene.dialect.max_naks + 1):
        scene.say("NAK")
        sent += scene.hush()
        for _ in range(2):
            scene.say("ACK 8")
            sent += scene.hush()
    assert sent.count(X2) == scene.dialect.max_naks
    failed = scene.take(BatchFailed)
    assert [(event.reason, event.lines_done, event.lines_touched) for event in failed] == [("error", 1, 1)]
    assert scene.engine.free() == 1


@pytest.mark.parametrize("executed", [True, False])
def test_silence_asks_the_count(executed: bool) -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    assert scene.wait(2.9) == b""
    assert scene.wait(0.2) == ASKED
    assert [fault.kind for fault in scene.take(ProtocolFault)] == ["lost_answer"]
    scene.say(f"ACK {8 if executed else 7}")
    assert scene.hush() == ASKED
    scene.say(f"ACK {8 if executed else 7}")
    assert scene.hush() == (X2 if executed else X1)


def test_a_late_ack_before_the_answer() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.wait(3.1)
    scene.say("ACK ACK 8")
    assert scene.hush() == ASKED
    scene.say("ACK 8")
    assert scene.hush() == X2


def test_answers_to_several_enqs_come_at_once_when_the_machine_stands() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    assert scene.wait(5.9) == ASKED * 3
    scene.say("ACK ACK 8 ACK 8 ACK 8")
    sent = scene.wait(0.7)  # the first time it is said; the question is asked again
    assert sent == ASKED
    scene.say("ACK 8")
    assert scene.hush() == b""  # of four ENQs there may be answers still to come
    assert scene.wait(0.5) == X2


def test_silence_without_end_is_a_lost_link_and_the_batch_stays_open() -> None:
    scene = ready(7)
    scene.batch("X1")
    scene.log.clear()
    scene.wait(60)
    assert scene.take(LinkLost) == [LinkLost("the machine does not answer")]
    assert scene.take(BatchFailed) == []


def test_an_ack_that_is_noise_is_found_out_by_the_count() -> None:
    """ENQ is answered when the machine stands: the true ACK comes first, then the count. Nothing goes out before."""
    scene = ready(7)
    scene.batch("G1 X1 F1", "X2", expected_s=10)
    assert scene.say("ACK") == ASKED
    assert set(scene.wait(4.0)) == set(ASKED)
    scene.say("ACK ACK 8 ACK 8 ACK 8")
    assert scene.wait(1.0) == X2


def test_ack_and_a_count_that_says_no() -> None:
    """The ACK was noise and the frame was lost: the count has the last word, twice."""
    scene = ready(7)
    scene.batch("X1")
    scene.say("ACK")
    scene.say("ACK 7")
    assert scene.hush() == ASKED
    scene.say("ACK 7")
    assert scene.hush() == X1


def test_a_doubled_ack_is_no_ack_of_the_next_frame() -> None:
    scene = ready(7, baud=9600)
    scene.batch("X1", "X2")
    scene.now += 0.02
    scene.say("ACK")
    assert scene.say("ACK 8") == X2
    assert scene.say("ACK") == b""  # X2 takes 4 ms on the line
    assert [fault.kind for fault in scene.take(ProtocolFault)] == ["unasked_answer"]
    scene.now += 0.02
    assert scene.executes(9) == b""
    assert scene.take(BatchDone) == [BatchDone(8)]


def test_time_for_the_frame_for_its_bytes_and_for_what_turns() -> None:
    scene = ready(7, baud=9600)
    scene.batch("G1 X1000 F60")  # a second; six bytes
    assert scene.engine.next_timer() == pytest.approx(scene.now + 1.0 + 2.0 + 6 / 960)
    scene = ready(7)
    scene.batch("G0 M3 X50000 T2")
    assert scene.engine.next_timer() == pytest.approx(scene.now + 1.0 + 2.0 + scene.dialect.auxiliary_s)


def test_after_a_rest_the_machine_is_asked_before_anything_moves() -> None:
    scene = ready(7)
    scene.wait(1.5)
    assert scene.batch("X1") == ASKED
    assert scene.say("ACK 7") == X1


def test_a_machine_that_was_switched_off_and_on_in_a_rest_moves_nothing() -> None:
    scene = ready(7)
    scene.wait(1.5)
    scene.batch("X1")
    scene.say("ACK 0")
    scene.hush()
    scene.say("ACK 0")
    assert scene.hush() == b""
    assert isinstance(scene.take(MachineRestarted)[0], MachineRestarted)
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("restart", 0, 0)
    assert scene.engine.next_id == 1


def test_a_restart_within_a_frame() -> None:
    scene = ready(7)
    scene.batch("X1", "X2", "X3")
    scene.executes(8)
    scene.wait(3.1)
    for _ in range(2):
        scene.say("ACK 0")
        scene.hush()
    assert len(scene.take(MachineRestarted)) == 1
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("restart", 1, 2)
    assert scene.take(StateReported)[-1].position == {}
    assert scene.engine.free() == 1


def test_a_count_of_0_proves_nothing_of_the_first_frame() -> None:
    scene = ready(0)
    scene.batch("X1", "X2")
    scene.wait(3.1)
    for _ in range(2):
        scene.say("ACK 0")
        assert X1 not in scene.hush()
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("link", 0, 1)
    assert scene.take(FateInDoubt)[0].doubtful == (1,)
    scene.wait(0.5)
    scene.greet(0)
    assert scene.engine.free() == 1


@pytest.mark.parametrize("words", ["ACK", ""])
def test_a_count_of_1_proves_nothing_of_the_second_frame(words: str) -> None:
    """The machine may have restarted before the frame and executed it since: then it counts 1 again."""
    scene = ready(1)
    scene.batch("X1")
    scene.say(words)
    sent = scene.wait(3.1 if not words else 0.0)
    for _ in range(2):
        scene.say("ACK 1")
        sent += scene.hush()
    assert X1 not in sent
    assert len(scene.take(FateInDoubt)) == 1


def test_a_count_of_2_does() -> None:
    scene = ready(2)
    scene.batch("X1")
    scene.wait(3.1)
    scene.say("ACK 2")
    scene.hush()
    scene.say("ACK 2")
    assert scene.hush() == X1


def test_but_nak_does() -> None:
    scene = ready(0)
    scene.batch("X1")
    scene.say("NAK")
    assert scene.hush() == ASKED
    scene.say("ACK 0")
    scene.hush()
    scene.say("ACK 0")
    assert scene.hush() == X1


@pytest.mark.parametrize(("wait_s", "words"), [(0.9, "NAK"), (0.0, "NAK ACK")])
def test_but_not_a_nak_that_is_late_or_has_an_ack_behind_it(wait_s: float, words: str) -> None:
    scene = ready(0)
    scene.batch("X1")
    scene.wait(wait_s)
    scene.say(words)
    sent = scene.hush()
    for _ in range(2):
        scene.say("ACK 0")
        sent += scene.hush()
    assert X1 not in sent
    assert len(scene.take(FateInDoubt)) == 1


def test_a_machine_that_counts_more_than_was_sent() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.say("ACK")
    scene.say("ACK 9")
    scene.hush()
    scene.say("ACK 9")
    scene.hush()
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("link", 0, 1)
    assert "counts 9 frames" in scene.take(FateInDoubt)[0].reason


# --- hold, stop, emergency --------------------------------------------------------------------------------------------


def test_xoff_within_a_frame_stops_the_clock() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.say("XOFF")
    assert scene.wait(1000) == b""
    scene.say("XON")
    assert scene.statuses() == ["run", "hold", "run"]
    assert scene.executes(8) == X2


def test_xoff_between_frames_holds_the_next_one() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    assert scene.say("ACK") == ASKED
    assert scene.say("XOFF ACK 8") == b""
    assert scene.hush() == b""
    assert scene.statuses() == ["run", "hold"]
    assert scene.wait(100) == b""
    assert scene.say("XON") == X2


def test_cycle_start_overrides_an_xoff_whose_xon_was_lost() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.say("XOFF")
    scene.executes(8)
    assert scene.press(CycleStart(1)) == X2
    assert scene.take(CommandDone) == [CommandDone(1)]


def test_pause_acts_behind_the_frame() -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.press(FeedHold(1))
    assert scene.take(CommandDone) == []
    assert scene.executes(8) == b""
    assert scene.take(CommandDone) == [CommandDone(1)]
    assert scene.statuses() == ["run", "hold"]
    assert scene.press(CycleStart(2)) == X2
    scene.executes(9)
    assert scene.take(BatchDone) == [BatchDone(8)]


def test_while_held_the_machine_is_asked_for() -> None:
    scene = ready(7, dialect=Dialect(check="none", poll_interval_s=5))
    scene.batch("X1", "X2")
    scene.press(FeedHold(1))
    scene.executes(8)
    assert scene.wait(5) == ASKED
    assert scene.say("ACK 8") == b""
    assert scene.press(CycleStart(2)) == X2


def test_a_hold_at_rest_holds_what_comes() -> None:
    scene = ready(7)
    scene.press(FeedHold(1))
    assert scene.take(CommandDone) == [CommandDone(1)]
    assert scene.batch("X1") == b""
    assert scene.statuses() == ["hold"]
    assert scene.press(CycleStart(2)) == X1


@pytest.mark.parametrize("held", [True, False])
def test_stop_ends_the_batch_behind_the_frame(held: bool) -> None:
    scene = ready(7)
    scene.batch("X1", "X2", "X3")
    if held:
        scene.press(FeedHold(1))
        scene.executes(8)
        assert scene.press(Stop(2)) == b""
    else:
        scene.press(Stop(2))
        assert scene.take(BatchFailed) == []
        assert scene.executes(8) == b""
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("stop", 1, 1)
    assert scene.take(CommandDone)[-1] == CommandDone(2)
    assert scene.engine.free() == 1
    assert scene.engine.next_id == 9


def test_the_emergency_stop_goes_out_at_once_until_it_is_heard() -> None:
    scene = ready(7)
    scene.engine.submit(SendBatch(8, ("X1", "X2"), 1.0), scene.now)
    assert scene.press(EmergencyStop(1)) == STOP  # and not the frame that had not gone out
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("estop", 0, 1)
    assert scene.wait(1.0) == STOP * 3
    scene.say("CAN")
    assert scene.hush() == b""
    assert scene.take(CommandDone) == [CommandDone(1)]
    assert scene.statuses()[-1] == "alarm"
    with pytest.raises(LocalError, match="alarm"):
        scene.batch("X1")
    scene.by_hand("X1")
    assert "clear it" in scene.take(CommandFailed)[0].message


def test_a_count_in_which_can_stands_is_not_the_can_of_an_emergency_stop() -> None:
    scene = ready(0x1817)
    scene.batch("X1")
    scene.wait(3.1)  # ENQ is open
    scene.press(EmergencyStop(1))
    scene.say("ACK 6168")  # 00 00 18 18: the late answer to ENQ ends with CAN's byte
    scene.hush()
    assert scene.take(CommandDone) == []
    scene.say("CAN")
    scene.hush()
    assert scene.take(CommandDone) == [CommandDone(1)]


def test_the_alarm_is_cleared_and_the_count_taken_anew() -> None:
    scene = ready(7)
    scene.press(EmergencyStop(1))
    scene.say("CAN")
    scene.hush()
    assert scene.submit(ClearAlarm(2)) == ASKED
    scene.say("ACK 0")
    assert scene.hush() == ASKED
    scene.say("ACK 0")
    scene.hush()
    assert scene.take(CommandDone)[-1] == CommandDone(2)
    assert scene.take(MachineRestarted) == []
    assert scene.statuses()[-1] == "idle"
    assert scene.engine.next_id == 1


def test_an_emergency_stop_that_is_not_heard() -> None:
    scene = ready(7)
    scene.press(EmergencyStop(1))
    sent = scene.wait(60)
    assert set(sent) == set(STOP)
    assert "own emergency button" in scene.take(CommandFailed)[0].message
    assert len(scene.take(LinkLost)) == 1


@pytest.mark.parametrize("asking", [False, True])
def test_the_machine_aborts_by_itself(asking: bool) -> None:
    scene = ready(7)
    scene.batch("X1", "X2")
    scene.executes(8)
    if asking:
        scene.wait(3.1)
    scene.say("CAN")
    scene.hush()
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("alarm", 1, 2)
    alarm = scene.take(StateReported)[-1]
    assert (alarm.status, alarm.position) == ("alarm", {})
    assert alarm.alarm is not None


def test_pressed_twice_it_is_one_emergency_stop() -> None:
    scene = ready(7)
    assert scene.press(EmergencyStop(1)) == STOP
    assert scene.press(EmergencyStop(2)) == b""
    scene.say("CAN")
    scene.hush()
    assert scene.take(CommandDone) == [CommandDone(1), CommandDone(2)]


def test_the_hold_key_at_rest_is_a_state() -> None:
    scene = ready(7)
    scene.say("XOFF XOFF")
    scene.say("XON")
    assert scene.statuses() == ["hold", "idle"]
    scene.press(FeedHold(1))
    scene.press(CycleStart(2))
    assert scene.statuses() == ["hold", "idle"]


def test_in_alarm_xoff_changes_no_state() -> None:
    scene = ready(7)
    scene.say("CAN")
    scene.log.clear()
    scene.say("XOFF")
    assert scene.statuses() == []


# --- by hand ----------------------------------------------------------------------------------------------------------


def test_a_block_by_hand() -> None:
    scene = ready(7)
    assert scene.by_hand("X1", "X2") == X1
    scene.executes(8)
    scene.executes(9)
    assert scene.news()[-1] == CommandDone(1)
    assert scene.engine.next_id == 10


def test_no_block_by_hand_is_sent_that_is_no_frame() -> None:
    scene = ready(7)
    assert scene.by_hand("G0 X1.5") == b""
    assert "'X1.5'" in scene.take(CommandFailed)[0].message
    scene.by_hand()
    assert scene.take(CommandDone) == [CommandDone(2)]


@pytest.mark.parametrize(("sent", "said"), [(True, "not known"), (False, "the link was lost")])
def test_a_lost_link_answers_what_is_open_by_hand(sent: bool, said: str) -> None:
    scene = ready(7)
    if not sent:
        scene.wait(1.5)  # so that the machine is asked first
    scene.by_hand("X1")
    scene.wait(60)
    failed = scene.take(CommandFailed)[0]
    assert failed.token == 1
    assert said in failed.message
    assert ("not known" in failed.message) == sent


def test_a_lost_link_answers_a_question() -> None:
    scene = ready(7)
    scene.submit(Locate(1))
    scene.wait(60)
    assert [event.token for event in scene.take(CommandFailed)] == [1]


def test_what_it_does_not_know() -> None:
    scene = ready(7)
    scene.submit(ListFiles(1))
    scene.press(JogCancel(2))
    assert [event.token for event in scene.take(CommandFailed)] == [1, 2]


def test_where_is_it() -> None:
    scene = ready(7)
    scene.batch("X1000 Z-500", end={"x": 5.0, "z": 1.0})
    scene.executes(8)
    assert scene.submit(Locate(1)) == ASKED
    scene.say("ACK 8")
    assert scene.take(StateReported)[-1].position == {"x": 5.0, "z": 1.0}
    assert scene.take(CommandDone) == [CommandDone(1)]
    scene.by_hand("X-250")
    scene.executes(9)
    assert scene.take(StateReported)[-1].position == {"x": 4.75, "z": 1.0}


def test_the_position_within_a_batch_follows_from_its_end() -> None:
    scene = ready(7)
    scene.batch("X1000", "X2000", "Z500", end={"x": 10.0, "z": 0.0})
    scene.now += 0.3
    scene.executes(8)
    assert scene.take(StateReported)[-1].position == {"x": 8.0, "z": -0.5}


def test_idle_is_told_when_nothing_follows() -> None:
    scene = ready(7)
    scene.batch("X1")
    scene.executes(8)
    assert scene.statuses() == ["run"]
    scene.wait(0.3)
    assert scene.statuses() == ["idle"]


def test_at_rest_the_machine_is_asked_for_now_and_then() -> None:
    scene = ready(7, dialect=Dialect(check="none", poll_interval_s=5))
    assert scene.wait(5) == ASKED
    scene.say("ACK 7")
    assert scene.wait(5) == ASKED
    for _ in range(2):
        scene.say("ACK 0")
        scene.hush()
    assert len(scene.take(MachineRestarted)) == 1
    scene.wait(100)
    assert len(scene.take(LinkLost)) == 1


def test_a_late_answer_at_rest_is_a_fault_and_no_more() -> None:
    scene = ready(7)
    scene.say("ACK")
    scene.say("NAK 42")
    assert {fault.kind for fault in scene.take(ProtocolFault)} == {"unasked_answer"}
    assert scene.news() == []


# --- our own mistakes -------------------------------------------------------------------------------------------------


def test_a_batch_out_of_turn() -> None:
    scene = ready(7)
    with pytest.raises(LocalError, match="next ID is 8"):
        scene.submit(SendBatch(9, ("X1",), 1.0))
    with pytest.raises(LocalError, match=r"'X1\.5'"):
        scene.submit(SendBatch(8, ("X1.5",), 1.0))
    with pytest.raises(LocalError, match="no frames"):
        scene.submit(SendBatch(8, (), 1.0))
    scene.batch("X1")
    with pytest.raises(LocalError, match="a frame is on the wire"):
        scene.batch("X2")


def test_the_recorder_and_the_console() -> None:
    scene = ready(7)
    scene.batch("F5 T1")
    scene.executes(8)
    assert scene.console[-4:] == ["> F5 T1", "< ACK", "> ENQ", "< ACK 8"]
    frames = scene.engine.recent_frames()
    assert [frame.data.hex() for frame in frames if frame.direction == ">"][-2:] == ["250000000501", "05"]


@given(st.lists(st.tuples(st.binary(max_size=12), st.floats(0, 3)), max_size=25), st.booleans())
def test_any_bytes_at_any_time_raise_nothing(bursts: list[tuple[bytes, float]], counter: bool) -> None:
    scene = Scene(Dialect(counter=counter)).greet(7)
    for data, wait_s in bursts:
        if scene.engine.free() and not any(
            isinstance(event, StateReported) and event.status == "alarm" for event in scene.log
        ):
            scene.batch("X1", "Z2")
        scene.engine.receive_data(data, scene.now)
        scene.wait(wait_s)


# --- where it stands --------------------------------------------------------------------------------------------------


def test_somebody_says_where_it_stands_and_nothing_goes_out() -> None:
    scene = ready()
    assert scene.submit(SetPosition(5, {"x": 10.0})) == b""
    (report,) = scene.take(StateReported)
    assert (report.position, report.complete) == ({"x": 10.0}, True)
    assert scene.take(CommandDone) == [CommandDone(5)]
    assert scene.engine.free() == 1


def test_in_alarm_the_position_is_not_taken() -> None:
    scene = ready()
    scene.say("CAN")
    scene.log.clear()
    scene.submit(SetPosition(5, {"x": 10.0}))
    assert [type(event) for event in scene.log] == [CommandFailed]


def test_a_stop_ends_a_hold() -> None:
    scene = ready()
    scene.press(FeedHold(1))
    assert scene.take(StateReported)[-1].status == "hold"
    scene.press(Stop(2))
    assert scene.take(StateReported)[-1].status == "idle"
