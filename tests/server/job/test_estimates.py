"""How long a job will still take, through the whole daemon: learned, corrected, frozen, kept over a restart."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from jobs import store
from jobs.program import ProgramStore
from server.app import Workshop
from server.job import estimates as module
from server.job.estimates import Estimates
from sim.elvinto.settings import SimSettings
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

LINES = 60
PROGRAM = "G90 G21\n" + "".join(f"G1 X{10 * (i % 2)} Y{i % 7} F600\n" for i in range(1, LINES)) + "M30\n"
SHORT = "G90\nG1 X1 F600\nM30\n"


async def shown(shop: Workshop, job: int) -> dict[str, Any]:
    return dict((await shop.jobs.get(job))["progress"])


async def seconds_to_end(bench: Bench, job: int) -> float:
    began = asyncio.get_running_loop().time()
    await bench.status(job, "completed")
    return asyncio.get_running_loop().time() - began


def slower(tmp_path: Path) -> Bench:
    return Bench(tmp_path, SimSettings(speed_factor=1 / 1.5))


def test_the_next_runs_of_a_slow_machine_are_told_right_from_the_beginning(tmp_path: Path) -> None:
    async def main() -> None:
        bench = slower(tmp_path)
        shop = await bench.connected()
        errors, widths = [], []
        for _ in range(4):
            job = (await bench.job(PROGRAM))["id"]
            await until(lambda: shop.machines[MACHINE].metrics.seconds_left() is not None, within_s=5)
            first = await shown(shop, job)
            lasted_s = await seconds_to_end(bench, job)
            errors.append(abs(first["seconds_left"] / lasted_s - 1.0))
            widths.append((first["seconds_left_max"] - first["seconds_left_min"]) / first["seconds_left"])
            assert (await shown(shop, job))["seconds_left"] is None
        assert errors[0] > 0.25
        assert errors[3] < 0.15, "runs of a minute weigh half"
        assert errors == sorted(errors, reverse=True)
        assert widths == sorted(widths, reverse=True)
        runs = await shop.db.run(store.runs, MACHINE, limit=9)
        assert len(runs) == 4
        assert all(run.taken_s / run.planned_s == pytest.approx(1.5, rel=0.25) for run in runs)
        assert shop.machines[MACHINE].metrics.pace_factor > 1.2
        await shop.stop()

    run_simulated(main())


def test_it_comes_with_the_events_and_is_right_half_way(tmp_path: Path) -> None:
    async def main() -> None:
        bench = slower(tmp_path)
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        half = shop.machines[MACHINE].stream
        await until(lambda: half.runner is not None and half.runner.ledger.cursor.done > LINES // 2, within_s=600)
        told = await shown(shop, job)
        lasted_s = await seconds_to_end(bench, job)
        assert told["seconds_left"] == pytest.approx(lasted_s, rel=0.12)
        assert told["seconds_left_min"] <= lasted_s <= told["seconds_left_max"]
        await shop.stop()

    run_simulated(main())


def test_a_pause_freezes_it_and_is_not_learned(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        await until(lambda: len(bench.executed()) > 20, within_s=60)
        await shop.jobs.pause(job)
        await bench.status(job, "paused")
        before = await shown(shop, job)
        await asyncio.sleep(1000)
        after = await shown(shop, job)
        assert before["seconds_left"] is not None
        assert [after[key] for key in before if key.startswith("seconds_left")] == [
            before[key] for key in before if key.startswith("seconds_left")
        ]
        await shop.jobs.resume(job)
        lasted_s = await seconds_to_end(bench, job)
        assert before["seconds_left"] == pytest.approx(lasted_s, rel=0.15)
        (run,) = await shop.db.run(store.runs, MACHINE, limit=9)
        assert run.taken_s < 2 * run.planned_s, "the pause is in no figure"
        await shop.stop()

    run_simulated(main())


def test_a_daemon_that_begins_anew_in_the_middle_knows_it_again(tmp_path: Path) -> None:
    async def main() -> None:
        bench = slower(tmp_path)
        bench.options = {"resume_within": 60.0}
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        await until(lambda: len(bench.executed()) > LINES // 2, within_s=600)
        before = await shown(shop, job)
        bench.crash()
        shop = await bench.connected()
        assert shop.machines[MACHINE].stream._pace.planned_s > 0.0, "what was measured before is still known"
        after = await shown(shop, job)
        assert after["seconds_left"] == pytest.approx(before["seconds_left"], rel=0.15)
        lasted_s = await seconds_to_end(bench, job)
        assert after["seconds_left"] == pytest.approx(lasted_s, rel=0.15)
        await shop.stop()

    run_simulated(main())


def test_a_feed_override_changes_it_at_once(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        await until(lambda: len(bench.executed()) > 20, within_s=60)
        machine = shop.machines[MACHINE]
        before = await shown(shop, job)
        machine.stream.conditions(machine.state._replace(overrides={"feed": 50}))
        after = await shown(shop, job)
        assert after["line"] == before["line"]
        assert 1.5 * before["seconds_left"] < after["seconds_left"] < 2.1 * before["seconds_left"]
        await bench.status(job, "completed")
        await shop.stop()

    run_simulated(main())


def test_a_program_without_motion_and_one_that_is_gone_have_no_estimate(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = (await bench.job("G90\nM3 S100\nM5\nM30\n"))["id"]
        assert (await shown(shop, job))["seconds_left"] is None
        await bench.status(job, "completed")
        estimates = Estimates(shop.db, ProgramStore(tmp_path / "empty"), {}, shop.jobs._starter.worker)
        row = dict(await shop.jobs.row(job)) | {"program": "0" * 64}
        estimates._pieces = shop.jobs._starter.pieces
        await estimates.supply(shop.machines[MACHINE], row, object())  # type: ignore[arg-type]
        assert not estimates._timelines
        await shop.stop()

    run_simulated(main())


def test_the_same_program_again_is_not_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        measured: list[str] = []
        measure = module.measured

        def counted(programs: Any, piece: Any, program: str, lines: int) -> Any:
            measured.append(program)
            return measure(programs, piece, program, lines)

        monkeypatch.setattr(module, "measured", counted)
        for text in (SHORT, SHORT, SHORT + "\n"):
            job = (await bench.job(text))["id"]
            await bench.status(job, "completed")
        assert len(measured) == 2
        await shop.stop()

    run_simulated(main())
