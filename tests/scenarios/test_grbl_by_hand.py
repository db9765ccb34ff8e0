"""What people do by hand on a virtual Grbl, and in which moment of it: in simulated time."""

import asyncio
from pathlib import Path

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from tests.harness.grblworkshop import GrblBench
from tests.scenarios.test_grbl_jobs import simulated, state_is


def test_a_pause_right_behind_a_jog_ends_it(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await router.jog({"x": 50.0}, 600.0)
        assert router.state.status == "idle", "no report has shown it yet"
        router.pause()
        await asyncio.sleep(3)
        assert router.state.status == "idle"
        assert router.state.position["x"] < 5.0
        with pytest.raises(ProblemError, match="no running job"):
            router.pause()
        await router.jog({"x": 50.0}, 600.0)
        await state_is(router, "jog")
        router.pause()
        await state_is(router, "idle", within_s=2.0)

    simulated(tmp_path, story)
