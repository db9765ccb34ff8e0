"""What must never happen on a Grbl, each as somebody at the machine would bring it about, in simulated time."""

import asyncio
import re
from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.grbl.simsettings import SimSettings
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import until
from tests.harness.workshop import MACHINE
from tests.scenarios.test_grbl_jobs import HEAD, HOMED, chunk, simulated, state_is, zigzag

NOWHERE = {"X": 0.0, "Y": 0.0, "Z": 0.0}
LONG = zigzag(60_000)


async def check(shop: Workshop, text: str) -> int:
    stored, _ = await shop.programs.store(chunk(text.encode()), "part.nc")
    return int((await shop.jobs.create(stored["id"], MACHINE, mode="check", force=True))["id"])


async def homed(router: Controller) -> None:
    await router.home()
    await until(lambda: bool(router.state.homed) and router.state.status == "idle", within_s=120.0)


def lossy(router: Controller, pattern: bytes, instead: bytes) -> None:
    """The wire garbles what the controller says."""
    assert router._link is not None
    engine = router._link.engine
    hear = engine.receive_data
    engine.receive_data = lambda data, now: hear(re.sub(pattern, instead, data), now)  # type: ignore[method-assign]


@pytest.mark.parametrize("by", ["reset", "power"])
def test_a_check_that_is_paused_moves_nothing_after_the_mode_is_gone(tmp_path: Path, by: str) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await check(shop, LONG)
        await state_is(router, "check")
        router.pause()
        await bench.status(job, "paused", within_s=20)
        if by == "reset":
            await router.reset()
        else:
            bench.cable.pull()
            bench.machine.restart(asyncio.get_running_loop().time())
            await bench.cable.live_alone(2)
            bench.cable.plugged = True
        view = await bench.status(job, "interrupted", within_s=20)
        assert view["error"]["code"] == {"reset": "machine_reset", "power": "link_lost"}[by]
        await state_is(router, "idle")
        await asyncio.sleep(20)
        assert bench.machine.position == NOWHERE

    simulated(tmp_path, story)


def test_a_check_whose_controller_restarts_unheard_moves_nothing(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await check(shop, LONG)
        await state_is(router, "check")
        await asyncio.sleep(0.5)
        lossy(router, rb"Grbl [^\r]*", b"Gr")
        bench.machine.restart(asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(job, "interrupted", within_s=5)
        await asyncio.sleep(20)
        assert bench.machine.position["X"] < 2.0, "no more than what was in its buffer"

    simulated(tmp_path, story)


def test_a_job_right_behind_check_mode_is_not_taken_for_executed(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, _router: Controller) -> None:
        stored, _ = await shop.programs.store(chunk(zigzag(10).encode()), "part.nc")
        await shop.panels[MACHINE].check_mode(on=True)
        job = await shop.jobs.create(stored["id"], MACHINE, force=True)
        await asyncio.sleep(20)
        view = await shop.jobs.get(job["id"])
        assert (view["status"], view["hold"]) == ("queued", True)

    simulated(tmp_path, story)


@pytest.mark.parametrize("ms", [3, 6, 9, 15, 30])
def test_a_check_that_is_stopped_while_it_begins_leaves_the_mode(tmp_path: Path, ms: int) -> None:
    async def story(_bench: GrblBench, shop: Workshop, router: Controller) -> None:
        making = asyncio.ensure_future(check(shop, zigzag(400)))
        await asyncio.sleep(ms / 1000)
        if router.stream.active_job is not None:
            router.stop()
        await making
        await asyncio.sleep(5)
        assert router.state.status == "idle"

    simulated(tmp_path, story, latency_s=0.002)


def test_a_job_that_stands_still_is_not_resumed_after_a_break(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        router.pause()
        bench.cable.pull()
        bench.machine.restart(asyncio.get_running_loop().time())
        await bench.cable.live_alone(1)
        bench.cable.plugged = True
        await until(lambda: router.link_status == "connected", within_s=30)
        view = await bench.status(job["id"], "interrupted", within_s=1)
        assert view["error"]["code"] in ("link_lost", "in_doubt")

    simulated(tmp_path, story)


def test_an_alarm_whose_line_was_lost_ends_the_job_and_nothing_goes_on_after_the_unlock(tmp_path: Path) -> None:
    moves = [f"G1 X-{20 + i / 10:.1f} F600" for i in range(400)]
    text = "\n".join([*HEAD, "G1 X-20 F3000", "G38.2 X-25 F100", *moves, "M30"]) + "\n"

    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        await homed(router)
        lossy(router, b"ALARM:", b"ALXRM-")
        stored, _ = await shop.programs.store(chunk(text.encode()), "part.nc")
        job = await shop.jobs.create(stored["id"], MACHINE, force=True, on_error="ignore")
        view = await bench.status(job["id"], "failed")
        assert view["error"]["code"] == "alarm"
        await asyncio.sleep(5)
        assert router.stream.active_job is None
        place = dict(bench.machine.position)
        await router.unlock()
        await asyncio.sleep(20)
        assert bench.machine.position == place

    simulated(tmp_path, story, settings=SimSettings(dollar=HOMED))


def test_proof_and_alarm_in_one_piece_end_the_job(tmp_path: Path) -> None:
    """The batch that the proof makes room for is handed over in the moment of the alarm."""

    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(2000))
        await asyncio.sleep(8)
        link: Any = router._link
        answers = b"ok\r\n" * len(link.engine._window.entries)
        link.receive(answers + b"<Idle|MPos:0.000,0.000,0.000|Bf:15,128|FS:0,0>\r\nALARM:1\r\n")
        view = await bench.status(job["id"], "failed", within_s=1)
        assert view["error"]["code"] == "alarm"
        assert router.stream.active_job is None
        assert {row["status"] for row in await shop.jobs.batches(job["id"])} <= {"ok", "failed", "unsent"}

    simulated(tmp_path, story)


def test_an_e_stop_pressed_twice_loses_the_position_once_and_for_all(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await homed(router)
        await bench.job("\n".join([*HEAD, "G1 X-150 F300", "M30"]) + "\n")
        await asyncio.sleep(3)
        router.estop()
        await asyncio.sleep(0.1)
        router.estop()
        await asyncio.sleep(5)
        assert router.unheard_stop is None
        assert router.state.homed is not True
        assert router.state.status == "alarm"

    simulated(tmp_path, story, settings=SimSettings(dollar=HOMED))


def test_home_asked_in_a_locked_alarm_does_not_begin_at_the_reset(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await homed(router)
        await router.run_blocks(["G0 X-20"])
        job = await bench.job("\n".join([*HEAD, "G1 X-500 F3000", "M30"]) + "\n")
        await bench.status(job["id"], "failed")
        await asyncio.sleep(2)
        with pytest.raises(ProblemError) as refused:
            await router.home()
        assert (refused.value.code, "soft limit" in refused.value.detail) == ("machine_busy", True)
        place = dict(bench.machine.position)
        assert place["X"] == pytest.approx(-20.0, abs=0.1)
        await router.reset()
        await asyncio.sleep(30)
        assert bench.machine.position == place

    simulated(tmp_path, story, settings=SimSettings(dollar=HOMED))


def test_what_is_still_inside_after_a_break_can_be_paused(tmp_path: Path) -> None:
    text = "\n".join([*HEAD, *[f"G1 X{10 * i} F300" for i in range(1, 60)], "M30"]) + "\n"

    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        job = await bench.job(text)
        await asyncio.sleep(6)
        bench.cable.pull()
        await bench.status(job["id"], "interrupted")
        await bench.cable.live_alone(1)
        bench.cable.plugged = True
        await until(lambda: router.link_status == "connected", within_s=30)
        await state_is(router, "run", within_s=2)
        router.pause()
        await state_is(router, "hold", within_s=2)
        router.resume()
        await state_is(router, "run", within_s=2)
        await bench.status(job["id"], "interrupted", within_s=0.1)

    simulated(tmp_path, story, settings=SimSettings(reset_on_open=False))


@pytest.mark.parametrize("what", ["block", "jog"])
def test_a_stop_right_behind_a_move_stops_it(tmp_path: Path, what: str) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await asyncio.sleep(1)
        moving = None
        if what == "jog":
            await router.jog({"x": 100.0}, 600)
        else:
            moving = asyncio.ensure_future(router.run_blocks(["G1 X100 F600"]))
        await asyncio.sleep(0.01)
        assert router.state.status == "idle", "no report has shown it yet"
        router.stop()
        await asyncio.sleep(15)
        assert bench.machine.position["X"] < 5.0
        if moving is not None:
            assert (await moving)[0]["ok"] is False
        with pytest.raises(ProblemError):
            router.stop()

    simulated(tmp_path, story)


def test_a_pause_right_behind_a_block_holds_it(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await asyncio.sleep(1)
        moving = asyncio.ensure_future(router.run_blocks(["G1 X100 F600"]))
        await asyncio.sleep(0.01)
        router.pause()
        await asyncio.sleep(15)
        assert bench.machine.position["X"] < 5.0
        router.resume()
        assert (await moving)[0]["ok"] is True
        assert bench.machine.position["X"] == pytest.approx(100.0, abs=0.01)

    simulated(tmp_path, story)


def test_a_job_that_is_being_cancelled_is_not_resumed(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(zigzag(300))
        await asyncio.sleep(6)
        router.pause()
        await bench.status(job["id"], "paused", within_s=2)
        router.stop()
        with pytest.raises(ProblemError):
            router.resume()
        await bench.status(job["id"], "cancelled", within_s=3)
        assert (await shop.jobs.row(job["id"]))["hold"], "had the daemon died it would not have moved"

    simulated(tmp_path, story)


def test_a_check_makes_way_for_the_next_job_when_its_reset_is_over(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, _router: Controller) -> None:
        first = await check(shop, zigzag(400))
        second = await bench.job(zigzag(5))
        await bench.status(first, "completed")
        await bench.status(second["id"], "completed", within_s=30)
        assert bench.machine.position["X"] == pytest.approx(0.5, abs=0.01)

    simulated(tmp_path, story)


TOOLS = "\n".join([*HEAD, "G1 X1 F600", "T3 M6", *[f"G1 X{i} F600" for i in range(2, 20)], "M30"]) + "\n"


@pytest.mark.parametrize("then", ["resume", "stop"])
def test_a_pause_while_a_tool_is_waited_for_outlives_the_tool(tmp_path: Path, then: str) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        job = await bench.job(TOOLS)
        await bench.status(job["id"], "waiting", within_s=30.0)
        await shop.jobs.pause(job["id"])
        await asyncio.sleep(1)
        await router.confirm_tool()
        await asyncio.sleep(10)
        await bench.status(job["id"], "paused", within_s=0.1)
        assert bench.machine.position["X"] < 2.0
        if then == "resume":
            router.resume()
            await bench.status(job["id"], "completed", within_s=60)
        else:
            router.stop()
            await bench.status(job["id"], "cancelled", within_s=60)

    simulated(tmp_path, story, settings=SimSettings(flavour="grblHAL"), grbl={"firmware": "grblhal"})


def test_a_tool_whose_end_was_lost_on_the_wire_is_asked_for_again(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        job = await bench.job(TOOLS)
        await bench.status(job["id"], "waiting", within_s=30.0)
        link: Any = router._link
        write = link._write
        link._write = lambda data: write(data.replace(b"~", b""))
        await router.confirm_tool()
        link._write = write
        await bench.status(job["id"], "running", within_s=0.2)
        await bench.status(job["id"], "waiting", within_s=2)
        await router.confirm_tool()
        await bench.status(job["id"], "completed", within_s=60)

    simulated(tmp_path, story, settings=SimSettings(flavour="grblHAL"), grbl={"firmware": "grblhal"})


def test_a_reader_neither_keeps_a_job_from_beginning_nor_fills_its_stream(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        reading = asyncio.ensure_future(shop.panels[MACHINE].settings.all())
        await asyncio.sleep(0)
        assert router.manual.busy
        router.check_can_start()
        await reading
        job = await bench.job(zigzag(60))
        await state_is(router, "run")
        link: Any = router._link
        sent, write = bytearray(), link._write
        link._write = lambda data: (sent.extend(data), write(data))
        began_at = asyncio.get_running_loop().time()
        for _ in range(50):
            assert (await shop.panels[MACHINE].modal())["machine"] == MACHINE
            await asyncio.sleep(0.01)
        assert 1 <= sent.count(b"$G") <= 1 + asyncio.get_running_loop().time() - began_at
        await bench.status(job["id"], "completed")

    simulated(tmp_path, story)
