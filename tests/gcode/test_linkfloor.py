"""The wait for the link: against the recurrence written plainly, and by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.linkfloor import LinkFloor
from tests.harness.programs import quick

few_seconds = st.sampled_from((0.0, 0.001, 0.003, 0.01, 0.5))
rows = st.lists(st.tuples(few_seconds, few_seconds), min_size=1, max_size=80)


def plainly(seconds: list[float], floors: list[float], window: int) -> list[float]:
    over, arrived = [0.0] * window, 0.0
    for motion, floor in zip(seconds, floors, strict=True):
        arrived = max(arrived, over[-window]) + floor
        over.append(max(over[-1], arrived) + motion)
    return [after - before for before, after in zip(over[window - 1 :], over[window:], strict=False)]


@quick
@given(rows, st.integers(1, 20), st.lists(st.integers(0, 30), max_size=8))
def test_as_the_recurrence_in_pieces_of_any_size(rows: list[tuple[float, float]], window: int, cuts: list[int]) -> None:
    seconds, floors = (np.array(column) for column in zip(*rows, strict=True))
    link, parts, at = LinkFloor(window), [], 0
    for size in [*cuts, len(rows)]:
        parts.append(link.slowed(seconds[at : at + size], floors[at : at + size]))
        at += size
    assert np.concatenate(parts) == pytest.approx(plainly(list(seconds), list(floors), window), abs=1e-9)


def test_a_fast_link_costs_the_first_line_and_nothing_more() -> None:
    took = LinkFloor(15).slowed(np.full(1000, 0.01), np.full(1000, 0.003))
    assert took[0] == pytest.approx(0.013)
    assert took[1:] == pytest.approx(np.full(999, 0.01))


def test_a_slow_link_sets_the_pace() -> None:
    took = LinkFloor(15).slowed(np.full(1000, 0.001), np.full(1000, 0.003))
    assert took.sum() == pytest.approx(1000 * 0.003 + 0.001)


def test_one_slow_motion_lets_the_link_run_ahead_by_one_queue() -> None:
    seconds = np.array([1.0, *[0.001] * 60])
    took = LinkFloor(15).slowed(seconds, np.full(61, 0.003))
    # 14 lines come while the first is carried out and 5 more while those are; from then on each is waited for.
    assert took[1:15] == pytest.approx(np.full(14, 0.001))
    assert took[30:] == pytest.approx(np.full(31, 0.003))
