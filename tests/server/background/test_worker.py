"""Work done elsewhere."""

import asyncio
import threading

import pytest

from server.background.worker import InlineWorker, ThreadWorker, Worker
from tests.harness.simloop import run_simulated


async def answers_and_errors_come_back(worker: Worker) -> None:
    assert await worker.run(max, 3, 7) == 7
    assert await worker.run(int, "ff", base=16) == 255
    with pytest.raises(ZeroDivisionError):
        await worker.run(lambda: 1 // 0)
    worker.close()


@pytest.mark.real
def test_in_a_thread() -> None:
    async def main() -> None:
        worker = ThreadWorker("test")
        assert await worker.run(threading.get_ident) != threading.get_ident()
        await answers_and_errors_come_back(worker)

    asyncio.run(main())


@pytest.mark.real
def test_what_comes_after_the_end_is_cancelled_and_no_error_of_the_work() -> None:
    async def main() -> None:
        worker = ThreadWorker("test")
        worker.close()
        with pytest.raises(asyncio.CancelledError):
            await worker.run(max, 3, 7)

    asyncio.run(main())


def test_at_once() -> None:
    run_simulated(answers_and_errors_come_back(InlineWorker()))
