"""Modes and what is pressed: what is asked of the daemon, and what is printed."""

import json
from typing import Any

import pytest

from tests.harness.fakedaemon import problem
from tests.server.cli.conftest import Run


@pytest.mark.parametrize(
    ("argv", "path", "body", "out"),
    [
        (["spindle-stop"], "spindle-stop", None, "router: spindle_stop\n"),
        (["door"], "door", None, "router: door\n"),
        (["sleep"], "sleep", None, "router: sleep\n"),
        (["check-mode", "on"], "check-mode", {"on": True}, "router: check_mode\n"),
        (["check-mode", "off"], "check-mode", {"on": False}, "router: check_mode\n"),
    ],
)
def test_verbs(millstream: Run, argv: list[str], path: str, body: Any, out: str) -> None:
    accepted = {"machine": "router", "accepted": path.replace("-", "_")}
    outcome = millstream(*argv, answers={f"POST /machines/router/{path}": accepted})
    assert (outcome.code, outcome.out) == (0, out)
    assert outcome.daemon.made()[-1] == f"POST /machines/router/{path}"
    if body is not None:
        assert outcome.daemon.body() == body
    outcome = millstream(*argv, "--json", answers={f"POST /machines/router/{path}": accepted})
    assert json.loads(outcome.out) == accepted


def test_overrides(millstream: Run) -> None:
    answer = {"machine": "router", "asked": {"feed": 110, "rapid": 50}, "present": {}}
    outcome = millstream("override", "--feed", 110, "--rapid", 50, answers={"PATCH /machines/router/overrides": answer})
    assert (outcome.code, outcome.out) == (0, "router: feed 110 %, rapid 50 %\n")
    assert outcome.daemon.body() == {"feed": 110, "rapid": 50}


def test_coolant(millstream: Run) -> None:
    answer = {"machine": "router", "flood": True, "mist": False}
    outcome = millstream("coolant", "--flood", "--no-mist", answers={"POST /machines/router/coolant": answer})
    assert (outcome.code, outcome.out) == (0, "router: flood on, mist off\n")
    assert outcome.daemon.body() == {"flood": True, "mist": False}


def test_defaults(millstream: Run) -> None:
    answer = {"machine": "router", "restored": "all", "backup": 7}
    outcome = millstream(
        "restore-defaults", "all", "--confirm", "router", answers={"POST /machines/router/restore": answer}
    )
    assert (outcome.code, outcome.out) == (0, "router: all restored; backup 7 has everything as it was\n")
    assert outcome.daemon.body() == {"what": "all", "confirm": "router"}


@pytest.mark.parametrize(
    "argv",
    [
        ["override"],
        ["override", "--feed", "9"],
        ["override", "--feed", "fast"],
        ["coolant"],
        ["check-mode"],
        ["check-mode", "maybe"],
        ["restore-defaults", "all"],
        ["restore-defaults", "some", "--confirm", "router"],
    ],
)
def test_wrong_usage(millstream: Run, argv: list[str]) -> None:
    assert millstream(*argv).code == 2


def test_a_refusal_is_code_1(millstream: Run) -> None:
    refused = problem(409, "not_supported", "The elvinto controller of router has no door.")
    outcome = millstream("door", answers={"POST /machines/router/door": refused})
    assert outcome.code == 1
    assert "has no door" in outcome.err
