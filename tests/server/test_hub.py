import asyncio
import itertools
import json
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.hub import (
    CONSOLE_LIMIT,
    CONSOLE_READERS,
    CONSOLE_SENDS,
    CONSOLE_SLICE,
    QUEUE_LIMIT,
    QUEUE_LIMIT_BYTES,
    REPLAY_LIMIT,
    REPLAY_LIMIT_BYTES,
    TOPICS,
    CutError,
    Filter,
    Hub,
    rfc3339,
)
from tests.harness.fakeworkshop import settle
from tests.harness.simloop import run_simulated as run

START = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)


def hub(first_seq: int | None = 0) -> Hub:
    return Hub(clock=lambda: START, first_seq=first_seq)


def test_a_message_is_an_envelope_of_the_contract() -> None:
    async def main() -> None:
        h = hub(1840)
        reader = h.subscribe(Filter())
        h.publish("job", "router", {"id": 1})
        assert json.loads(await reader.next()) == {
            "seq": 1841,
            "type": "job",
            "machine": "router",
            "at": "2026-03-01T09:30:00.000Z",
            "data": {"id": 1},
        }

    run(main())


def test_times_are_utc_with_z() -> None:
    assert rfc3339(datetime.fromisoformat("2026-03-01T12:30:00.2504+03:00")) == "2026-03-01T09:30:00.250Z"


def test_sequence_goes_on_rising_over_a_restart_of_the_daemon() -> None:
    earlier = Hub(clock=lambda: START)
    for _ in range(1000):
        earlier.publish("job", None, {})
    later = Hub(clock=lambda: datetime(2026, 3, 1, 9, 31, tzinfo=UTC))
    assert later.seq > earlier.seq
    assert later.missed(earlier.seq, Filter()) is None


def test_state_is_coalesced_for_a_reader_that_is_slow() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter())
        for number in range(5_000):
            h.publish("state", "router", {"n": number})
        assert json.loads(await reader.next())["data"] == {"n": 4_999}

    run(main())


def test_rate_bounds_the_state_messages_of_all_machines() -> None:
    async def main() -> None:
        h = hub()
        loop = asyncio.get_running_loop()
        reader = h.subscribe(Filter(rate_hz=10))
        heard: list[tuple[float, str, int]] = []

        async def listen() -> None:
            while True:
                message = json.loads(await reader.next())
                heard.append((loop.time(), message["machine"], message["data"]["n"]))

        listening = asyncio.ensure_future(listen())
        begin = loop.time()
        for number in range(1000):
            h.publish("state", "router", {"n": number})
            h.publish("state", "lathe", {"n": number})
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.25)
        listening.cancel()
        assert 10 <= len([at for at, _, _ in heard if at < begin + 1.0]) <= 11
        assert {machine for _, machine, _ in heard} == {"router", "lathe"}
        gaps = [later[0] - earlier[0] for earlier, later in itertools.pairwise(heard)]
        assert min(gaps) >= 0.0999
        # The newest always arrives, however many were left out.
        assert {(machine, n) for _, machine, n in heard[-2:]} == {("router", 999), ("lathe", 999)}

    run(main())


def test_events_are_not_held_back_by_the_rate_of_states() -> None:
    async def main() -> None:
        h = hub()
        loop = asyncio.get_running_loop()
        reader = h.subscribe(Filter(rate_hz=0.1))
        h.publish("state", "router", {"n": 1})
        await reader.next()
        h.publish("state", "router", {"n": 2})
        h.publish("alarm", "router", {})
        before = loop.time()
        assert json.loads(await reader.next())["type"] == "alarm"
        assert loop.time() == before

    run(main())


def test_many_consoles_are_thinned_and_few_never_are() -> None:
    async def main() -> None:
        now = START
        h = Hub(clock=lambda: now, first_seq=0)
        few = [h.subscribe(Filter()) for _ in range(CONSOLE_READERS)]
        for _ in range(CONSOLE_SENDS):
            h.publish("console", "router", {})
        assert [reader.left_out for reader in few] == [0] * CONSOLE_READERS
        many = [h.subscribe(Filter()) for _ in range(CONSOLE_SENDS // 4 - CONSOLE_READERS)]
        for _ in range(10):
            h.publish("console", "router", {})
            h.publish("job", "router", {})
        assert {reader.left_out for reader in many} == {10 - 4}, "a slice has four lines for fifty readers"
        now += CONSOLE_SLICE
        h.publish("console", "router", {})
        assert {reader.left_out for reader in many} == {10 - 4}
        types = [json.loads(await many[0].next())["type"] for _ in range(15)]
        assert types.count("job") == 10, "nothing else is left out"

    run(main())


def test_nothing_but_state_and_console_is_ever_left_out() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter())
        for _ in range(QUEUE_LIMIT * 2):
            h.publish("console", "router", {})
        for number in range(QUEUE_LIMIT - CONSOLE_LIMIT):
            h.publish("job", "router", {"n": number})
        types = [json.loads(await reader.next())["type"] for _ in range(QUEUE_LIMIT)]
        assert types.count("console") == CONSOLE_LIMIT
        assert types.count("job") == QUEUE_LIMIT - CONSOLE_LIMIT
        assert reader.left_out == QUEUE_LIMIT * 2 - CONSOLE_LIMIT

    run(main())


def test_a_reader_that_does_not_read_is_cut_and_changes_nothing_for_others() -> None:
    async def main() -> None:
        h = hub()
        stuck, good = h.subscribe(Filter()), h.subscribe(Filter())
        heard = []
        for number in range(QUEUE_LIMIT + 1):
            h.publish("job", "router", {"n": number})
            heard.append(json.loads(await good.next())["data"]["n"])
        assert heard == list(range(QUEUE_LIMIT + 1))
        assert stuck.is_cut
        assert not good.is_cut
        with pytest.raises(CutError, match="does not read"):
            await stuck.next()
        await stuck.until_cut()
        h.unsubscribe(stuck)
        assert (h.readers, h.cut_readers) == (1, 1)

    run(main())


def test_the_queue_of_a_reader_is_bounded_in_bytes_too() -> None:
    async def main() -> None:
        h = hub()
        stuck = h.subscribe(Filter())
        big = "x" * (QUEUE_LIMIT_BYTES // 10)
        for _ in range(10):
            h.publish("log", None, {"message": big})
        assert stuck.is_cut

    run(main())


def test_bytes_that_were_read_count_no_more() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter())
        big = "x" * (QUEUE_LIMIT_BYTES // 3)
        for _ in range(10):
            h.publish("log", None, {"message": big})
            await reader.next()
        assert not reader.is_cut

    run(main())


def test_a_reader_that_went_by_itself_was_not_dropped() -> None:
    async def main() -> None:
        h = hub()
        h.unsubscribe(h.subscribe(Filter()))
        assert (h.readers, h.cut_readers) == (0, 0)

    run(main())


def test_topics_and_machines_are_filtered() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter(topics=frozenset({"job", "program"}), machines=frozenset({"router"})))
        h.publish("job", "lathe", {})
        h.publish("state", "router", {})
        h.publish("console", "router", {})
        h.publish("program", None, {"id": "concerns nobody, so everybody"})
        h.publish("job", "router", {"mine": True})
        assert json.loads(await reader.next())["type"] == "program"
        assert json.loads(await reader.next())["data"] == {"mine": True}

    run(main())


def test_narrowing_forgets_a_state_that_waits() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter(rate_hz=1))
        h.publish("state", "router", {"n": 1})
        await reader.next()
        h.publish("state", "router", {"n": 2})
        reader.narrow(Filter(machines=frozenset({"lathe"}), rate_hz=1))
        h.publish("state", "lathe", {"n": 3})
        assert json.loads(await reader.next())["data"] == {"n": 3}

    run(main())


def test_a_waiting_reader_is_woken() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter())
        waiting = asyncio.ensure_future(reader.next())
        await settle()
        assert not waiting.done()
        h.publish("tool", "router", {"tool": 3})
        assert json.loads(await waiting)["data"] == {"tool": 3}

    run(main())


def test_missed_events_are_replayed_without_states_and_console() -> None:
    h = hub()
    for topic in TOPICS:
        h.publish(topic, "router", {})
    missed = h.missed(2, Filter())
    assert missed is not None
    assert [json.loads(text)["seq"] for text in missed] == [3, 5, 6, 7, 8, 9]
    only = h.missed(0, Filter(topics=frozenset({"alarm"})))
    assert only is not None
    assert [json.loads(text)["type"] for text in only] == ["alarm"]
    assert h.missed(h.seq, Filter()) == []


def test_what_is_too_old_or_from_the_future_is_not_replayed() -> None:
    h = hub(first_seq=100)
    assert h.missed(99, Filter()) is None
    assert h.missed(101, Filter()) is None
    for _ in range(REPLAY_LIMIT + 5):
        h.publish("job", "router", {})
    assert h.missed(104, Filter()) is None
    kept = h.missed(105, Filter())
    assert kept is not None
    assert len(list(kept)) == REPLAY_LIMIT


def test_large_messages_do_not_fill_the_memory() -> None:
    h = hub()
    for _ in range(100):
        h.publish("queue", "router", {"jobs": "x" * (REPLAY_LIMIT_BYTES // 10)})
    assert h.missed(0, Filter()) is None
    kept = h.missed(95, Filter())
    assert kept is not None
    assert sum(map(len, kept)) <= REPLAY_LIMIT_BYTES


def test_states_do_not_push_events_out_of_the_replay() -> None:
    h = hub()
    h.publish("job", "router", {})
    for _ in range(REPLAY_LIMIT * 2):
        h.publish("state", "router", {})
        h.publish("console", "router", {})
    missed = h.missed(0, Filter())
    assert missed is not None
    assert len(list(missed)) == 1


@given(st.lists(st.sampled_from(TOPICS), max_size=60), st.integers(0, 60))
def test_reconnecting_anywhere_loses_no_event_that_counts(topics: list[str], at: int) -> None:
    h = hub()
    seen = set()
    for topic in topics[:at]:
        seen.add(h.publish(topic, "router", {}))
    since = h.seq
    expected = [h.publish(topic, "router", {}) for topic in topics[at:]]
    counted = [seq for seq, topic in zip(expected, topics[at:], strict=True) if topic not in ("state", "console")]
    missed = h.missed(since, Filter())
    assert missed is not None
    assert [json.loads(text)["seq"] for text in missed] == counted


def test_what_a_machine_says_cannot_break_the_json() -> None:
    async def main() -> None:
        h = hub()
        reader = h.subscribe(Filter())
        h.publish("console", "router", {"text": "\ud800\u2028</script>\x00", "x": float("nan"), "y": [float("inf")]})
        text = await reader.next()
        assert text.isascii()
        assert json.loads(text)["data"] == {"text": "\ud800\u2028</script>\x00", "x": None, "y": [None]}

    run(main())


class Asked:
    """Data that count how often they were asked for."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self) -> dict[str, Any]:
        self.times += 1
        return {"text": "G1 X1"}


@pytest.mark.parametrize("kind", ["state", "console"])
def test_what_nobody_gets_is_not_made(kind: str) -> None:
    h, data = hub(), Asked()
    assert h.publish(kind, "mill", data) == 1
    reader = h.subscribe(Filter())
    h.unsubscribe(reader)
    assert h.publish(kind, "mill", data) == 2, "the numbers rise all the same"
    assert data.times == 0
    assert h.published[kind] == 2


def test_what_somebody_gets_is_made_once_for_all() -> None:
    async def main() -> None:
        h, data = hub(), Asked()
        readers = [h.subscribe(Filter()) for _ in range(3)]
        h.publish("console", "mill", data)
        assert [json.loads(await reader.next())["data"] for reader in readers] == [{"text": "G1 X1"}] * 3
        assert data.times == 1

    run(main())


def test_what_can_be_asked_for_later_is_made_with_nobody_there() -> None:
    h, data = hub(), Asked()
    h.publish("job", "mill", data)
    assert data.times == 1
    missed = h.missed(0, Filter())
    assert missed is not None
    assert [json.loads(text)["data"] for text in missed] == [{"text": "G1 X1"}]


def test_a_message_that_no_reader_wants_is_not_made() -> None:
    h, data = hub(), Asked()
    h.subscribe(Filter(topics=frozenset({"job"})))
    h.subscribe(Filter(machines=frozenset({"router"})))
    h.publish("console", "mill", data)
    h.publish("state", "mill", data)
    assert data.times == 0
    h.subscribe(Filter(topics=frozenset({"console"}), machines=frozenset({"mill"})))
    h.publish("console", "mill", data)
    assert data.times == 1
