"""The engine scene by scene, where the machine counts nothing: what ACKs alone can tell, and what they cannot."""

import pytest

from protocol.commands import EmergencyStop
from protocol.events import BatchDone, BatchFailed, CommandFailed, FateInDoubt, LinkLost, LinkReady, ProtocolFault
from protocol.ncframe.codec import Frame
from protocol.ncframe.dialect import Dialect
from tests.protocol.ncframe.scene import ASKED, Scene, ready_without_counter

X1, X2 = (Frame(x=n).to_bytes() for n in (1, 2))


def test_first_contact_is_one_ack() -> None:
    scene = Scene(Dialect(check="none", counter=False))
    assert scene.sent() == ASKED
    scene.say("ACK")
    scene.hush()
    assert scene.news() == [LinkReady()]
    assert scene.engine.next_id == 1000


def test_ack_is_the_end_of_a_frame_and_ids_rise_by_one() -> None:
    scene = ready_without_counter()
    assert scene.batch("X1", "X2") == X1
    assert scene.say("ACK") == X2
    assert scene.say("ACK") == b""
    assert scene.take(BatchDone) == [BatchDone(1000)]
    assert scene.engine.next_id == 1001


def test_nak_and_one_ack_of_enq_the_frame_again() -> None:
    scene = ready_without_counter()
    scene.batch("X1")
    scene.say("NAK")
    assert scene.hush() == ASKED
    scene.say("ACK")
    assert scene.hush() == X1


@pytest.mark.parametrize("answers", ["ACK ACK", ""])
def test_nak_and_anything_else_is_in_doubt(answers: str) -> None:
    """Two ACKs: one of them may be the frame's, and the NAK noise. It must not go out again."""
    scene = ready_without_counter()
    scene.batch("X1", "X2")
    scene.say("NAK")
    assert scene.hush() == ASKED
    scene.say(answers)
    assert X1 not in scene.wait(5)
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("link", 0, 1)
    assert scene.take(FateInDoubt)[0].doubtful == (1000,)


def test_silence_is_in_doubt_at_once_and_nothing_goes_out_but_enq() -> None:
    scene = ready_without_counter()
    scene.batch("X1", "X2", "Z3")
    scene.say("ACK")
    sent = scene.wait(3.2)
    assert set(sent) == set(ASKED)
    failed = scene.take(BatchFailed)[0]
    assert (failed.reason, failed.lines_done, failed.lines_touched) == ("link", 1, 2)
    assert [fault.kind for fault in scene.take(ProtocolFault)] == ["lost_answer"]
    scene.say("ACK")
    scene.hush()
    scene.wait(1)
    assert scene.engine.free() == 1
    assert scene.engine.next_id == 1001


def test_a_late_ack_after_a_doubt_is_no_ack_of_what_follows() -> None:
    scene = ready_without_counter()
    scene.batch("X1")
    scene.wait(3.2)
    scene.say("ACK ACK")  # the frame's, and that of ENQ
    scene.hush()
    assert scene.batch("X2") == X2
    assert scene.take(BatchDone) == []


def test_an_ack_too_early_is_not_believed_without_asking() -> None:
    scene = ready_without_counter()
    scene.batch("G0 X100000", "X2", expected_s=10)  # 2 s
    scene.now += 0.3
    assert scene.say("ACK") == b""
    assert scene.hush() == ASKED
    assert scene.wait(1.5) == b""
    scene.say("ACK ACK")  # it stands now: the frame's and that of ENQ
    assert scene.hush() == X2


def test_an_ack_too_early_and_then_nak_is_in_doubt() -> None:
    scene = ready_without_counter()
    scene.batch("G0 X100000", expected_s=10)
    scene.say("ACK")
    scene.say("NAK")
    assert scene.hush() == ASKED
    scene.say("ACK")
    scene.hush()
    assert len(scene.take(FateInDoubt)) == 1


def test_an_ack_before_the_frame_can_have_been_on_the_line_is_ignored() -> None:
    scene = ready_without_counter(baud=9600)
    scene.batch("X1", "X2")
    scene.now += 0.002
    assert scene.say("ACK") == b""
    assert scene.take(ProtocolFault)[0].kind == "unasked_answer"
    scene.now += 0.01
    assert scene.say("ACK") == X2


def test_two_acks_in_one_piece_are_one() -> None:
    scene = ready_without_counter()
    scene.batch("X1", "X2", "Z3")
    assert scene.say("ACK ACK") == X2
    assert scene.take(ProtocolFault)[0].kind == "unasked_answer"


def test_a_command_by_hand_in_doubt_says_so() -> None:
    scene = ready_without_counter()
    scene.by_hand("X1", "X2")
    scene.wait(4)
    failed = scene.take(CommandFailed)[0]
    assert "0 of 2 frames executed; the frame on the wire may have been" in failed.message


def test_silence_after_a_doubt_is_a_lost_link() -> None:
    scene = ready_without_counter()
    scene.batch("X1")
    scene.wait(60)
    assert len(scene.take(LinkLost)) == 1
    assert len(scene.take(BatchFailed)) == 1


def test_the_emergency_stop_in_a_doubt() -> None:
    scene = ready_without_counter()
    scene.batch("X1")
    scene.wait(3.05)
    scene.press(EmergencyStop(1))
    scene.say("CAN")
    scene.hush()
    assert scene.engine.free() == 1
    assert scene.statuses()[-1] == "alarm"
