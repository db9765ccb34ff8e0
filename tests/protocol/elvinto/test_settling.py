"""Lost fates, played by hand: every branch of elvinto §5.3-§5.5."""

import math

import pytest

from protocol.commands import Locate, RunBlock, SendBatch
from protocol.elvinto.settle import Case, RestartProbe
from protocol.engine import OpenWork
from protocol.events import (
    BatchDone,
    BatchFailed,
    CommandDone,
    CommandFailed,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    LinkLost,
    LinkReady,
    MachineRestarted,
)
from tests.harness.scripted import Scripted, state

PROBES = [(k, "GCODE,DATA<#W95") for k in range(1, 100)]
START = {"x": 0.0, "y": 0.0, "z": 0.0}


def batch(id: int, x: float, **more) -> SendBatch:
    return SendBatch(id, (f"G1X{x:g}",), 0.5, {"x": x, "y": 0.0, "z": 0.0}, **more)


def still(id: int) -> SendBatch:
    """Ends where it began: the position tells nothing about it."""
    return batch(id, 0)


def inherit(*batches: SendBatch, move_until: float = math.inf, start=START) -> Scripted:
    return Scripted(first_id=3000, open_work=OpenWork(batches, start, move_until))


def settle(scene: Scripted, x: float) -> None:
    """Probes stay unanswered; the question where it stands is answered."""
    while True:
        sent = scene.wait(0.1)
        asked = [id for id, message in sent if message.endswith("W95") and id >= 3000]
        if asked:
            scene.say(f"RECEIVED,ID<#{asked[-1]}", state("idle", x), f"OK,ID<#{asked[-1]}")
            return


class TestInheritedWork:
    def test_no_init_and_five_probes_that_only_a_restarted_machine_executes(self):
        scene = inherit(batch(2001, 1))
        assert scene.wait(1.49) == PROBES[:5]
        assert scene.wait(0.02) == [(3000, "GCODE,DATA<#W95")]

    def test_where_the_position_would_tell_nothing_the_same_bytes_go_out_again(self):
        scene = inherit(still(2001))
        assert scene.wait(1.51)[-1] == (2001, "GCODE,DATA<#G1X0")
        scene.say("RECEIVED,ID<#2001", "OK,ID<#2001")
        assert scene.take(FateSettled, LinkReady) == [FateSettled((2001,), (), START), LinkReady()]
        assert scene.engine.free() == 0  # its memory is proven first
        scene.answer_position(0)
        assert scene.engine.free() == 1

    def test_the_late_ok_of_the_first_leaves_the_second_to_be_found_out(self):
        scene = inherit(batch(2001, 1), batch(2002, 2))
        scene.say("OK,ID<#2001")
        assert scene.take(FateSettled, FateInDoubt) == []
        settle(scene, 1)
        (settled,) = scene.take(FateSettled)
        assert (settled.done, settled.undone) == ((2001,), (2002,))

    def test_a_repeated_batch_that_runs_is_waited_for_whatever_is_reported(self):
        scene = inherit(still(2001))
        assert scene.wait(1.51)[-1] == (2001, "GCODE,DATA<#G1X0")
        scene.say("RECEIVED,ID<#2001", state("run", 5), state("idle", 5), state("idle", 5))
        assert scene.take(FateSettled, FateInDoubt) == []  # it does not stand where the batch ends
        assert scene.sent() == []
        scene.say("OK,ID<#2001")
        (settled,) = scene.take(FateSettled)
        assert (settled.done, settled.undone) == ((2001,), ())

    def test_a_machine_that_acknowledges_repeats_settles_it(self):
        scene = inherit(still(2001), batch(2002, 2))
        scene.say(*(f"RECEIVED,ID<#{k}" for k in range(1, 6)), "OK,ID<#3")  # no STATE: not restarted
        assert scene.wait(1.51)[-1] == (2001, "GCODE,DATA<#G1X0")
        scene.say("RECEIVED,ID<#2001", "OK,ID<#2001")
        settle(scene, 2)
        assert scene.take(FateSettled)[0].done == (2001, 2002)

    @pytest.mark.parametrize(("x", "done"), [(0, ()), (1, (2001,)), (2, (2001, 2002))])
    def test_a_silent_machine_is_asked_where_it_stands(self, x, done):
        scene = inherit(batch(2001, 1), batch(2002, 2))
        settle(scene, x + 0.009)
        (settled,) = scene.take(FateSettled)
        assert settled.done == done
        assert settled.undone == (2001, 2002)[len(done) :]
        assert scene.engine.free() == 1

    @pytest.mark.parametrize("x", [0.5, 3, 1.011])
    def test_a_position_that_fits_nothing_is_doubt(self, x):
        scene = inherit(batch(2001, 1), batch(2002, 2), move_until=-math.inf)
        settle(scene, x)
        (doubt,) = scene.take(FateInDoubt)
        assert (doubt.done, doubt.doubtful) == ((), (2001, 2002))
        assert doubt.position["x"] == x
        assert scene.engine.free() == 1

    def test_a_batch_that_ends_where_it_began_is_doubt(self):
        scene = inherit(batch(2001, 0), move_until=-math.inf)
        settle(scene, 0)
        assert scene.take(FateInDoubt)[0].doubtful == (2001,)

    def test_an_unknown_end_excludes_nothing(self):
        scene = inherit(SendBatch(2001, ("G28",), 1, {"x": 0.0, "y": 0.0}), move_until=-math.inf)
        settle(scene, 0)
        assert scene.take(FateInDoubt)

    def test_a_repeated_batch_that_falls_silent_after_received_is_asked_for(self):
        scene = inherit(still(2001))
        scene.wait(1.51)
        scene.say("RECEIVED,ID<#2001")
        assert (3000, "GCODE,DATA<#W95") in scene.wait(3)

    def test_after_a_long_break_nothing_that_moves_is_sent(self):
        scene = inherit(still(2001), move_until=-1)
        sent = scene.wait(3)
        assert {message for _, message in sent} == {"GCODE,DATA<#W95"}
        assert any(id >= 3000 for id, _ in sent)

    def test_nothing_in_flight_and_the_machine_where_the_job_left_it(self):
        scene = inherit(start={"x": 5.0})
        settle(scene, 5)
        assert scene.take(FateSettled, FateInDoubt, LinkReady)[0].done == ()

    def test_nothing_in_flight_and_the_machine_elsewhere(self):
        scene = inherit(start={"x": 5.0})
        settle(scene, 6)
        assert "does not stand" in scene.take(FateInDoubt)[0].reason

    def test_an_ok_that_comes_by_itself_settles_it(self):
        scene = inherit(batch(2001, 1))
        scene.say("OK,ID<#2001")
        assert scene.take(FateSettled)[0].done == (2001,)

    def test_an_ok_of_the_second_settles_the_first_too(self):
        scene = inherit(batch(2001, 1), batch(2002, 2))
        scene.say("OK,ID<#2002")
        assert scene.take(FateSettled)[0].done == (2001, 2002)

    def test_an_error_is_doubt(self):
        scene = inherit(still(2001))
        scene.wait(1.51)
        scene.say("ERROR,ID<#2001,NUM<#2")
        assert "ERROR 2" in scene.take(FateInDoubt)[0].reason

    def test_an_alarm_is_doubt(self):
        scene = inherit(batch(2001, 1))
        scene.say(state("axisalarm", 1, more=",ALARMNUM<#5,AXISNUM<#1"))
        doubt, ready = scene.take(FateInDoubt, LinkReady)
        assert doubt.doubtful == (2001,)
        assert isinstance(ready, LinkReady)

    def test_a_machine_still_running_is_waited_for(self):
        scene = inherit(batch(2001, 1))
        for _ in range(20):
            scene.wait(0.2)
            scene.say(state("run", 0.5))
        assert [id for id, _ in scene.wait(0.1) if id == 2001] == []
        scene.say(state("idle", 1), "OK,ID<#2001")
        assert scene.take(FateSettled)[0].done == (2001,)

    def test_a_last_report_of_a_motion_is_no_restart(self):
        scene = inherit(batch(2001, 1))
        scene.wait(0.1)
        scene.say(state("idle", 1))
        sent = scene.wait(3.01)
        assert len([id for id, _ in sent if id < 100]) == 9
        assert sent[-1] == (3000, "GCODE,DATA<#W95")
        assert scene.take(MachineRestarted) == []

    def test_a_lock_is_an_alarm_that_was_not_cleared(self):
        scene = inherit(batch(2001, 1), move_until=-1)
        for _ in range(200):
            if any(message == "READY" for _, message in scene.wait(0.1)):
                break
        scene.say("READY")
        doubt, _ready = scene.take(FateInDoubt, LinkReady)
        assert "alarm" in doubt.reason
        assert scene.engine.free() == 1

    def test_silence_gives_the_link_up_and_settles_nothing(self):
        scene = inherit(batch(2001, 1))
        scene.wait(120)
        assert scene.take(FateSettled, FateInDoubt, LinkLost) == [LinkLost("the machine does not answer")]


class TestRestartedMachine:
    def test_it_executes_the_probes(self):
        scene = inherit(batch(2001, 1))
        scene.sent()
        scene.say("RECEIVED,ID<#1", state(), "OK,ID<#1")
        scene.wait(0.31)
        scene.say("RECEIVED,ID<#2", state(), "OK,ID<#2")
        assert scene.wait(0.31)[-1][1] == "INIT"
        restarted, doubt = scene.take(MachineRestarted, FateInDoubt)
        assert isinstance(restarted, MachineRestarted)
        assert doubt.doubtful == (2001,)

    def test_it_says_ready(self):
        scene = inherit(batch(2001, 1))
        scene.say("READY")
        assert len(scene.take(MachineRestarted, FateInDoubt)) == 2

    def test_with_nothing_in_flight(self):
        scene = inherit()
        scene.say("READY")
        assert [type(e) for e in scene.take(MachineRestarted, FateInDoubt)] == [MachineRestarted, FateInDoubt]


class TestEndOfProgram:
    def test_alone_it_is_repeated_without_probes(self):
        scene = inherit(SendBatch(2001, ("M30",), 0.5, START, ends_program=True))
        assert scene.sent() == [(2001, "GCODE,DATA<#M30")]
        scene.say("RECEIVED,ID<#2001", "OK,ID<#2001")
        assert scene.take(FateSettled)[0].done == (2001,)

    def test_unheard_it_goes_out_once_more(self):
        scene = inherit(SendBatch(2001, ("M30",), 0.5, START, ends_program=True), move_until=-1)
        settle(scene, 0)
        assert scene.take(FateSettled)[0].undone == (2001,)

    def test_behind_another_batch_nothing_is_repeated(self):
        scene = inherit(batch(2001, 1), SendBatch(2002, ("M30",), 0.5, {"x": 1.0}, ends_program=True))
        sent = scene.wait(4)
        assert {message for _, message in sent} == {"GCODE,DATA<#W95"}


class TestInMidEpoch:
    def ready(self) -> Scripted:
        scene = Scripted(first_id=3000)
        scene.shake_hands()
        return scene

    def test_a_batch_that_nobody_received_is_settled(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.wait(1)
        scene.say("HELLO")  # the link is alive
        scene.wait(2.4)
        assert scene.take(FateUnknown) == [FateUnknown((sent.id,))]
        settle(scene, 0)
        assert scene.take(FateSettled)[0].undone == (sent.id,)
        assert scene.engine.free() == 1
        assert scene.engine.next_id > sent.id

    def test_received_while_its_fate_is_asked_for_is_good_news(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.wait(1)
        scene.say("HELLO")
        scene.wait(2.4)
        scene.say(f"RECEIVED,ID<#{sent.id}")
        settle(scene, 1)
        assert scene.take(BatchDone) == [BatchDone(sent.id, inferred=True)]

    def test_a_lost_ok_is_asked_for(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.say(f"RECEIVED,ID<#{sent.id}")
        assert scene.wait(2.4) == []
        probes = scene.wait(0.9)
        assert [id for id, _ in probes] == [1, 2, 3]
        settle(scene, 1)
        assert scene.take(BatchDone, FateUnknown) == [BatchDone(sent.id, inferred=True)]

    def test_the_ok_comes_while_it_is_asked_for(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.say(f"RECEIVED,ID<#{sent.id}")
        scene.wait(2.6)
        scene.say(f"OK,ID<#{sent.id}")
        assert scene.take(BatchDone)[0].id == sent.id
        settle(scene, 1)
        assert scene.engine.free() == 1

    def test_accepted_but_elsewhere_is_doubt(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.say(f"RECEIVED,ID<#{sent.id}")
        scene.wait(2.6)
        settle(scene, 0.4)
        assert scene.take(FateInDoubt)[0].doubtful == (sent.id,)

    def test_two_idle_reports_elsewhere_are_looked_into(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.say(f"RECEIVED,ID<#{sent.id}", state("idle", 0), state("idle", 0))
        assert scene.take(BatchDone) == []
        settle(scene, 1)
        assert scene.take(BatchDone)

    def test_a_report_in_answer_to_the_probe_of_a_repetition_stops_the_repeating(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.wait(0.16)
        scene.say("RECEIVED,ID<#1", state())
        assert scene.take(FateUnknown) == [FateUnknown((sent.id,))]
        scene.sent()
        scene.say("RECEIVED,ID<#2", state())
        scene.wait(0.31)
        scene.say("RECEIVED,ID<#3", state())
        assert [m for _, m in scene.wait(0.31)][-1] == "INIT"
        assert [type(e) for e in scene.take(MachineRestarted, FateInDoubt)] == [MachineRestarted, FateInDoubt]

    def test_a_command_by_hand_gets_an_answer_all_the_same(self):
        scene = self.ready()
        scene.engine.submit(RunBlock(5, ("G1X1",)), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"RECEIVED,ID<#{id}")
        scene.wait(3.1)
        settle(scene, 7)
        assert scene.take(CommandDone) == [CommandDone(5)]

    def test_a_command_by_hand_that_never_arrived_is_repeated_and_then_in_doubt(self):
        scene = self.ready()
        scene.engine.submit(RunBlock(5, ("G1X1",)), scene.now)
        scene.wait(1)
        scene.say("HELLO")
        scene.wait(2.4)
        settle(scene, 0)
        assert scene.take(CommandFailed, FateSettled, FateInDoubt)[0].token == 5

    def test_running_again_prolongs_the_question(self):
        scene = self.ready()
        scene.batch("G1X1", end={"x": 1})
        scene.wait(0.1)
        scene.say("HELLO")
        scene.wait(4)
        for _ in range(30):
            scene.wait(1)
            scene.say(state("run", 0.5))
        assert scene.take(LinkLost, FateInDoubt) == []
        settle(scene, 1)
        assert scene.take(FateSettled)

    def test_a_link_lost_with_a_command_by_hand_in_flight_is_told(self):
        scene = self.ready()
        scene.engine.submit(RunBlock(5, ("G1X1",)), scene.now)
        scene.wait(120)
        failed, lost = scene.take(CommandFailed, LinkLost)
        assert "not known" in failed.message
        assert isinstance(lost, LinkLost)

    def test_a_question_by_hand_is_told_too(self):
        scene = self.ready()
        scene.engine.submit(Locate(6), scene.now)
        scene.wait(120)
        assert [type(e) for e in scene.take(CommandFailed, LinkLost)] == [CommandFailed, LinkLost]

    def test_a_batch_whose_position_was_asked_for_when_the_link_died_is_done(self):
        scene = self.ready()
        sent = scene.batch("G28", locate_after=True)
        scene.say(f"OK,ID<#{sent.id}")
        scene.wait(120)
        assert [type(e) for e in scene.take(BatchDone, LinkLost)] == [BatchDone, LinkLost]

    def test_a_lost_ok_of_a_command_by_hand(self):
        scene = self.ready()
        scene.engine.submit(RunBlock(5, ("G1X1",)), scene.now)
        ((id, _),) = scene.sent()
        scene.say(f"RECEIVED,ID<#{id}")
        scene.wait(3.1)
        scene.say(f"OK,ID<#{id}")
        assert scene.take(CommandDone) == [CommandDone(5)]

    def test_an_ok_of_a_command_by_hand_whose_fate_was_unknown(self):
        scene = self.ready()
        scene.engine.submit(RunBlock(5, ("G1X1",)), scene.now)
        ((id, _),) = scene.sent()
        scene.wait(0.1)
        scene.say("HELLO")
        scene.wait(1.6)
        scene.say(f"OK,ID<#{id}")
        assert scene.take(CommandDone) == [CommandDone(5)]

    def test_an_alarm_while_it_is_asked_for_is_doubt(self):
        scene = self.ready()
        sent = scene.batch("G1X1", end={"x": 1})
        scene.say(f"RECEIVED,ID<#{sent.id}")
        scene.wait(2.6)
        scene.say(state("axisalarm", 0.4, more=",ALARMNUM<#5,AXISNUM<#1"))
        assert [type(e) for e in scene.take(FateInDoubt, BatchFailed)] == [FateInDoubt]


class TestVerdicts:
    def test_probes_that_were_answered_twice(self):
        probe = RestartProbe(5)
        probe.heard_state()
        assert probe.end_round() is None
        probe.heard_state()
        assert probe.end_round() is True

    def test_a_single_answer_in_ten_is_noise(self):
        probe = RestartProbe(5)
        probe.heard_state()
        assert [probe.end_round() for _ in range(10)] == [None] * 9 + [False]

    def test_running_voids_the_count(self):
        probe = RestartProbe(3)
        probe.heard_state()
        probe.end_round()
        probe.still_running()
        assert [probe.end_round() for _ in range(4)] == [None, None, None, False]

    def test_the_origin_moves_with_what_is_done(self):
        case = Case((batch(2001, 1), batch(2002, 0)), START, 0)
        case.finished(2001)
        assert case.located({"x": 0.0}, 0.01)
        assert case.done == [2001, 2002]


def test_what_is_known_to_be_done_says_nothing_about_what_follows():
    case = Case((batch(1, 1), batch(2, 2), batch(3, 3)), START, math.inf)
    case.finished(2)
    assert case.done == [1, 2]
    case.finished(1)
    assert (case.done, case.remaining_ids) == ([1, 2], (3,))
