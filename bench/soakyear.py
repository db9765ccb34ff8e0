"""A year of one machine in simulated time, by the day: jobs, pulled plugs, killed daemons; what is left by evening.

Not what is made of the figures (soak.py). In the first third of the year daemons are killed and restarted; the rest is
the life of one. The one rule: every job is judged by what the machine executed, and nothing that people left
behind is cleared away by anybody but the daemon itself.
"""

import asyncio
import gc
import pickle
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from bench.soakmachines import LINES, MILLS, Mill
from bench.soakmemory import malloc_kb, payload, resident_mb, sqlite_kb
from bench.soakpeople import MACRO, People
from jobs import history, seals
from server.access import audit, auditing, endedtokens
from server.config.audit import AuditConfig
from server.config.history import HistoryConfig
from server.store import retention, sealing
from tests.harness.simloop import run_simulated, until

SEED = 17
DAY_S = 86_400.0
MONTH_DAYS = 30
IDLE_S = 10.0
"""Of the time between two jobs so much is simulated second by second, with the polls of an idle machine."""
BREAKS = 0.12
KILLS = 0.09
"""Of all jobs."""
RESTARTS = 0.08
ESTOPS = 0.1
MACROS = 0.2
"""Of all days."""
KILLING = 1 / 3
"""Of the year: then no daemon is killed or restarted any more, and what the last one lets grow, grows on."""
LIMIT_S = 1e9


@dataclass(frozen=True, slots=True)
class Keeping:
    """What the daemon is told to keep."""

    history: HistoryConfig
    audit: AuditConfig


SOME = Keeping(
    HistoryConfig(keep_days=7, keep_jobs=14, keep_unused_programs_days=3), AuditConfig(keep_rows=1000, keep_days=7)
)
ALL = Keeping(HistoryConfig(), AuditConfig())
"""As long as nobody says anything."""


@dataclass(frozen=True, slots=True)
class Sample:
    """What there is by evening. `objects`: those that the collector knows; `blocks`: all pieces up to 512 bytes of
    Python's own allocator, `malloc_kb` what is larger, or of other libraries, and `sqlite_kb` of SQLite. `pages` of the
    database, each 4 KiB, those that are in use; `rows` by table, and `payload` its bytes, with those of its indexes."""

    day: int
    objects: int
    blocks: int
    malloc_kb: float
    sqlite_kb: float
    resident_mb: float
    tasks: int
    threads: int
    files: int
    pages: int
    wal_kb: float
    programs: int
    programs_kb: float
    jobs: int
    rows: Mapping[str, int] = field(default_factory=dict)
    payload: Mapping[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        rows = " ".join(f"{table} {count}" for table, count in self.rows.items() if count)
        return (
            f"day {self.day}: {self.jobs} jobs; {self.resident_mb:.1f} MiB, {self.objects:,} objects, "
            f"{self.blocks:,} blocks, {self.malloc_kb:,.0f} + {self.sqlite_kb:,.0f} KiB, {self.tasks} tasks, "
            f"{self.threads} threads, {self.files} files; {self.pages} pages, "
            f"WAL {self.wal_kb:.0f} KiB, {self.programs} files of programs, {self.programs_kb:.0f} KiB; rows: {rows}"
        )


class Year:
    """One machine, its daemons and its people. `told` hears of the end of each month."""

    def __init__(self, mill: Mill, keep: Keeping, *, days: int, jobs_a_day: int, seed: int = SEED) -> None:
        self.mill, self.bench = mill, mill.bench
        self.random = Random(seed)
        self.people = People(Random(seed + 1))
        self.keep = keep
        self.days, self.jobs_a_day = days, jobs_a_day
        self.jobs = self.breaks = self.kills = self.restarts = self.estops = 0
        self._killing = True
        self._passed_s = time.monotonic()
        self.bench.monotonic = self._monotonic

    async def live(self, told: Callable[[Sample], None]) -> list[Sample]:
        """All days. What was seen lies in a file meanwhile: it is not to grow in the memory that is looked at."""
        await self._serve()
        with tempfile.TemporaryFile() as seen:
            for day in range(1, self.days + 1):
                self._killing = day <= self.days * KILLING
                await self._day()
                sample = self._look(day)
                pickle.dump(sample, seen)
                if day % MONTH_DAYS == 0:
                    told(sample)
            await self._end()
            seen.seek(0)
            return [pickle.load(seen) for _ in range(self.days)]

    async def _day(self) -> None:
        for _ in range(self.jobs_a_day):
            await self._job()
            self._pass(DAY_S / self.jobs_a_day)
        await self.people.day(self.last_job)
        if self._drawn(ESTOPS):
            await self.mill.estop(self.people)
            self.estops += 1
        if self.mill.macros and self._drawn(MACROS):
            await self._macro()
        if self._killing and self._drawn(RESTARTS):
            await self._restart()
        shop = self.bench.shop
        await sealing.seal_ended(shop.db, shop.jobs.clock)
        if self.keep.history.removes:
            await retention.remove_expired(self.keep.history, shop.db, shop.jobs.clock, shop.programs.delete)
        await auditing.remove_expired(self.keep.audit, shop.db, shop.jobs.clock)
        await endedtokens.remove_old(shop.db, shop.jobs.clock)

    async def _job(self) -> None:
        far, stood = self.random.randrange(800), self.mill.way()[-1:]
        while [float(far)] == stood:  # a move to where it stands is none, and would be missed
            far = self.random.randrange(800)
        await self.mill.ready(self.people)
        await self.people.hands()
        self.mill.forget()
        program = (await self.people.upload(self.mill.program(far)))["id"]
        body = {"program": program, "machine": "router", "force": True}
        self.last_job = (await self.people.asks("POST", "/api/v1/jobs", 201, json=body)).json()["id"]
        await self._disturb(program)
        await self.mill.settle(self.people, self.last_job, far)
        self.jobs += 1
        await asyncio.sleep(IDLE_S)

    async def _disturb(self, program: str) -> None:
        """Somewhere in the middle of the job."""
        lines, drawn = self.random.randrange(LINES), self.random.random()
        try:
            await until(lambda: len(self.mill.way()) >= lines, within_s=120.0, step_s=0.01)
        except AssertionError as error:
            raise AssertionError(f"it stands still: {await self.bench.shop.jobs.get(self.last_job)}") from error
        if drawn < BREAKS:
            await self._unplug()
        elif self._killing and drawn < BREAKS + KILLS:
            await self._kill()
        elif drawn < 0.5:
            await self.people.queue(program)

    async def _macro(self) -> None:
        program = (await self.people.upload(MACRO % self.random.randrange(10**6)))["id"]
        body = {"program": program, "machine": "router", "force": True, "hold": True}
        job = (await self.people.asks("POST", "/api/v1/jobs", 201, json=body)).json()["id"]
        await self.people.asks("POST", f"/api/v1/jobs/{job}/cancel", 200, 202)

    async def _unplug(self) -> None:
        self.bench.cable.pull()
        await self.bench.cable.live_alone(self.random.uniform(0.0, 2.0))
        self.bench.cable.plugged = True
        self.breaks += 1

    async def _kill(self) -> None:
        await self._leave()
        self.bench.crash()
        await self.bench.cable.live_alone(self.random.uniform(0.0, 2.0))
        await self._serve()
        self.kills += 1

    async def _restart(self) -> None:
        await self._leave()
        await self.bench.shop.stop()
        self.bench.shop = None
        await self._serve()
        self.restarts += 1

    async def _serve(self) -> None:
        self.bench.databases.clear()
        await self.people.serve(await self.bench.connected())
        await self.mill.served(self.people)

    async def _leave(self) -> None:
        await self.mill.left()
        await self.people.leave()
        self.bench.set_back_s = self.bench.shop.jobs.clock.set_back_s

    async def _end(self) -> None:
        shop = self.bench.shop
        await self._leave()
        found = await shop.db.run(lambda db: [*history.faults(db), *seals.faults(db), *audit.faults(db)])
        await shop.stop()
        if found:
            raise AssertionError(f"the history is not as it was written: {found[:3]}")

    def _drawn(self, chance: float) -> bool:
        return self.random.random() < chance

    def _pass(self, seconds: float) -> None:
        """Time for people, and for what they have signed in with; not for the machine, nor for who waits for it."""
        clock: Any = self.bench.shop.jobs.clock
        clock.set_back_s -= seconds
        self._passed_s += seconds

    def _monotonic(self) -> float:
        return self._passed_s + asyncio.get_running_loop().time()

    def _look(self, day: int) -> Sample:
        gc.collect()
        # Python keeps the 4096 names of attributes it looked up last, also such as were put together just for that (its
        # own http.cookiejar does it for every answer): a table with a bound, which takes years to fill.
        sys._clear_type_cache()
        objects, blocks, malloc = len(gc.get_objects()), sys.getallocatedblocks(), malloc_kb()
        sqlite = sqlite_kb()
        db = self.bench.databases[-1].db

        def number(query: str) -> int:
            return int(db.conn.execute(query).fetchone()[0])

        tables = [
            row[0] for row in db.conn.execute("select name from sqlite_master where type = 'table' order by name")
        ]
        programs = [path.stat().st_size for path in (self.bench.folder / "programs").iterdir()]
        wal = self.bench.folder / "millstream.db-wal"
        return Sample(
            day=day,
            objects=objects,
            blocks=blocks,
            malloc_kb=malloc - sqlite,
            sqlite_kb=sqlite,
            resident_mb=resident_mb(),
            tasks=len(asyncio.all_tasks()),
            threads=threading.active_count(),
            files=sum(1 for _ in Path("/proc/self/fd").iterdir()),
            pages=number("pragma page_count") - number("pragma freelist_count"),
            wal_kb=wal.stat().st_size / 1024 if wal.exists() else 0.0,
            programs=len(programs),
            programs_kb=sum(programs) / 1024,
            jobs=self.jobs,
            rows={table: number(f'select count(*) from "{table}"') for table in tables if table[0] != "_"},
            payload=payload(db.conn),
        )


def lived(
    name: str, keep: Keeping, *, days: int, jobs_a_day: int, told: Callable[[Sample], None] = lambda _sample: None
) -> tuple[list[Sample], Year]:
    """So many days. Raises AssertionError when a job did not come out as it had to."""

    async def main(folder: Path) -> tuple[list[Sample], Year]:
        year = Year(MILLS[name](folder), keep, days=days, jobs_a_day=jobs_a_day)
        return await year.live(told), year

    with tempfile.TemporaryDirectory(prefix="millstream-bench-") as folder:
        return run_simulated(main(Path(folder)), limit_s=LIMIT_S)
