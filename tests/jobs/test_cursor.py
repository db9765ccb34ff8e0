"""Four counters, never confused."""

import pytest
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
        getattr(cursor, name)(line)
        assert 0 <= cursor.done <= cursor.received <= cursor.sent <= cursor.read


@pytest.mark.parametrize(
    ("before", "name", "line", "after"),
    [
        (Cursor(), "was_done", 5, Cursor(5, 5, 5, 5)),
        (Cursor(9, 0, 0, 0), "was_sent", 5, Cursor(9, 5, 0, 0)),
        (Cursor.at(7), "was_received", 3, Cursor(7, 7, 7, 7)),
        (Cursor.at(7), "was_received", 8, Cursor(8, 8, 8, 7)),
    ],
)
def test_each_counter_brings_those_before_it_along(before: Cursor, name: str, line: int, after: Cursor) -> None:
    getattr(before, name)(line)
    assert before == after


def test_falling_back_keeps_what_was_read() -> None:
    cursor = Cursor(9, 8, 8, 4)
    cursor.fell_back(4)
    assert cursor == Cursor(9, 4, 4, 4)
