"""The engine against a machine played by hand: each rule of elvinto §3-§6 as a short scene."""

import pytest

from protocol.commands import (
    AskToolChange,
    ClearAlarm,
    EmergencyStop,
    FeedHold,
    Home,
    ListFiles,
    Locate,
    RunBlock,
    RunFile,
    SendBatch,
)
from protocol.elvinto.dialect import Dialect
from protocol.elvinto.engine import ElvintoEngine
from protocol.elvinto.ids import came_of
from protocol.engine import Engine
from protocol.errors import LocalError, MessageTooLongError
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    FateUnknown,
    FilesListed,
    LinkLost,
    LinkReady,
    MachineRestarted,
    ProgramEnded,
    ProtocolFault,
    StateReported,
    ToolRequested,
)
from tests.harness.scripted import QUIET, Scripted, framed, state


def ready(**position: float) -> Scripted:
    scene = Scripted()
    scene.shake_hands(**position)
    return scene


def test_the_engine_is_what_the_contract_asks_for():
    engine: Engine = ElvintoEngine(QUIET, first_id=1, baud=115200, now=0.0)
    assert engine.free() == 0


class TestHandshake:
    def test_init_ready_reports_position(self):
        scene = Scripted()
        scene.say()
        assert scene.sent() == [(1000, "INIT")]
        scene.say("RECEIVED,ID<#1000", "OK,ID<#1000")
        assert scene.sent() == [(1001, "READY")]
        scene.say("READY")
        assert scene.sent() == [(1002, "GCODE,DATA<#W90")]
        scene.say("RECEIVED,ID<#1002", "OK,ID<#1002")
        assert scene.sent() == [(1003, "GCODE,DATA<#W95")]
        assert scene.engine.free() == 0
        scene.say("RECEIVED,ID<#1003", state("idle", 10, 20, 30))
        assert scene.take(LinkReady) == []  # the machine is still busy with the question until OK, or OK is lost
        scene.wait(0.31)
        assert scene.take(LinkReady)
        assert scene.engine.free() == 1

    def test_a_machine_that_acknowledges_no_init_and_reports_no_moves(self):
        scene = Scripted(Dialect(init_acknowledged=False, report_moves=False, poll_interval_s=0))
        assert scene.sent() == [(1000, "INIT"), (1001, "READY")]
        scene.say("READY")
        assert scene.sent() == [(1002, "GCODE,DATA<#W95")]

    def test_what_does_no_harm_twice_is_repeated_under_new_ids(self):
        scene = Scripted()
        assert scene.wait(0.5) == [(1000, "INIT"), (1001, "INIT")]
        scene.say("OK,ID<#1000")
        assert scene.wait(0.35) == [(1002, "READY"), (1003, "READY")]

    def test_a_lost_ok_of_init_does_not_hang_the_handshake(self):
        scene = Scripted()
        scene.say("RECEIVED,ID<#1000")
        assert scene.wait(0.31)[-1] == (1001, "READY")

    def test_late_answers_to_repeated_ready_are_no_restart(self):
        scene = Scripted()
        scene.say("OK,ID<#1000")
        scene.wait(0.31)
        scene.say("READY", "READY")
        assert scene.take(MachineRestarted) == []

    def test_silence_gives_the_link_up(self):
        scene = Scripted()
        assert len(scene.wait(60)) == 10
        assert scene.take(LinkLost)
        assert scene.engine.next_timer() is None
        scene.say("READY")
        assert scene.sent() == []

    def test_a_machine_without_w90_works_all_the_same(self):
        scene = Scripted()
        scene.say("OK,ID<#1000", "READY")
        scene.say("ERROR,ID<#1002,NUM<#1")
        assert scene.sent()[-1] == (1003, "GCODE,DATA<#W95")

    def test_a_machine_in_alarm_is_shown_as_such_and_can_be_cleared(self):
        scene = Scripted()
        scene.say("OK,ID<#1000", "READY")
        scene.sent()
        while not any(message == "READY" for _, message in scene.wait(0.1)):
            assert scene.now < 30  # W90 is not executed; in the end: is anybody there?
        scene.say("READY")
        states = scene.take(StateReported, LinkReady)
        assert [type(e) for e in states] == [StateReported, LinkReady]
        assert states[0].status == "alarm"
        scene.engine.submit(ClearAlarm(7), scene.now)
        ((id, message),) = scene.sent()
        assert message == "RESETALERT"
        scene.say(f"OK,ID<#{id}")
        assert scene.take(CommandDone) == [CommandDone(7)]
        assert scene.sent()[0][1] == "INIT"  # the handshake that the alarm cut off


class TestBatch:
    def test_sent_received_done(self):
        scene = ready()
        batch = scene.batch("G1X1", "G1X2", end={"x": 2})
        scene.say(f"RECEIVED,ID<#{batch.id}")
        scene.say(state("run", 1), f"OK,ID<#{batch.id}")
        assert scene.take(BatchSent, BatchReceived, BatchDone) == [
            BatchSent(batch.id, 1),
            BatchReceived(batch.id),
            BatchDone(batch.id),
        ]
        assert scene.engine.free() == 1
        assert scene.engine.next_id == batch.id + 1
        assert scene.sent() == []  # not a byte more than the protocol needs

    def test_received_in_the_spelling_of_the_prose(self):
        scene = ready()
        batch = scene.batch("G1X1")
        scene.say(f"RECEIVE,ID<#{batch.id}")
        assert scene.take(BatchReceived)

    def test_ok_counts_for_received(self):
        scene = ready()
        batch = scene.batch("G1X1")
        scene.say(f"OK,ID<#{batch.id}")
        assert scene.take(BatchDone) == [BatchDone(batch.id)]

    def test_the_same_bytes_under_the_same_id_with_a_restart_probe_between(self):
        scene = ready()
        batch = scene.batch("G1X1")
        assert scene.wait(0.65) == [
            (1, "GCODE,DATA<#W95"),
            (batch.id, "GCODE,DATA<#G1X1"),
            (2, "GCODE,DATA<#W95"),
            (batch.id, "GCODE,DATA<#G1X1"),
        ]

    def test_after_a_repetition_the_memory_is_proven_before_anything_else(self):
        scene = ready()
        batch = scene.batch("G1X1", end={"x": 1})
        scene.wait(0.31)
        scene.say(f"RECEIVED,ID<#{batch.id}", f"OK,ID<#{batch.id}")
        assert scene.take(BatchDone) == []
        assert scene.engine.free() == 0
        ((id, _),) = scene.sent()
        assert id == batch.id + 1
        # A machine whose memory a flipped digit raised acknowledges, and executes nothing: no STATE.
        scene.say(f"RECEIVED,ID<#{id}", f"OK,ID<#{id}")
        assert scene.engine.free() == 0
        later = scene.wait(2)
        assert later[0] == (id + 1, "GCODE,DATA<#W95")
        # Three tries in vain: the next ID has a digit more.
        assert later[2][0] == 10_000
        scene.say(state("idle", 1), f"OK,ID<#{later[-1][0]}")
        assert scene.engine.free() == 1
        assert scene.engine.next_id == later[-1][0] + 1
        assert scene.take(BatchDone) == [BatchDone(batch.id)]

    def test_a_restart_between_two_copies_leaves_the_batch_in_doubt(self):
        scene = ready()
        batch = scene.batch("G1X1", end={"x": 1})
        scene.wait(0.31)
        scene.say(f"RECEIVED,ID<#{batch.id}", f"OK,ID<#{batch.id}", "READY")
        (failed,) = scene.take(BatchDone, BatchFailed)
        assert failed.reason == "restart"
        assert "twice" in failed.message

    def test_a_link_lost_before_the_proof_leaves_the_batch_open(self):
        scene = ready()
        batch = scene.batch("G1X1", end={"x": 1})
        scene.wait(0.31)
        scene.say(f"RECEIVED,ID<#{batch.id}", f"OK,ID<#{batch.id}")
        scene.wait(60)
        assert [type(e) for e in scene.take(BatchDone, BatchFailed, LinkLost)] == [LinkLost]

    def test_an_acknowledgement_of_an_id_never_given_raises_the_ids(self):
        scene = ready()
        batch = scene.batch("G1X1")
        scene.say("RECEIVED,ID<#9004")
        assert [e.kind for e in scene.take(ProtocolFault)] == ["unknown_id"]
        scene.say(f"OK,ID<#{batch.id}")
        assert scene.sent() == [(9005, "GCODE,DATA<#W95")]
        scene.say("RECEIVED,ID<#9005", state(), "OK,ID<#9005")
        assert scene.engine.next_id == 9006

    def test_a_stale_acknowledgement_is_counted_and_ignored(self):
        scene = ready()
        batch = scene.batch("G1X1")
        scene.say(f"OK,ID<#{batch.id - 1}", "RECEIVED,ID<#3", "OK", "RECEIVED,ID<#x")
        assert scene.take(BatchDone, BatchReceived) == []
        scene.say(f"OK,ID<#{batch.id}")
        assert scene.take(BatchDone)

    def test_error_fails_the_batch(self):
        scene = ready()
        batch = scene.batch("G1X1", "G5")
        scene.say(f"ERROR,ID<#{batch.id},NUM<#3")
        assert scene.take(BatchFailed) == [BatchFailed(batch.id, "error", 3, "the machine answered ERROR 3")]
        assert scene.engine.free() == 1

    def test_an_alarm_fails_the_batch_and_nothing_is_sent_until_it_is_cleared(self):
        scene = ready()
        batch = scene.batch("G1X900")
        scene.say(f"RECEIVED,ID<#{batch.id}", state("axisalarm", 800, more=" ALARMNUM<#6, AXISNUM<#1"))
        report, failed = scene.take(StateReported, BatchFailed)
        assert report.alarm.code == 6
        assert report.alarm.axis == "x"
        assert failed.reason == "alarm"
        assert "soft limit" in failed.message
        assert scene.wait(60) == []
        with pytest.raises(LocalError):
            scene.engine.submit(SendBatch(scene.engine.next_id, ("G1X1",), 1), scene.now)
        scene.engine.submit(ClearAlarm(1), scene.now)
        ((id, _),) = scene.sent()
        scene.say(state("axisalarm", 800), f"RECEIVED,ID<#{id}", f"OK,ID<#{id}", state("idle", 800))
        assert scene.take(CommandDone) == [CommandDone(1)]
        scene.answer_position(800)
        assert scene.engine.free() == 1

    def test_the_position_is_asked_for_where_it_cannot_be_computed(self):
        scene = ready()
        batch = scene.batch("G28", locate_after=True)
        scene.say(f"RECEIVED,ID<#{batch.id}", f"OK,ID<#{batch.id}")
        assert scene.take(BatchDone) == []
        scene.answer_position(0, 0, 50)
        (done,) = scene.take(BatchDone)
        assert done.position["z"] == 50

    def test_after_the_end_of_a_program_the_memory_is_proven(self):
        scene = ready()
        batch = scene.batch("M30", ends_program=True)
        scene.say(f"OK,ID<#{batch.id}")
        assert scene.take(BatchDone)
        assert scene.engine.free() == 0
        scene.answer_position()
        assert scene.engine.free() == 1

    def test_the_end_of_a_program_is_repeated_without_probes(self):
        scene = ready()
        batch = scene.batch("M30", ends_program=True)
        assert scene.wait(0.61) == [(batch.id, "GCODE,DATA<#M30")] * 2

    def test_two_idle_reports_stand_for_a_lost_ok(self):
        scene = ready()
        batch = scene.batch("G1X5", end={"x": 5})
        scene.say(f"RECEIVED,ID<#{batch.id}", state("run", 2), state("idle", 5))
        assert scene.take(BatchDone) == []
        scene.say(state("idle", 5))
        assert scene.take(BatchDone) == [BatchDone(batch.id, inferred=True)]

    def test_one_report_at_its_end_stands_for_a_lost_received_and_ok(self):
        scene = ready()
        batch = scene.batch("G1X5", end={"x": 5})
        scene.say(state("idle", 5))
        scene.answer_position(5)
        assert scene.take(BatchDone) == [BatchDone(batch.id, inferred=True)]

    def test_a_report_from_where_it_began_says_nothing(self):
        scene = ready()
        batch = scene.batch("G1X5", end={"x": 5})
        scene.say(state("idle", 0))
        assert scene.wait(0.31)[-1] == (batch.id, "GCODE,DATA<#G1X5")

    def test_what_is_seen_running_is_not_repeated(self):
        scene = ready()
        batch = scene.batch("G1X5", end={"x": 5})
        scene.say(state("run", 1))
        assert scene.wait(1.9) == []
        scene.say(state("run", 2))
        assert scene.wait(1.9) == []
        scene.say(f"OK,ID<#{batch.id}")
        assert scene.take(BatchDone) == [BatchDone(batch.id)]

    def test_what_was_seen_running_and_fell_silent_is_looked_into(self):
        scene = ready()
        batch = scene.batch("G1X5", end={"x": 5})
        scene.say(state("run", 1))
        scene.wait(2.6)
        assert scene.take(FateUnknown) == [FateUnknown((batch.id,))]

    def test_seen_running_and_idle_is_looked_into(self):
        scene = ready()
        batch = scene.batch("G1X5", end={"x": 5})
        scene.say(state("run", 1), state("idle", 5))
        assert scene.take(FateUnknown) == [FateUnknown((batch.id,))]

    def test_an_error_of_a_repeated_batch_proves_nothing_of_the_memory(self):
        scene = ready()
        batch = scene.batch("G5")
        scene.wait(0.31)
        scene.say(f"ERROR,ID<#{batch.id},NUM<#1")
        assert scene.take(BatchFailed)
        scene.answer_position()
        assert scene.engine.free() == 1

    def test_any_other_error_is_counted(self):
        scene = ready()
        scene.say("ERROR,ID<#77777,NUM<#1")
        assert [e.kind for e in scene.take(ProtocolFault)] == ["unknown_id"]

    def test_a_program_end_repeated_while_idle_reports_come_in(self):
        scene = ready()
        batch = scene.batch("M30", ends_program=True)
        scene.say(state("idle"))
        assert scene.wait(0.31) == [(batch.id, "GCODE,DATA<#M30")]

    def test_misuse_raises(self):
        scene = ready()
        with pytest.raises(LocalError, match="out of turn"):
            scene.engine.submit(SendBatch(scene.engine.next_id + 1, ("G1X1",), 1), scene.now)
        with pytest.raises(MessageTooLongError):
            scene.engine.submit(SendBatch(scene.engine.next_id, ("G1X1",) * 4000, 1), scene.now)
        assert scene.engine.free() == 1
        assert scene.sent() == []
        scene.batch("G1X1")
        with pytest.raises(LocalError, match="takes no command"):
            scene.engine.submit(Locate(1), scene.now)

    def test_silence_of_everything_gives_the_link_up(self):
        scene = ready()
        scene.batch("G1X1")
        scene.wait(10)
        assert scene.take(LinkLost)


class TestRestart:
    def test_an_unasked_ready_fails_what_is_in_flight_and_initialises(self):
        scene = ready()
        batch = scene.batch("G1X1")
        scene.say(f"RECEIVED,ID<#{batch.id}", "READY")
        restarted, failed = scene.take(MachineRestarted, BatchFailed)
        assert isinstance(restarted, MachineRestarted)
        assert (failed.id, failed.reason) == (batch.id, "restart")
        assert [message for _, message in scene.sent()] == ["INIT"]

    def test_a_garbled_ready_is_looked_into(self):
        scene = ready()
        batch = scene.batch("G1X1", end={"x": 1})
        scene.engine.receive_data(framed("READY").replace(b"MD5<#a", b"MD5<#b"), scene.now)
        assert scene.take(FateUnknown) == [FateUnknown((batch.id,))]
        assert scene.sent()[0] == (1, "GCODE,DATA<#W95")

    def test_in_idle_too(self):
        scene = ready()
        scene.say("READY")
        assert scene.take(MachineRestarted)
        scene.shake_hands()


class TestByHand:
    def test_blocks_by_hand(self):
        scene = ready()
        scene.engine.submit(RunBlock(5, ("G91", "G1X1F100", "G90")), scene.now)
        ((id, message),) = scene.sent()
        assert message == "GCODE,DATA<#G91|G1X1F100|G90"
        scene.say(f"RECEIVED,ID<#{id}", f"OK,ID<#{id}")
        assert scene.take(CommandDone) == [CommandDone(5)]
        scene.answer_position(1)  # where it has come to
        assert scene.engine.free() == 1

    def test_an_error_is_the_answer(self):
        scene = ready()
        scene.engine.submit(RunBlock(5, ("G5",)), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"ERROR,ID<#{id},NUM<#2")
        (failed,) = scene.take(CommandFailed)
        assert (failed.token, failed.code) == (5, 2)

    def test_where_it_stands(self):
        scene = ready()
        scene.engine.submit(Locate(9), scene.now)
        scene.answer_position(3)
        report, done = scene.take(StateReported, CommandDone)
        assert report.position["x"] == 3
        assert done == CommandDone(9)

    def test_clearing_an_alarm_without_an_answer_fails(self):
        scene = ready()
        scene.say(state("cnscalarm", more=",ALARMNUM<#100"))
        scene.engine.submit(ClearAlarm(1), scene.now)
        scene.wait(1)
        scene.say("STATE,TYPE<#cnscalarm,MX<#0")
        scene.wait(10)
        assert [e.token for e in scene.take(CommandFailed)] == [1]

    def test_idle_is_watched(self):
        scene = Scripted(Dialect())
        scene.shake_hands()
        assert scene.wait(5.1)[0][1] == "GCODE,DATA<#W95"
        scene.wait(60)
        assert scene.take(LinkLost)


class TestEmergency:
    def test_it_goes_out_before_everything_and_fails_what_is_in_flight(self):
        scene = ready()
        batch = SendBatch(scene.engine.next_id, ("G1X9",), 1)
        scene.engine.submit(batch, scene.now)
        scene.engine.realtime(EmergencyStop(3), scene.now)
        assert scene.sent() == [(batch.id + 1, "GCODE,DATA<#W98")]  # the batch had not gone out: it never will
        assert scene.take(BatchFailed) == [BatchFailed(batch.id, "estop", 100, "the emergency stop was pressed")]
        scene.say(state("cnscalarm", more=",ALARMNUM<#100"))
        report, done = scene.take(StateReported, CommandDone)
        assert report.alarm.code == 100
        assert done == CommandDone(3)
        assert scene.wait(60) == []

    def test_it_is_repeated_under_new_ids_until_heard(self):
        scene = ready()
        batch = scene.batch("G1X9")
        scene.say(f"RECEIVED,ID<#{batch.id}")
        scene.engine.realtime(EmergencyStop(3), scene.now)
        sent = scene.wait(2)
        assert [message for _, message in sent] == ["GCODE,DATA<#W98"] * 7
        assert len({id for id, _ in sent}) == 7
        assert sent[3][0] >= 10_000
        scene.say(f"RECEIVED,ID<#{sent[2][0]}")
        assert scene.take(CommandDone) == [CommandDone(3)]

    def test_pressed_twice_both_are_answered(self):
        scene = ready()
        scene.engine.realtime(EmergencyStop(1), scene.now)
        scene.engine.realtime(EmergencyStop(2), scene.now)
        scene.say(state("cnscalarm", more=",ALARMNUM<#100"))
        assert scene.take(CommandDone) == [CommandDone(1), CommandDone(2)]

    def test_in_the_handshake(self):
        scene = Scripted()
        scene.engine.realtime(EmergencyStop(1), scene.now)
        assert [m for _, m in scene.sent()] == ["GCODE,DATA<#W98"]
        scene.say("RECEIVED,ID<#1001")
        assert [type(e) for e in scene.take(CommandDone, LinkReady)] == [CommandDone, LinkReady]

    def test_a_restart_meanwhile_is_followed_by_a_new_handshake_when_the_alarm_is_cleared(self):
        scene = ready()
        scene.engine.realtime(EmergencyStop(1), scene.now)
        scene.sent()
        scene.say("READY", state("cnscalarm", more=",ALARMNUM<#100"))
        scene.engine.submit(ClearAlarm(2), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"OK,ID<#{id}")
        assert scene.sent()[0][1] == "INIT"

    def test_on_a_dead_link_it_says_so(self):
        scene = ready()
        scene.engine.realtime(EmergencyStop(1), scene.now)
        scene.wait(60)
        failed, lost = scene.take(CommandFailed, LinkLost)
        assert failed.token == 1
        assert isinstance(lost, LinkLost)
        scene.engine.realtime(EmergencyStop(2), scene.now)
        assert "own emergency button" in scene.take(CommandFailed)[0].message


class TestSdCard:
    def listing(self) -> tuple[Scripted, int]:
        scene = ready()
        scene.engine.submit(ListFiles(4), scene.now)
        ((id, message),) = scene.sent()
        assert message == "READDIR"
        return scene, id

    def test_files_are_listed(self):
        scene, _ = self.listing()
        scene.say(
            "SDD_OK,TYPE<#SDHC,FS<#FAT,ROOT<#OK", "DIR_BEGIN", "FILE,NAME<#a.nc", "FILE,NAME<0LEsLm5j", "END_BEGIN"
        )
        listed, done = scene.take(FilesListed, CommandDone)
        assert listed == FilesListed(4, ("a.nc", "б,.nc"), readable=True, card="SDHC")
        assert done == CommandDone(4)

    @pytest.mark.parametrize(
        ("answer", "problem"),
        [
            ("SDD_NO", "no SD card"),
            ("SDD_OK,TYPE<#SD1,FS<#NO,ROOT<#OK", "FAT"),
            ("SDD_OK,TYPE<#SD1,FS<#FAT,ROOT<#NO", "root folder"),
        ],
    )
    def test_a_card_that_cannot_be_read_says_why(self, answer, problem):
        scene, _ = self.listing()
        scene.say(answer)
        (listed,) = scene.take(FilesListed)
        assert not listed.readable
        assert problem in listed.problem

    def test_a_listing_with_a_hole_is_asked_for_again(self):
        scene, id = self.listing()
        scene.say("DIR_BEGIN", "FILE,NAME<#a.nc")
        scene.engine.receive_data(framed("FILE,NAME<#b.nc").replace(b"b.nc", b"c.nc"), scene.now)
        scene.say("DIR_END")
        assert scene.take(FilesListed) == []
        assert scene.wait(0.31) == [(id + 1, "READDIR")]
        scene.say("DIR_BEGIN", "FILE,NAME<#a.nc", "FILE,NAME<#b.nc", "DIR_END")
        assert scene.take(FilesListed)[0].names == ("a.nc", "b.nc")

    def test_no_answer_is_told(self):
        scene, _ = self.listing()
        scene.wait(20)
        assert [e.token for e in scene.take(CommandFailed)] == [4]

    def test_a_program_runs_from_the_card(self):
        scene = ready()
        scene.engine.submit(RunFile(6, "деталь 1.nc"), scene.now)
        ((id, message),) = scene.sent()
        assert message == "RUN,NAME<0LTQtdGC0LDQu9GMIDEubmM="
        scene.say(f"RECEIVED,ID<#{id}")
        assert scene.take(CommandDone) == []  # ERROR may follow
        assert scene.engine.free() == 0
        scene.say(state("run", 1))
        assert scene.take(CommandDone) == [CommandDone(6)]
        scene.say("TOOL,NUM<#2", "PROGRAM_END")
        assert scene.take(ToolRequested, ProgramEnded) == [ToolRequested(2), ProgramEnded()]
        scene.answer_position()
        assert scene.engine.free() == 1

    def test_a_lost_program_end_is_found_out(self):
        scene = ready()
        scene.engine.submit(RunFile(6, "a.nc"), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"OK,ID<#{id}")
        scene.wait(1.5)
        scene.say(state("run", 1))  # not silent yet
        asked = scene.wait(5.5)
        assert [m for _, m in asked] == ["GCODE,DATA<#W95"] * 2
        scene.say(state("idle"), state("idle"))
        assert scene.take(ProgramEnded)

    def test_a_program_that_says_nothing_is_taken_to_run(self):
        scene = ready()
        scene.engine.submit(RunFile(6, "a.nc"), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"RECEIVED,ID<#{id}")
        scene.wait(0.31)
        assert scene.take(CommandDone) == [CommandDone(6)]

    def test_a_missing_file_is_refused_after_received_too(self):
        scene = ready()
        scene.engine.submit(RunFile(6, "x"), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"RECEIVED,ID<#{id}", f"ERROR,ID<#{id},NUM<#4")
        assert scene.take(CommandDone, CommandFailed)[0].code == 4
        scene.answer_position()
        assert scene.engine.free() == 1

    def test_an_alarm_ends_it(self):
        scene = ready()
        scene.engine.submit(RunFile(6, "x"), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"RECEIVED,ID<#{id}", state("cnscalarm", more=",ALARMNUM<#100"))
        assert scene.take(CommandDone) == [CommandDone(6)]
        assert scene.engine.free() == 1

    def test_a_missing_file_is_refused(self):
        scene = ready()
        scene.engine.submit(RunFile(6, "x"), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"ERROR,ID<#{id},NUM<#4")
        assert scene.take(CommandFailed)[0].code == 4

    def test_whether_a_tool_change_is_pending(self):
        scene = ready()
        scene.engine.submit(AskToolChange(8), scene.now)
        scene.sent()
        scene.say("TOOL,NUM<#3")
        assert scene.take(ToolRequested, CommandDone) == [ToolRequested(3), CommandDone(8)]
        scene.answer_position()
        scene.engine.submit(AskToolChange(9), scene.now)
        scene.wait(1)
        assert scene.take(ToolRequested, CommandDone) == [CommandDone(9)]


def test_a_command_that_is_none_is_our_bug_and_raises():
    scene = ready()
    with pytest.raises(AssertionError):
        scene.engine.submit(EmergencyStop(1), scene.now)  # type: ignore[arg-type]  # realtime() takes it
    assert scene.sent() == []
    assert scene.engine.free() == 1


def test_a_report_that_nobody_asked_for_is_where_the_next_batch_begins():
    scene = ready()
    scene.say(state("idle", 7))
    assert [report.position["x"] for report in scene.take(StateReported)] == [7]
    assert scene.sent() == []
    assert scene.engine.free() == 1
    scene.batch("G1X9", end={"x": 9.0, "y": 0.0, "z": 0.0})
    scene.say(state("idle", 7))
    assert scene.take(BatchDone) == []  # where it began, not where it ends
    scene.say(state("idle", 9))
    assert scene.engine.free() == 0  # done, without RECEIVED: what it remembers is proven first
    scene.answer_position(9)
    assert scene.take(BatchDone) == [BatchDone(1004, inferred=True)]


def test_unknown_messages_are_ignored():
    scene = ready()
    scene.say("HELLO,A<#1", "STATE,TYPE<#dancing", "TOOL,NUM<#x", "PROGRAM_END", "FILE,NAME<#a")
    assert [e.kind for e in scene.take()] == ["malformed", "malformed"]


def test_the_recorder_keeps_the_last_frames():
    scene = ready()
    for _ in range(150):
        batch = scene.batch("G1X1")
        scene.say(f"RECEIVED,ID<#{batch.id}", f"OK,ID<#{batch.id}")
    frames = scene.engine.recent_frames()
    assert len(frames) == 200
    assert frames[-1].data.endswith(f"OK,ID<#{batch.id};".encode())
    assert {frame.direction for frame in frames} == {"<", ">"}


def test_what_only_another_dialect_knows_is_answered_and_not_sent():
    scene = ready()
    scene.engine.submit(Home(5), scene.now)
    scene.engine.realtime(FeedHold(6), scene.now)
    assert [event.token for event in scene.take(CommandFailed)] == [5, 6]
    assert scene.sent() == []
    assert scene.engine.free() == 1


@pytest.mark.parametrize(
    ("heard", "given", "came"),
    [
        (2033, [2013], True),
        (20133, [2013], True),
        (213, [2013], True),
        (2013, [2013], False),
        (2034, [2013], False),
        (2033, [2013, 2034], False),
        (20114, [2011, 2012, 2013, 2014], False),
        (3, [2013], False),
    ],
)
def test_an_id_that_nobody_gave_came_of_the_repetition_or_of_a_question(heard, given, came):
    assert came_of(heard, given) is came
