"""Four counters, never confused."""

from hypothesis import given
from hypothesis import strategies as st

from jobs.cursor import Cursor

STEPS = st.lists(
    st.tuples(st.sampled_from(["was_read", "was_sent", "was_received", "was_done", "fell_back"]), st.integers(0, 1000)),
    max_size=30,
)


@given(STEPS)
def test_done_is_never_before_received_nor_that_before_sent_nor_that_before_read(steps: list[tuple[str, int]]) -> None:
    cursor = Cursor()
    for name, line in steps:
        cursor = getattr(cursor, name)(line)
        assert 0 <= cursor.done <= cursor.received <= cursor.sent <= cursor.read


def test_each_counter_brings_those_before_it_along() -> None:
    assert Cursor().was_done(5) == Cursor(5, 5, 5, 5)
    assert Cursor().was_read(9).was_sent(5) == Cursor(9, 5, 0, 0)
    assert Cursor.at(7).was_received(3) == Cursor(7, 7, 7, 7)


def test_falling_back_keeps_what_was_read() -> None:
    assert Cursor(9, 8, 8, 4).fell_back(4) == Cursor(9, 4, 4, 4)
