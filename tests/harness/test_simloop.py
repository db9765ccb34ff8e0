"""The simulated loop: time jumps, order is kept, and what would hang fails."""

import asyncio

import pytest

from tests.harness.simloop import NothingScheduledError, TooLongError, run_simulated, until


def test_a_day_passes_in_no_time_and_timers_ring_in_order_and_on_time() -> None:
    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        rung: list[float] = []
        for when in (86_400.0, 0.3, 0.1, 3600.0, 0.1 + 0.2):
            loop.call_at(when, lambda when=when: rung.append(when))
            loop.call_at(when, lambda when=when: rung.append(loop.time()))
        await asyncio.sleep(86_401)
        return rung

    rung = run_simulated(main())
    assert rung == sorted(rung)
    assert rung[::2] == pytest.approx(rung[1::2])


def test_everybody_waiting_for_somebody_else_raises() -> None:
    async def main() -> None:
        await asyncio.get_running_loop().create_future()

    with pytest.raises(NothingScheduledError):
        run_simulated(main())


def test_a_wait_that_never_ends_raises() -> None:
    async def main() -> None:
        while True:
            await asyncio.sleep(0.1)

    with pytest.raises(TooLongError):
        run_simulated(main(), limit_s=100.0)


def test_an_error_in_a_callback_fails_the_run() -> None:
    async def main() -> None:
        asyncio.get_running_loop().call_soon(lambda: 1 // 0)
        await asyncio.sleep(1)

    with pytest.raises(ZeroDivisionError):
        run_simulated(main())


def test_what_is_not_reached_is_said() -> None:
    async def main() -> None:
        with pytest.raises(AssertionError, match="not reached within 5 s"):
            await until(lambda: False, within_s=5)
        await until(lambda: True, within_s=0)

    run_simulated(main())
