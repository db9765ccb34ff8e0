"""What a request has to say before a job is taken up; the stories are in tests/scenarios/test_grbl_recovery.py."""

from dataclasses import replace
from typing import Any

import pytest

from gcode.reentry import Reentry, Step
from protocol.machine import MachineState
from server.config.model import MachineConfig
from server.config.reentry import AS_CONFIGURED, ReentryWish
from server.job.takingup import TakingUp
from server.problems import ProblemError
from server.programs.plans import Plan
from server.programs.workpiece import Workpiece


class Machine:
    """As much of a controller as is looked at."""

    name = "mill"

    def __init__(self, homed: bool | None) -> None:
        self.state = MachineState(homed=homed)


class Pieces:
    """As much of a starter."""

    def __init__(self, protocol: str, **reentry: Any) -> None:
        machine = {"name": "mill", "port": "sim:", "protocol": protocol, "reentry": reentry}
        self.pieces = {"mill": Workpiece.of(MachineConfig.model_validate(machine))}


def taking_up(protocol: str = "grbl", **reentry: Any) -> TakingUp:
    return TakingUp(None, Pieces(protocol, **reentry))  # type: ignore[arg-type]


def plan(*steps: Step) -> Plan:
    return Plan(None, 5, (), Reentry(steps, 0, ("look out",), {"x": 1.0}))  # type: ignore[arg-type]


KEPT, GONE = {"restarted": 0}, {"restarted": 1}
LIFT = Step("G0 Z5", "lift")
PEOPLE = Step("", "operator", "make sure that tool 3 is in the spindle")


@pytest.mark.parametrize(
    ("homed", "force", "refused"), [(None, False, True), (False, False, True), (None, True, False)]
)
def test_a_position_that_may_be_lost_needs_a_word(homed: bool | None, force: bool, refused: bool) -> None:
    machine: Any = Machine(homed)
    wish = ReentryWish(force=force)
    if refused:
        with pytest.raises(ProblemError, match="not homed") as problem:
            taking_up().check_homed(machine, KEPT, wish)
        assert problem.value.code == "wrong_state"
    else:
        taking_up().check_homed(machine, KEPT, wish)
    taking_up().check_homed(Machine(True), KEPT, AS_CONFIGURED)  # type: ignore[arg-type]
    taking_up("elvinto").check_homed(machine, KEPT, AS_CONFIGURED)


@pytest.mark.parametrize("homed", [None, False, True])
def test_a_machine_that_has_restarted_in_the_job_needs_the_same_word(homed: bool | None) -> None:
    machine: Any = Machine(homed)
    up = taking_up("elvinto")
    assert up.view(machine, GONE, AS_CONFIGURED, 5, None)["needs"] == ([] if homed else ["force"])
    if not homed:
        with pytest.raises(ProblemError, match="not homed since it was restarted") as problem:
            up.check_homed(machine, GONE, AS_CONFIGURED)
        assert problem.value.code == "wrong_state"
    up.check_homed(machine, GONE, ReentryWish(force=homed is not True))
    taking_up("ncframe").check_homed(machine, GONE, AS_CONFIGURED)  # it is taken up at no line at all


@pytest.mark.parametrize(
    ("needs", "homed", "reentry", "steps", "line"),
    [
        ([], True, {"clearance": 5.0}, (LIFT,), 5),
        (["force"], None, {"clearance": 5.0}, (LIFT,), 5),
        (["operator_done"], True, {"clearance": 5.0}, (LIFT, PEOPLE), 5),
        (["clearance", "operator_done", "force"], False, {}, (PEOPLE,), 5),
        (["force"], False, {}, (), 1),
    ],
)
def test_what_a_request_has_to_say_besides(
    needs: list[str], homed: bool | None, reentry: dict[str, Any], steps: tuple[Step, ...], line: int
) -> None:
    machine: Any = Machine(homed)
    shown = taking_up(**reentry).view(machine, KEPT, AS_CONFIGURED, line, plan(*steps))
    assert shown["needs"] == needs
    assert [step["text"] for step in shown["steps"]] == [step.text for step in steps]


def test_the_way_is_shown_as_it_would_be_gone() -> None:
    machine: Any = Machine(homed=True)
    up = taking_up(clearance=5.0, plunge_feed=60.0)
    assert up.view(machine, KEPT, ReentryWish(clearance=9.0), 5, None)["way"] == {
        "clearance": 9.0,
        "clearance_is_machine": False,
        "plunge_feed": 60.0,
        "spindle_wait": 3.0,
    }
    assert taking_up().view(machine, KEPT, AS_CONFIGURED, 5, None)["way"] is None


def test_for_other_machines_there_is_nothing_here() -> None:
    machine: Any = Machine(None)
    shown = taking_up("elvinto", clearance=5.0).view(machine, KEPT, AS_CONFIGURED, 5, None)
    assert shown == {"steps": [], "takes_over": 0, "warnings": [], "place": {}, "needs": [], "way": None}


def test_looking_at_a_plan_says_nothing_is_done_and_nothing_edited() -> None:
    wish = ReentryWish(clearance=3.0, blocks=("G90",), force=True)
    assert taking_up().as_a_trial(wish) == replace(wish, operator_done=True, blocks=None)
