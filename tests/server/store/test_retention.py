"""Retention while the daemon runs: old jobs, events and programs go, by themselves, and the stream does not notice."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from jobs import history, retention, seals
from server.config.history import HistoryConfig
from server.problems import ProblemError
from server.store import retention as keeping
from server.store import sealing
from tests.harness.simloop import LoopClock, run_simulated
from tests.harness.workshop import Bench, one_chunk

DAY_S = 86_400.0
PART = "G90\n" + "".join(f"G1 X{i} F6000\n" for i in range(1, 40)) + "M30\n"


def test_what_is_over_its_time_goes_and_the_rest_runs_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "MIN_PRUNED", 3)
    monkeypatch.setattr(keeping, "EVERY_S", 100.0)
    config = HistoryConfig(keep_days=3, keep_unused_programs_days=2)

    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        clock: Any = shop.jobs.clock
        going_on = [
            asyncio.create_task(sealing.keep_sealing(shop.db, clock)),
            asyncio.create_task(keeping.keep_within(config, shop.db, clock, shop.programs.delete)),
        ]
        for day in range(6):
            job = await bench.job(f"(day {day})\n{PART}")
            await bench.status(job["id"], "completed")
            clock.set_back_s -= DAY_S  # the days between jobs pass for people, not for the poll of an idle machine
        job = await bench.job(PART)  # runs while the old ones go
        await bench.status(job["id"], "completed")
        await asyncio.sleep(2 * keeping.EVERY_S)
        jobs = [view["id"] for view in await shop.jobs.list(None, None, 100, None)]
        assert jobs == [7, 6, 5]
        assert len(await shop.programs.list()) == 3
        assert len(list((tmp_path / "programs").glob("*.nc"))) == 3
        assert await shop.db.run(lambda db: [*history.faults(db), *seals.faults(db)]) == []
        assert history.anchor(bench.databases[-1].db).up_to > 0
        for task in going_on:
            task.cancel()
        await shop.stop()

    run_simulated(main())


def test_without_a_limit_nothing_is_looked_for() -> None:
    async def main() -> None:
        await keeping.keep_within(HistoryConfig(), None, None, None)  # type: ignore[arg-type]

    run_simulated(main())


def test_a_program_that_cannot_be_deleted_keeps_no_other(tmp_path: Path) -> None:
    config = HistoryConfig(keep_unused_programs_days=1)

    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.start()
        clock: Any = shop.jobs.clock
        stored = [(await shop.programs.store(one_chunk(b"G1 X%d F1\n" % i), "a.nc"))[0]["id"] for i in range(5)]
        clock.set_back_s -= 2 * DAY_S
        refusals = {stored[0]: ProblemError("program_in_use", "needed"), stored[1]: PermissionError(13, "read-only")}
        asked: list[str] = []

        async def delete(program: str) -> None:
            asked.append(program)
            if program in refusals:
                raise refusals[program]
            await shop.programs.delete(program)

        await keeping.remove_expired(config, shop.db, clock, delete)
        assert sorted(asked) == sorted(stored), "each once in a round"
        assert {program["id"] for program in await shop.programs.list()} == set(stored[:2])
        with shop.programs.needed(stored[0]):
            await keeping.remove_expired(config, shop.db, clock, shop.programs.delete)
        assert [program["id"] for program in await shop.programs.list()] == stored[:1]
        await shop.stop()

    run_simulated(main())


def test_a_full_disk_does_not_end_it() -> None:
    class FullDisk:
        tries = 0

        async def run(self, *_: object, **__: object) -> None:
            self.tries += 1
            raise ProblemError("disk_full", "no room")

    async def main() -> None:
        full, clock = FullDisk(), LoopClock(asyncio.get_running_loop())
        work = keeping.keep_within(HistoryConfig(keep_jobs=1), full, clock, None)  # type: ignore[arg-type]
        task = asyncio.create_task(work)
        await asyncio.sleep(keeping.EVERY_S * 2.5)
        assert full.tries == 3
        task.cancel()

    run_simulated(main())
