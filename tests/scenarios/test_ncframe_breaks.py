"""Jobs on a virtual lathe when cable, daemon, power or wire fail. No frame is ever executed twice.

What is compared is where the lathe was led, count by count, with the rounded positions of the program: a frame that ran
twice, or not at all, would lead everything behind it elsewhere.
"""

import asyncio
import random
from pathlib import Path
from typing import Any

import pytest

from gcode.motion import Motion
from gcode.ncframe.reader import FrameReader
from gcode.ncframe.rules import FrameRules
from gcode.profile import load_profile
from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.faults import FaultRates
from sim.ncframe.settings import SimSettings
from tests.harness.ncworkshop import HERE, NcBench, Place, simulated, stands
from tests.harness.simloop import until
from tests.harness.workshop import MACHINE

PART = """G21 G90 G54
M8 M3 S3
G1 X2.0004 Z-1.0003 F240
G91 X0.0004 Z-0.6667
X0.3334 Z-0.0007; Z-0.3333; M9
G2 X3 Z-3 R3
(full circle) G3 I-2 K0
G90 G1 X4 Z-8 F200
G92 X0 Z0
X-1 Z-1 M10 M11
G4 P0.3
G3 X-3 Z-3 I-2 K0
T2
G1 Z-5 F100 M12
Z-6; Z-6.5; Z-7
M30
"""
"""What makes a line several frames, and what makes frames hang on those before them."""
COUNTED = SimSettings(start_count=100)
UNCOUNTED = SimSettings(counter=False)


def whole_path(text: str) -> list[Place]:
    """Where the translation leads, from zero, count by count: read once, from end to end."""
    lines = enumerate(text.encode().split(b"\n"), 1)
    reader = FrameReader(lines, load_profile("ncframe-lathe"), Motion(), FrameRules(), {"x": 0.0, "z": 0.0})
    path: list[Place] = []
    while not reader.ended:
        path += [(round(b.end[0] * 1000), round(b.end[1] * 1000)) for b in reader.more(1)[0] if b.moves]
    return path


PATH = whole_path(PART)
FRAMES = 21


async def again(bench: NcBench) -> tuple[Workshop, Controller]:
    """A daemon after one that died."""
    shop = await bench.connected()
    return shop, shop.machines[MACHINE]


async def in_time(bench: NcBench, *, frame: int, delay_s: float) -> None:
    await bench.moving(frame)
    await asyncio.sleep(delay_s)


def test_the_part_is_what_it_is_meant_to_be(tmp_path: Path) -> None:
    """Without any trouble: as many frames as the tests below think, and lines of several."""

    async def story(bench: NcBench, _shop: Workshop, _lathe: Controller) -> None:
        job = await bench.job(PART)
        view = await bench.status(job["id"], "completed")
        assert view["progress"]["line"] == 16
        assert bench.path() == PATH
        assert len(bench.machine.executed) == FRAMES

    simulated(tmp_path, story)


@pytest.mark.parametrize("frame", range(1, FRAMES + 1))
def test_kill_9_at_every_frame_goes_on_behind_the_last_one(tmp_path: Path, frame: int) -> None:
    async def story(bench: NcBench, _shop: Workshop, _lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=frame, delay_s=0.2 * (frame % 2))
        bench.crash()
        await bench.cable.live_alone(1.0)
        await again(bench)
        view = await bench.status(job["id"], "completed")
        assert view["error"] is None
        assert bench.path() == PATH

    simulated(tmp_path, story, settings=COUNTED, ncframe={"max_batch_blocks": 1 + frame % 5})


@pytest.mark.parametrize("frame", range(2, FRAMES + 1, 3))
def test_kill_9_and_a_long_break_leave_nothing_in_doubt_and_people_go_on(tmp_path: Path, frame: int) -> None:
    async def story(bench: NcBench, _shop: Workshop, _lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=frame, delay_s=0.01)
        bench.crash()
        await bench.cable.live_alone(100.0)
        shop, lathe = await again(bench)
        view = await bench.status(job["id"], "interrupted", "completed")
        if view["status"] == "interrupted":
            assert view["error"]["code"] == "break_too_long"
            assert view["error"]["line_from"] is None
            await stands(bench)
            plan = await shop.jobs.recover(job["id"])
            assert plan["can_continue"], plan
            with pytest.raises(ProblemError) as refused:
                await shop.jobs.recover(job["id"], "from_line", 3)
            assert refused.value.code == "wrong_state"
            await shop.jobs.recover(job["id"], "continue")
            await bench.status(job["id"], "completed")
        assert bench.path() == PATH
        assert lathe.state.status == "idle"

    simulated(tmp_path, story, settings=COUNTED, ncframe={"max_batch_blocks": 1 + frame % 5})


@pytest.mark.parametrize("seed", range(8))
def test_the_daemon_dies_again_and_again(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)

    async def story(bench: NcBench, _shop: Workshop, _lathe: Controller) -> None:
        job = await bench.job(PART)
        for _ in range(6):
            await asyncio.sleep(chance.uniform(0.05, 2.0))
            if bench.machine.executed and bench.machine.executed[-1].text.startswith("M30"):
                break
            bench.crash()
            await bench.cable.live_alone(chance.choice([0.01, 1.0, 3.0]))
            await again(bench)
        await bench.status(job["id"], "completed")
        assert bench.path() == PATH

    options = {"resume_within": 60.0}
    simulated(tmp_path, story, settings=COUNTED, ncframe={"max_batch_blocks": chance.randint(1, 6)}, options=options)


@pytest.mark.parametrize("frame", [3, 7, 12, 20])
@pytest.mark.parametrize("away_s", [0.05, 3.0])
def test_a_pulled_plug_is_bridged(tmp_path: Path, frame: int, away_s: float) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=frame, delay_s=0.05)
        bench.cable.pull()
        await bench.cable.live_alone(away_s)
        bench.cable.plugged = True
        await bench.status(job["id"], "completed")
        assert bench.path() == PATH
        assert {row["status"] for row in await shop.jobs.batches(job["id"])} <= {"ok", "unsent", "undone"}
        assert lathe.program_position == {"x": PATH[-1][0] / 1000, "z": PATH[-1][1] / 1000}

    simulated(tmp_path, story, settings=COUNTED)


def test_a_long_break_in_the_middle_of_a_batch_is_told_frame_by_frame(tmp_path: Path) -> None:
    text = "G90\n" + "".join(f"G1 Z-{i} F120\n" for i in range(1, 21)) + "M30\n"

    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(text)
        await in_time(bench, frame=8, delay_s=0.05)
        bench.cable.pull()
        await bench.cable.live_alone(60.0)
        bench.cable.plugged = True
        view = await bench.status(job["id"], "interrupted")
        await until(lambda: lathe.link_status == "connected", within_s=60.0)
        await asyncio.sleep(1.0)
        view = await shop.jobs.get(job["id"])
        assert (view["error"]["code"], view["error"]["line_from"]) == ("break_too_long", None)
        assert view["progress"]["line"] == 1 + 8
        assert lathe.program_position == {"x": 0.0, "z": -8.0}
        await lathe.jog({"z": 0.5}, 100)
        await asyncio.sleep(5.0)
        with pytest.raises(ProblemError) as moved:
            await shop.jobs.recover(job["id"], "continue")
        assert "moved" in str(moved.value)
        await lathe.jog({"z": -0.5}, 100)
        await asyncio.sleep(5.0)
        await shop.jobs.recover(job["id"], "continue")
        await bench.status(job["id"], "completed")
        assert bench.machine.position == (0, -20_000)

    simulated(tmp_path, story, settings=COUNTED, ncframe={"max_batch_seconds": 4.0})


def test_moved_by_hand_and_disconnected_it_does_not_know_where_it_stands(tmp_path: Path) -> None:
    """The journal knows the job's frames, not those by hand: what it knows must not be taken for the position."""

    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=8, delay_s=0.05)
        bench.cable.pull()
        await bench.cable.live_alone(60.0)
        bench.cable.plugged = True
        await bench.status(job["id"], "interrupted")
        await until(lambda: lathe.link_status == "connected", within_s=60.0)
        await lathe.jog({"z": 2.0}, 100)
        await asyncio.sleep(5.0)
        bench.cable.pull()
        bench.cable.plugged = True
        await until(lambda: lathe.link_status == "connected", within_s=60.0)
        await asyncio.sleep(1.0)
        assert lathe.program_position == {}
        with pytest.raises(ProblemError) as refused:
            await shop.jobs.recover(job["id"], "continue")
        assert "where it stands" in str(refused.value)

    simulated(tmp_path, story, settings=COUNTED)


def test_a_break_while_paused_stays_a_pause(tmp_path: Path) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=8, delay_s=0.05)
        lathe.pause()
        await bench.status(job["id"], "paused")
        bench.cable.pull()
        await bench.cable.live_alone(600.0)
        bench.cable.plugged = True
        await until(lambda: lathe.link_status == "connected", within_s=60.0)
        await stands(bench)
        assert (await shop.jobs.get(job["id"]))["status"] == "paused"
        lathe.resume()
        await bench.status(job["id"], "completed")
        assert bench.path() == PATH

    simulated(tmp_path, story, settings=COUNTED)


@pytest.mark.parametrize("frame", [4, 9, 15])
@pytest.mark.parametrize("how", ["unplug", "kill"])
def test_without_a_counter_a_break_is_a_doubt_that_is_told(tmp_path: Path, frame: int, how: str) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=frame, delay_s=0.05)
        if how == "kill":
            bench.crash()
        else:
            bench.cable.pull()
        await bench.cable.live_alone(3.0)
        bench.cable.plugged = True
        shop, lathe = await again(bench)
        view = await bench.status(job["id"], "interrupted")
        assert view["error"]["code"] == "in_doubt"
        assert "counts n" in view["error"]["message"]
        assert "stands" in view["error"]["message"]
        assert view["error"]["line_from"] is not None
        assert lathe.program_position == {}
        done = len(bench.path())
        assert bench.path() == PATH[:done]
        await stands(bench)
        for action in ("continue", "from_line"):
            with pytest.raises(ProblemError):
                await shop.jobs.recover(job["id"], action, 3 if action == "from_line" else None)
        await shop.jobs.cancel(job["id"])
        await bench.status(job["id"], "cancelled")

    simulated(tmp_path, story, settings=UNCOUNTED)


def test_without_a_counter_a_frame_that_is_lost_is_a_doubt(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=5, delay_s=0.05)
        bench.cable._link._pump._down.cut()
        view = await bench.status(job["id"], "interrupted", within_s=60.0)
        assert view["error"]["code"] == "in_doubt"
        await asyncio.sleep(5.0)
        assert lathe.program_position == {}

    simulated(tmp_path, story, settings=UNCOUNTED)


@pytest.mark.parametrize("frame", [2, 6, 11, 17])
@pytest.mark.parametrize("delay_s", [0.0, 0.3])
def test_a_restart_of_the_lathe_ends_everything_by_itself(tmp_path: Path, frame: int, delay_s: float) -> None:
    async def story(bench: NcBench, shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=frame, delay_s=delay_s)
        bench.machine.restart(asyncio.get_running_loop().time())
        bench.cable.touch()
        view = await bench.status(job["id"], "interrupted", within_s=120.0)
        assert view["error"]["code"] in ("machine_restarted", "in_doubt")
        assert lathe.program_position == {}
        done = len(bench.path())
        assert bench.path() == PATH[:done]
        await stands(bench, 60.0)
        with pytest.raises(ProblemError):
            await shop.jobs.recover(job["id"], "continue")

    simulated(tmp_path, story, settings=COUNTED)


@pytest.mark.parametrize("seed", range(6))
def test_a_bad_wire_costs_time_and_nothing_else(tmp_path: Path, seed: int) -> None:
    """Bytes lost and flipped both ways: NAKs, lost answers, counts that are nonsense."""

    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        bench.cable.faults, bench.cable.seed = FaultRates(loss=0.01, flip=0.01), 100 * seed
        await lathe.disconnect()
        await lathe.connect()
        await until(lambda: lathe.link_status == "connected", within_s=120.0)
        (said,) = await lathe.run_blocks([HERE])
        assert said["ok"]
        job = await bench.job(PART)
        view: Any = await bench.status(job["id"], "completed", "interrupted", "failed", within_s=3000.0)
        done = len(bench.path())
        assert bench.path() == PATH[:done], "whatever becomes of the job"
        if view["status"] == "completed":
            assert done == len(PATH)

    simulated(tmp_path, story, settings=SimSettings(start_count=100, framing="gap"))


def test_a_storm_of_naks_fails_the_job_with_nothing_in_doubt(tmp_path: Path) -> None:
    async def story(bench: NcBench, _shop: Workshop, lathe: Controller) -> None:
        job = await bench.job(PART)
        await in_time(bench, frame=5, delay_s=0.0)
        judge = bench.machine._judge

        def refuse(now: float) -> None:
            bench.machine._bad = "storm"

        bench.machine._judge = refuse
        view = await bench.status(job["id"], "failed", within_s=60.0)
        assert view["error"]["code"] == "machine_error"
        assert "refused" in view["error"]["message"]
        assert view["error"]["line_from"] is None
        assert bench.path() == PATH[: len(bench.path())]
        bench.machine._judge = judge
        x, z = bench.machine.position
        await until(lambda: lathe.state.status == "idle", within_s=5.0)
        assert lathe.program_position == {"x": x / 1000, "z": z / 1000}

    simulated(tmp_path, story, settings=COUNTED)
