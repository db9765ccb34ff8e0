"""Where work is done that takes long or waits for the disk: reading, checking and planning programs.

Not the database (dbthread.py). The one rule: the loop's thread, which keeps the machines, never waits for a disk.
"""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, Protocol, TypeVar

T = TypeVar("T")
P = ParamSpec("P")


class Worker(Protocol):
    """Runs functions elsewhere."""

    async def run(self, fn: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """The result of `fn`, or its error."""

    def for_bytes(self, size_bytes: int) -> "Worker":
        """The worker for a program of that size: large ones may have one of their own (childworker.py)."""

    def close(self) -> None:
        """No more work; what has begun ends."""


class ThreadWorker:
    """`threads` at a time."""

    def __init__(self, name: str, threads: int = 1) -> None:
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix=name)
        self._closed = False

    async def run(self, fn: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        if self._closed:
            raise asyncio.CancelledError  # as what waited when it was closed
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._pool, lambda: fn(*args, **kwargs))

    def for_bytes(self, size_bytes: int) -> Worker:  # noqa: ARG002 - one for all
        return self

    def close(self) -> None:
        self._closed = True
        self._pool.shutdown(wait=False, cancel_futures=True)


class InlineWorker:
    """The same without a thread, for simulated time."""

    async def run(self, fn: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        return fn(*args, **kwargs)

    def for_bytes(self, size_bytes: int) -> Worker:  # noqa: ARG002 - one for all
        return self

    def close(self) -> None:
        """Nothing to end."""
