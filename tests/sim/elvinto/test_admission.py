"""What is admitted when: the cases one by one, without a machine."""

import pytest

from sim.elvinto.admission import Situation, Verdict, judge_command, judge_question
from sim.elvinto.commands import Command
from sim.elvinto.settings import SimSettings

RUNNING = Command.batch(7, ["G0X1"])
MOVES = ["G0X1"]


@pytest.mark.parametrize(
    ("situation", "wire_id", "blocks", "verdict"),
    [
        (Situation(None, alarm=False, last_id=7), 8, MOVES, "execute"),
        (Situation(None, alarm=False, last_id=7), 7, MOVES, "answered"),
        (Situation(None, alarm=False, last_id=7), 3, MOVES, "answered"),
        (Situation(RUNNING, alarm=False, last_id=7), 8, MOVES, "busy"),
        (Situation(RUNNING, alarm=False, last_id=7), 7, MOVES, "busy"),
        (Situation(RUNNING, alarm=False, last_id=7), 8, ["W98"], "interrupt"),
        (Situation(RUNNING, alarm=False, last_id=7), 7, ["W98"], "busy"),
        (Situation(RUNNING, alarm=False, last_id=7), 8, ["W98", "W95"], "busy"),
        (Situation(None, alarm=True, last_id=7), 8, ["W95"], "alarm"),
    ],
)
def test_batches(situation: Situation, wire_id: int, blocks: list[str], verdict: Verdict) -> None:
    assert judge_command(SimSettings(), situation, "GCODE", wire_id, blocks) == verdict


def test_habits_of_a_machine() -> None:
    running = Situation(RUNNING, alarm=False, last_id=7)
    reack, deaf = SimSettings(repeat="reack"), SimSettings(estop_while_running=False)
    assert judge_command(reack, running, "GCODE", 7, MOVES) == "acknowledged"
    assert judge_command(reack, running, "GCODE", 6, MOVES) == "busy"
    assert judge_command(deaf, running, "GCODE", 8, ["W98"]) == "busy"


def test_an_alarm_lets_nothing_through_but_its_reset() -> None:
    alarm = Situation(None, alarm=True, last_id=7)
    assert judge_command(SimSettings(), alarm, "RESETALERT", 8, []) == "execute"
    open_ear = SimSettings(init_in_alarm=True)
    assert judge_command(open_ear, alarm, "GCODE", 8, ["W95"]) == "execute"
    assert judge_command(open_ear, alarm, "GCODE", 8, ["W95", "G0X1"]) == "alarm"
    assert judge_command(open_ear, alarm, "GCODE", 8, []) == "alarm"


def test_questions() -> None:
    assert judge_question(SimSettings(), Situation(None, alarm=False, last_id=7)) is None
    assert judge_question(SimSettings(), Situation(RUNNING, alarm=True, last_id=7)) == "busy"
    assert judge_question(SimSettings(), Situation(None, alarm=True, last_id=7)) == "alarm"
    assert judge_question(SimSettings(init_in_alarm=True), Situation(None, alarm=True, last_id=7)) is None
