"""millstream control and millstream audit, against a daemon that answers as told."""

import json
from typing import Any

from server.api.accessmodels import AuditView, ControlView
from server.api.routing import example_of
from tests.harness.fakedaemon import machine
from tests.server.cli.conftest import Run

CONTROL = "/machines/router/control"


def view(**changes: Any) -> dict[str, Any]:
    return {**example_of(ControlView), **changes}


def test_who_has_it(millstream: Run) -> None:
    answers = {"GET /machines": [machine()], f"GET {CONTROL}": view()}
    outcome = millstream("control", answers=answers)
    assert (outcome.code, outcome.out) == (0, "router: screen at 192.168.1.17, since 2026-03-01T09:30:00.250Z\n")
    answers[f"GET {CONTROL}"] = view(holder=None)
    assert millstream("control", answers=answers).out == "router: nobody moves it by hand\n"
    assert json.loads(millstream("control", "--json", answers=answers).out)["holder"] is None


def test_taking_it_over_and_giving_it_back(millstream: Run) -> None:
    answers = {
        f"POST {CONTROL}": view(yours=True),
        f"GET {CONTROL}": view(holder=None),
        f"DELETE {CONTROL}": None,
    }
    outcome = millstream("control", "-m", "router", "--takeover", answers=answers)
    assert "(you)" in outcome.out
    assert millstream("control", "-m", "router", "--release", answers=answers).code == 0
    assert millstream("control", "-m", "router", "--release", "--take", answers=answers).code == 2


def test_the_audit_is_shown_so_that_no_terminal_obeys_it(millstream: Run) -> None:
    row = {**example_of(AuditView), "name": "\x1b[2J\u202e"}
    outcome = millstream("audit", answers={"GET /audit": [row]})
    assert outcome.code == 0
    assert "\x1b" not in outcome.out
    assert "\u202e" not in outcome.out
    assert "/api/v1/machines/{m}/home" in outcome.out
    assert json.loads(millstream("audit", "--json", answers={"GET /audit": [row]}).out) == [row]
