"""Times for people."""

import asyncio
from datetime import UTC, datetime

from server.clock import WallClock, seconds_since, stamp
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
