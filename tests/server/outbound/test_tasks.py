"""Tasks end although a cancellation was swallowed, and what they raise concerns nobody."""

import asyncio

from server.outbound.tasks import ASKED_AGAIN_S, end
from tests.harness.simloop import run_simulated


def test_a_task_that_swallows_a_cancellation_is_asked_again() -> None:
    async def deaf(times: int) -> None:
        for _ in range(times):
            try:
                await asyncio.sleep(1000)
            except asyncio.CancelledError:
                continue
        raise ValueError

    async def main() -> None:
        loop = asyncio.get_running_loop()
        tasks = [asyncio.create_task(deaf(times)) for times in (1, 3)]
        await asyncio.sleep(0)
        await end(tasks)
        assert all(task.done() for task in tasks)
        assert loop.time() <= 4 * ASKED_AGAIN_S
        await end(tasks)
        await end([])

    run_simulated(main())
