"""A backup made in the middle of a job, restored when the machine has gone on: nothing moves, and work begins anew."""

import asyncio
from datetime import UTC, datetime
from pathlib import Path

import pytest

from server.store import archive
from server.store.restoring import restore
from tests.harness.simloop import run_simulated
from tests.harness.workshop import MACHINE, Bench

LINES = 60
NOW = datetime(2026, 4, 1, 12, 30, tzinfo=UTC)


def program(count: int) -> str:
    return "G90\n" + "".join(f"G1 X{i} Y{i % 7} F6000\n" for i in range(1, count)) + "M30\n"


def backup(folder: Path, target: Path) -> None:
    archive.write(
        target,
        database=folder / "millstream.db",
        programs=folder / "programs",
        config=None,
        version="1",
        created_at="2026-03-01T09:00:00.000Z",
    )


@pytest.mark.parametrize("restarted", [False, True], ids=["machine went on", "machine forgot its IDs"])
def test_nothing_moves_because_of_a_restore(tmp_path: Path, restarted: bool) -> None:
    async def main() -> None:
        old = Bench(tmp_path / "old", options={"resume_within": 3600.0})
        shop = await old.connected()
        job = await old.job(program(LINES))
        waiting = await old.job("G90\nG1 X5 F6000\nM30\n")
        await asyncio.sleep(1.0)
        assert (await shop.jobs.get(job["id"]))["status"] == "running"
        backup(old.folder, tmp_path / "b.zip")
        await old.status(waiting["id"], "completed")
        await shop.stop()
        if restarted:
            old.machine.restart(asyncio.get_running_loop().time())
            await old.cable.live_alone(5.0)
        executed = len(old.executed())

        (tmp_path / "new").mkdir()
        held = restore(tmp_path / "b.zip", tmp_path / "new", now=NOW).held
        assert held == 1
        new = Bench(tmp_path / "new", options={"resume_within": 3600.0})
        new.machine, new.cable = old.machine, old.cable
        shop = await new.connected()
        await asyncio.sleep(120)
        assert len(new.executed()) == executed, "nothing has moved"
        after = await shop.jobs.get(job["id"])
        assert (after["status"], after["error"]["code"]) == ("failed", "in_doubt")
        assert after["error"]["line_from"] > after["progress"]["line"]
        assert (await shop.jobs.get(waiting["id"]))["status"] == "queued"
        assert shop.machines[MACHINE].state.status == "idle"

        await shop.jobs.cancel(waiting["id"])
        again = await new.job("G90\nG1 X9 F6000\nM30\n")
        await new.status(again["id"], "completed")
        await shop.stop()

    run_simulated(main())
