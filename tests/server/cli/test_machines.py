"""machines, console, ports, and the verbs."""

import json
from types import SimpleNamespace

import pytest

from server.cli import machines
from tests.harness.fakedaemon import machine, problem
from tests.server.cli.conftest import Run

TWO = {"GET /machines": [machine("router"), machine("lathe")]}


def accepted(name: str, verb: str) -> dict[str, object]:
    return {f"POST /machines/{name}/{verb}": {"machine": name, "accepted": verb}}


def test_machines_shows_what_they_do(millstream: Run) -> None:
    outcome = millstream("machines", answers={"GET /machines": [machine(active_job=17, queue_length=2)]})
    assert outcome.code == 0
    expected = "router connected idle X1.500 Z5.000 17 2 /dev/ttyUSB0"
    assert outcome.out.splitlines()[1].split() == expected.split()


def test_machines_as_json_is_the_answer(millstream: Run) -> None:
    assert json.loads(millstream("machines", "--json").out) == [machine()]


def test_a_hostile_name_is_shown_safely(millstream: Run) -> None:
    assert "\x1b" not in millstream("machines", answers={"GET /machines": [machine("\x1b[2J")]}).out


@pytest.mark.parametrize("verb", ["pause", "resume", "stop", "estop", "home", "unlock", "reset"])
def test_a_verb_goes_to_the_only_machine(millstream: Run, verb: str) -> None:
    outcome = millstream(verb, answers=accepted("router", verb))
    assert outcome.code == 0
    assert outcome.out == f"router: {verb}\n"
    assert outcome.daemon.made()[-1] == f"POST /machines/router/{verb}"


@pytest.mark.parametrize("verb", ["pause", "resume", "stop", "estop", "home", "unlock", "reset"])
def test_a_named_machine_is_not_looked_up_first(millstream: Run, verb: str) -> None:
    outcome = millstream(verb, "--machine", "lathe", answers=accepted("lathe", verb))
    assert outcome.code == 0
    assert outcome.daemon.made() == [f"POST /machines/lathe/{verb}"]


@pytest.mark.parametrize("verb", ["pause", "resume", "stop", "console"])
def test_of_several_machines_one_must_be_named(millstream: Run, verb: str) -> None:
    outcome = millstream(verb, answers=TWO)
    assert outcome.code == 2
    assert "--machine router or lathe" in outcome.err


def test_without_machines_there_is_nothing_to_do(millstream: Run) -> None:
    assert millstream("pause", answers={"GET /machines": []}).code == 1


def test_estop_without_a_name_is_for_all_even_if_one_refuses(millstream: Run) -> None:
    answers = {
        **TWO,
        "POST /machines/router/estop": problem(409, "not_connected", "No link."),
        **accepted("lathe", "estop"),
    }
    outcome = millstream("estop", answers=answers)
    assert outcome.code == 1
    assert outcome.out == "lathe: estop\n"
    assert outcome.err == "router: Title of not_connected: No link.\n"
    assert outcome.daemon.made()[1:] == ["POST /machines/router/estop", "POST /machines/lathe/estop"]


def test_estop_as_json_has_a_line_for_each_machine(millstream: Run) -> None:
    answers = {**TWO, **accepted("router", "estop")}
    outcome = millstream("estop", "--json", answers=answers)
    assert outcome.code == 1
    told = [json.loads(line) for line in outcome.out.splitlines()]
    assert [one.get("accepted", one.get("code")) for one in told] == ["estop", "not_found"]


def test_a_machine_name_cannot_leave_its_path(millstream: Run) -> None:
    outcome = millstream("pause", "--machine", "../jobs/1/cancel?x#y")
    assert outcome.daemon.made() == ["POST /machines/..%2Fjobs%2F1%2Fcancel%3Fx%23y/pause"]


def test_console_prints_both_directions_safely(millstream: Run) -> None:
    lines = [
        {"at": "T1", "direction": ">", "text": "INIT;"},
        {"at": "T2", "direction": "<", "text": "OK\x1b[2J"},
    ]
    outcome = millstream("console", "--limit", 2, answers={"GET /machines/router/console": lines})
    assert outcome.out == "T1 > INIT;\nT2 < OK\\x1b[2J\n"
    assert outcome.daemon.made()[-1] == "GET /machines/router/console?limit=2"


def test_ports_are_those_of_this_computer(millstream: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    port = SimpleNamespace(device="/dev/ttyUSB0", description="FT232R", hwid="USB VID:PID=0403:6001")
    monkeypatch.setattr(machines.list_ports, "comports", lambda: [port])
    assert millstream("ports").out == "/dev/ttyUSB0  FT232R  USB VID:PID=0403:6001\n"
    assert json.loads(millstream("ports", "--json").out) == [
        {"port": "/dev/ttyUSB0", "description": "FT232R", "hardware": "USB VID:PID=0403:6001"}
    ]


def test_no_ports_is_explained(millstream: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machines.list_ports, "comports", list)
    assert "No serial ports" in millstream("ports").out
    assert json.loads(millstream("ports", "--json").out) == []


def test_a_jog_and_its_end(millstream: Run) -> None:
    taken = accepted("router", "jog") | {"DELETE /machines/router/jog": {"machine": "router", "accepted": "cancel_jog"}}
    outcome = millstream("jog", "--x", "-1.5", "--z", 2, "--feed", 600, answers=taken)
    assert (outcome.code, outcome.out) == (0, "router: jog\n")
    assert outcome.daemon.body() == {"x": -1.5, "z": 2.0, "feed": 600.0}
    outcome = millstream("jog", "--cancel", answers=taken)
    assert (outcome.code, outcome.out) == (0, "router: cancel_jog\n")
    assert outcome.daemon.made()[-1] == "DELETE /machines/router/jog"


@pytest.mark.parametrize(
    "argv", [[], ["--x", "1"], ["--feed", "600"], ["--x", "0", "--feed", "600"], ["--x", "1", "--cancel"]]
)
def test_a_jog_that_is_none_asks_nothing(millstream: Run, argv: list[str]) -> None:
    outcome = millstream("jog", *argv)
    assert outcome.code == 2
    assert outcome.daemon.made() == []
