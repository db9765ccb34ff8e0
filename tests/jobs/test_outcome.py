"""The words for how a job stopped."""

import pytest

from jobs import outcome
from jobs.job import Status
from jobs.outcome import MACHINE_GONE, Outcome
from protocol.events import BatchFailed


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (BatchFailed(7, "restart", None, "gone"), MACHINE_GONE),
        (BatchFailed(7, "error", 4, "No such code."), ("machine_error", "The machine answered ERROR 4. No such code.")),
        (BatchFailed(7, "error", None, ""), ("machine_error", "The machine answered ERROR.")),
        (BatchFailed(7, "alarm", 5, "X is at its end."), ("alarm", "The machine is in alarm. X is at its end.")),
        (BatchFailed(7, "estop", None, ""), ("estop", "The emergency stop was pressed.")),
        (BatchFailed(7, "stop", None, "stopped"), outcome.MACHINE_RESET),
        (BatchFailed(7, "link", None, "down"), outcome.in_doubt("down")),
    ],
)
def test_a_batch_that_failed(event: BatchFailed, expected: Outcome | tuple[str, str]) -> None:
    found = outcome.failure(event)
    if isinstance(expected, tuple):
        expected = Outcome(Status.FAILED, *expected)
    assert found == expected


def test_a_break_names_its_limit() -> None:
    found = outcome.break_too_long(90.0)
    assert (found.status, found.code) == (Status.INTERRUPTED, "break_too_long")
    assert "(90 s)" in found.message
