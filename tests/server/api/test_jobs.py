from typing import Any

import pytest

from server.api.models import PROGRAM_ID, JobView
from server.config.reentry import ReentryWish
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.simloop import run_simulated as run

JOBS = "/api/v1/jobs"
PLAIN = {
    "start_line": None,
    "end_line": None,
    "hold": False,
    "note": None,
    "force": False,
    "idempotency_key": None,
    "mode": "run",
    "on_error": None,
    "ignored_errors": None,
}


def ask(method: str, path: str, body: Any = None, **headers: str) -> tuple[int, Any, list[Any]]:
    async def main() -> tuple[int, Any, list[Any]]:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            answer = await client.request(method, path, json=body, headers=headers)
            return answer.status_code, answer.json(), workshop.jobs.calls

    return run(main())


def test_a_job_is_made() -> None:
    status, body, calls = ask("POST", JOBS, {"program": PROGRAM_ID, "machine": "router"})
    assert (status, JobView.model_validate(body).id) == (201, 17)
    assert calls == [("create", PROGRAM_ID, "router", PLAIN)]


def test_everything_that_can_be_said_of_a_job() -> None:
    options = {"start_line": 5, "end_line": 9, "hold": True, "note": "second side", "force": True}
    options |= {"mode": "check", "on_error": "ignore", "ignored_errors": [20, 33]}
    body = {"program": PROGRAM_ID, "machine": "router", **options}
    _, _, calls = ask("POST", JOBS, body, **{"Idempotency-Key": "k1"})
    assert calls == [("create", PROGRAM_ID, "router", {**options, "idempotency_key": "k1"})]


@pytest.mark.parametrize(
    "extra",
    [
        {"start_line": 0},
        {"end_line": 0},
        {"start_line": 9, "end_line": 8},
        {"hold": "maybe"},
        {"end_lin": 4},
        {"note": 7},
    ],
)
def test_jobs_that_are_none(extra: dict[str, Any]) -> None:
    status, body, calls = ask("POST", JOBS, {"program": PROGRAM_ID, "machine": "router", **extra})
    assert (status, body["code"], calls) == (422, "invalid_request", [])


def test_a_job_for_a_machine_that_does_not_exist() -> None:
    status, body, calls = ask("POST", JOBS, {"program": PROGRAM_ID, "machine": "router2"})
    assert (status, body["code"], calls) == (404, "unknown_machine", [])


def test_jobs_are_listed_in_pages() -> None:
    assert ask("GET", JOBS)[2] == [("list", None, None, 100, None)]
    path = f"{JOBS}?machine=router&status=queued,running&limit=5&before=17"
    assert ask("GET", path)[2] == [("list", "router", "queued,running", 5, 17)]


def test_a_job_is_shown() -> None:
    assert ask("GET", f"{JOBS}/17")[1]["id"] == 17


@pytest.mark.parametrize(("verb", "status"), [("pause", 202), ("resume", 202), ("cancel", 202)])
def test_actions(verb: str, status: int) -> None:
    answered, body, calls = ask("POST", f"{JOBS}/17/{verb}")
    assert (answered, body["id"], calls) == (status, 17, [(verb, 17)])


def test_rerun_makes_a_new_job() -> None:
    status, body, calls = ask("POST", f"{JOBS}/17/rerun")
    assert (status, body["id"], calls) == (201, 18, [("rerun", 17)])


def test_a_place_in_the_queue() -> None:
    assert ask("POST", f"{JOBS}/17/move", {"position": 1})[2] == [("move", 17, 1)]
    for body in ({"position": 0}, {}, None):
        assert ask("POST", f"{JOBS}/17/move", body)[0] == 422


def test_recovery_answers_the_plan_without_a_body_and_acts_with_one() -> None:
    assert ask("POST", f"{JOBS}/17/recover")[2] == [("recover", 17, None, None)]
    assert ask("POST", f"{JOBS}/17/recover", {"action": "continue"})[2] == [("recover", 17, "continue", None)]
    assert ask("POST", f"{JOBS}/17/recover", {"action": "from_line", "line": 9})[2] == [("recover", 17, "from_line", 9)]


def test_a_plan_for_another_line_or_way_moves_nothing() -> None:
    assert ask("POST", f"{JOBS}/17/recover", {"line": 5})[2] == [("recover", 17, None, 5)]
    assert ask("POST", f"{JOBS}/17/recover", {"clearance": 9, "clearance_is_machine": True, "plunge_feed": 50.5})[
        2
    ] == [("recover", 17, None, None, ReentryWish(9.0, clearance_is_machine=True, plunge_feed=50.5))]


def test_a_plan_is_run_with_what_the_operator_says() -> None:
    body = {"action": "from_line", "blocks": ["G90"], "spindle_wait": 0, "operator_done": True, "force": True}
    wish = ReentryWish(blocks=("G90",), spindle_wait=0.0, operator_done=True, force=True)
    assert ask("POST", f"{JOBS}/17/recover", body)[2] == [("recover", 17, "from_line", None, wish)]


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"action": "continue", "line": 5},
        {"action": "continue", "force": True},
        {"action": "guess"},
        {"action": None},
        {"line": 0},
        {"line": 5, "force": True},
        {"blocks": ["G0 X1"]},
        {"line": 5, "blocks": ["G0 X1"]},
        {"operator_done": True},
        {"line": 5, "clearance_is_machine": True},
        {"line": 5, "clearance": 1e6},
        {"action": "from_line", "plunge_feed": 0},
        {"action": "from_line", "blocks": []},
        {"action": "from_line", "blocks": ["G0"] * 201},
        {"action": "from_line", "blocks": ["G0" + "0" * 300]},
        {"action": "from_line", "lift": 3},
        [],
    ],
)
def test_recovery_never_guesses(body: Any) -> None:
    """Above all `{}` is not "no body": what moves a machine is asked for in full."""
    status, answer, calls = ask("POST", f"{JOBS}/17/recover", body)
    assert (status, answer["code"], calls) == (422, "invalid_request", [])


@pytest.mark.parametrize("part", ["batches", "events"])
def test_the_journal_page_by_page(part: str) -> None:
    assert ask("GET", f"{JOBS}/17/{part}")[2] == [(part, 17, 0)]
    assert ask("GET", f"{JOBS}/17/{part}?after=10000")[2] == [(part, 17, 10_000)]
    assert ask("GET", f"{JOBS}/17/{part}?after=-1")[0] == 422


def test_the_report() -> None:
    status, _, calls = ask("GET", f"{JOBS}/17/report")
    assert (status, calls) == (200, [("report", 17)])
