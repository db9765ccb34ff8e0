"""The controller's own check (`$C`): what it writes all the same, and a daemon that dies between `$C` and a line."""

import asyncio
from pathlib import Path

import pytest

from server.app import Workshop
from server.controller import Controller
from server.problems import ProblemError
from tests.harness.grblworkshop import GrblBench
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
