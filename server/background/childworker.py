"""Where large programs are checked, measured and drawn: in a process of its own, which is there while there is work.

A thread that computes takes the interpreter from the loop a millisecond at a time, at each of its sends, and beside a
hundred readers that would be tenths of a second. Small programs are not worth a process: they stay in a thread. The
one rule: what is handed over travels as a pickle, so it may hold neither the loop nor anything that is open.
"""

import asyncio
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ParamSpec, TypeVar

from server.background.child import opened, read_block, write_block
from server.background.worker import ThreadWorker, Worker

T = TypeVar("T")
P = ParamSpec("P")

LARGE_BYTES = 1 << 20
"""Of a program: some 30,000 lines, for which a thread computes a tenth of a second."""
IDLE_S = 30.0
"""Without work for so long it ends, and gives its memory back."""
ROOT = Path(__file__).resolve().parent.parent


class ChildEndedError(OSError):
    """The process ended in the middle of its work."""


class ChildWorker:
    """One process, begun when it is needed. Made on the loop."""

    def __init__(self, name: str, *, idle_s: float = IDLE_S) -> None:
        self._name = name
        self._idle_s = idle_s
        self._thread = ThreadWorker(name)
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False
        self._alarm: asyncio.TimerHandle | None = None
        self._ending: asyncio.Task[None] | None = None
        self._under_way = 0

    @property
    def pid(self) -> int | None:
        """Of the process, while there is one."""
        return None if self._process is None else self._process.pid

    async def run(self, fn: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """The result of `fn`, or its error; ChildEndedError where the process was ended (for its memory, mostly)."""
        self._quiet()
        self._under_way += 1
        try:
            answer = await self._thread.run(self._ask, pickle.dumps((fn, args, kwargs)))
        finally:
            self._under_way -= 1
            if not self._under_way and not self._closed:
                self._alarm = asyncio.get_running_loop().call_later(self._idle_s, self._rest)
        result: T = opened(answer)
        return result

    def for_bytes(self, size_bytes: int) -> Worker:  # noqa: ARG002 - there is one for all
        """Itself."""
        return self

    def close(self) -> None:
        """No more work; what has begun ends here."""
        self._closed = True
        self._quiet()
        self._end()
        self._thread.close()

    def _quiet(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _rest(self) -> None:
        self._alarm = None
        self._ending = asyncio.ensure_future(self._thread.run(self._end))

    # --- in the thread ----------------------------------------------------------------------------------------

    def _ask(self, request: bytes) -> bytes:
        rested = self._process is not None
        answer, code = self._answered(request)
        if answer is None and rested and not self._closed:
            answer, code = self._answered(request)  # the first one may have been dying before it was asked
        if answer is None:
            raise ChildEndedError(f"the process for {self._name} ended with {code} before its answer")
        return answer

    def _answered(self, request: bytes) -> tuple[bytes | None, int]:
        """The answer, or None and what the process ended with."""
        process = self._process
        if process is None or process.poll() is not None:
            self._end()
            process = self._process = _begun()
            if self._closed:
                self._end()  # `close` came before there was one to end
                raise ChildEndedError(f"the process for {self._name} was ended before its answer")
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            write_block(process.stdin, request)  # type: ignore[arg-type]
            answer = read_block(process.stdout)  # type: ignore[arg-type]
        except OSError:
            answer = None
        if answer is not None:
            return answer, 0
        self._end()
        return None, process.wait()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with suppress(OSError), process:  # closes the pipes and waits
                pass


def _begun() -> "subprocess.Popen[bytes]":
    """The same interpreter with the same code, wherever the daemon was started."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-P", "-m", "server.background.child"]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment)  # noqa: S603 - ourselves


class BySize:
    """A thread for small programs, a process of its own for large ones."""

    def __init__(self, name: str) -> None:
        self._thread = ThreadWorker(name)
        self._child = ChildWorker(name)

    async def run(self, fn: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """In the thread."""
        return await self._thread.run(fn, *args, **kwargs)

    def for_bytes(self, size_bytes: int) -> Worker:
        """The worker for a program of that size."""
        return self._thread if size_bytes < LARGE_BYTES else self._child

    def close(self) -> None:
        """No more work."""
        self._thread.close()
        self._child.close()
