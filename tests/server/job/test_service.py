"""The queue for the API: what is refused, what is ordered, and what does not start by itself."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from server.machine.controller import Controller
from server.problems import ProblemError
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench, one_chunk

PROGRAM = "G90\nG1 X1 F600\nG1 X2\nG1 X3\nM30\n"


def told(folder: Path, story: Callable[[Bench], Awaitable[None]], **options: Any) -> None:
    async def main() -> None:
        bench = Bench(folder, options=options)
        await bench.connected()
        await story(bench)
        assert bench.shop is not None
        await bench.shop.stop()

    run_simulated(main())


async def refusal(work: Awaitable[Any]) -> ProblemError:
    with pytest.raises(ProblemError) as refused:
        await work
    return refused.value


async def program(bench: Bench, text: str = PROGRAM) -> str:
    assert bench.shop is not None
    stored, _ = await bench.shop.programs.store(one_chunk(text.encode()), "part.nc")
    return str(stored["id"])


def test_what_does_not_exist(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        id = await program(bench)
        assert (await refusal(jobs.create(id, "nobody"))).code == "unknown_machine"
        assert (await refusal(jobs.create("f" * 64, MACHINE))).code == "unknown_program"
        for work in (jobs.get(7), jobs.pause(7), jobs.batches(7), jobs.events(7), jobs.report(7), jobs.recover(7)):
            assert (await refusal(work)).code == "unknown_job"
        assert (await refusal(jobs.list(None, "sleeping", 10, None))).code == "invalid_request"

    told(tmp_path, story)


@pytest.mark.parametrize(("first", "last"), [(6, None), (1, 6), (3, 2), (0, 9)])
def test_lines_that_are_not_there(tmp_path: Path, first: int, last: int | None) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        work = jobs.create(await program(bench), MACHINE, start_line=first, end_line=last, force=True)
        assert (await refusal(work)).code == "invalid_request"

    told(tmp_path, story)


def test_a_program_without_blocks(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        id = await program(bench, "(nothing)\n")
        assert (await refusal(jobs.create(id, MACHINE, force=True))).code == "empty_program"

    told(tmp_path, story)


def test_a_part_of_a_program_gets_its_modal_state_first(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        job = await bench.job(PROGRAM, start_line=3, end_line=4)
        view = await bench.status(job["id"], "completed")
        assert bench.executed() == ["G90", "G1", "F600", "X2", "X3"]
        assert view["progress"]["line"] == 4
        assert view["progress"]["acknowledged_lines"] == 2
        events = await bench.shop.jobs.events(job["id"])  # type: ignore[union-attr]
        assert "prologue" in [event["type"] for event in events]

    told(tmp_path, story)


def test_queued_jobs_can_be_moved_held_released_and_cancelled(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        shop = bench.shop
        assert shop is not None
        jobs = shop.jobs
        running = await bench.job(PROGRAM)
        ids = [(await bench.job(PROGRAM))["id"] for _ in range(3)]
        assert shop.machines[MACHINE].view()["queue_length"] == 3
        await jobs.move(ids[2], 1)
        assert (await jobs.pause(ids[0]))["hold"] is True
        assert (await jobs.cancel(ids[1]))["status"] == "cancelled"
        assert shop.machines[MACHINE].view()["queue_length"] == 2
        assert (await refusal(jobs.cancel(ids[1]))).code == "wrong_state"
        assert (await refusal(jobs.move(running["id"], 1))).code == "wrong_state"
        await bench.status(ids[2], "completed")
        assert (await jobs.get(ids[0]))["status"] == "queued"
        assert (await jobs.resume(ids[0]))["status"] == "running"
        await bench.status(ids[0], "completed")
        assert await jobs.counts() == {"completed": 3, "cancelled": 1}
        assert [job["id"] for job in await jobs.list(MACHINE, "completed, cancelled", 2, None)] == [4, 3]

    told(tmp_path, story)


def test_a_held_job_is_not_released_for_a_machine_that_cannot_take_it(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        job = await bench.job(PROGRAM, hold=True)
        bench.cable.pull()
        assert (await refusal(jobs.resume(job["id"]))).code == "not_connected"
        assert (await jobs.get(job["id"]))["hold"] is True

    told(tmp_path, story)


def test_rerun_is_a_new_job_of_the_same(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        first = await bench.job(PROGRAM, note="blue", end_line=3)
        await bench.status(first["id"], "completed")
        again = await jobs.rerun(first["id"])
        assert (again["id"], again["rerun_of"], again["note"], again["end_line"]) == (2, 1, "blue", 3)
        await bench.status(again["id"], "completed")

    told(tmp_path, story)


def test_a_queue_has_an_end(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        jobs._queue_limit = 2
        for _ in range(2):
            await bench.job(PROGRAM, hold=True)
        assert (await refusal(bench.job(PROGRAM, hold=True))).code == "queue_full"

    told(tmp_path, story)


def test_a_failed_job_puts_the_queue_on_hold(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        shop = bench.shop
        assert shop is not None
        first, second = await bench.job(PROGRAM), await bench.job(PROGRAM)
        await until(lambda: len(bench.executed()) > 1, within_s=10)
        shop.machines[MACHINE].estop()
        await bench.status(first["id"], "failed")
        await until(lambda: not shop.jobs._background._tasks, within_s=10)
        assert (await shop.jobs.get(second["id"]))["hold"] is True

    told(tmp_path, story)


def test_a_report_sums_up(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        job = await bench.job(PROGRAM)
        await bench.status(job["id"], "completed")
        report = await jobs.report(job["id"])
        assert (report["job"]["status"], report["blocks"], report["doubtful"]) == ("completed", 5, [])

    told(tmp_path, story)


def test_announcements_of_a_queue(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        shop = bench.shop
        assert shop is not None
        before = dict(shop.hub.published)
        await bench.job(PROGRAM, hold=True)
        assert shop.hub.published["queue"] > before.get("queue", 0)
        assert shop.hub.published["job"] > before.get("job", 0)

    told(tmp_path, story)


def slowed(bench: Bench, seconds: float) -> None:
    """The database answers like a thread would: later, and what others asked meanwhile comes in between."""
    db = bench.databases[-1]
    at_once = db.run

    async def run(*args: Any, **kwargs: Any) -> Any:
        await asyncio.sleep(seconds)
        result = await at_once(*args, **kwargs)
        await asyncio.sleep(seconds)
        return result

    db.run = run  # type: ignore[method-assign]


@pytest.mark.parametrize("after_steps", range(9))
@pytest.mark.parametrize("verb", ["cancel", "pause"])
def test_a_job_that_begins_at_the_very_moment_when_it_is_taken_back(
    tmp_path: Path, verb: str, after_steps: int
) -> None:
    async def story(bench: Bench) -> None:
        jobs = bench.shop.jobs  # type: ignore[union-attr]
        job = await bench.job(PROGRAM, hold=True)
        slowed(bench, 0.01)
        going = asyncio.ensure_future(jobs.resume(job["id"]))
        await asyncio.sleep(0.01 * after_steps + 0.005)
        try:
            await getattr(jobs, verb)(job["id"])
            obeyed = True
        except ProblemError as problem:
            assert problem.code == "wrong_state"  # noqa: PT017 - either answer will do, if it is true
            obeyed = False
        with contextlib.suppress(ProblemError):
            await going
        await asyncio.sleep(1.0)
        view = await jobs.get(job["id"])
        if obeyed:
            assert view["status"] in {"cancel": ("cancelled",), "pause": ("queued", "paused")}[verb]
            assert bench.executed() == []
        if view["status"] in ("queued", "paused"):
            await jobs.cancel(job["id"])
        # The machine and the database are there for the next one.
        following = await bench.job(PROGRAM)
        await bench.status(following["id"], "completed")

    told(tmp_path, story)


def pressed(controller: Controller, verb: str) -> None:
    """Whatever the answer is."""
    with contextlib.suppress(ProblemError):
        getattr(controller, verb)()


@pytest.mark.parametrize("verb", ["stop", "pause", "estop"])
def test_whoever_stops_between_two_jobs_stops_the_second(tmp_path: Path, verb: str) -> None:
    async def story(bench: Bench) -> None:
        controller = bench.shop.machines[MACHINE]  # type: ignore[union-attr]
        await bench.job(PROGRAM)
        second = await bench.job(PROGRAM)
        assert (second["status"], second["hold"]) == ("queued", False)
        slowed(bench, 0.2)
        await until(lambda: controller.stream.active_job is None, within_s=60)
        before = bench.executed()
        pressed(controller, verb)
        await asyncio.sleep(60)
        assert bench.executed() == before
        view = await bench.shop.jobs.get(second["id"])  # type: ignore[union-attr]
        assert (view["status"], view["hold"]) == ("queued", True)

    told(tmp_path, story)


@pytest.mark.parametrize("after_s", [0.3 * step for step in range(9)])
@pytest.mark.parametrize("verb", ["stop", "pause"])
def test_whoever_stops_while_a_job_is_made_keeps_it_from_beginning(tmp_path: Path, verb: str, after_s: float) -> None:
    async def story(bench: Bench) -> None:
        controller = bench.shop.machines[MACHINE]  # type: ignore[union-attr]
        stored = await program(bench)
        slowed(bench, 0.2)
        making = asyncio.ensure_future(bench.shop.jobs.create(stored, MACHINE, force=True))  # type: ignore[union-attr]
        await asyncio.sleep(after_s + 0.1)
        if bench.executed():
            return  # it has begun, and this is an ordinary stop
        pressed(controller, verb)
        job = await making
        await asyncio.sleep(60)
        assert bench.executed() == []
        # What was wanted can be asked for again.
        if (await bench.shop.jobs.get(job["id"]))["status"] == "queued":  # type: ignore[union-attr]
            await bench.shop.jobs.resume(job["id"])  # type: ignore[union-attr]
            await bench.status(job["id"], "completed")

    told(tmp_path, story)


def test_a_pause_in_the_last_block_of_a_job_keeps_the_next_one_from_beginning(tmp_path: Path) -> None:
    async def story(bench: Bench) -> None:
        controller = bench.shop.machines[MACHINE]  # type: ignore[union-attr]
        first, second = await bench.job(PROGRAM), await bench.job(PROGRAM)

        def is_at_its_end() -> bool:
            runner = controller.stream.runner
            return runner is not None and any(flight.entry.batch.ends_program for flight in runner.flights)

        await until(is_at_its_end, within_s=60, step_s=0.001)
        controller.pause()
        await bench.status(first["id"], "completed")
        before = bench.executed()
        await asyncio.sleep(60)
        assert bench.executed() == before
        view = await bench.shop.jobs.get(second["id"])  # type: ignore[union-attr]
        assert (view["status"], view["hold"]) == ("queued", True)

    told(tmp_path, story)
