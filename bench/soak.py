"""A year in a workshop in minutes of simulated time: jobs, pulled plugs, killed daemons, with retention. What grows?

Memory (objects, resident size), tasks, open files and the database are looked at every day. Nothing here is about
speed. The one rule: what the machine executed is compared after each job; a soak that loses a line has not passed.
"""

import asyncio
import gc
import os
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from bench.report import Figure, Report
from jobs import history, seals
from server import retention, sealing
from server.historyconfig import HistoryConfig
from sim.elvinto.settings import SimSettings
from tests.harness.simloop import run_simulated
from tests.harness.workshop import MACHINE, Bench

TITLE = "soak: a year of jobs, breaks and restarts in simulated time"
SEED = 17
DAY_S = 86_400.0
IDLE_S = 30.0
"""Of the time between two jobs so much is simulated second by second, with the polls of an idle machine."""
KEEP = HistoryConfig(keep_days=10, keep_jobs=40, keep_unused_programs_days=2)
GROWTH = 1.05
BLOCKS = 40
LIMIT_S = 1e9


@dataclass(frozen=True, slots=True)
class Sample:
    """What there is at the end of a day. `pages`: of the database file, each 4 KiB."""

    objects: int
    resident_mb: float
    tasks: int
    files: int
    pages: int
    jobs: int
    events: int


class Year:
    """One machine and its daemons, day by day."""

    def __init__(self, folder: Path, jobs_a_day: int, seed: int = SEED) -> None:
        settings = SimSettings(executed_limit=4 * BLOCKS)
        options = {"resume_within": 60.0, "elvinto": {"max_batch_blocks": 8}}
        self.bench = Bench(folder, settings, options=options)
        self.random = Random(seed)
        self.jobs_a_day = jobs_a_day
        self.jobs = self.breaks = self.restarts = 0
        self._round: asyncio.Task[None] | None = None

    async def day(self) -> Sample:
        """Its jobs, one restart, and a look at what there is."""
        for number in range(self.jobs_a_day):
            await self._job()
            self._pass(DAY_S / self.jobs_a_day)
            if number == self.jobs_a_day // 2:
                await self._restart()
        shop = await self.bench.connected()
        await sealing.seal_ended(shop.db, shop.jobs.clock)
        await retention.remove_expired(KEEP, shop.db, shop.jobs.clock, shop.programs.delete)
        return self._look()

    async def end(self) -> list[Any]:
        """Stop; what is wrong with the history."""
        assert self.bench.shop is not None
        found = await self.bench.shop.db.run(lambda db: [*history.faults(db), *seals.faults(db)])
        await self.bench.shop.stop()
        return found

    async def _job(self) -> None:
        bench, far = self.bench, self.random.randrange(1000)
        await bench.connected()
        wanted = [f"X{far + i}" for i in range(BLOCKS)]
        text = "".join(["G90\n", *(f"G1 {word} F6000\n" for word in wanted), "M30\n"])
        job = (await bench.job(text))["id"]
        match self.random.randrange(4):
            case 0:
                await self._unplug()
            case 1:
                await self._kill()
            case _:
                pass
        view = await bench.status(job, "completed", "interrupted", "failed")
        said = [block.removeprefix("G1").removesuffix("F6000") for block in bench.executed()]
        if view["status"] != "completed" or [word for word in said if word.startswith("X")][-BLOCKS:] != wanted:
            raise AssertionError(f"job {job} after {self.jobs} others: {view}, {said[-BLOCKS:]}")
        self.jobs += 1
        await asyncio.sleep(IDLE_S)

    async def _unplug(self) -> None:
        await asyncio.sleep(self.random.uniform(0.05, 0.4))
        self.bench.cable.pull()
        await self.bench.cable.live_alone(self.random.uniform(0.0, 2.0))
        self.bench.cable.plugged = True
        self.breaks += 1

    async def _kill(self) -> None:
        await asyncio.sleep(self.random.uniform(0.05, 0.4))
        self._keep_clock()
        self.bench.crash()
        self.bench.databases.clear()
        await self.bench.cable.live_alone(self.random.uniform(0.0, 2.0))
        await self.bench.connected()
        self.restarts += 1

    async def _restart(self) -> None:
        shop = await self.bench.connected()
        self._keep_clock()
        await shop.stop()
        self.bench.shop = None
        self.bench.databases.clear()
        await self.bench.connected()
        self.restarts += 1

    def _pass(self, seconds: float) -> None:
        """Time for people alone."""
        assert self.bench.shop is not None
        clock: Any = self.bench.shop.jobs.clock
        clock.set_back_s -= seconds

    def _keep_clock(self) -> None:
        assert self.bench.shop is not None
        clock: Any = self.bench.shop.jobs.clock
        self.bench.set_back_s = clock.set_back_s

    def _look(self) -> Sample:
        gc.collect()
        db = self.bench.databases[-1].db

        def number(query: str) -> int:
            return int(db.conn.execute(query).fetchone()[0])

        return Sample(
            objects=len(gc.get_objects()),
            resident_mb=_resident_mb(),
            tasks=len(asyncio.all_tasks()),
            files=sum(1 for _ in Path("/proc/self/fd").iterdir()),
            pages=number("pragma page_count"),
            jobs=number("select count(*) from jobs"),
            events=number("select count(*) from events"),
        )


def _resident_mb() -> float:
    with suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1024**2
    return 0.0


def lived(days: int, jobs_a_day: int) -> tuple[list[Sample], Year]:
    """So many days. Raises AssertionError when a job did not come out as it had to."""

    async def main(folder: Path) -> tuple[list[Sample], Year]:
        year = Year(folder, jobs_a_day)
        samples = [await year.day() for _ in range(days)]
        if found := await year.end():
            raise AssertionError(f"the history is not as it was written: {found[:3]}")
        return samples, year

    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        return run_simulated(main(Path(folder)), limit_s=LIMIT_S)


def growth(samples: list[Sample]) -> Iterator[Figure]:
    """The last third beside the middle one: by then retention has begun and all caches are full. The history is cut a
    few hundred events at a time, so its length goes up and down."""
    third = len(samples) // 3
    for name in ("objects", "resident_mb", "tasks", "files", "pages", "jobs", "events"):
        values = [float(getattr(sample, name)) for sample in samples]
        middle, last = max(values[third:-third]), max(values[-third:])
        yield Figure(f"{name}, at most", last, digits=0)
        goal = None if name == "events" else GROWTH
        yield Figure(f"{name}, last third / middle third", last / max(middle, 1.0), goal=goal, digits=3)


def run(*, days: int = 365, jobs_a_day: int = 8) -> Report:
    """The year."""
    samples, year = lived(days, jobs_a_day)
    told = f"{days} days, {year.jobs} jobs, {year.breaks} pulled plugs, {year.restarts} restarts on {MACHINE}"
    return Report.of(TITLE, [(told, tuple(growth(samples)))])
