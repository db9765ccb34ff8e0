"""What waits for an address: order, back-off, age, number; delivered or counted as dropped, over restarts too."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.outbound.webhookqueue import LONGEST_WAIT_S, Queue, Waiting, messages_of, text_of
from server.waysout import WayOut


def queue(counted: WayOut, limit: int = 3, give_up_after_s: float = 100.0) -> Queue:
    return Queue(limit=limit, give_up_after_s=give_up_after_s, counted=counted)


def message(number: int, since_s: float = 0.0) -> Waiting:
    return Waiting(str(number), f'{{"n":{number}}}', since_s)


def test_in_order_and_a_failure_holds_up_those_behind_it() -> None:
    counted = WayOut()
    there = queue(counted)
    for number in range(2):
        there.put(message(number))
    first = there.head(0.0)
    assert first == message(0)
    assert [there.failed(10.0) for _ in range(4)] == [1.0, 2.0, 4.0, 8.0]
    assert there.due_at == 18.0
    assert there.head(0.0) is first
    there.delivered(first)
    assert there.due_at == 0.0
    assert there.head(0.0) == message(1)
    assert there.failed(0.0) == 1.0, "a new message begins anew"
    assert (counted.sent, counted.failures, counted.waiting) == (1, 5, 1)


def test_waits_have_an_end() -> None:
    there = queue(WayOut())
    waits = [there.failed(0.0) for _ in range(100)]
    assert waits[-1] == LONGEST_WAIT_S
    assert waits == sorted(waits)


def test_too_many_and_too_old_are_dropped_and_counted() -> None:
    counted = WayOut()
    there = queue(counted)
    for number in range(5):
        there.put(message(number, since_s=float(number)))
    assert there.head(0.0) == message(2, 2.0)
    assert counted.dropped == 2
    assert there.head(103.5) == message(4, 4.0)
    assert (counted.dropped, counted.waiting) == (4, 1)
    assert there.head(1000.0) is None
    assert counted.waiting == 0


def test_one_that_was_dropped_while_it_was_on_its_way_takes_no_other_with_it() -> None:
    there = queue(WayOut())
    there.put(message(0))
    on_its_way = there.head(0.0)
    assert on_its_way is not None
    for number in range(1, 4):
        there.put(message(number))
    there.delivered(on_its_way)
    assert there.snapshot() == (message(1), message(2), message(3))


def test_nobody_wants_it() -> None:
    counted = WayOut()
    there = queue(counted)
    there.put(message(0))
    there.refused(message(0))
    assert len(there) == 1, "another message of the same words is another one"
    head = there.head(0.0)
    assert head is not None
    there.refused(head)
    assert (len(there), counted.waiting) == (0, 0)


def test_what_waited_comes_before_what_is_new() -> None:
    counted = WayOut()
    there = queue(counted)
    there.put(message(9))
    there.restore([message(number) for number in range(4)])
    assert there.snapshot() == (message(2), message(3), message(9))
    assert (counted.waiting, counted.dropped) == (3, 2)


@given(st.lists(st.tuples(st.text(max_size=20), st.text(max_size=20), st.floats(0, 1e10)), max_size=10))
def test_what_is_written_is_read_again(told: list[tuple[str, str, float]]) -> None:
    messages = [Waiting(*one) for one in told]
    assert messages_of(text_of(messages)) == messages


@pytest.mark.parametrize(
    "text", ["", "{", "{}", "[1]", '[{"id": 1, "body": "", "since_s": 0}]', '[{"id": "a"}]', "null"]
)
def test_a_file_that_is_none_of_ours(text: str) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - of the JSON reader, or ours
        messages_of(text)
