"""What waits for one reader: the order of events, gathered console lines, states by their rate, the limits."""

import asyncio
import itertools
from datetime import UTC, datetime
from typing import Any

import pytest

from server.live.fanout import TICK_S
from server.live.hub import CONSOLE_GATHER_S, Hub
from server.live.subscription import (
    CONSOLE_LIMIT,
    PIECE_BYTES,
    QUEUE_LIMIT,
    QUEUE_LIMIT_BYTES,
    Filter,
    Subscription,
)
from server.live.textframe import text_frame
from tests.harness.simloop import run_simulated as run
from tests.harness.textframes import Ear, messages

START = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)


def hub() -> Hub:
    return Hub(clock=lambda: START, first_seq=0)


def data(reader: Subscription, now: float = 0.0) -> list[Any]:
    return [message["data"] for message in messages(reader.take(now))]


def test_state_is_coalesced_for_a_reader_that_is_slow() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    for number in range(5_000):
        h.publish("state", "router", {"n": number})
    assert data(reader) == [{"n": 4_999}]
    assert reader.take(1.0) == b""
    assert reader.due_at is None


def test_states_of_several_machines_come_in_turn() -> None:
    h = hub()
    reader = h.subscribe(Filter(rate_hz=8))
    heard = []
    for step in range(40):
        for machine in ("router", "lathe"):
            h.publish("state", machine, {"machine": machine})
        heard += data(reader, step * 0.125)
    assert {machine["machine"] for machine in heard[-2:]} == {"router", "lathe"}
    assert len(heard) == 40


def test_rate_bounds_the_state_messages_of_all_machines() -> None:
    async def main() -> None:
        h, loop = hub(), asyncio.get_running_loop()
        heard: list[tuple[float, str, int]] = []

        class Listening(Ear):
            def write(self, data: bytes) -> None:
                heard.extend((loop.time(), one["machine"], one["data"]["n"]) for one in messages(data))

        h.subscribe(Filter(rate_hz=10)).begin(Listening())
        begin = loop.time()
        for number in range(1000):
            h.publish("state", "router", {"n": number})
            h.publish("state", "lathe", {"n": number})
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.25)
        assert 10 <= len([at for at, _, _ in heard if at < begin + 1.0]) <= 11
        assert {machine for _, machine, _ in heard} == {"router", "lathe"}
        gaps = [later[0] - earlier[0] for earlier, later in itertools.pairwise(heard)]
        assert min(gaps) >= 0.1 - TICK_S - 1e-6, "a tick late once, the beat is kept"
        # The newest always arrives, however many were left out.
        assert {(machine, n) for _, machine, n in heard[-2:]} == {("router", 999), ("lathe", 999)}

    run(main())


def test_after_a_rest_the_rate_counts_from_the_next_state() -> None:
    h = hub()
    reader = h.subscribe(Filter(rate_hz=10))
    for now, due_at in ((100.0, 100.1), (100.1, 100.2), (107.0, 107.1)):
        h.publish("state", "router", {})
        assert data(reader, now) == [{}]
        h.publish("state", "router", {})
        assert reader.due_at == pytest.approx(due_at)
        assert reader.take(now + 0.05) == b""


def test_events_are_not_held_back_by_the_rate_of_states() -> None:
    h = hub()
    reader = h.subscribe(Filter(rate_hz=0.1))
    h.publish("state", "router", {"n": 1})
    assert data(reader) == [{"n": 1}]
    h.publish("state", "router", {"n": 2})
    h.publish("alarm", "router", {})
    assert reader.due_at == 0.0
    assert [message["type"] for message in messages(reader.take(0.0))] == ["alarm"]


def test_console_lines_are_gathered_and_nothing_else_waits_for_them() -> None:
    async def main() -> None:
        h, ear = hub(), Ear()
        h.subscribe(Filter()).begin(ear)
        for number in range(30):
            h.publish("console", "router", {"n": number})
            await asyncio.sleep(0.001)
        assert ear.pieces == []
        await asyncio.sleep(CONSOLE_GATHER_S)
        assert [message["data"]["n"] for message in ear.heard] == [*range(30)]
        assert len(ear.pieces) == 1
        h.publish("console", "router", {"n": 30})
        h.publish("state", "router", {"n": 31})
        h.publish("console", "router", {"n": 32})
        h.publish("job", "router", {"n": 33})
        for _ in range(3):
            await asyncio.sleep(0)
        assert [message["data"]["n"] for message in ear.heard[30:]] == [30, 32, 33, 31]
        assert len(ear.pieces) == 2, "who is served is given all there is"
        h.publish("console", "router", {"n": 34})
        await asyncio.sleep(2 * CONSOLE_GATHER_S)
        assert ear.heard[-1]["data"]["n"] == 34

    run(main())


def test_who_comes_now_gets_no_line_of_before() -> None:
    async def main() -> None:
        h, early, late = hub(), Ear(), Ear()
        h.subscribe(Filter()).begin(early)
        h.publish("console", "router", {"n": 1})
        h.subscribe(Filter()).begin(late)
        h.publish("console", "router", {"n": 2})
        await asyncio.sleep(1)
        assert [[message["data"]["n"] for message in ear.heard] for ear in (early, late)] == [[1, 2], [2]]

    run(main())


def test_nothing_but_state_and_console_is_ever_left_out() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    for _ in range(QUEUE_LIMIT * 2):
        h.publish("console", "router", {})
        h.hand_out_lines()
    for number in range(QUEUE_LIMIT - CONSOLE_LIMIT):
        h.publish("job", "router", {"n": number})
    types: list[str] = []
    while piece := reader.take(0.0):
        types += [message["type"] for message in messages(piece)]
    assert types.count("console") == CONSOLE_LIMIT
    assert types.count("job") == QUEUE_LIMIT - CONSOLE_LIMIT
    assert reader.left_out == QUEUE_LIMIT * 2 - CONSOLE_LIMIT
    assert not reader.is_cut


def test_the_queue_of_a_reader_is_bounded_in_bytes_too() -> None:
    h = hub()
    stuck = h.subscribe(Filter())
    big = "x" * (QUEUE_LIMIT_BYTES // 10)
    for _ in range(10):
        h.publish("log", None, {"message": big})
    assert stuck.is_cut
    assert stuck.take(0.0) == b""


def test_bytes_that_were_read_count_no_more() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    big = "x" * (QUEUE_LIMIT_BYTES // 3)
    for _ in range(10):
        h.publish("log", None, {"message": big})
        assert reader.take(0.0)
    assert not reader.is_cut


def test_a_socket_is_given_pieces() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    for _ in range(100):
        h.publish("log", None, {"message": "x" * (PIECE_BYTES // 10)})
    assert 9 <= len(messages(reader.take(0.0))) <= 10


def test_narrowing_forgets_a_state_that_waits() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    h.publish("state", "router", {"n": 2})
    reader.narrow(Filter(machines=frozenset({"lathe"})))
    h.publish("state", "lathe", {"n": 3})
    assert data(reader) == [{"n": 3}]


def test_what_is_owed_comes_first_and_never_cuts() -> None:
    async def main() -> None:
        h, ear = hub(), Ear()
        reader = h.subscribe(Filter())
        h.publish("job", "router", {"n": 9_999})
        reader.begin(ear, (text_frame(f'{{"data":{{"n":{number}}}}}') for number in range(QUEUE_LIMIT * 2)))
        await asyncio.sleep(1)
        assert [message["data"]["n"] for message in ear.heard] == [*range(QUEUE_LIMIT * 2), 9_999]
        assert not reader.is_cut

    run(main())


def test_a_cut_reader_gets_nothing_more() -> None:
    async def main() -> None:
        h, ear = hub(), Ear()
        reader = h.subscribe(Filter())
        reader.begin(ear)
        h.publish("job", "router", {})
        h.publish("state", "router", {})
        reader.cut("enough")
        reader.cut("twice")
        h.publish("job", "router", {})
        reader.push(text_frame("{}"))
        await asyncio.sleep(1)
        assert ear.pieces == []
        assert reader.cut_reason == "enough"

    run(main())
