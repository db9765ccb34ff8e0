"""Lost links, crashes and restarts in the middle of a job: every block once, or the job says what is in doubt.

The judge is the list of blocks that the machine began to execute. A crash may fall on any effect of the runner.
"""

import asyncio
import sqlite3
from pathlib import Path
from typing import Any, Literal

import pytest

from server.config.reentry import ReentryWish
from server.machine.jobstream import JobStream
from server.problems import ProblemError
from sim.elvinto.settings import SimSettings
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

Repeat = Literal["silent", "reack"]
REPEATS: tuple[Repeat, ...] = ("silent", "reack")
BLOCKS = 60


def program(count: int = BLOCKS, *, tail: str = "M30") -> str:
    moves = [f"G1 X{i} Y{i % 7} F6000" for i in range(1, count + 1)]
    return "\n".join(["G90", *moves, tail]) + "\n"


def wanted(count: int = BLOCKS) -> list[str]:
    return ["G90", *[f"X{i}Y{i % 7}" for i in range(1, count + 1)], "M30"]


def plain(executed: list[str]) -> list[str]:
    """Without the words that compacting leaves out or a start in the middle says again."""
    blocks = [block.removeprefix("G1").removesuffix("F6000") for block in executed]
    return [block for block in blocks if block not in ("", "F6000")]


def programme_of(executed: list[str]) -> list[str]:
    """As the program stands there: what a recovery said again (G90 in the middle) is left out; M30 may repeat."""
    blocks = plain(executed)
    kept = [block for i, block in enumerate(blocks) if i == 0 or block != "G90"]
    while kept[-2:] == ["M30", "M30"]:
        kept.pop()
    return kept


async def midway(bench: Bench, blocks: int = 25) -> None:
    await until(lambda: len(bench.executed()) >= blocks, within_s=60, step_s=0.01)


@pytest.mark.parametrize("repeat", REPEATS)
@pytest.mark.parametrize("away_s", [0.0, 1.0, 4.0])
def test_a_short_break_is_bridged(tmp_path: Path, repeat: Repeat, away_s: float) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat), options={"resume_within": 20.0})
        shop = await bench.connected()
        job = await bench.job(program())
        for blocks in (10, 25, 40):
            await midway(bench, blocks)
            bench.cable.pull()
            assert (await shop.jobs.get(job["id"]))["status"] == "running"
            await bench.cable.live_alone(away_s)
            bench.cable.plugged = True
            await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=30, step_s=0.01)
        await bench.status(job["id"], "completed")
        assert programme_of(bench.executed()) == wanted()
        assert shop.machines[MACHINE].metrics.link_errors["lost"] == 3
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("repeat", REPEATS)
def test_a_long_break_interrupts_with_the_certain_line_and_continue_goes_on(tmp_path: Path, repeat: Repeat) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat))
        shop = await bench.connected()
        job = await bench.job(program())
        await midway(bench)
        bench.cable.pull()
        await bench.cable.live_alone(9.0)
        assert (await shop.jobs.get(job["id"]))["status"] == "running"
        await asyncio.sleep(2.0)
        view = await shop.jobs.get(job["id"])
        assert (view["status"], view["error"]["code"]) == ("interrupted", "break_too_long")
        assert view["error"]["line_from"] == view["progress"]["line"] + 1
        with pytest.raises(ProblemError):
            await shop.jobs.recover(job["id"], "continue")
        bench.cable.plugged = True
        await bench.connected()
        view = await shop.jobs.get(job["id"])
        stood = len(bench.executed())
        assert view["status"] == "interrupted"
        assert view["error"]["line_from"] is None, "the position is proven: nothing is in doubt any more"
        assert view["progress"]["line"] == stood
        await asyncio.sleep(60)
        assert len(bench.executed()) == stood, "nothing moves by itself after a long break"
        plan = await shop.jobs.recover(job["id"])
        assert plan["can_continue"]
        assert plan["certain_line"] == stood
        assert plan["blocks"][:3] == ["G90", "G1", "F6000"]
        await shop.jobs.recover(job["id"], "continue")
        await bench.status(job["id"], "completed")
        assert programme_of(bench.executed()) == wanted()
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("repeat", REPEATS)
def test_continue_is_refused_when_the_machine_was_moved_by_hand(tmp_path: Path, repeat: Repeat) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat), options={"resume_within": 0})
        shop = await bench.connected()
        job = await bench.job(program())
        await midway(bench)
        bench.cable.pull()
        bench.cable.plugged = True
        await bench.connected()
        await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=30)
        assert (await shop.jobs.get(job["id"]))["status"] == "interrupted"
        controller = shop.machines[MACHINE]
        position = dict(controller.state.position)
        await controller.run_blocks(["G91", "G1 Z5 F100", "G90"])
        await until(lambda: controller.state.position["z"] == 5.0, within_s=30)
        plan = await shop.jobs.recover(job["id"])
        assert not plan["can_continue"]
        assert "moved" in plan["why_not"]
        with pytest.raises(ProblemError):
            await shop.jobs.recover(job["id"], "continue")
        await controller.run_blocks([f"G0 Z{position['z']:g}"])
        await until(lambda: controller.state.position["z"] == position["z"], within_s=30)
        before = bench.executed()
        await shop.jobs.recover(job["id"], "continue")
        await bench.status(job["id"], "completed")
        after = bench.executed()[len(before) :]
        assert "G1" in after[1], "the motion mode that the hand changed is said again"
        assert plain(before)[:-4] + [b for b in plain(after) if b != "G90"] == wanted()
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("repeat", REPEATS)
@pytest.mark.parametrize("when", ["executing", "paused", "unplugged", "daemon down"])
def test_a_machine_that_restarts_gets_not_one_block_more(tmp_path: Path, repeat: Repeat, when: str) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat), options={"resume_within": 60.0})
        shop = await bench.connected()
        job = await bench.job(program())
        await midway(bench)
        if when == "paused":
            shop.machines[MACHINE].pause()
            await bench.status(job["id"], "paused")
        elif when == "unplugged":
            bench.cable.pull()
        elif when == "daemon down":
            bench.crash()
        bench.machine.restart(asyncio.get_running_loop().time())
        bench.cable.touch()
        stood = bench.executed()
        bench.cable.plugged = True
        if when == "daemon down":
            shop = await bench.start()
        view = await bench.status(job["id"], "interrupted", within_s=60)
        await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=60)
        view = await bench.status(job["id"], "interrupted", within_s=60)
        await asyncio.sleep(60)
        assert bench.executed() == stood
        assert view["error"]["code"] in ("machine_restarted", "in_doubt")
        if when == "paused":
            assert view["error"]["line_from"] is None
            assert view["progress"]["line"] == len(stood)
        else:
            assert view["error"]["line_from"] <= len(stood) <= view["error"]["line_to"]
        plan = await shop.jobs.recover(job["id"])
        assert plan["restarted"]
        assert (plan["can_continue"], plan["needs"]) == (False, ["force"])
        with pytest.raises(ProblemError, match="not homed"):
            await shop.jobs.recover(job["id"], "from_line", 50)
        assert bench.executed() == stood, "where it stands nobody knows"
        await shop.jobs.recover(job["id"], "from_line", 50, ReentryWish(force=True))
        await bench.status(job["id"], "completed")
        assert plain(bench.executed()[len(stood) :])[1:] == wanted()[49:]
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("repeat", REPEATS)
def test_a_paused_job_survives_a_long_break_and_moves_only_when_asked(tmp_path: Path, repeat: Repeat) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat))
        shop = await bench.connected()
        job = await bench.job(program())
        await midway(bench)
        shop.machines[MACHINE].pause()
        await bench.status(job["id"], "paused")
        stood = bench.executed()
        for _ in range(2):
            bench.cable.pull()
            await bench.cable.live_alone(3600.0)
            bench.cable.plugged = True
            await bench.connected()
            await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=60)
        bench.crash()
        await bench.cable.live_alone(3600.0)
        shop = await bench.connected()
        assert (await shop.jobs.get(job["id"]))["status"] == "paused"
        assert bench.executed() == stood
        shop.machines[MACHINE].resume()
        await bench.status(job["id"], "completed")
        assert programme_of(bench.executed()) == wanted()
        await shop.stop()

    run_simulated(main())


class KilledError(Exception):
    """The daemon died here."""


class Assassin:
    """Kills the daemon before, or right after, the n-th effect of its runner."""

    def __init__(self, bench: Bench, at: int, *, after: bool, monkeypatch: pytest.MonkeyPatch) -> None:
        self.count = 0
        self.struck = False
        perform = JobStream._perform

        def deadly(stream: JobStream, effect: Any) -> None:
            if self.struck:
                return perform(stream, effect)
            self.count += 1
            if after:
                perform(stream, effect)
            if self.count == at:
                self.struck = True
                bench.crash()
                raise KilledError
            if not after:
                perform(stream, effect)
            return None

        monkeypatch.setattr(JobStream, "_perform", deadly)


async def killed_once(bench: Bench, assassin: Assassin) -> None:
    """Begin a job with the assassin about."""
    broken: list[BaseException] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _loop, context: broken.append(context.get("exception") or RuntimeError(context)))
    await bench.connected()
    try:
        await bench.job(program(30))
        await until(lambda: assassin.struck or len(bench.executed()) >= 32, within_s=60, step_s=0.01)
    except (KilledError, sqlite3.ProgrammingError, asyncio.CancelledError):
        assert assassin.struck, "only a dead daemon loses its database"
    assert all(isinstance(error, KilledError) for error in broken), broken


EFFECTS = range(1, 24)


@pytest.mark.slow
@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize(("repeat", "latency_s", "away_s"), [("silent", 0.001, 3.0), ("reack", 0.4, 0.2)])
def test_a_daemon_killed_at_any_effect_goes_on_and_every_block_is_executed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, repeat: Repeat, after: bool, latency_s: float, away_s: float
) -> None:
    finished = 0
    for at in EFFECTS:
        with monkeypatch.context() as patch:
            finished += _killed_at(tmp_path / str(at), patch, repeat, after, latency_s, away_s, at)
    assert finished == len(EFFECTS), "every one of these crashes can be bridged"


def _killed_at(
    folder: Path,
    patch: pytest.MonkeyPatch,
    repeat: Repeat,
    after: bool,
    latency_s: float,
    away_s: float,
    at: int,
) -> bool:
    async def main() -> bool:
        options = {"resume_within": 20.0, "elvinto": {"max_batch_blocks": 6}}
        bench = Bench(folder, SimSettings(repeat=repeat), options=options, latency_s=latency_s)
        assassin = Assassin(bench, at, after=after, monkeypatch=patch)
        await killed_once(bench, assassin)
        assert assassin.struck, f"the job has only {assassin.count} effects"
        await bench.cable.live_alone(away_s)
        shop = await bench.start()
        view = await bench.status(1, "completed", "interrupted", "queued", within_s=120)
        executed = programme_of(bench.executed()) if bench.executed() else []
        if view["status"] == "completed":
            assert executed == wanted(30), f"killed at effect {at}"
        elif view["status"] == "queued":
            assert bench.executed() == []
        else:
            certain = view["progress"]["line"]
            assert executed == wanted(30)[: len(executed)], "nothing twice, nothing left out"
            assert certain <= len(executed) <= (view["error"]["line_to"] or certain)
        await shop.stop()
        return view["status"] != "interrupted"

    return run_simulated(main())


@pytest.mark.parametrize("repeat", REPEATS)
def test_a_daemon_that_was_away_for_long_leaves_the_job_interrupted_and_proves_the_line(
    tmp_path: Path, repeat: Repeat
) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat))
        await bench.connected()
        job = await bench.job(program())
        await midway(bench)
        bench.crash()
        await bench.cable.live_alone(60.0)
        stood = bench.executed()
        shop = await bench.connected()
        view = await bench.status(job["id"], "interrupted")
        assert view["error"]["code"] == "break_too_long"
        assert view["error"]["line_from"] is None
        assert view["progress"]["line"] == len(stood)
        await asyncio.sleep(60)
        assert bench.executed() == stood
        await shop.jobs.recover(job["id"], "continue")
        await bench.status(job["id"], "completed")
        assert programme_of(bench.executed()) == wanted()
        await shop.stop()

    run_simulated(main())


def test_a_pause_that_was_granted_outlives_a_crash(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, options={"resume_within": 60.0})
        shop = await bench.connected()
        job = await bench.job(program())
        await midway(bench)
        shop.machines[MACHINE].pause()
        await asyncio.sleep(0.01)
        assert (await shop.jobs.get(job["id"]))["status"] == "running", "its batch in flight is not done yet"
        bench.crash()
        shop = await bench.connected()
        view = await bench.status(job["id"], "paused", "completed", "interrupted")
        assert view["status"] == "paused"
        assert view["progress"]["line"] == len(bench.executed())
        shop.machines[MACHINE].resume()
        await bench.status(job["id"], "completed")
        assert programme_of(bench.executed()) == wanted()
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("repeat", REPEATS)
def test_waiting_for_a_tool_outlives_a_crash(tmp_path: Path, repeat: Repeat) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(repeat=repeat))
        await bench.connected()
        job = await bench.job("G90\nG1 X1 Y1 F3000\nT2 M06\nG1 X2 Y2\nM30\n")
        await bench.status(job["id"], "waiting")
        stood = bench.executed()
        bench.crash()
        await bench.cable.live_alone(3600.0)
        shop = await bench.connected()
        view = await shop.jobs.get(job["id"])
        assert (view["status"], view["tool"]) == ("waiting", 2)
        assert bench.executed() == stood
        await shop.machines[MACHINE].confirm_tool()
        await bench.status(job["id"], "completed")
        assert len(bench.executed()) == len(stood) + 2
        await shop.stop()

    run_simulated(main())


def test_nothing_starts_because_a_daemon_started(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        await bench.job(program(5))
        second = await bench.job(program(6))
        await midway(bench, 3)
        shop.machines[MACHINE].stop()
        await asyncio.sleep(0.01)
        bench.crash()
        shop = await bench.connected()
        await asyncio.sleep(120)
        assert (await shop.jobs.get(second["id"]))["status"] == "queued"
        assert len(bench.executed()) <= 7
        await shop.stop()

    run_simulated(main())
