"""Giving a machine to a job: everything that can happen while its program is read."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from server.job.starting import Background
from tests.harness.simloop import run_simulated
from tests.harness.workshop import MACHINE, Bench

PROGRAM = "G90\nG1 X1 F600\nG1 X2\nG1 X3\nM30\n"


class SlowWorker:
    """Takes its time, and lets something happen meanwhile."""

    def __init__(self, meanwhile: Callable[[], None]) -> None:
        self._meanwhile = meanwhile

    async def run(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        await asyncio.sleep(1.0)
        self._meanwhile()
        await asyncio.sleep(1.0)
        return fn(*args, **kwargs)

    def close(self) -> None: ...


async def with_worker(bench: Bench, meanwhile: Callable[[], None]) -> "asyncio.Task[dict[str, Any]]":
    shop = await bench.connected()
    shop.jobs._starter.worker = SlowWorker(meanwhile)
    return asyncio.ensure_future(bench.job(PROGRAM))


def test_while_the_program_is_read_the_job_is_checking_and_the_machine_is_taken(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        seen: list[Any] = []

        def look() -> None:
            machine = bench.shop.machines[MACHINE]  # type: ignore[union-attr]
            seen.append((machine.view()["active_job"], machine.stream.moving))

        job = await (await with_worker(bench, look))
        assert seen == [(1, True)]
        assert job["status"] == "running"
        await bench.status(job["id"], "completed")
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_a_job_that_is_cancelled_meanwhile_does_not_begin(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        tasks: list[Any] = []
        making = await with_worker(
            bench,
            lambda: tasks.append(asyncio.ensure_future(bench.shop.jobs.cancel(1))),  # type: ignore[union-attr]
        )
        assert (await making)["status"] == "cancelled"
        await tasks[0]
        assert bench.executed() == []
        assert bench.shop.machines[MACHINE].stream.active_job is None  # type: ignore[union-attr]
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_a_link_that_breaks_meanwhile_sends_the_job_back_to_the_queue_on_hold(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        job = await (await with_worker(bench, bench.cable.pull))
        assert (job["status"], job["hold"]) == ("queued", True)
        bench.cable.plugged = True
        await asyncio.sleep(60)
        assert bench.executed() == []
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_a_program_whose_file_is_gone_fails_the_job(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)

        def take_away() -> None:
            for path in (tmp_path / "programs").glob("*.nc"):
                path.unlink()

        job = await (await with_worker(bench, take_away))
        assert (job["status"], job["error"]["code"]) == ("failed", "program_missing")
        assert bench.shop.machines[MACHINE].stream.active_job is None  # type: ignore[union-attr]
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_a_start_that_cannot_be_said_in_blocks_fails_the_job(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        program = "G90\nG1 X0 Y0 F600\nG2 X2 Y0 I1 J0\nX4 Y0 I1 J0\nM30\n"
        job = await bench.job(program, start_line=4)
        assert (job["status"], job["error"]["code"]) == ("failed", "not_plannable")
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())


def test_a_daemon_that_died_while_it_read_puts_the_job_back_on_hold(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        making = await with_worker(bench, bench.crash)
        await asyncio.sleep(1.5)
        making.cancel()
        shop = await bench.connected()
        job = await shop.jobs.get(1)
        assert (job["status"], job["hold"]) == ("queued", True)
        assert bench.executed() == []
        await shop.stop()

    run_simulated(main())


def test_a_job_whose_program_vanished_while_the_daemon_was_down(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, options={"resume_within": 60.0, "elvinto": {"max_batch_blocks": 2}})
        await bench.connected()
        job = await bench.job(PROGRAM)
        await asyncio.sleep(0.2)
        bench.crash()
        for path in (tmp_path / "programs").glob("*.nc"):
            path.unlink()
        shop = await bench.connected()
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "program_missing"
        assert view["progress"]["line"] == len(bench.executed())
        await shop.stop()

    run_simulated(main())


def test_background_work_ends_with_the_daemon() -> None:
    async def main() -> None:
        background = Background()
        ended: list[str] = []

        async def work() -> None:
            try:
                await asyncio.sleep(1000)
            finally:
                ended.append("cancelled")

        background.begin(work())
        await asyncio.sleep(0)
        await background.close()
        assert ended == ["cancelled"]

    run_simulated(main())


@pytest.mark.parametrize("hold", [True, False])
def test_two_jobs_at_once_start_one_after_the_other(tmp_path: Path, hold: bool) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        jobs = await asyncio.gather(bench.job(PROGRAM, hold=hold), bench.job(PROGRAM))
        await bench.status(jobs[1]["id"], "completed")
        if hold:
            assert (await shop.jobs.get(jobs[0]["id"]))["status"] == "queued"
        else:
            await bench.status(jobs[0]["id"], "completed")
            assert bench.executed()[:5] == bench.executed()[5:]
        await shop.stop()

    run_simulated(main())


def test_a_line_is_not_done_when_only_the_blocks_before_it_are(tmp_path: Path) -> None:
    """The modal state that is said again first is a batch of its own where the line is a barrier: a daemon that dies
    behind it must not take the tool change for done."""

    async def main() -> None:
        bench = Bench(tmp_path)
        await bench.connected()
        job = await bench.job("G90\nG1 X1 F600\nG1 X2\nT2 M6\nG1 X3\nM30\n", start_line=4)
        await bench.status(job["id"], "waiting")
        rows = await bench.shop.jobs.batches(job["id"])  # type: ignore[union-attr]
        assert [(row["line_from"], row["line_to"]) for row in rows] == [(3, 3), (4, 4)]
        await bench.shop.stop()  # type: ignore[union-attr]

    run_simulated(main())
