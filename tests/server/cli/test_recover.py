"""`millstream recover`: a plan is shown, and run only when that is said."""

import json
from typing import Any

import pytest

from server.api.recovermodels import PLAN_EXAMPLE
from tests.harness.fakedaemon import job, problem
from tests.server.cli.conftest import Run

PATH = "POST /jobs/17/recover"
PLAN: dict[str, Any] = {
    **PLAN_EXAMPLE,
    "steps": [
        {"text": "G0 Z20", "purpose": "lift", "note": "before anything else moves"},
        {"text": "", "purpose": "tool", "note": "put tool 2 in\x1b[2J"},
    ],
    "needs": ["clearance", "operator_done", "force"],
    "warnings": ["the offset is G55"],
}


def test_the_plan_is_shown_and_nothing_is_run(millstream: Run) -> None:
    outcome = millstream("recover", 17, answers={PATH: PLAN})
    assert outcome.code == 0
    assert outcome.daemon.made() == [PATH]
    assert outcome.daemon.requests[-1].content == b""
    lines = [" ".join(line.split()) for line in outcome.out.splitlines()]
    assert lines[0] == "job 17: lines up to 600 are certain"
    assert "in doubt: lines 601 to 612" in lines
    assert any(line.startswith("--continue: not possible. Lines 601 to 612") for line in lines)
    assert "G0 Z20 lift before anything else moves" in lines
    assert any(line.startswith("(by hand) tool put tool 2 in") for line in lines)
    assert "warning: the offset is G55" in lines
    assert [line.split()[1].strip(",") for line in lines if line.startswith("needs ")] == [
        "--clearance",
        "--operator-done",
        "--force",
    ]
    assert "\x1b" not in outcome.out


def test_a_plan_for_another_line_and_way(millstream: Run) -> None:
    argv = ["recover", 17, "--line", 30, "--clearance", "-3", "--clearance-is-machine", "--spindle-wait", 0]
    outcome = millstream(*argv, "--json", answers={PATH: PLAN})
    assert outcome.daemon.body() == {
        "line": 30,
        "clearance": -3.0,
        "clearance_is_machine": True,
        "spindle_wait": 0.0,
    }
    assert json.loads(outcome.out) == PLAN


def test_a_plan_that_cannot_be_run_and_one_that_can_go_on(millstream: Run) -> None:
    plan = {**PLAN, "line_why_not": "There is no clearance.", "can_continue": True, "why_not": None, "steps": []}
    outcome = millstream("recover", 17, answers={PATH: {**plan, "line_from": None, "line_to": None, "reason": None}})
    assert "--continue: possible\n" in outcome.out
    assert "--run from line 601: not possible. There is no clearance.\n" in outcome.out
    assert "in doubt" not in outcome.out
    assert "G17" in outcome.out, "without steps the first blocks are shown"


@pytest.mark.parametrize(
    ("argv", "body"),
    [
        (["--continue"], {"action": "continue"}),
        (["--run"], {"action": "from_line"}),
        (
            ["--run", "--line", "30", "--clearance", "15", "--force", "--operator-done"],
            {"action": "from_line", "line": 30, "clearance": 15.0, "force": True, "operator_done": True},
        ),
    ],
)
def test_going_on(millstream: Run, argv: list[str], body: dict[str, Any]) -> None:
    outcome = millstream("recover", 17, *argv, answers={PATH: job(3)})
    assert outcome.code == 0
    assert outcome.daemon.body() == body
    assert outcome.out.startswith("job 17: ")
    assert json.loads(millstream("recover", 17, *argv, "--json", answers={PATH: job(3)}).out)["id"] == 17


def test_a_refusal_is_code_1(millstream: Run) -> None:
    refused = problem(409, "wrong_state", "router was not homed since it was connected.")
    outcome = millstream("recover", 17, "--run", answers={PATH: refused})
    assert (outcome.code, "not homed" in outcome.err) == (1, True)


@pytest.mark.parametrize(
    "argv",
    [
        [],
        ["0"],
        ["17", "--run", "--continue"],
        ["17", "--continue", "--line", "3"],
        ["17", "--continue", "--force"],
        ["17", "--force"],
        ["17", "--operator-done"],
        ["17", "--clearance-is-machine"],
        ["17", "--line", "0"],
    ],
)
def test_wrong_usage_asks_nothing(millstream: Run, argv: list[str]) -> None:
    outcome = millstream("recover", *argv)
    assert outcome.code == 2
    assert outcome.daemon.made() == []
