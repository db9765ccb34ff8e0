"""When a job on a Grbl is complete: every line acknowledged, and the machine stands, whatever its reports tell."""

from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from sim.grbl.core import State
from sim.grbl.simsettings import SimSettings
from tests.harness.grblworkshop import GrblBench
from tests.scenarios.test_grbl_jobs import simulated

ENDS = {
    "a move": "G1 X40 F1200",
    "a slow last move": "G1 X1 F1200\nG1 X1.5 F10",
    "lines that move nothing": "G1 X20 F1200\nM8\nG90\nM9",
    "many short ones": "\n".join(f"G1 X{i / 100:.2f} F600" for i in range(1, 80)),
    "a program end": "G1 X20 F1200\nM30",
}


@pytest.mark.parametrize("mask", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("end", ENDS)
def test_a_job_is_complete_when_the_machine_stands(tmp_path: Path, mask: float, end: str) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        core, seen = bench.machine.core, list[tuple[State, int]]()
        publish = shop.hub.publish

        def listen(kind: str, machine: str | None, data: Any) -> int:
            if kind == "job" and data["status"] == "completed":
                seen.append((core.state, len(core.planner.blocks)))
            return publish(kind, machine, data)

        shop.hub.publish = listen  # type: ignore[method-assign, assignment]
        program = f"G21 G90 G94\n{ENDS[end]}"
        job = await bench.job(program)
        view = await bench.status(job["id"], "completed")
        assert seen
        assert set(seen) == {(State.IDLE, 0)}
        assert (view["progress"]["line"], router.state.status) == (len(program.splitlines()), "idle")

    simulated(tmp_path, story, settings=SimSettings(dollar={10: mask}))
