"""The table of a job's states, and the page that is made from it."""

from pathlib import Path

import pytest

from jobs.job import ACTIVE, ENDED, MOVING, TRANSITIONS, JobError, Status, check_transition, diagram
from protocol.errors import LocalError


def test_every_status_is_in_the_table_and_can_be_reached() -> None:
    assert set(TRANSITIONS) == set(Status)
    reached = {after for following in TRANSITIONS.values() for after in following}
    assert reached | {Status.QUEUED} == set(Status)


def test_ends_are_ends_and_interrupted_is_none() -> None:
    assert {Status.COMPLETED, Status.FAILED, Status.CANCELLED} == ENDED
    assert Status.INTERRUPTED in ACTIVE - MOVING


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (Status.COMPLETED, Status.RUNNING),
        (Status.QUEUED, Status.RUNNING),
        (Status.INTERRUPTED, Status.COMPLETED),
        (Status.FAILED, Status.QUEUED),
    ],
)
def test_what_the_table_does_not_know_raises(before: Status, after: Status) -> None:
    with pytest.raises(LocalError, match=f"from {before} to {after}"):
        check_transition(before, after)


def test_what_it_knows_does_not() -> None:
    for before, following in TRANSITIONS.items():
        for after in following:
            check_transition(before, after)


def test_the_page_is_made_from_the_table() -> None:
    page = Path(__file__).parents[2] / "docs" / "job-states.md"
    assert page.read_text(encoding="utf-8") == diagram(), "make it anew: python -m jobs.job > docs/job-states.md"


def test_an_error_as_the_api_shows_it() -> None:
    assert JobError("alarm", "x", 3, 4).view() == {"code": "alarm", "message": "x", "line_from": 3, "line_to": 4}
