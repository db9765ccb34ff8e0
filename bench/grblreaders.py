"""Many WebSocket readers in one process of their own: `python -m bench.grblreaders URL COUNT TOPICS [RATE]`.

It prints `ready` when all of them are connected and, when its standard input ends, how many messages came and in how
many seconds. The one rule: they only read, as dashboards do that are left open, with the time that the others leave.
"""

import asyncio
import sys
import time

from websockets.asyncio.client import connect

from bench.loadclients import polite


async def read(url: str, count: int, topics: str, rate_hz: float = 20.0) -> tuple[int, float]:
    """Messages of all readers, and seconds."""
    ready = asyncio.Semaphore(0)
    came = 0

    async def one() -> None:
        nonlocal came
        address = f"{url}/events?topics={topics}&rate={rate_hz:g}"
        async with connect(address, open_timeout=60, compression=None) as socket:
            ready.release()
            async for _ in socket:
                came += 1

    tasks = [asyncio.create_task(one()) for _ in range(count)]
    for _ in tasks:
        await ready.acquire()
    began_s, before = time.monotonic(), came
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return came - before, time.monotonic() - began_s


if __name__ == "__main__":
    polite()
    print(*asyncio.run(read(sys.argv[1], int(sys.argv[2]), sys.argv[3], *map(float, sys.argv[4:]))), flush=True)
