"""Many WebSocket readers in one process of their own: `python -m bench.grblreaders URL COUNT TOPICS`.

It prints `ready` when all of them are connected and, when its standard input ends, how many messages came. The one
rule: they only read, as dashboards do that are left open.
"""

import asyncio
import sys

from websockets.asyncio.client import connect


async def read(url: str, count: int, topics: str) -> int:
    """Messages of all readers."""
    ready = asyncio.Semaphore(0)
    came = 0

    async def one() -> None:
        nonlocal came
        async with connect(f"{url}/events?topics={topics}", open_timeout=60, compression=None) as socket:
            ready.release()
            async for _ in socket:
                came += 1

    tasks = [asyncio.create_task(one()) for _ in range(count)]
    for _ in tasks:
        await ready.acquire()
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return came


if __name__ == "__main__":
    print(asyncio.run(read(sys.argv[1], int(sys.argv[2]), sys.argv[3])), flush=True)
