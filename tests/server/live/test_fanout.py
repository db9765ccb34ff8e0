"""Whose turn it is: few sends in a turn, everybody in the end, and nobody who does not read."""

import asyncio
from datetime import UTC, datetime

from server.live.fanout import SENDS_A_TURN, TICK_S
from server.live.hub import Hub
from server.live.subscription import Filter, Subscription
from tests.harness.simloop import run_simulated as run
from tests.harness.textframes import Ear

START = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)
CROWD = 100


def crowd(count: int = CROWD, **wanted: float) -> tuple[Hub, list[Subscription], list[Ear]]:
    """A hub and its readers, which have begun."""
    hub = Hub(clock=lambda: START, first_seq=0)
    readers, ears = [hub.subscribe(Filter(**wanted)) for _ in range(count)], [Ear() for _ in range(count)]
    for reader, ear in zip(readers, ears, strict=True):
        reader.begin(ear)
    return hub, readers, ears


def test_a_turn_of_the_loop_has_few_sends_however_many_readers_there_are() -> None:
    async def main() -> None:
        hub, _, ears = crowd()
        hub.publish("state", "router", {})
        turns = 0
        while (served := sum(bool(ear.pieces) for ear in ears)) < CROWD:
            await asyncio.sleep(0)
            turns += 1
            now_served = sum(bool(ear.pieces) for ear in ears)
            assert now_served - served <= SENDS_A_TURN
            assert turns < 2 * CROWD
        assert turns >= CROWD // SENDS_A_TURN
        assert {len(ear.heard) for ear in ears} == {1}

    run(main())


def test_somebody_else_comes_between_the_sends() -> None:
    """What the loop is asked to do while a crowd is being served is done before the crowd is."""

    async def main() -> None:
        hub, _, ears = crowd()
        hub.publish("job", "router", {})
        await asyncio.sleep(0)
        asyncio.get_running_loop().call_soon(hub.publish, "alarm", "router", {})
        await asyncio.sleep(0)
        assert hub.published["alarm"] == 1
        assert sum(bool(ear.pieces) for ear in ears) <= 3 * SENDS_A_TURN
        await asyncio.sleep(1)
        assert all([message["type"] for message in ear.heard] == ["job", "alarm"] for ear in ears)

    run(main())


def test_who_does_not_read_holds_up_nobody_and_goes_on_where_it_was() -> None:
    async def main() -> None:
        hub, readers, ears = crowd(3)
        ears[1].takes = False
        for number in range(50):
            hub.publish("job", "router", {"n": number})
            hub.publish("state", "router", {"n": number})
            await asyncio.sleep(0.01)
        await asyncio.sleep(1)
        for ear in (ears[0], ears[2]):
            jobs = [message["data"]["n"] for message in ear.heard if message["type"] == "job"]
            assert jobs == [*range(50)]
        assert ears[1].pieces == []
        ears[1].takes = True
        readers[1].wake()
        await asyncio.sleep(1)
        assert [message["type"] for message in ears[1].heard] == ["job"] * 50 + ["state"]
        assert ears[1].heard[-1]["data"] == {"n": 49}

    run(main())


def test_readers_that_wait_for_their_time_share_the_ticks() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        hub, _, ears = crowd(20, rate_hz=20.0)
        for _ in range(100):
            hub.publish("state", "router", {})
            await asyncio.sleep(0.01)
        began, served = loop.time(), sum(len(ear.pieces) for ear in ears)
        for _ in range(200):
            hub.publish("state", "router", {})
            await asyncio.sleep(0.01)
        rate = (sum(len(ear.pieces) for ear in ears) - served) / len(ears) / (loop.time() - began)
        assert 19.0 <= rate <= 20.5
        before = {ear: len(ear.pieces) for ear in ears}
        hub.publish("state", "router", {"n": "last"})
        await asyncio.sleep(0.05 + 2 * TICK_S)
        assert all(ear.heard[-1]["data"] == {"n": "last"} for ear in ears)
        assert all(len(ear.pieces) > before[ear] for ear in ears)

    run(main())


def test_a_reader_that_has_gone_is_not_served() -> None:
    async def main() -> None:
        hub, readers, ears = crowd(2)
        for topic in ("job", "console", "state"):
            hub.publish(topic, "router", {})
        hub.unsubscribe(readers[0])
        await asyncio.sleep(1)
        assert ears[0].pieces == []
        assert len(ears[1].heard) == 3
        hub.publish("console", "router", {})
        hub.unsubscribe(readers[1])
        await asyncio.sleep(1)
        assert len(ears[1].heard) == 3

    run(main())


def test_a_fault_with_one_reader_is_not_the_next_ones() -> None:
    class Broken(Ear):
        def write(self, data: bytes) -> None:
            raise RuntimeError("broken")

    async def main() -> None:
        faults: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: faults.append(context["exception"]))
        hub, _, ears = crowd(2)
        hub.subscribe(Filter()).begin(Broken())
        for _ in range(3):
            hub.publish("job", "router", {})
            await asyncio.sleep(1)
        assert [len(ear.heard) for ear in ears] == [3, 3]
        assert len(faults) == 3

    run(main())
