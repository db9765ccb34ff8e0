"""Times for people."""

import asyncio
from datetime import UTC, datetime, timedelta, timezone

import pytest

from server.clock import WallClock, rfc3339, seconds_since, stamp
from tests.harness.simloop import LoopClock, run_simulated


def test_the_computers_clock_is_in_utc() -> None:
    assert WallClock().now().tzinfo is UTC


def test_stamps_and_what_has_passed_since() -> None:
    async def main() -> None:
        clock = LoopClock(asyncio.get_running_loop())
        before = stamp(clock)
        assert before == "2026-03-01T09:00:00.000Z"
        assert datetime.fromisoformat(before).tzinfo is not None
        await asyncio.sleep(2.5)
        assert seconds_since(clock, before) == 2.5
        assert seconds_since(clock, None) is None

    run_simulated(main())


def test_a_clock_that_was_set_back_says_nothing() -> None:
    async def main() -> None:
        clock = LoopClock(asyncio.get_running_loop())
        before = stamp(clock)
        clock.set_back_s = 60.0
        assert seconds_since(clock, before) is None

    run_simulated(main())


@pytest.mark.parametrize(
    ("at", "text"),
    [
        (datetime(2026, 3, 1, 9, 0, 0, 0, UTC), "2026-03-01T09:00:00.000Z"),
        (datetime(2026, 3, 1, 9, 0, 0, 999_999, UTC), "2026-03-01T09:00:00.999Z"),
        (datetime(2026, 3, 1, 9, 0, 1, 0, UTC), "2026-03-01T09:00:01.000Z"),
        (datetime(2026, 3, 1, 8, 59, 59, 7_500, UTC), "2026-03-01T08:59:59.007Z"),
        (datetime(2026, 3, 1, 9, 59, 59, 8_000, timezone(timedelta(hours=1))), "2026-03-01T08:59:59.008Z"),
        (datetime.max.replace(tzinfo=UTC), "9999-12-31T23:59:59.999Z"),
        (datetime.min.replace(tzinfo=UTC), "0001-01-01T00:00:00.000Z"),
    ],
)
def test_a_stamp_is_of_its_own_second_whatever_was_asked_before(at: datetime, text: str) -> None:
    assert rfc3339(at) == text
