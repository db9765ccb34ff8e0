"""Sealing while the daemon runs: jobs that have ended are sealed after a while, and a full disk does not end it."""

import asyncio
from pathlib import Path

import pytest

from jobs import history, seals
from server.problems import ProblemError
from server.store import sealing
from tests.harness.simloop import LoopClock, run_simulated
from tests.harness.workshop import Bench


def test_an_ended_job_is_sealed_and_its_history_is_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seals, "PIECE_ROWS", 2)

    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job("G90\n" + "".join(f"G1 X{i} F6000\n" for i in range(1, 200)) + "M30\n")
        sealing_goes_on = asyncio.create_task(sealing.keep_sealing(shop.db, LoopClock(asyncio.get_running_loop())))
        await bench.status(job["id"], "completed")
        assert (await shop.db.run(seals.counts))["sealed"] == 0
        await asyncio.sleep(sealing.SETTLED_S + 2 * sealing.EVERY_S)
        counted = await shop.db.run(seals.counts)
        assert (counted["jobs"], counted["sealed"]) == (1, 1)
        assert await shop.db.run(lambda db: list(seals.faults(db))) == []
        assert await shop.db.run(history.verify) is None
        sealing_goes_on.cancel()
        await shop.stop()

    run_simulated(main())


def test_a_full_disk_does_not_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    class FullDisk:
        tries = 0

        async def run(self, *_: object, **__: object) -> None:
            self.tries += 1
            raise ProblemError("disk_full", "no room")

    async def main() -> None:
        full = FullDisk()
        task = asyncio.create_task(sealing.keep_sealing(full, LoopClock(asyncio.get_running_loop())))  # type: ignore[arg-type]
        await asyncio.sleep(sealing.EVERY_S * 3.5)
        assert full.tries == 4
        task.cancel()

    run_simulated(main())
