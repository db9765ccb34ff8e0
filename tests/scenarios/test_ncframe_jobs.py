"""Jobs on a virtual lathe behind NC frames through the whole chain, in simulated time: what people do to them."""

import asyncio
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.ncframe.settings import SimSettings
from tests.harness.apps import create_app
from tests.harness.ncworkshop import NcBench, simulated, stands
from tests.harness.simloop import until
from tests.harness.toolpathreader import read_toolpath
from tests.harness.workshop import MACHINE, one_chunk

STEPS = 40
PATH = [(1000 * (i % 2), -2000 * i) for i in range(1, STEPS + 1)]
ZIGZAG = "\n".join(["G21 G90", *(f"G1 X{x / 1000:g} Z{z / 1000:g} F240" for x, z in PATH), "M30"]) + "\n"
"""Each step takes half a second."""


def test_a_program_runs_once_and_leads_where_it_says(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        view = await bench.status(job["id"], "completed")
        assert view["progress"]["line"] == STEPS + 2
        assert bench.path() == PATH
        assert bench.executed()[-1] == "M30"
        assert lathe.program_position == {"x": 0.0, "z": -80.0}
        assert {row["status"] for row in await shop.jobs.batches(job["id"])} == {"ok"}
        following = await bench.job("G91\nG1 Z80 F240\nM30\n")
        await bench.status(following["id"], "completed")
        assert bench.machine.position == (0, 0)

    simulated(tmp_path, story)


def test_over_http(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, _lathe: Controller) -> None:
        transport = httpx.ASGITransport(create_app(shop))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8420") as client:
            machine = (await client.get("/api/v1/machines/router")).json()
            assert machine["protocol"] == "ncframe"
            assert machine["state"]["position"]["work"] == {"x": 0.0, "z": 0.0}
            assert "home" not in machine["capabilities"]
            home = await client.post("/api/v1/machines/router/home")
            assert (home.status_code, home.json()["code"]) == (409, "not_supported")
            program = (await client.post("/api/v1/programs?name=part.nc", content=ZIGZAG.encode())).json()["id"]
            check = (await client.get(f"/api/v1/programs/{program}/check?machine=router")).json()
            assert check["errors"] == []
            body = {"program": program, "machine": "router"}
            in_the_middle = await client.post("/api/v1/jobs", json={**body, "start_line": 5, "force": True})
            assert in_the_middle.status_code == 422
            assert "first line" in in_the_middle.json()["detail"]
            answer = await client.post("/api/v1/jobs", json={**body, "force": True})
            assert answer.status_code == 201, answer.text
            await bench.status(answer.json()["id"], "completed")
        assert bench.path() == PATH

    simulated(tmp_path, story)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("G90\nG1 Z-9000 F100\n", "does not fit into a frame"),
        ("G90\nG1 Z-1 F300\n", "F is from 0 to 255"),
        ("G90\nG1 Z-1 F100\nG96 S100\n", "constant surface speed"),
        ("G91\nG41 D1\nG1 Z-1 F100\n", "radius"),
    ],
)
def test_what_no_frame_can_carry_is_refused_before_anything_moves(tmp_path: Path, text: str, said: str) -> None:
    async def story(bench: NcBench, _shop: Workshop, _lathe: Controller) -> None:
        with pytest.raises(ProblemError) as refused:
            await bench.job(text)
        assert refused.value.code == "preflight_failed"
        assert said in str(refused.value.extra)
        assert bench.machine.executed == []

    simulated(tmp_path, story)


def test_where_the_machine_stands_has_to_be_said_before_absolute_moves(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        await lathe.disconnect()
        await lathe.connect()
        await until(lambda: lathe.link_status == "connected", within_s=10.0)
        assert lathe.program_position == {}, "a lathe that was disconnected may have been moved"
        job = await bench.job("G91\nG1 Z-1 F240\nG90\nG1 Z-9\nM30\n")
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "not_plannable"
        assert "line 4" in view["error"]["message"]
        assert bench.machine.executed == [], "not even the first line, which could be sent"
        await lathe.run_blocks(["G92 X10 Z20"])
        job = await bench.job("G90\nG1 Z10 F240\nM30\n")
        if job["status"] == "queued":
            await shop.jobs.resume(job["id"])
        await bench.status(job["id"], "completed")
        assert bench.machine.position == (0, -10_000)
        assert lathe.program_position == {"x": 10.0, "z": 10.0}

    simulated(tmp_path, story)


def test_a_pause_acts_behind_the_frame_and_resume_goes_on(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        await bench.moving(7)
        lathe.pause()
        await bench.status(job["id"], "paused", within_s=1.0)
        assert lathe.state.status == "hold"
        assert len(bench.path()) == 7
        await stands(bench, 60.0)
        with pytest.raises(ProblemError) as refused:
            await lathe.jog({"z": 1.0}, 100)
        assert refused.value.code == "job_active"
        lathe.resume()
        await bench.status(job["id"], "completed")
        assert bench.path() == PATH

    simulated(tmp_path, story)


def test_the_hold_key_at_the_lathe_is_a_pause(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        await bench.moving(5)
        bench.machine.hold(asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(job["id"], "paused", within_s=1.0)
        await asyncio.sleep(120)
        bench.machine.release(asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(job["id"], "completed")
        assert bench.path() == PATH

    simulated(tmp_path, story)


def test_stop_ends_behind_the_frame_with_nothing_in_doubt(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        await bench.moving(8)
        lathe.stop()
        view = await bench.status(job["id"], "cancelled", within_s=2.0)
        assert view["error"] is None
        assert view["progress"]["line"] == 1 + 8
        assert bench.path() == PATH[:8]
        assert lathe.program_position == {"x": 0.0, "z": -16.0}
        await stands(bench)
        (last,) = [row for row in await shop.jobs.batches(job["id"]) if row["line_to"] == 9]
        assert last["status"] == "ok", "its row tells what was executed of it"
        await until(lambda: lathe.state.status == "idle", within_s=2.0)
        back = await bench.job("G90\nG0 X0 Z0\nM30\n")
        await bench.status(back["id"], "completed")
        assert bench.machine.position == (0, 0)

    simulated(tmp_path, story)


def test_stop_of_a_paused_job_leaves_the_machine_to_the_next(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        await bench.moving(3)
        lathe.pause()
        await bench.status(job["id"], "paused", within_s=2.0)
        lathe.stop()
        await bench.status(job["id"], "cancelled", within_s=2.0)
        await until(lambda: lathe.state.status == "idle", within_s=2.0)
        back = await bench.job("G90\nG0 X0 Z0\nM30\n")
        await bench.status(back["id"], "completed")

    simulated(tmp_path, story)


def test_the_emergency_stop_is_at_once_and_the_position_is_gone(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        await bench.moving(6)
        lathe.estop()
        view = await bench.status(job["id"], "failed", within_s=1.0)
        assert view["error"]["code"] == "estop"
        assert (view["error"]["line_from"], view["error"]["line_to"]) == (7, 7), "the frame that was on its way"
        await until(lambda: lathe.unheard_stop is None, within_s=2.0)
        assert lathe.state.status == "alarm"
        assert lathe.program_position == {}
        assert not bench.machine.executed[-1].finished
        with pytest.raises(ProblemError) as refused:
            await lathe.run_blocks(["G91 G1 Z1 F100"])
        assert refused.value.code == "alarm_active"
        await lathe.unlock()
        await until(lambda: lathe.state.status == "idle", within_s=5.0)
        assert lathe.program_position == {}
        assert (await lathe.run_blocks(["G90 G1 Z1 F100"]))[0]["ok"] is False, "absolute from an unknown place"
        assert (await lathe.run_blocks(["G91 G1 Z1 F100"]))[0]["ok"] is True

    simulated(tmp_path, story)


def test_a_limit_switch_fails_the_job(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(ZIGZAG)
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "alarm"
        assert len(bench.path()) == 15
        assert lathe.program_position == {}

    simulated(tmp_path, story, settings=SimSettings(start_count=100, travel_z_mm=30.0))


def test_a_program_stop_waits_for_people(tmp_path: Path) -> None:
    text = "G90\nG1 Z-1 F240\nG1 Z-2 M0\nG1 Z-3\nM30\n"

    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(text)
        view = await bench.status(job["id"], "paused")
        assert view["progress"]["line"] == 3
        await stands(bench, 600.0)
        lathe.resume()
        await bench.status(job["id"], "completed")
        assert bench.path() == [(0, -1000), (0, -2000), (0, -3000)]

    simulated(tmp_path, story)


def test_a_tool_change_waits_for_people_and_the_rest_of_its_line_with_it(tmp_path: Path) -> None:
    text = "G90\nG1 Z-1 F240\nT3 M6 G1 Z-2\nG1 Z-3\nM30\n"

    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(text)
        view = await bench.status(job["id"], "waiting")
        assert (view["tool"], view["progress"]["line"]) == (3, 2)
        await stands(bench, 60.0)
        assert bench.path() == [(0, -1000)]
        await lathe.confirm_tool()
        await bench.status(job["id"], "completed")
        assert bench.path() == [(0, -1000), (0, -2000), (0, -3000)]

    simulated(tmp_path, story)


async def by_hand(lathe: Controller, *blocks: str) -> list[Any]:
    return [result["error"] for result in await lathe.run_blocks(list(blocks))]


def test_by_hand(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        assert await by_hand(lathe, "G91", "G1 X2 Z-1 F100", "Z-1") == [None, None, None]
        assert bench.machine.position == (2000, -2000)
        assert await by_hand(lathe, "G90 G0 X0") == [None]
        assert bench.machine.position == (0, -2000)
        assert lathe.program_position == {"x": 0.0, "z": -2.0}
        await lathe.jog({"z": -0.5}, 1000)
        await until(lambda: lathe.program_position["z"] == -2.5, within_s=10.0)
        assert "F255" in bench.executed()[-1], "no faster than the machine can"
        (error,) = await by_hand(lathe, "G42 D1 G1 X3 F100")
        assert error["code"] is None
        (error,) = await by_hand(lathe, "G1 Z-9000 F100")
        assert "does not fit" in error["message"]
        with pytest.raises(ProblemError) as refused:
            await lathe.jog({"y": 1.0}, 100)
        assert refused.value.code == "invalid_request"
        with pytest.raises(ProblemError) as refused:
            await lathe.unlock()
        assert refused.value.code == "wrong_state"
        await lathe.reset()
        await until(lambda: lathe.link_status == "connected", within_s=10.0)

    simulated(tmp_path, story)


def test_modes_by_hand_are_not_those_of_the_job_nor_the_other_way_round(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        await by_hand(lathe, "G91")
        job = await bench.job("G1 Z-5 F240\nG1 Z-6\nM30\n")
        await bench.status(job["id"], "completed")
        assert bench.machine.position == (0, -6000), "a job begins in G90"
        await by_hand(lathe, "G1 Z-7 F240")
        assert bench.machine.position == (0, -7000)

    simulated(tmp_path, story)


OFFSET = b"G21,G90,F240;G41 G1 X10 Z-10,LF\nZ-40;X30\nG40 G1 X0 Z0\nM30\n"
"""As the source prints programs; 2 mm are added to X and to Z from the first move on."""


def test_the_drawing_and_the_estimate_are_of_what_the_frames_do(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        program, _ = await shop.programs.store(one_chunk(OFFSET), "offset.nc")
        drawing = await shop.programs.toolpath(program["id"])
        _, pieces = await drawing.open()
        found = read_toolpath(b"".join([piece async for piece in pieces]))
        drawn = [(round(x * 1000), round(z * 1000)) for x, z in found.places]
        job = await shop.jobs.create(program["id"], MACHINE, force=True)
        began = asyncio.get_running_loop().time()
        await until(lambda: lathe.metrics.seconds_left() is not None, within_s=5)
        told = lathe.metrics.seconds_left()
        await bench.status(job["id"], "completed")
        assert bench.path() == [(12000, -8000), (12000, -38000), (32000, -38000), (0, 0)] == drawn[-4:]
        assert told == pytest.approx(asyncio.get_running_loop().time() - began, rel=0.1)
        plain = await shop.programs.toolpath(program["id"], profile="ncframe-lathe")
        assert plain.etag != drawing.etag, "a lathe with other tools has a drawing of its own"

    simulated(tmp_path, story, ncframe={"compensation": "offset", "tool_radius": 2.0})
