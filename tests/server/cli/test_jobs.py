"""submit and jobs."""

import json
from pathlib import Path

import httpx
import pytest

from server.cli import jobs, progress
from tests.harness.fakedaemon import Turns, job, problem
from tests.server.cli.conftest import Run

PROGRAM = b"G21\nG0 X1\n"
ANSWERS = {
    "POST /programs": {"id": "c0ffee", "name": "part.nc", "lines": 2, "bytes": 10, "sha256": "c0ffee"},
    "POST /jobs": job(status="queued"),
}


@pytest.fixture
def part(tmp_path: Path) -> Path:
    path = tmp_path / "part.nc"
    path.write_bytes(PROGRAM)
    return path


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress.time, "sleep", lambda _seconds: None)


def test_submit_uploads_the_bytes_and_queues_a_job(millstream: Run, part: Path) -> None:
    outcome = millstream("submit", part, answers=ANSWERS)
    assert outcome.code == 0
    assert outcome.out == "job 17 (part.nc on router): queued\n"
    assert outcome.daemon.made() == ["GET /machines", "POST /programs?name=part.nc", "POST /jobs"]
    assert outcome.daemon.requests[1].content == PROGRAM
    assert outcome.daemon.requests[1].headers["Content-Length"] == str(len(PROGRAM))
    assert outcome.daemon.body() == {"program": "c0ffee", "machine": "router", "hold": False, "force": False}


def test_submit_hands_all_options_on(millstream: Run, part: Path) -> None:
    options = ["--hold", "--force", "--note", "second side", "--start-line", 2, "--end-line", 9, "-m", "lathe"]
    assert millstream("submit", part, *options, answers=ANSWERS).daemon.body() == {
        "program": "c0ffee",
        "machine": "lathe",
        "hold": True,
        "force": True,
        "note": "second side",
        "start_line": 2,
        "end_line": 9,
    }


def test_submit_as_json_is_the_job(millstream: Run, part: Path) -> None:
    assert json.loads(millstream("submit", part, "--json", answers=ANSWERS).out) == job(status="queued")


def test_submit_of_a_missing_file_is_wrong_usage(millstream: Run) -> None:
    outcome = millstream("submit", "nowhere.nc", answers=ANSWERS)
    assert outcome.code == 2
    assert outcome.daemon.requests == []


def test_a_refused_check_names_the_lines(millstream: Run, part: Path) -> None:
    finding = {"line": 2, "column": 1, "code": "unknown_code", "message": "G55 does not exist", "count": 1}
    report = {"errors": [finding], "warnings": []}
    refusal = problem(422, "preflight_failed", "1 error.", report=report)
    outcome = millstream("submit", part, answers={**ANSWERS, "POST /jobs": refusal})
    assert outcome.code == 1
    assert "  line 2: G55 does not exist" in outcome.err


def test_a_long_check_is_waited_for_under_one_key(millstream: Run, part: Path) -> None:
    course = Turns(httpx.ReadTimeout("slow"), httpx.ReadTimeout("slow"), job(0))
    outcome = millstream("submit", part, answers={**ANSWERS, "POST /jobs": course})
    assert outcome.code == 0
    assert outcome.err.count("still checks the program") == 1
    keys = [one.headers["Idempotency-Key"] for one in outcome.daemon.requests if one.url.path.endswith("/jobs")]
    assert len(keys) == 3
    assert len(set(keys)) == 1


def test_a_daemon_that_is_gone_is_not_asked_again(millstream: Run, part: Path) -> None:
    outcome = millstream("submit", part, answers={**ANSWERS, "POST /jobs": httpx.ReadError("gone")})
    assert outcome.code == 3
    assert outcome.daemon.made().count("POST /jobs") == 1


def test_what_the_daemon_warns_of_is_said(millstream: Run, part: Path) -> None:
    warned = job(status="queued", warnings=[{"code": "startup_blocks", "message": "It runs\x1b G54."}])
    outcome = millstream("submit", part, answers={**ANSWERS, "POST /jobs": warned})
    assert outcome.err == "It runs\\x1b G54.\n"


def test_watch_follows_to_the_end(millstream: Run, part: Path) -> None:
    course = Turns(job(0), job(5), job(10, status="completed"))
    outcome = millstream("submit", part, "--watch", answers={**ANSWERS, "GET /jobs/17": course})
    assert outcome.code == 0
    assert outcome.out == "job 17 (part.nc on router): completed\n"
    assert outcome.daemon.made().count("GET /jobs/17") == 3


@pytest.mark.parametrize("status", ["failed", "cancelled", "interrupted"])
def test_a_watched_job_that_is_not_completed_is_1(millstream: Run, part: Path, status: str) -> None:
    error = {"code": "alarm", "message": "end limit switch hit", "line_from": 5, "line_to": 7}
    end = job(4, status=status, error=error)
    outcome = millstream("submit", part, "--watch", answers={**ANSWERS, "GET /jobs/17": end})
    assert outcome.code == 1
    assert f"{status}: end limit switch hit (lines 5 to 7 in doubt)" in outcome.out


def test_a_watched_job_as_json_is_printed_once_whatever_its_end(millstream: Run, part: Path) -> None:
    end = job(4, status="failed")
    outcome = millstream("submit", part, "--watch", "--json", answers={**ANSWERS, "GET /jobs/17": end})
    assert outcome.code == 1
    assert json.loads(outcome.out) == end


def test_ctrl_c_says_that_the_job_goes_on(millstream: Run, part: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(jobs, "follow", pressed)
    outcome = millstream("submit", part, "--watch", answers=ANSWERS)
    assert outcome.code == 130
    assert outcome.err == "Job 17 goes on; `millstream stop --machine router` stops it.\n"


def test_jobs_lists_them(millstream: Run) -> None:
    waiting = job(3, status="waiting", tool=2)
    outcome = millstream("jobs", "-m", "router", "--status", "waiting", "--limit", 5, answers={"GET /jobs": [waiting]})
    assert outcome.daemon.made() == ["GET /jobs?machine=router&status=waiting&limit=5"]
    line = outcome.out.splitlines()[1].strip()
    assert line.split(maxsplit=4) == ["17", "router", "c0ffee", "3/10", "waiting for an operator: tool 2"]


def test_jobs_as_json_is_the_answer(millstream: Run) -> None:
    assert json.loads(millstream("jobs", "--json", answers={"GET /jobs": [job()]}).out) == [job()]
