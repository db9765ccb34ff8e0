"""A job's next step waits for its turn while the machine has something to do; lines are read beside the loop."""

import asyncio
from collections.abc import Callable
from typing import Any

from jobs.feed import Feed
from jobs.job import Status
from jobs.runner import Runner
from server.background.worker import InlineWorker
from server.machine.turns import Turns
from tests.harness.fakes import ListSource, batch
from tests.harness.simloop import run_simulated


class SlowWorker(InlineWorker):
    """A disk that takes a second."""

    async def run(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        await asyncio.sleep(1.0)
        return fn(*args, **kwargs)


def runner(source: ListSource, *, at_work: bool) -> Runner:
    made = Runner(1, 10.0, Feed(source))
    made.begin()
    if at_work:
        made.advance(1000, free=True)
        made.feed.journaled(1, 1000)
        made.advance(1000, free=True)
        assert made.ledger.open
    return made


def test_a_machine_that_stands_still_gets_everything_at_once() -> None:
    async def main() -> None:
        job = runner(ListSource([batch(1)]), at_work=False)
        turns = Turns(asyncio.get_running_loop(), InlineWorker(), lambda: None)
        assert [turns.admits(job, 1000, 1) for _ in range(3)] == [True] * 3
        assert not turns.pending

    run_simulated(main())


def test_one_at_work_takes_one_step_in_a_turn_and_has_no_turn_for_nothing() -> None:
    async def main() -> None:
        job = runner(ListSource([batch(1), batch(3)]), at_work=True)
        admitted: list[list[bool]] = []
        turns = Turns(
            asyncio.get_running_loop(),
            InlineWorker(),
            lambda: admitted.append([turns.admits(job, 1001, 1) for _ in range(2)]),
        )
        assert not turns.admits(job, 1001, 1)
        assert turns.pending
        assert not turns.admits(job, 1001, 1)
        await asyncio.sleep(0)
        assert admitted == [[True, False]]
        await asyncio.sleep(0)
        assert admitted == [[True, False]] * 2, "the step that was asked for in the turn has one of its own"
        job.advance(1001, free=True)  # planned and to be written down: nothing can be done now
        await asyncio.sleep(0)
        assert not turns.admits(job, 1001, 0)
        assert not turns.pending

    run_simulated(main())


class Faulty(ListSource):
    def read(self) -> None:
        raise ZeroDivisionError("a fault of ours")


def test_a_reading_that_fails_unexpectedly_ends_the_job_when_what_is_open_has_ended() -> None:
    async def main() -> None:
        source = Faulty([batch(1)])
        job = runner(source, at_work=True)
        source.reading = True
        went: list[bool] = []
        turns = Turns(asyncio.get_running_loop(), InlineWorker(), lambda: went.append(True))
        turns.read_for(job)
        await asyncio.sleep(1)
        assert went == [True]
        assert not turns.pending
        assert job.status is Status.RUNNING, "a batch is with the machine"
        assert job.feed.end is not None
        assert (job.feed.end.status, job.feed.end.code) == (Status.FAILED, "internal")
        assert "ZeroDivisionError" in job.feed.end.message
        turns.read_for(job)
        assert not turns.pending, "it is not tried again and again"

    run_simulated(main())


def test_lines_are_read_once_and_the_job_goes_on_behind_that() -> None:
    async def main() -> None:
        source = ListSource([])
        source.reading = True
        job = runner(source, at_work=False)
        went: list[float] = []
        loop = asyncio.get_running_loop()
        turns = Turns(loop, SlowWorker(), lambda: went.append(loop.time()))
        began_s = loop.time()
        turns.read_for(job)
        turns.read_for(job)
        assert turns.pending
        await asyncio.sleep(2.5)
        assert [at - began_s for at in went] == [1.0]
        turns.read_for(job)
        assert (source.reading, turns.pending) == (False, False), "there is nothing to read any more"

    run_simulated(main())
