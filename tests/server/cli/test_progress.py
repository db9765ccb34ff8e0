"""A job followed: to its end, across a daemon that restarts, and never for ever."""

import pytest

from server.cli.common import CliError, ExitCode
from server.cli.progress import MAX_SILENCE_S, POLL_S, describe, follow, left
from tests.harness.fakedaemon import Turns, job


def follow_turns(*answers: object) -> tuple[object, list[float]]:
    turns = Turns(*answers)
    slept: list[float] = []

    def fetch() -> dict[str, object]:
        answer = turns.next()
        if isinstance(answer, Exception):
            raise answer
        assert isinstance(answer, dict)
        return answer

    return follow(fetch, "part.nc", sleep=slept.append), slept


SILENT = CliError(ExitCode.UNREACHABLE, "no daemon answers")


def test_a_job_on_hold_says_why() -> None:
    why = {"code": "not_connected", "message": "router is connecting."}
    assert describe(job(status="queued", hold_reason=why)) == "queued, on hold: router is connecting."
    assert describe(job(status="queued", hold_reason=None)) == "queued"


def test_it_ends_with_the_job() -> None:
    end = job(10, status="completed")
    assert follow_turns(job(), job(5), end) == (end, [POLL_S, POLL_S])


def test_it_waits_for_a_daemon_that_restarts() -> None:
    end = job(10, status="completed")
    result, slept = follow_turns(job(), SILENT, SILENT, end)
    assert result == end
    assert slept == [POLL_S, 1.0, 1.0]


def test_it_gives_a_silent_daemon_up() -> None:
    slept: list[float] = []

    def fetch() -> dict[str, object]:
        raise SILENT

    with pytest.raises(CliError):
        follow(fetch, "part.nc", sleep=slept.append)
    assert sum(slept) == MAX_SILENCE_S


def test_a_refusal_ends_it_at_once() -> None:
    with pytest.raises(CliError, match="unknown"):
        follow_turns(job(), CliError(ExitCode.FAILED, "unknown job"))


@pytest.mark.parametrize(
    ("described", "text"),
    [
        (job(), "running"),
        (job(status="waiting", tool=3), "waiting for an operator: tool 3"),
        (job(status="waiting"), "waiting for an operator: a decision"),
        (
            job(status="failed", error={"code": "alarm", "message": "hit", "line_from": None, "line_to": None}),
            "failed: hit",
        ),
        (
            job(status="interrupted", error={"code": "in_doubt", "message": "m", "line_from": 4, "line_to": 6}),
            "interrupted: m (lines 4 to 6 in doubt)",
        ),
    ],
)
def test_a_job_in_words(described: dict[str, object], text: str) -> None:
    assert describe(described) == text


@pytest.mark.parametrize(
    ("least", "seconds", "most", "text"),
    [
        (None, None, None, ""),
        (None, 40.4, None, "about 40 s left"),
        (700.0, 720.0, 740.0, "about 12 min left"),
        (600.0, 720.0, 864.0, "10 to 14 min left"),
        (20.0, 40.0, 80.0, "20 to 80 s left"),
        (60.0, 100.0, 160.0, "60 s to 3 min left"),
        (4000.0, 5400.0, 8000.0, "67 min to 2 h 13 min left"),
        (0.0, 0.0, 0.0, "about 0 s left"),
        (1.3, 1.4, 1.45, "about 1 s left"),
    ],
)
def test_what_is_left_in_words(least: float | None, seconds: float | None, most: float | None, text: str) -> None:
    assert left({"seconds_left": seconds, "seconds_left_min": least, "seconds_left_max": most}) == text
