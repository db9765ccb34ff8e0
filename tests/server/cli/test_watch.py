"""watch: the events go on across broken connections, and what is shown is the latest."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any

import httpx
import pytest
from websockets.datastructures import Headers
from websockets.exceptions import InvalidStatus
from websockets.http11 import Response

from server.cli import watch
from server.cli.common import CliError, ExitCode
from server.cli.watch import Board, listen
from tests.harness.fakedaemon import STATE, job, machine
from tests.server.cli.conftest import Run

HELLO = {
    "seq": 3,
    "type": "hello",
    "machine": None,
    "data": {"machines": [machine()], "jobs": [job(4), job(10, "completed", id=16)], "resync": False},
}


def event(seq: int, type_: str = "state", data: Any = STATE) -> dict[str, Any]:
    return {"seq": seq, "type": type_, "machine": "router", "data": data}


class Wire:
    """Connections that give what they are told and then break."""

    def __init__(self, *connections: Any) -> None:
        self._connections = list(connections)
        self.addresses: list[str] = []
        self.tokens: list[str | None] = []

    @contextmanager
    def open(self, address: str, token: str | None) -> Iterator[Any]:
        self.addresses.append(address)
        self.tokens.append(token)
        connection = self._connections.pop(0)
        if isinstance(connection, Exception):
            raise connection
        yield (json.dumps(one) for one in connection)


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch.time, "sleep", lambda _seconds: None)


def test_after_a_break_it_goes_on_from_where_it_was() -> None:
    wire = Wire([HELLO, event(7)], OSError("gone"), [event(9)])
    events = list(islice(listen("http://mill:1", "mill_x", {"topics": "state"}, open_=wire.open), 3))
    assert [one["seq"] for one in events] == [3, 7, 9]
    assert wire.addresses == [
        "ws://mill:1/api/v1/events?topics=state",
        "ws://mill:1/api/v1/events?topics=state&since=7",
        "ws://mill:1/api/v1/events?topics=state&since=7",
    ]
    assert wire.tokens == ["mill_x"] * 3


def test_https_means_wss() -> None:
    wire = Wire([HELLO])
    next(listen("https://mill", None, {}, open_=wire.open))
    assert wire.addresses == ["wss://mill/api/v1/events?"]


def test_no_daemon_at_the_first_try_is_3() -> None:
    with pytest.raises(CliError) as caught:
        next(listen("http://mill:1", None, {}, open_=Wire(ConnectionRefusedError()).open))
    assert caught.value.code is ExitCode.UNREACHABLE


def refusal(body: bytes) -> InvalidStatus:
    return InvalidStatus(Response(401, "Unauthorized", Headers(), body))


def test_a_refusal_is_told_in_the_words_of_the_daemon() -> None:
    problem = {"code": "unauthorized", "title": "A token is needed", "detail": "Send one."}
    wire = Wire(refusal(json.dumps(problem).encode()))
    with pytest.raises(CliError, match=r"A token is needed: Send one\.") as caught:
        next(listen("http://mill:1", None, {}, open_=wire.open))
    assert caught.value.code is ExitCode.FAILED
    assert caught.value.problem == problem


@pytest.mark.parametrize("body", [b"", b"[]", b"<html>", b"{}"])
def test_a_refusal_of_something_else_is_3(body: bytes) -> None:
    with pytest.raises(CliError) as caught:
        next(listen("http://mill:1", None, {}, open_=Wire(refusal(body)).open))
    assert caught.value.code is ExitCode.UNREACHABLE


def test_the_board_begins_with_the_snapshot() -> None:
    board = Board()
    assert board.take(HELLO) == "router  idle  X1.500 Z5.000  job 17 running 4/10  55 to 70 s left"


def test_the_board_follows_states_and_jobs() -> None:
    board = Board()
    board.take(HELLO)
    moved = {**STATE, "status": "run", "feed": 600.0, "spindle": 12000.0}
    still = "running 4/10  55 to 70 s left"
    assert board.take(event(8, data=moved)) == f"router  run  X1.500 Z5.000  F600  S12000  job 17 {still}"
    still = "running 5/10  55 to 70 s left"
    assert board.take(event(9, "job", job(5))) == f"router  run  X1.500 Z5.000  F600  S12000  job 17 {still}"


def test_the_board_shows_an_alarm_safely() -> None:
    alarm = {**STATE, "status": "alarm", "alarm": {"code": 2, "axis": "x", "message": "hit\x1b[2J"}}
    assert Board().take(event(1, data=alarm)) == "router  alarm  X1.500 Z5.000  ALARM hit\\x1b[2J"


def test_the_board_shows_one_machine_where_one_is_wanted() -> None:
    board = Board("lathe")
    board.take({**HELLO, "data": {"machines": [machine("router"), machine("lathe")], "jobs": []}})
    assert board.lines() == ["lathe  idle  X1.500 Z5.000"]


def test_types_that_it_does_not_know_are_passed_over() -> None:
    assert Board().take(event(1, "io", {"pins": 3})) is None
    assert Board().take({"type": "queue"}) is None


def test_a_tool_request_has_a_line_of_its_own() -> None:
    assert Board().take(event(1, "tool", {"number": 3})) == 'router: tool {"number": 3}'


def test_json_is_a_message_a_line_until_ctrl_c(millstream: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def events(*_: Any) -> Iterator[Any]:
        yield HELLO
        raise KeyboardInterrupt

    monkeypatch.setattr(watch, "listen", events)
    outcome = millstream("watch", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    assert json.loads(outcome.out) == HELLO


def test_lines_for_a_pipe(millstream: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def events(*_: Any) -> Iterator[Any]:
        yield from (HELLO, event(4, "console", {"text": "OK;"}), event(5))
        raise KeyboardInterrupt

    monkeypatch.setattr(watch, "listen", events)
    outcome = millstream("watch")
    assert outcome.code == 0
    assert outcome.out.splitlines() == ["router  idle  X1.500 Z5.000  job 17 running 4/10  55 to 70 s left"] * 2


def test_a_wrong_address_is_told_before_anything_is_shown(millstream: Run) -> None:
    assert millstream("watch", answers={"GET /machines": httpx.ConnectError("refused")}).code == 3
