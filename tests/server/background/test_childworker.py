"""A process that computes: answers, errors, its end, and that it takes nothing along."""

import asyncio
import os
import pickle
import subprocess
import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from gcode.motion import Motion
from jobs.batch import BatchLimits
from jobs.expansion import ExpandError, TooLargeError
from jobs.program import ProgramStore, UnknownProgramError
from server.background import childworker
from server.background.child import answered, opened
from server.background.childworker import LARGE_BYTES, BySize, ChildEndedError, ChildWorker
from server.background.worker import ThreadWorker
from server.job.estimates import measured
from server.problems import ProblemError
from server.programs.plans import Planning
from server.programs.toolpaths import Drawer, Reader
from server.programs.workpiece import Workpiece
from tests.harness.programs import elvinto

pytestmark = pytest.mark.real


def worked(story: Callable[[ChildWorker], Awaitable[None]], *, idle_s: float = 30.0) -> None:
    async def main() -> None:
        worker = ChildWorker("test", idle_s=idle_s)
        try:
            async with asyncio.timeout(60):
                await story(worker)
        finally:
            worker.close()

    asyncio.run(main())


def refused(number: int) -> None:
    raise ERRORS[number]


def alive(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and stat.read_text().rpartition(")")[2].split()[0] != "Z"


ERRORS = [
    UnknownProgramError("abc"),
    ExpandError(3, 4, "too_long", "It has no end."),
    TooLargeError("more than 5 bytes"),
    ProblemError("no_preview", "It is too long.", limit=5),
    OSError(28, "No space left on device"),
]


def test_results_and_errors_come_back_and_it_ends_with_the_worker() -> None:
    pids: list[int] = []

    async def story(worker: ChildWorker) -> None:
        assert worker.pid is None, "nobody has asked for anything"
        assert await worker.run(divmod, 17, 5) == (3, 2)
        assert await worker.run(os.getpid) == worker.pid != os.getpid()
        assert await worker.run(print, "what is said here is not an answer") is None
        for number, error in enumerate(ERRORS):
            with pytest.raises(type(error)) as raised:
                await worker.run(refused, number)
            assert (raised.value.args, vars(raised.value)) == (error.args, vars(error))
        assert await asyncio.gather(*(worker.run(pow, 2, n) for n in range(5))) == [1, 2, 4, 8, 16]
        assert worker.pid is not None
        pids.append(worker.pid)

    worked(story)
    assert not alive(pids[0])


def test_one_that_was_killed_is_told_and_the_next_one_works() -> None:
    async def story(worker: ChildWorker) -> None:
        with pytest.raises(ChildEndedError, match="ended with 9"):
            await worker.run(os._exit, 9)
        assert await worker.run(abs, -1) == 1
        before = worker.pid
        assert before is not None
        os.kill(before, 9)
        while alive(before):
            await asyncio.sleep(0.01)
        assert await worker.run(abs, -2) == 2
        assert worker.pid != before

    worked(story)


def test_without_work_it_ends_and_comes_again() -> None:
    async def story(worker: ChildWorker) -> None:
        assert await worker.run(abs, -1) == 1
        while worker.pid is not None:
            await asyncio.sleep(0.01)
        assert await worker.run(abs, -2) == 2

    worked(story, idle_s=0.01)


def test_what_has_begun_ends_with_the_worker() -> None:
    async def main() -> None:
        worker = ChildWorker("test")
        await worker.run(abs, -1)
        working = asyncio.ensure_future(worker.run(time.sleep, 60))
        await asyncio.sleep(0.1)
        began, pid = time.monotonic(), worker.pid
        worker.close()
        with pytest.raises(ChildEndedError):
            await working
        assert time.monotonic() - began < 30
        assert pid is not None
        assert not alive(pid)

    asyncio.run(main())


def test_one_that_begins_while_the_worker_is_closed_ends_too(monkeypatch: pytest.MonkeyPatch) -> None:
    begin, about_to, closed = childworker._begun, threading.Event(), threading.Event()

    def late() -> "subprocess.Popen[bytes]":
        about_to.set()
        closed.wait(10)
        return begin()

    monkeypatch.setattr(childworker, "_begun", late)

    async def story(worker: ChildWorker) -> None:
        work = asyncio.create_task(worker.run(time.sleep, 60))
        await asyncio.to_thread(about_to.wait, 10)
        worker.close()
        closed.set()
        async with asyncio.timeout(10):
            with pytest.raises(ChildEndedError):
                await work
        assert worker.pid is None

    worked(story)


def test_what_is_handed_over_in_earnest_comes_back_as_from_here(tmp_path: Path) -> None:
    store = ProgramStore(tmp_path)
    with store.writer("part.nc") as writer:
        writer.write(b"G21 G90\nG0 X1 Y1\nG1 X50 F600\nG2 X60 Y11 I0 J10\nM30\n")
        program = writer.finish().id
    planning, piece = Planning(store), Workpiece(elvinto(), Motion(), BatchLimits(), True, False, "utf-8")

    async def story(worker: ChildWorker) -> None:
        report = await worker.run(planning.check, piece, program)
        assert report == planning.check(piece, program)
        timeline = await worker.run(measured, store, piece, program, 5)
        assert pickle.dumps(timeline) == pickle.dumps(measured(store, piece, program, 5))
        drawer, path = Drawer(store, planning.motion_of), store.beside(program, ".elvinto.x.toolpath")
        await worker.run(drawer.make, path, program, Reader(piece.profile))
        there = path.read_bytes()
        drawer.make(path, program, Reader(piece.profile))
        assert path.read_bytes() == there

    worked(story)


def test_an_answer_that_no_pickle_takes_is_an_error() -> None:
    for request in (pickle.dumps((eval, ("lambda: 0",), {})), b"nonsense"):
        with pytest.raises((pickle.PickleError, AttributeError)):
            opened(answered(request))
    with pytest.raises(RuntimeError, match="ValueError"):
        opened(answered(pickle.dumps((exec, ("raise ValueError(lambda: 0)", {}), {}))))


def test_small_programs_have_no_process() -> None:
    worker = BySize("test")
    assert isinstance(worker.for_bytes(LARGE_BYTES - 1), ThreadWorker)
    assert isinstance(worker.for_bytes(LARGE_BYTES), ChildWorker)
    assert asyncio.run(worker.run(abs, -1)) == 1
    worker.close()
