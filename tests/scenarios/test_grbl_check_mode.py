"""The controller's own check (`$C`): what it writes all the same, and a daemon that dies between `$C` and a line."""

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.grbl.core import State
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, one_chunk
from tests.scenarios.test_grbl_jobs import simulated

WRITING = "G21 G90\nG1 X7 F500\nG10 L20 P2 X0\nG28.1\nG30.1\nM30\n"


def test_a_check_that_writes_the_memory_is_refused_unless_forced(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        stored, _ = await shop.programs.store(one_chunk(WRITING.encode()), "part.nc")
        with pytest.raises(ProblemError, match="line 3") as refused:
            await shop.jobs.create(stored["id"], MACHINE, mode="check")
        assert (refused.value.code, refused.value.extra["lines"]) == ("needs_force", [3, 4, 5])
        assert bench.executed() == []
        assert bench.machine.core.memory.coords["G28"] == (0.0, 0.0, 0.0)
        job = await shop.jobs.create(stored["id"], MACHINE, mode="check", force=True)
        await bench.status(job["id"], "completed")
        (written,) = [event for event in await shop.jobs.events(job["id"]) if event["type"] == "check_writes"]
        assert written["data"] == {"lines": [3, 4, 5]}
        await asyncio.sleep(2)
        assert router.state.position["x"] == 0.0, "nothing has moved"
        # As tried on Grbl 1.1h: the memory has the place of a motion that never was.
        coords = bench.machine.core.memory.coords
        assert (coords["G28"][0], coords["G30"][0], coords["G55"][0]) == (7.0, 7.0, 7.0)

    simulated(tmp_path, story)


def test_a_job_that_is_run_writes_without_a_question(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, _router: Controller) -> None:
        stored, _ = await shop.programs.store(one_chunk(b"G21 G90\nG10 L2 P2 X3\nM30\n"), "part.nc")
        job = await shop.jobs.create(stored["id"], MACHINE)
        await bench.status(job["id"], "completed")
        assert bench.machine.core.memory.coords["G55"][0] == 3.0

    simulated(tmp_path, story)


@pytest.mark.parametrize(
    ("block", "told"), [("G54", "start-up blocks: G54."), ("G0X30", "G0 moves the machine"), ("", None)]
)
def test_who_queues_a_check_is_told_what_runs_behind_it(tmp_path: Path, block: str, told: str | None) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path)
        bench.machine.core.memory.startup[0] = block
        shop = await bench.connected()
        job = await bench.job(CHECKED, mode="check")
        behind = await bench.job(CHECKED, mode="check")
        run = await bench.job(CHECKED)
        assert [one["code"] for one in job["warnings"]] == ([] if told is None else ["startup_blocks"])
        assert told is None or told in job["warnings"][0]["message"]
        assert "when the check begins" in behind["warnings"][0]["message"]
        assert run["warnings"] == []
        assert "warnings" not in await shop.jobs.get(job["id"])
        await shop.stop()

    run_simulated(main())


CHECKED = "G21 G90\nG1 X7 F500\nM30\n"


async def dies_behind_the_switch(bench: GrblBench) -> int:
    """kill -9 when the controller is in check mode and no line of the job has gone out."""
    assert bench.shop is not None
    shop = bench.shop

    async def never(*_: Any) -> None:
        await asyncio.sleep(3600)

    shop.jobs._starter._begin = never  # type: ignore[method-assign, assignment]
    request = asyncio.create_task(bench.job(CHECKED, mode="check"))
    await until(lambda: bench.machine.core.state is State.CHECK, within_s=5.0)
    (job,) = await shop.jobs.list(MACHINE, None, 10, None)
    assert job["status"] == "checking"
    bench.crash()
    with contextlib.suppress(asyncio.CancelledError):
        request.cancel()
        await request
    assert bench.executed() == []
    return int(job["id"])


def test_a_check_mode_that_was_left_behind_is_left_and_said(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path)
        await bench.connected()
        job = await dies_behind_the_switch(bench)
        shop = await bench.connected()
        router = shop.machines[MACHINE]
        await until(lambda: router.state.status == "idle", within_s=10.0)
        await asyncio.sleep(1)
        kinds = [event["type"] for event in await shop.jobs.events(job)]
        assert [kind for kind in kinds if kind.startswith("check_mode")] == [
            "check_mode_entered",
            "check_mode_found",
            "check_mode_left",
        ]
        view = await shop.jobs.get(job)
        assert (view["status"], view["hold"]) == ("queued", True), "nothing begins by itself"
        assert bench.executed() == []
        following = await bench.job(CHECKED)
        await bench.status(following["id"], "completed")
        assert router.state.work_position["x"] == 7.0
        await shop.stop()

        again = GrblBench(tmp_path)  # whoever switches it on now is not this daemon
        again.machine.receive_data(b"$C\n", 0.0)
        shop = await again.connected()
        await asyncio.sleep(20)
        assert shop.machines[MACHINE].state.status == "check"
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("block", ["G0X30", "M3S900"])
def test_a_check_mode_is_left_to_people_where_a_start_up_block_would_move(tmp_path: Path, block: str) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path)
        bench.machine.core.memory.startup[1] = block
        await bench.connected()
        job = await dies_behind_the_switch(bench)
        shop = await bench.connected()
        router = shop.machines[MACHINE]
        await asyncio.sleep(30)
        assert (router.state.status, router.state.position["x"], router.state.spindle_rpm) == ("check", 0.0, 0.0)
        (found,) = [event for event in await shop.jobs.events(job) if event["type"] == "check_mode_found"]
        assert found["data"] == {"left": False}
        (entered,) = [event for event in await shop.jobs.events(job) if event["type"] == "check_mode_entered"]
        assert len(entered["data"]["dangers"]) == 1
        await shop.stop()

    run_simulated(main())


def test_a_check_mode_that_is_gone_already_is_only_written_down(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path)
        await bench.connected()
        job = await dies_behind_the_switch(bench)
        bench.machine.receive_data(b"\x18", asyncio.get_running_loop().time())
        await bench.cable.live_alone(2.0)
        shop = await bench.connected()
        await asyncio.sleep(5)
        kinds = [event["type"] for event in await shop.jobs.events(job)]
        assert [kind for kind in kinds if kind.startswith("check_mode")] == ["check_mode_entered", "check_mode_left"]
        await shop.stop()

    run_simulated(main())


def test_an_interrupted_check_keeps_the_mode_until_it_is_cancelled(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path)
        shop = await bench.connected()
        job = (await bench.job("G21 G90\n" + "G4 P1\nG1 X1 F100\n" * 2000, mode="check"))["id"]
        await until(lambda: len(bench.executed()) > 5, within_s=5.0, step_s=0.01)
        bench.crash()
        shop = await bench.connected()
        await asyncio.sleep(10)
        router = shop.machines[MACHINE]
        assert (router.state.status, (await shop.jobs.get(job))["status"]) == ("check", "interrupted")
        await shop.jobs.cancel(job)
        await until(lambda: router.state.status == "idle", within_s=10.0)
        await asyncio.sleep(1)
        assert [event["type"] for event in await shop.jobs.events(job)][-1] == "check_mode_left"
        await shop.stop()

    run_simulated(main())
