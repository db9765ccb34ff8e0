"""The command line as a whole: wrong usage, errors with and without --json, exit codes."""

import json

import httpx
import pytest

from tests.harness.fakedaemon import problem
from tests.server.cli.conftest import Run

COMMANDS = (
    *[
        "serve",
        "demo",
        "check",
        "translate",
        "submit",
        "jobs",
        "machines",
        "watch",
        "console",
        "ports",
        "pause",
        "resume",
        "stop",
        "estop",
    ],
    *("token create", "token list", "token revoke", "sim elvinto"),
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(millstream: Run, command: str) -> None:
    outcome = millstream(*command.split(), "--help")
    assert outcome.code == 0
    assert f"Usage: millstream {command}" in outcome.out


@pytest.mark.parametrize(
    "argv", [["nonsense"], ["jobs", "--nonsense"], ["check", "nowhere.nc", "--profile", "elvinto"]]
)
def test_wrong_usage_is_2(millstream: Run, argv: list[str]) -> None:
    outcome = millstream(*argv)
    assert outcome.code == 2
    assert "Error" in outcome.err


def test_no_daemon_is_3_and_says_what_to_do(millstream: Run) -> None:
    outcome = millstream("machines", answers={"GET /machines": httpx.ConnectError("refused")})
    assert outcome.code == 3
    assert "no daemon answers" in outcome.err
    assert "millstream serve" in outcome.err


def test_no_daemon_as_json(millstream: Run) -> None:
    outcome = millstream("machines", "--json", answers={"GET /machines": httpx.ConnectError("refused")})
    assert outcome.code == 3
    assert json.loads(outcome.out)["code"] == "unreachable"
    assert outcome.err == ""


@pytest.mark.parametrize(
    "answer",
    [httpx.ReadTimeout("slow"), httpx.ReadError("gone"), httpx.Response(200, text="<html>"), httpx.Response(502)],
)
def test_what_does_not_answer_like_a_daemon_is_3(millstream: Run, answer: object) -> None:
    assert millstream("machines", answers={"GET /machines": answer}).code == 3


def test_a_refusal_is_1_with_title_and_detail(millstream: Run) -> None:
    outcome = millstream("pause", answers={"POST /machines/router/pause": problem(409, "wrong_state", "No job runs.")})
    assert outcome.code == 1
    assert outcome.err == "Title of wrong_state: No job runs.\n"


def test_a_refusal_as_json_is_the_problem(millstream: Run) -> None:
    answers = {"POST /machines/router/pause": problem(409, "wrong_state", "No job runs.")}
    outcome = millstream("pause", "--json", answers=answers)
    assert outcome.code == 1
    assert json.loads(outcome.out)["code"] == "wrong_state"


def test_a_missing_token_is_told(millstream: Run) -> None:
    outcome = millstream("jobs", answers={"GET /jobs": problem(401, "unauthorized", "Send a token.")})
    assert outcome.code == 1
    assert "MILLSTREAM_TOKEN" in outcome.err


def test_the_token_comes_from_the_environment(millstream: Run) -> None:
    outcome = millstream("machines", environ={"MILLSTREAM_TOKEN": "mill_x"})
    assert outcome.daemon.requests[0].headers["Authorization"] == "Bearer mill_x"
    assert "Authorization" not in millstream("machines").daemon.requests[0].headers


def test_the_address_comes_from_the_option_or_the_environment(millstream: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    assert millstream("machines", "--url", "http://mill:1/").daemon.requests[0].url.host == "mill"
    monkeypatch.setenv("MILLSTREAM_URL", "http://other:2")
    assert str(millstream("machines").daemon.requests[0].url) == "http://other:2/api/v1/machines"


@pytest.mark.parametrize("url", ["mill:8420", "ftp://mill", "http://", "nonsense"])
def test_an_address_that_is_none_is_wrong_usage(millstream: Run, url: str) -> None:
    assert millstream("machines", "--url", url).code == 2


def test_hostile_text_of_a_refusal_is_made_safe(millstream: Run) -> None:
    outcome = millstream("jobs", answers={"GET /jobs": problem(409, "wrong_state", "\x1b[2J")})
    assert "\x1b" not in outcome.err
