"""An event loop whose time jumps to the next timer: a day of streaming in a second, and always the same.

Not for threads, sockets or processes: there is nothing to wait for but timers. The one rule: it never waits. When
nothing is ready and nothing is scheduled it raises, and so it does past its limit, because a test that would hang is
a test that failed.
"""

import asyncio
import selectors
from collections.abc import Coroutine
from datetime import UTC, datetime, timedelta
from typing import Any, TypeVar

T = TypeVar("T")

LIMIT_S = 100_000.0
RESOLUTION_S = 1e-9
EPOCH = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)


class NothingScheduledError(Exception):
    """Everybody waits for somebody else."""


class TooLongError(Exception):
    """Simulated time went past the limit."""


class _Jump(selectors.SelectSelector):
    """Instead of waiting for `timeout`, that much time is over."""

    def __init__(self, loop: "SimLoop") -> None:
        super().__init__()
        self._sim = loop

    def select(self, timeout: float | None = None) -> Any:
        if timeout is None:
            raise NothingScheduledError(f"at {self._sim.time():.3f} s nothing is ready and nothing is scheduled")
        self._sim.pass_time(timeout)
        return []


class SimLoop(asyncio.SelectorEventLoop):
    """Simulated time in seconds, from 0. Several loops may share one time line: pass `start_s`."""

    def __init__(self, *, start_s: float = 0.0, limit_s: float = LIMIT_S) -> None:
        self._now_s = start_s
        self._limit_s = limit_s
        super().__init__(_Jump(self))
        # asyncio runs what is due *before* now + resolution: not 0, and far below every interval that matters.
        self._clock_resolution = RESOLUTION_S
        self.slow_callback_duration = float("inf")

    def time(self) -> float:
        return self._now_s

    def pass_time(self, seconds: float) -> None:
        """Only forward; a timer must not be missed by a rounding of the sum."""
        if seconds > 0:
            due = [timer.when() for timer in self._scheduled if not timer.cancelled()]  # type: ignore[attr-defined]
            self._now_s = max(self._now_s + seconds, min(due, default=0.0))
        if self._now_s > self._limit_s:
            raise TooLongError(f"simulated time went past {self._limit_s:g} s")


class LoopClock:
    """The clock for people, driven by a loop's time. `set_back_s` is what a wrong hand did to it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, *, set_back_s: float = 0.0) -> None:
        self._loop = loop
        self.set_back_s = set_back_s

    def now(self) -> datetime:
        return EPOCH + timedelta(seconds=self._loop.time() - self.set_back_s)


def run_simulated(main: Coroutine[Any, Any, T], *, start_s: float = 0.0, limit_s: float = LIMIT_S) -> T:
    """Run `main` in simulated time. An exception in any callback fails the run."""
    loop = SimLoop(start_s=start_s, limit_s=limit_s)
    broken: list[BaseException] = []

    def on_error(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        broken.append(context.get("exception") or RuntimeError(context["message"]))

    loop.set_exception_handler(on_error)
    try:
        result = loop.run_until_complete(main)
        for task in asyncio.all_tasks(loop):
            task.cancel()
        loop.run_until_complete(asyncio.sleep(0))
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        loop.close()
    if broken:
        raise broken[0]
    return result


async def until(condition: Any, *, within_s: float, step_s: float = 0.05) -> None:
    """Let simulated time pass until `condition()` holds. Raises AssertionError when it does not."""
    loop = asyncio.get_running_loop()
    deadline = loop.time() + within_s
    while not condition():
        if loop.time() >= deadline:
            raise AssertionError(f"not reached within {within_s:g} s of simulated time")
        await asyncio.sleep(step_s)
