import json
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.clock import rfc3339
from server.live.hub import (
    CONSOLE_LINES,
    CONSOLE_PIECE_LINES,
    CONSOLE_READERS,
    CONSOLE_SLICE,
    REPLAY_FOR,
    REPLAY_LIMIT,
    REPLAY_LIMIT_BYTES,
    Hub,
)
from server.live.subscription import QUEUE_LIMIT, TOPICS, Filter
from tests.harness.simloop import run_simulated as run
from tests.harness.textframes import messages, texts

START = datetime(2026, 3, 1, 9, 30, tzinfo=UTC)


def hub(first_seq: int | None = 0) -> Hub:
    return Hub(clock=lambda: START, first_seq=first_seq)


def test_a_message_is_an_envelope_of_the_contract() -> None:
    h = hub(1840)
    reader = h.subscribe(Filter())
    h.publish("job", "router", {"id": 1})
    assert messages(reader.take(0.0)) == [
        {
            "seq": 1841,
            "type": "job",
            "machine": "router",
            "at": "2026-03-01T09:30:00.000Z",
            "data": {"id": 1},
        }
    ]


def test_a_message_is_framed_once_for_all() -> None:
    h = hub()
    one, other = h.subscribe(Filter()), h.subscribe(Filter())
    h.publish("job", "router", {"id": 1})
    kept = h.missed(0, Filter())
    assert kept is not None
    assert one.take(0.0) is other.take(0.0) is next(iter(kept))


def test_times_are_utc_with_z() -> None:
    assert rfc3339(datetime.fromisoformat("2026-03-01T12:30:00.2504+03:00")) == "2026-03-01T09:30:00.250Z"


def test_sequence_goes_on_rising_over_a_restart_of_the_daemon() -> None:
    earlier = Hub(clock=lambda: START)
    for _ in range(1000):
        earlier.publish("job", None, {})
    later = Hub(clock=lambda: datetime(2026, 3, 1, 9, 31, tzinfo=UTC))
    assert later.seq > earlier.seq
    assert later.missed(earlier.seq, Filter()) is None


def test_many_consoles_are_thinned_and_few_never_are() -> None:
    now = START
    h = Hub(clock=lambda: now, first_seq=0)
    few = [h.subscribe(Filter()) for _ in range(CONSOLE_READERS)]
    for _ in range(CONSOLE_LINES):
        h.publish("console", "router", {})
        h.hand_out_lines()
        for reader in few:
            assert reader.take(0.0)
    many = [h.subscribe(Filter()) for _ in range(CONSOLE_LINES // 4 - CONSOLE_READERS)]
    for _ in range(10):
        h.publish("console", "router", {})
        h.publish("job", "router", {})
    left_out = (10 - 4) * (CONSOLE_LINES // 4)
    assert h.console_left_out == left_out, "a slice has four lines for all these readers"
    now += CONSOLE_SLICE
    h.publish("console", "router", {})
    h.hand_out_lines()
    assert h.console_left_out == left_out
    types = [message["type"] for message in messages(many[0].take(0.0))]
    assert types.count("job") == 10, "nothing else is left out"
    assert types.count("console") == 5


def test_a_reader_that_does_not_read_is_cut_and_changes_nothing_for_others() -> None:
    async def main() -> None:
        h = hub()
        stuck, good = h.subscribe(Filter()), h.subscribe(Filter())
        heard = []
        for number in range(QUEUE_LIMIT + 1):
            h.publish("job", "router", {"n": number})
            heard += [message["data"]["n"] for message in messages(good.take(0.0))]
        assert heard == list(range(QUEUE_LIMIT + 1))
        assert stuck.is_cut
        assert not good.is_cut
        assert "does not read" in stuck.cut_reason
        await stuck.until_cut()
        h.unsubscribe(stuck)
        assert (h.readers, h.cut_readers) == (1, 1)

    run(main())


def test_a_reader_that_went_by_itself_was_not_dropped() -> None:
    h = hub()
    h.unsubscribe(h.subscribe(Filter()))
    assert (h.readers, h.cut_readers) == (0, 0)


def test_topics_and_machines_are_filtered() -> None:
    h = hub()
    reader = h.subscribe(Filter(topics=frozenset({"job", "program"}), machines=frozenset({"router"})))
    h.publish("job", "lathe", {})
    h.publish("state", "router", {})
    h.publish("console", "router", {})
    h.publish("program", None, {"id": "concerns nobody, so everybody"})
    h.publish("job", "router", {"mine": True})
    program, job = messages(reader.take(0.0))
    assert program["type"] == "program"
    assert job["data"] == {"mine": True}


def test_readers_that_change_their_mind_get_what_they_want_from_then_on() -> None:
    h = hub()
    one, other = h.subscribe(Filter(topics=frozenset({"job"}))), h.subscribe(Filter())

    def got(topic: str) -> list[int]:
        h.publish(topic, "router", {})
        return [len(messages(reader.take(0.0))) for reader in (one, other)]

    assert (got("job"), got("log")) == ([1, 1], [0, 1])
    one.narrow(Filter(topics=frozenset({"log"})))
    assert (got("job"), got("log")) == ([0, 1], [1, 1])
    other.cut("enough")
    assert (got("job"), got("log")) == ([0, 0], [1, 0])
    h.unsubscribe(one)
    assert (got("job"), got("log")) == ([0, 0], [0, 0])
    one = h.subscribe(Filter())
    assert got("log") == [1, 0]


def test_missed_events_are_replayed_without_states_and_console() -> None:
    h = hub()
    for topic in TOPICS:
        h.publish(topic, "router", {})
    missed = h.missed(2, Filter())
    assert missed is not None
    assert [messages(frame)[0]["seq"] for frame in missed] == [3, 5, 6, 7, 8, 9]
    only = h.missed(0, Filter(topics=frozenset({"alarm"})))
    assert only is not None
    assert [messages(frame)[0]["type"] for frame in only] == ["alarm"]
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


def test_what_is_older_than_a_day_is_not_replayed() -> None:
    at = START
    h = Hub(clock=lambda: at, first_seq=0)
    for _ in range(3):
        h.publish("job", "router", {})
    at = START + REPLAY_FOR
    h.publish("job", "router", {})
    assert h.missed(0, Filter()) is not None
    at += timedelta(seconds=1)
    h.publish("job", "router", {})
    assert h.missed(2, Filter()) is None
    missed = h.missed(3, Filter())
    assert missed is not None
    assert len(list(missed)) == 2
    at = START  # a clock that is set back forgets nothing by that
    h.publish("job", "router", {})
    assert h.missed(3, Filter()) is not None


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
    assert [messages(frame)[0]["seq"] for frame in missed] == counted


def test_what_a_machine_says_cannot_break_the_json() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    h.publish("console", "router", {"text": "\ud800\u2028</script>\x00", "x": float("nan"), "y": [float("inf")]})
    h.hand_out_lines()
    (text,) = texts(reader.take(0.0))
    assert text.isascii()
    assert json.loads(text)["data"] == {"text": "\ud800\u2028</script>\x00", "x": None, "y": [None]}


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
    h, data = hub(), Asked()
    readers = [h.subscribe(Filter()) for _ in range(3)]
    h.publish("console", "mill", data)
    h.hand_out_lines()
    assert [messages(reader.take(0.0))[0]["data"] for reader in readers] == [{"text": "G1 X1"}] * 3
    assert data.times == 1


def test_lines_that_nobody_hands_out_do_not_grow() -> None:
    h = hub()
    reader = h.subscribe(Filter())
    for _ in range(CONSOLE_PIECE_LINES):
        assert reader.take(0.0) == b""
        h.publish("console", "mill", {})
    assert len(messages(reader.take(0.0))) == CONSOLE_PIECE_LINES


def test_what_can_be_asked_for_later_is_made_with_nobody_there() -> None:
    h, data = hub(), Asked()
    h.publish("job", "mill", data)
    assert data.times == 1
    missed = h.missed(0, Filter())
    assert missed is not None
    assert [messages(frame)[0]["data"] for frame in missed] == [{"text": "G1 X1"}]


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


def test_lines_of_a_console_that_nobody_reads_are_counted_all_the_same() -> None:
    hub = Hub(first_seq=0)
    assert hub.unwanted("router", 3)
    other = hub.subscribe(Filter(topics=frozenset({"job"})))
    assert hub.unwanted("router", 2)
    assert (hub.seq, hub.published["console"]) == (5, 5)
    hub.unsubscribe(other)
    hub.subscribe(Filter())
    assert not hub.unwanted("router", 2)
    assert hub.seq == 5
