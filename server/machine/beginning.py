"""A job that is about to begin, or to go on after an interruption: its program is being read, nothing is sent yet.

Not the reading (starting.py, recovery.py) and not the running (jobstream.py). The one rule: what people say meanwhile
counts; a job that was cancelled does not begin, and one that was paused stands still before its first byte.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlite_utils import Database

from jobs import history, store
from jobs.store import Row
from server.background.dbthread import Db
from server.clock import Clock, stamp
from server.live.hub import Hub
from server.machine.views import job_view


class Beginning:
    """Of one machine. `reserved`: the job that is to begin; `cancelled`, `held`: what people want of what is read."""

    def __init__(self, machine: str, *, db: Db, hub: Hub, clock: Clock) -> None:
        self.reserved: int | None = None
        self.cancelled = self.held = False
        self.halts = 0
        """How often a pause or a stop was demanded. A job that was to be chosen before that does not begin after it:
        whoever presses stop between two jobs, or while one is being made, wants nothing to move."""
        self._going_on: int | None = None
        self._machine = machine
        self._db = db
        self._hub = hub
        self._clock = clock

    @property
    def wanted(self) -> bool:
        """A job is about to begin or to go on, and nobody has demanded its end."""
        return (self.reserved or self._going_on) is not None and not self.cancelled

    def reserve(self, job: int) -> None:
        """Nothing else may use the machine while this job's program is read."""
        self.reserved, self.cancelled, self.held = job, False, False

    def release(self) -> bool:
        """The program is read; whether the job may still begin."""
        self.reserved = None
        return not self.cancelled

    @contextmanager
    def going_on(self, job: int) -> Iterator[None]:
        """The program of an interrupted job is read. A second request for it does not forget what was said before."""
        outer = self._going_on
        if outer is None:
            self._going_on, self.cancelled, self.held = job, False, False
        try:
            yield
        finally:
            self._going_on = outer

    def cancel(self) -> None:
        """It does not begin."""
        self.cancelled = True

    def hold(self, *, hold: bool) -> None:
        """It stands still before its first byte; or begins after all."""
        job = self.reserved or self._going_on
        if hold is self.held or job is None:
            return
        self.held = hold
        told: list[Row | None] = []

        def write(db: Database) -> None:
            store.set_hold(db, job, hold)
            kind = "pause_demanded" if hold else "resumed"
            history.append(db, at=stamp(self._clock), kind=kind, data={}, machine=self._machine, job=job)
            told.append(store.job(db, job))

        def tell() -> None:
            if told[0] is not None:
                self._hub.publish("job", self._machine, job_view(told[0], self._clock))

        self._db.post(write, then=tell)
