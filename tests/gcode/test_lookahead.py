"""The look-ahead as columns against the same recurrences, one block after the other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.lookahead import backward_limits, durations, forward_speeds
from tests.harness.programs import quick

speeds2 = st.sampled_from((0.0, 1.0, 400.0, 2500.0)) | st.floats(0, 1e4).map(lambda value: round(value, 3))
energies = st.sampled_from((0.5, 4.0, 400.0)) | st.floats(0.01, 1e4).map(lambda value: round(value, 3))
blocks = st.lists(st.tuples(speeds2, energies), min_size=1, max_size=60)


@quick
@given(blocks, st.integers(0, 40))
def test_every_window_can_brake_to_a_stop(blocks: list[tuple[float, float]], ahead: int) -> None:
    limit2, energy = (np.array(column) for column in zip(*blocks, strict=True))
    if ahead > len(blocks):
        return
    expected = []
    for first in range(len(blocks) - ahead + 1):
        enter2 = 0.0
        for later in reversed(range(first, first + ahead)):
            enter2 = min(limit2[later], enter2 + energy[later])
        expected.append(enter2)
    assert backward_limits(limit2, energy, ahead)[: len(expected)] == pytest.approx(expected[: len(blocks)])


@quick
@given(blocks)
def test_no_block_is_entered_faster_than_the_one_before_can_reach(blocks: list[tuple[float, float]]) -> None:
    allowed2, energy = (np.array(column) for column in zip(*blocks, strict=True))
    expected = [allowed2[0]]
    for before, allowed in zip(energy, allowed2[1:], strict=False):
        expected.append(min(allowed, expected[-1] + before))
    assert forward_speeds(allowed2, energy) == pytest.approx(expected)


def test_a_long_way_of_small_blocks_keeps_its_digits() -> None:
    # A million of them: a sum from the beginning would have lost the seventh digit of a speed near nothing.
    energy = np.full(1_000_000, 400.0)
    allowed2 = np.full(1_000_000, 1e-6)
    assert (backward_limits(allowed2, energy, 14) == 1e-6).all()
    assert (forward_speeds(allowed2, energy) == 1e-6).all()


def test_durations_of_the_shapes_of_a_block() -> None:
    entry2, exit2 = np.array([0.0, 0.0, 400.0, 400.0, 0.0]), np.array([0.0, 400.0, 0.0, 400.0, 0.0])
    length = np.array([100.0, 1.0, 1.0, 100.0, 0.5])
    took = durations(entry2, exit2, np.full(5, 20.0), np.full(5, 200.0), length)
    assert took == pytest.approx([5.1, 0.1, 0.1, 5.0, 0.1])
