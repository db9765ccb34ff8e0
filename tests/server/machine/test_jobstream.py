"""The job side of a machine: effects in order, signs of life at most once a second, frames at a fault."""

import asyncio
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from jobs import batch, history, journal
from jobs.batch import BatchPlanner
from jobs.effects import SetStatus
from jobs.job import Status
from jobs.program import ProgramStore
from jobs.runner import Runner
from protocol.elvinto.engine import ElvintoEngine
from protocol.errors import LocalError
from protocol.events import BatchDone
from server.live.subscription import Filter
from server.machine.jobstream import ALIVE_EVERY_S, PROGRESS_EVERY_S, PROGRESS_UNSEEN_S, JobStream
from sim.elvinto.settings import SimSettings
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

PROGRAM = "G90\n" + "".join(f"G1 X{i} Y{i % 7} F600\n" for i in range(1, 60)) + "M30\n"


def test_signs_of_life_are_durable_about_once_a_second(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[float] = []
    alive = JobStream.alive

    def counted(stream: JobStream) -> None:
        written.append(asyncio.get_running_loop().time())
        alive(stream)

    monkeypatch.setattr(JobStream, "alive", counted)

    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        await asyncio.sleep(30)
        assert written == [], "without a job nobody needs them"
        job = await bench.job(PROGRAM)
        await bench.status(job["id"], "completed")
        gaps = [later - earlier for earlier, later in pairwise(written)]
        assert min(gaps) >= ALIVE_EVERY_S
        assert max(gaps) <= ALIVE_EVERY_S + 1.0
        await shop.stop()

    run_simulated(main())


def test_a_fault_of_ours_in_the_reading_fails_the_job_behind_what_was_sent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = BatchPlanner.read
    monkeypatch.setattr(batch, "LINES_AT_ONCE", 20)
    monkeypatch.setattr(ProgramStore, "runs", ProgramStore.lines)

    def faulty(planner: BatchPlanner) -> None:
        if len(bench.executed()) > 10:
            raise KeyError("a fault of ours")
        read(planner)

    monkeypatch.setattr(BatchPlanner, "read", faulty)
    bench = Bench(tmp_path)

    async def main() -> None:
        shop = await bench.connected()
        job = await bench.job(PROGRAM)
        view = await bench.status(job["id"], "failed", "completed")
        error = view["error"]
        assert (view["status"], error["code"], error["line_from"]) == ("failed", "internal", None)
        assert "KeyError" in error["message"]
        assert 10 < view["progress"]["line"] == len(bench.executed()) < 60
        await shop.stop()

    run_simulated(main())


def test_a_fault_of_ours_between_two_batches_interrupts_the_job_which_goes_on_when_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    advance = Runner.advance
    bench = Bench(tmp_path)

    def faulty(runner: Runner, *args: Any, **named: Any) -> list[Any]:
        if len(bench.executed()) > 10:
            raise KeyError("a fault of ours")
        return advance(runner, *args, **named)

    monkeypatch.setattr(Runner, "advance", faulty)

    async def main() -> None:
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        view = await bench.status(job, "interrupted", "completed")
        assert (view["status"], view["error"]["code"]) == ("interrupted", "internal")
        assert "KeyError" in view["error"]["message"]
        await asyncio.sleep(60)
        view = await shop.jobs.get(job)
        assert view["error"]["line_from"] is None, "the machine has said how what it had has ended"
        assert 10 < view["progress"]["line"] == len(bench.executed()) < 60
        assert caplog.text.count("a fault of the daemon") == 1, "with every turn it comes again"
        monkeypatch.undo()
        await shop.jobs.recover(job, "continue")
        await bench.status(job, "completed")
        reached = [found[1] for block in bench.executed() if (found := re.search(r"X(\d+)", block))]
        assert reached == [str(x) for x in range(1, 60)], "each line once"
        await shop.stop()

    run_simulated(main())


def test_a_batch_that_a_fault_of_ours_kept_from_the_machine_is_in_doubt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    submit = ElvintoEngine.submit
    bench = Bench(tmp_path)

    def faulty(engine: ElvintoEngine, command: Any, now: float) -> None:
        if len(bench.executed()) > 10:
            raise LocalError("a fault of ours")
        submit(engine, command, now)

    monkeypatch.setattr(ElvintoEngine, "submit", faulty)

    async def main() -> None:
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        await bench.status(job, "interrupted", "completed")
        await asyncio.sleep(60)
        view = await shop.jobs.get(job)
        error = view["error"]
        assert (view["status"], error["code"]) == ("interrupted", "internal")
        assert error["line_from"] == view["progress"]["line"] + 1 == len(bench.executed()) + 1
        assert error["line_to"] >= error["line_from"]
        await shop.jobs.cancel(job)
        assert (await bench.status(job, "cancelled"))["error"]["line_from"] == error["line_from"]
        await shop.stop()

    run_simulated(main())


def test_an_event_that_a_fault_of_ours_swallowed_leaves_its_batch_in_doubt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    handle = Runner.handle
    bench = Bench(tmp_path)

    def faulty(runner: Runner, event: Any, **named: Any) -> list[Any]:
        if isinstance(event, BatchDone) and len(bench.executed()) > 10:
            raise ZeroDivisionError("a fault of ours")
        return handle(runner, event, **named)

    monkeypatch.setattr(Runner, "handle", faulty)

    async def main() -> None:
        shop = await bench.connected()
        job = (await bench.job(PROGRAM))["id"]
        view = await bench.status(job, "interrupted", "completed")
        await asyncio.sleep(60)
        assert (view["error"]["code"], view["error"]["line_from"]) == ("internal", view["progress"]["line"] + 1)
        assert view["error"]["line_to"] == len(bench.executed()), "nothing has gone out any more"
        await shop.stop()

    run_simulated(main())


def test_a_break_goes_on_while_its_fate_is_being_settled(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(speed_factor=0.05), options={"resume_within": 60.0})
        await bench.connected()
        job = await bench.job(PROGRAM)
        await until(lambda: len(bench.executed()) >= 3, within_s=60)
        bench.crash()
        shop = await bench.start()
        before = await shop.db.run(journal.alive_at, MACHINE)
        await asyncio.sleep(10)
        assert next(shop.machines[MACHINE].console(10)), "the machine says that it is still executing"
        assert await shop.db.run(journal.alive_at, MACHINE) == before
        assert (await shop.jobs.get(job["id"]))["status"] == "running"
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize(("seen", "every_s"), [(True, PROGRESS_EVERY_S), (False, PROGRESS_UNSEEN_S)])
def test_progress_is_told_a_few_times_a_second_and_every_change_of_status(
    tmp_path: Path, seen: bool, every_s: float
) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(instant=True), options={"elvinto": {"max_batch_blocks": 1}})
        shop = await bench.connected()
        if seen:
            shop.hub.subscribe(Filter())
        job = await bench.job("G90\n" + "".join(f"G1 X{i % 500} F6000\n" for i in range(3000)) + "M30\n")
        began = asyncio.get_running_loop().time()
        before = shop.hub.published["job"]
        await bench.status(job["id"], "completed")
        lasted_s = asyncio.get_running_loop().time() - began
        told = shop.hub.published["job"] - before
        assert max(2, lasted_s / every_s / 2) <= told <= lasted_s / every_s + 3
        await shop.stop()

    run_simulated(main())


def test_a_fault_writes_the_last_frames_into_the_history_once(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(PROGRAM)
        await until(lambda: len(bench.executed()) >= 3, within_s=60)
        bench.cable.pull()
        await bench.status(job["id"], "interrupted")
        events = await shop.jobs.events(job["id"])
        (frames,) = [event["data"]["frames"] for event in events if event["type"] == "frames"]
        assert any("GCODE" in frame["text"] for frame in frames)
        assert await shop.db.run(history.verify) is None
        await shop.stop()

    run_simulated(main())


def test_a_clock_that_was_set_back_proves_no_short_break(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        stream = shop.machines[MACHINE].stream
        assert stream.adopt_alive("2026-03-01T09:00:00.000Z") <= asyncio.get_running_loop().time()
        assert stream.adopt_alive("2026-03-02T09:00:00.000Z") == -float("inf")
        assert stream.adopt_alive(None) == -float("inf")
        await shop.stop()

    run_simulated(main())


def test_effects_keep_their_order_whatever_happens_while_they_are_carried_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    perform = JobStream._perform

    def watched(stream: JobStream, effect: Any) -> None:
        seen.append(effect)
        perform(stream, effect)

    monkeypatch.setattr(JobStream, "_perform", watched)

    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        job = await bench.job(PROGRAM)
        await bench.status(job["id"], "completed")
        done = [mark.line_done for mark in seen if hasattr(mark, "line_done") and not isinstance(mark, SetStatus)]
        assert done == sorted(done)
        statuses = [effect.after for effect in seen if isinstance(effect, SetStatus)]
        assert statuses == [Status.RUNNING, Status.COMPLETED]
        await shop.stop()

    run_simulated(main())


def test_what_follows_from_one_event_is_one_transaction(tmp_path: Path) -> None:
    """A daemon that died between the end of a batch and what it meant would go on after a tool change by itself, run
    what stands behind M30, or send again what the machine has refused."""
    found: list[tuple[Any, ...]] = []

    def look(db: Any) -> None:
        query = """
            select jobs.status, batches.status, batches.line_to from jobs join batches on batches.job = jobs.id
            where batches.status != 'planned' order by seq desc limit 1
        """
        found.extend(db.execute(query).fetchall())

    async def main() -> None:
        bench = Bench(tmp_path, SimSettings(tool_change="report"))
        shop = await bench.connected()
        posted = bench.databases[-1].post

        def post(fn: Any, *args: Any, **named: Any) -> None:
            posted(fn, *args, **named)
            posted(look)

        bench.databases[-1].post = post  # type: ignore[method-assign]
        job = await bench.job("G90\nG1 X1 F600\nT2 M6\nG1 X2\nM30\nG1 X99 F600\n")
        await bench.status(job["id"], "waiting")
        assert ("running", "ok", 3) not in found, "the tool change was done and nobody asked for the tool"
        await shop.machines[MACHINE].confirm_tool()
        await bench.status(job["id"], "completed")
        assert ("running", "ok", 5) not in found, "the program had ended and the job had not"
        assert found.count(("waiting", "ok", 3)) >= 1
        failed = await bench.job("G90\nG1 X1 F600\nG1 X2\nM30\n")
        bench.machine.press_emergency(asyncio.get_running_loop().time())
        bench.cable.touch()
        await bench.status(failed["id"], "failed")
        await asyncio.sleep(1)
        assert ("running", "failed", 3) not in found
        await shop.stop()

    run_simulated(main())


def test_a_program_that_has_ended_is_completed_also_where_a_pause_was_demanded(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()

        def pause(block: Any) -> None:
            if block.text == "M30":
                shop.machines[MACHINE].pause()

        bench.machine._on_block = pause
        job = await bench.job("G90\nG1 X1 F600\nM30\nG1 X99 F600\n")
        await bench.status(job["id"], "completed", within_s=30)
        assert bench.executed()[-1] == "M30"
        await shop.stop()

    run_simulated(main())
