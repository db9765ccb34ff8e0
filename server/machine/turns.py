"""When a job's next batch is read, planned and handed over, so that the lines of the present one do not wait for it.

Not what is planned (jobs/) and not what is done about it (jobstream.py). Lines are read in a worker: it is milliseconds
of work in one piece, and a disk may be slow. The one rule: while a machine has something to do, its job takes one step
in a turn of the loop; one that stands still gets what it needs at once. A job whose lines cannot be read ends when what
is open has ended, and says so.
"""

import asyncio
import logging
from collections.abc import Callable

from jobs.feed import BatchSource
from jobs.runner import Runner
from server.background.worker import Worker

log = logging.getLogger(__name__)


class Turns:
    """Of one machine. `go` is called in a turn of its own: there the runner may take a step."""

    def __init__(self, loop: asyncio.AbstractEventLoop, reader: Worker, go: Callable[[], object]) -> None:
        self._loop = loop
        self._reader = reader
        self._go = go
        self._next: asyncio.Handle | None = None
        self._open = False
        self._reading: asyncio.Task[None] | None = None

    @property
    def pending(self) -> bool:
        """A turn comes anyway, or lines are being read and one comes behind that."""
        return self._next is not None or self._reading is not None

    def admits(self, runner: Runner, next_id: int, free: int) -> bool:
        """Whether the runner may take a step now; if not, and there may be one to take, it gets a turn."""
        if self._open or not runner.ledger.open:
            self._open = False
            return True
        if not self.pending and not runner.waits(next_id, free):
            self._next = self._loop.call_soon(self._take)
        return False

    def read_for(self, runner: Runner) -> None:
        """Have lines read, if that is what the runner waits for."""
        source = runner.feed.source
        if self._reading is None and source is not None and runner.reading:
            self._reading = self._loop.create_task(self._read(runner, source))

    def _take(self) -> None:
        self._next, self._open = None, True
        self._go()
        self._open = False

    async def _read(self, runner: Runner, source: BatchSource) -> None:
        try:
            await self._reader.run(source.read)
        except Exception as error:  # the outermost loop of the reading: nobody else would ever tell the job
            log.exception("lines of job %d could not be read", runner.job_id)
            runner.feed.broken(f"{type(error).__name__}: {error}")
        finally:
            self._reading = None
        self._take()
