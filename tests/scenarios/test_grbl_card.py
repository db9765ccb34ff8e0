"""A grblHAL that runs a program from its SD card, through the whole chain, in simulated time."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.grbl.simsettings import SimSettings
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import until
from tests.scenarios.test_grbl_jobs import simulated, state_is

MOVES = "".join(f"G1 X{i % 2 * 20} F1200\n" for i in range(1, 9))
FILES = {"part.nc": f"G21 G90\n{MOVES}M30\n", "bad.nc": "G21\nG1 X5 F600\nG2\n"}
HAL = {"settings": SimSettings(flavour="grblHAL", card=FILES)}


def texts(bench: GrblBench) -> list[str]:
    return bench.executed()


async def refused(awaitable: Any) -> str:
    with pytest.raises(ProblemError) as problem:
        await awaitable
    return problem.value.code


def test_a_file_is_listed_run_held_and_ends(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        assert "sd" in router.view()["capabilities"]
        listed = await router.list_files()
        assert listed == {"card": "SD", "readable": True, "names": ["bad.nc", "part.nc"], "problem": None}
        await router.run_file("part.nc")
        await state_is(router, "run")
        assert await refused(router.list_files()) == "machine_busy"
        assert await refused(router.run_blocks(["G0 X0"])) == "machine_busy"
        assert await refused(shop.panels["router"].modal()) == "machine_busy"
        job = await bench.job("G21 G90\nG1 X1 F600\nM30\n")
        assert (job["status"], job["hold"]) == ("queued", True)
        router.pause()
        await state_is(router, "hold")
        count = len(texts(bench))
        await asyncio.sleep(5)
        assert len(texts(bench)) == count
        router.resume()
        await until(lambda: router.own_program is None, within_s=60.0)
        assert router.state.status == "idle"
        assert texts(bench)[-1] == "M30"
        assert len(texts(bench)) == 10
        assert (await router.run_blocks(["G4 P0"]))[0]["ok"] is True
        await shop.jobs.resume(job["id"])
        await bench.status(job["id"], "completed")

    simulated(tmp_path, story, **HAL)


def test_an_error_in_a_file_ends_it_and_is_said(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        said: list[str] = []
        publish = shop.hub.publish

        def listen(kind: str, machine: str | None, data: Any) -> int:
            if kind == "log":
                said.append(data["message"])
            return publish(kind, machine, data)

        shop.hub.publish = listen  # type: ignore[method-assign, assignment]
        await router.run_file("bad.nc")
        await until(lambda: router.own_program is None, within_s=60.0)
        assert any("26 in SD file at line 3" in message for message in said), said
        assert router.metrics.link_errors == {}
        assert (await router.run_blocks(["G4 P0"]))[0]["ok"] is True
        assert await refused(router.run_file("none.nc")) == "command_failed"
        assert router.own_program is None

    simulated(tmp_path, story, **HAL)


def test_a_stop_ends_it_and_keeps_the_position(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await router.run_file("/part.nc")
        await state_is(router, "run")
        await asyncio.sleep(0.5)
        router.stop()
        await until(lambda: router.own_program is None and router.state.status == "idle", within_s=20.0)
        count = len(texts(bench))
        await asyncio.sleep(20)
        assert len(texts(bench)) == count
        assert 0 < router.state.position["x"] < 20

    simulated(tmp_path, story, **HAL)


def test_a_new_link_finds_it_running_and_sends_no_line(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await router.run_file("part.nc")
        await state_is(router, "run")
        bench.cable.pull()
        bench.cable.plugged = True
        await until(lambda: router.state.status == "run" and router.own_program is None, within_s=20.0)
        await state_is(router, "idle")
        await until(lambda: router.link_status == "connected", within_s=20.0)
        await asyncio.sleep(2)
        assert (await router.run_blocks(["G4 P0"]))[0]["ok"] is True
        assert texts(bench)[9] == "M30"

    simulated(tmp_path, story, **HAL)


@pytest.mark.parametrize("settings", [SimSettings(), SimSettings(flavour="grblHAL")])
def test_without_a_card_there_is_none(tmp_path: Path, settings: SimSettings) -> None:
    async def story(_bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        assert "sd" not in router.view()["capabilities"]
        assert await refused(router.list_files()) == "not_supported"
        assert await refused(router.run_file("part.nc")) == "not_supported"

    simulated(tmp_path, story, settings=settings)
