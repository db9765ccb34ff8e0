"""Jobs on a virtual lathe behind NC frames through the whole chain, in simulated time."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.controller import Controller
from server.problems import ProblemError
from sim.ncframe.settings import SimSettings
from tests.harness.ncworkshop import NcBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE


def zigzag(count: int, *, feed: int = 240, end: str = "M30") -> str:
    """Each step of 2 mm takes half a second."""
    moves = [f"G1 X{i % 2} Z{-2 * i} F{feed}" for i in range(1, count + 1)]
    return "\n".join(["G21 G90", *moves, end]) + "\n"


def simulated(folder: Path, story: Callable[[NcBench, Workshop, Controller], Awaitable[None]], **options: Any) -> None:
    async def main() -> None:
        bench = NcBench(folder, **options)
        shop = await bench.located()
        await story(bench, shop, shop.machines[MACHINE])
        if bench.shop is not None:
            await bench.shop.stop()

    run_simulated(main())


def test_a_program_runs_once(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(zigzag(40))
        view = await bench.status(job["id"], "completed")
        assert view["progress"]["line"] == 42
        assert bench.machine.position == (0, -80_000)
        assert len(bench.executed()) == 41
        assert lathe.program_position == {"x": 0.0, "z": -80.0}

    simulated(tmp_path, story)
