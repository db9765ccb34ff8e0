"""A pause, a stop and an e-stop while the program of a job is read, on every protocol: not a byte of it goes out."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from jobs import store
from server.app import Workshop
from server.background.worker import InlineWorker
from server.config.reentry import ReentryWish
from server.job.service import JobService
from server.machine.controller import Controller
from server.problems import ProblemError
from tests.harness.grblworkshop import GrblBench
from tests.harness.ncworkshop import HERE, NcBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

MILL = "G21 G90\nG1 X1 F600\nG1 X2\nM30\n"
LATHE = "G21 G90\nG1 X1 F200\nG1 X2\nM30\n"
CLEARANCE = {"reentry": {"clearance": 5.0}}

Story = Callable[[Bench, Workshop, Controller], Awaitable[None]]


def bench_of(protocol: str, folder: Path) -> Bench:
    match protocol:
        case "grbl":
            return GrblBench(folder, latency_s=0.01, options=CLEARANCE)
        case "ncframe":
            return NcBench(folder, latency_s=0.01)
        case _:
            return Bench(folder, latency_s=0.01)


def on_each(story: Story) -> Any:
    """The test of a story, with each protocol."""

    @pytest.mark.parametrize("protocol", ["elvinto", "grbl", "ncframe"])
    def test(tmp_path: Path, protocol: str) -> None:
        async def main() -> None:
            bench = bench_of(protocol, tmp_path)
            shop = await bench.connected()
            if protocol == "ncframe":
                assert (await shop.machines[MACHINE].run_blocks([HERE]))[0]["ok"]
            await story(bench, shop, shop.machines[MACHINE])
            await shop.stop()

        run_simulated(main())

    return test


class SlowReader(InlineWorker):
    """Reads a program in half a second."""

    async def run(self, fn: Any, *args: Any, **kwargs: Any) -> Any:
        await asyncio.sleep(0.5)
        return fn(*args, **kwargs)


async def checked(bench: Bench, controller: Controller) -> tuple[int, asyncio.Task[Any]]:
    """A job whose program is being read: its id, and the request that queues it, which has no answer yet."""
    assert bench.shop is not None
    bench.shop.jobs._starter.worker = SlowReader()
    request = asyncio.create_task(bench.job(program_for(bench)))
    await until(lambda: controller.stream.beginning.reserved is not None, within_s=1.0)
    job = controller.stream.beginning.reserved
    assert job is not None
    assert (await bench.shop.jobs.get(job))["status"] == "checking"
    return job, request


def program_for(bench: Bench) -> str:
    return LATHE if isinstance(bench, NcBench) else MILL


async def _paused(bench: Bench, shop: Workshop, controller: Controller) -> None:
    before = bench.executed()
    job, request = await checked(bench, controller)
    answer = await shop.jobs.pause(job)
    assert answer["hold"] is True
    queued = await request
    assert (queued["status"], queued["hold"]) == ("paused", True)
    await asyncio.sleep(30)
    assert bench.executed() == before, "it stands before its first line"
    view = await shop.jobs.get(job)
    assert (view["status"], view["progress"]["sent_line"], view["started_at"]) == ("paused", 0, None)
    kinds = [event["type"] for event in await shop.jobs.events(job)]
    assert kinds.count("pause_demanded") == 1
    controller.resume()
    view = await bench.status(job, "completed")
    assert len(bench.executed()) > len(before)
    assert view["hold"] is False


async def _taken_back(bench: Bench, shop: Workshop, controller: Controller) -> None:
    job, request = await checked(bench, controller)
    controller.pause()
    controller.pause()
    controller.resume()
    assert (await request)["hold"] is False
    await bench.status(job, "completed")
    kinds = [event["type"] for event in await shop.jobs.events(job)]
    assert (kinds.count("pause_demanded"), kinds.count("resumed")) == (1, 1)


async def _stopped(bench: Bench, shop: Workshop, controller: Controller) -> None:
    before = bench.executed()
    job, request = await checked(bench, controller)
    await shop.jobs.pause(job)
    answer = await shop.jobs.cancel(job)
    assert answer["cancelling"] is True or answer["status"] == "cancelled"
    assert (await request)["status"] == "cancelled"
    with pytest.raises(ProblemError, match="no running job"):
        controller.pause()
    await asyncio.sleep(30)
    assert bench.executed() == before


async def _next_in_line(bench: Bench, shop: Workshop, controller: Controller) -> None:
    """The pause comes before the job has left the queue: no other job begins in its place."""
    before, beginning = bench.executed(), controller.stream.beginning
    waiting = [await bench.job(program_for(bench), hold=True) for _ in range(2)]
    for job in waiting:
        shop.db.post(store.set_hold, job["id"], False)
    reserve = beginning.reserve

    def reserve_and_pause(job: int) -> None:
        reserve(job)
        controller.pause()

    beginning.reserve = reserve_and_pause  # type: ignore[method-assign]
    await shop.jobs.start_next(MACHINE, shop.machines[MACHINE].stream.beginning.halts)
    await asyncio.sleep(30)
    assert bench.executed() == before
    views = await shop.jobs.list(MACHINE, None, 10, None)
    assert [(view["status"], view["hold"]) for view in views] == [("queued", True), ("queued", True)]


test_a_pause_holds_the_job_before_its_first_byte = on_each(_paused)
test_a_pause_can_be_taken_back = on_each(_taken_back)
test_a_stop_behind_a_pause_ends_it = on_each(_stopped)
test_a_pause_in_the_moment_of_choosing_lets_no_other_job_begin = on_each(_next_in_line)


def test_what_is_heard_of_a_pause_while_checking(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01)
        shop = await bench.connected()
        seen: list[tuple[str, bool]] = []
        publish = shop.hub.publish

        def listen(kind: str, machine: str | None, data: Any) -> int:
            if kind == "job":
                seen.append((data["status"], data["hold"]))
            return publish(kind, machine, data)

        shop.hub.publish = listen  # type: ignore[method-assign, assignment]
        job, request = await checked(bench, shop.machines[MACHINE])
        shop.machines[MACHINE].pause()
        await request
        assert ("checking", True) in seen
        assert ("running", False) not in seen
        assert seen[-1] == ("paused", True)
        await shop.jobs.cancel(job)
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("resumed", [False, True])
def test_a_job_that_is_taken_up_again_can_be_paused_while_it_is_read(tmp_path: Path, resumed: bool) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01, options=CLEARANCE)
        shop = await bench.connected()
        controller, jobs = shop.machines[MACHINE], shop.jobs
        job, request = await taken_up(bench, controller)
        before = bench.executed()
        answer = await jobs.pause(job)
        assert (answer["status"], answer["hold"]) == ("interrupted", True)
        if resumed:
            controller.resume()
        view = await request
        assert (view["status"], view["hold"]) == (("running", False) if resumed else ("paused", True))
        await asyncio.sleep(20)
        assert (bench.executed() == before) is not resumed
        if not resumed:
            await jobs.resume(job)
        await bench.status(job, "completed")
        await shop.stop()

    run_simulated(main())


def test_a_job_that_is_cancelled_while_it_is_taken_up_has_ended_and_the_request_says_so(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01, options=CLEARANCE)
        shop = await bench.connected()
        job, request = await taken_up(bench, shop.machines[MACHINE])
        before = bench.executed()
        shop.machines[MACHINE].stop()
        with pytest.raises(ProblemError, match=f"Job {job} has ended meanwhile"):
            await request
        await bench.status(job, "cancelled")
        assert bench.executed() == before
        await shop.stop()

    run_simulated(main())


async def taken_up(bench: GrblBench, controller: Controller) -> tuple[int, asyncio.Task[dict[str, Any]]]:
    """A job that was interrupted and whose program is read again: its id, and the request, which has no answer yet."""
    assert bench.shop is not None
    jobs = bench.shop.jobs
    moves = "\n".join(f"G1 X{i / 10:.1f} F600" for i in range(1, 60))
    job = (await bench.job(f"G21 G90 G94\n{moves}\nM30\n"))["id"]
    await until(lambda: controller.state.status == "run", within_s=10.0)
    bench.cable.pull()
    bench.cable.plugged = True
    await until(lambda: controller.link_status == "connected", within_s=60.0)
    await until(lambda: controller.state.status == "idle", within_s=60.0)
    jobs._starter.worker = SlowReader()
    request = asyncio.create_task(recover(jobs, job))
    await until(lambda: controller.stream.beginning.wanted, within_s=1.0, step_s=0.001)
    await asyncio.sleep(0.05)
    return job, request


Deed = Callable[[Controller], Awaitable[object]]


async def _stops(controller: Controller) -> None:
    controller.estop()
    await asyncio.sleep(0.2)
    await controller.unlock()


DEEDS: dict[str, Deed] = {
    "an emergency stop that is reset already": _stops,
    "a reset": lambda controller: controller.reset(),
    "a jog": lambda controller: controller.jog({"x": 0.01}, 6000),
    "an origin": lambda controller: controller.run_blocks(["G92 X5"]),
}


@pytest.mark.parametrize("deed", DEEDS)
def test_what_happens_to_the_machine_while_a_job_is_taken_up_ends_that(tmp_path: Path, deed: str) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01, options=CLEARANCE)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        job, request = await taken_up(bench, controller)
        before = len(bench.executed())
        await DEEDS[deed](controller)
        await until(
            lambda: controller.state.status == "idle" and not controller.manual.busy, within_s=1.0, step_s=0.001
        )
        assert not request.done()
        with pytest.raises(ProblemError, match="used by hand while the program was read"):
            await request
        await asyncio.sleep(20)
        assert bench.executed()[before:] in ([], ["G92X5"])
        assert (await shop.jobs.get(job))["status"] == "interrupted"
        await shop.stop()

    run_simulated(main())


def test_a_pause_holds_what_is_moved_by_hand_while_a_job_is_taken_up(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01, options=CLEARANCE)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        _, request = await taken_up(bench, controller)
        by_hand = asyncio.create_task(controller.run_blocks(["G21 G91 G1 X50 F600"]))
        await until(lambda: controller.state.status == "run", within_s=0.4, step_s=0.01)
        controller.pause()
        await until(lambda: controller.state.status == "hold", within_s=1.0, step_s=0.01)
        with pytest.raises(ProblemError):
            await request
        by_hand.cancel()
        await shop.stop()

    run_simulated(main())


def test_behind_a_stop_while_checking_the_queue_waits(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01)
        shop = await bench.connected()
        controller, before = shop.machines[MACHINE], bench.executed()
        _, request = await checked(bench, controller)
        behind = asyncio.create_task(bench.job(MILL))
        await until(lambda: controller.queue_length() == 1, within_s=0.4, step_s=0.01)
        controller.estop()
        assert ((await request)["status"], (await behind)["status"]) == ("cancelled", "queued")
        await controller.unlock()
        await bench.job(MILL, hold=True)
        await asyncio.sleep(10)
        assert bench.executed() == before
        assert (await shop.jobs.get((await behind)["id"]))["hold"] is True
        await shop.stop()

    run_simulated(main())


def test_a_job_is_not_begun_on_what_was_before_a_reset(tmp_path: Path) -> None:
    async def main() -> None:
        bench = GrblBench(tmp_path, latency_s=0.01)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        await controller.run_blocks(["G92 X5"])
        before = bench.executed()
        _, request = await checked(bench, controller)
        await asyncio.sleep(0.2)
        await controller.reset()
        view = await request
        assert (view["status"], view["hold"]) == ("queued", True)
        await asyncio.sleep(10)
        assert bench.executed() == before
        await shop.stop()

    run_simulated(main())


async def recover(jobs: JobService, job: int) -> dict[str, Any]:
    return await jobs.recover(job, "from_line", None, ReentryWish(force=True, operator_done=True))
