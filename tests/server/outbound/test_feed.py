"""What the parts that tell others read: everything once, the newest state, and a part that is slow is cut and told."""

import asyncio
from contextlib import aclosing
from typing import Any

import pytest

from server.live.hub import Hub
from server.live.subscription import QUEUE_LIMIT
from server.live.textframe import text_frame
from server.outbound.feed import Feed, Notice, texts
from tests.harness.simloop import LoopClock, run_simulated

STANDING = Notice("state", "router", "t", {"status": "idle"}, fresh=True)


def hub() -> Hub:
    return Hub(clock=LoopClock(asyncio.get_running_loop()).now)


async def some(feed: Feed, count: int) -> list[Notice]:
    found: list[Notice] = []
    async with aclosing(aiter(feed)) as notices:  # type: ignore[type-var]
        async for notice in notices:
            found.append(notice)
            if len(found) == count:
                break
    return found


@pytest.mark.parametrize("length", [0, 1, 125, 126, 127, 65535, 65536, 70000])
def test_frames_of_every_length_give_their_texts(length: int) -> None:
    wanted = ["a" * length, "", "é" * 3]
    assert [text.decode() for text in texts(b"".join(map(text_frame, wanted)))] == wanted


def test_how_things_stand_then_what_happens() -> None:
    async def main() -> None:
        there = hub()
        feed = Feed(there, rate_hz=10.0, now_stands=lambda: [STANDING])
        reading = asyncio.create_task(some(feed, 3))
        await asyncio.sleep(0.1)
        there.publish("job", "router", {"id": 1})
        there.publish("console", "router", {"text": "?"})
        there.publish("alarm", "router", {"alarm": None})
        first, job, alarm = await reading
        assert first is STANDING
        assert (job.type, job.machine, job.data, job.fresh) == ("job", "router", {"id": 1}, False)
        assert job.at == "2026-03-01T09:00:00.100Z"
        assert alarm.type == "alarm"
        assert there.readers == 0, "it has left"

    run_simulated(main())


def test_states_come_at_the_rate_and_are_the_newest() -> None:
    async def main() -> None:
        there = hub()
        feed = Feed(there, rate_hz=2.0, now_stands=list)
        loop, found = asyncio.get_running_loop(), []

        async def read() -> None:
            async for notice in feed:
                found.append((loop.time(), notice.data["n"]))  # noqa: PERF401 - it is cancelled, and keeps what it has

        reading = asyncio.create_task(read())
        await asyncio.sleep(0)
        for number in range(100):
            there.publish("state", "router", {"n": number})
            await asyncio.sleep(0.05)
        await asyncio.sleep(1.0)
        reading.cancel()
        assert 10 <= len(found) <= 12
        assert found[-1][1] == 99, "the last one is not lost"

    run_simulated(main())


def test_a_part_that_does_not_read_is_cut_and_begins_with_how_things_stand() -> None:
    async def main() -> None:
        there = hub()
        stands: list[Any] = [STANDING]
        feed = Feed(there, rate_hz=10.0, now_stands=lambda: list(stands))
        notices = aiter(feed)
        assert await anext(notices) is STANDING
        for number in range(3 * QUEUE_LIMIT):
            there.publish("job", "router", {"id": number, "note": "x" * 1000})
            await asyncio.sleep(0)
        assert there.readers == 1
        stands[:] = [Notice("job", "router", "t", {"id": 7}, fresh=True)]
        seen = []
        while not (seen and seen[-1].fresh):
            seen.append(await anext(notices))
        assert len(seen) < QUEUE_LIMIT, "bounded"
        assert seen[-1].data == {"id": 7}
        assert (feed.restarts, there.cut_readers) == (1, 1)
        there.publish("job", "router", {"id": 8})
        assert (await anext(notices)).data == {"id": 8}
        await notices.aclose()  # type: ignore[attr-defined]
        assert there.readers == 0

    run_simulated(main())
