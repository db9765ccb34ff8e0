"""Rows of the Grbl, found again in its moves."""

from itertools import pairwise

import pytest

from bench.loadrig import ROW_MOVES, ROWS, STEPS_MM, _Rows, rows


def test_every_row_has_the_same_moves_and_stays_where_it_is() -> None:
    head, *lines = rows(2 * ROWS + 2)
    assert head == "G21 G90"
    assert len(lines) == (2 * ROWS + 2) * ROW_MOVES
    x_mm = [float(line.split()[1][1:]) for line in lines]
    y_mm = [float(line.split()[2][1:]) for line in lines]
    for row in range(2 * ROWS + 2):
        ways = [abs(after - before) for before, after in pairwise(x_mm[row * ROW_MOVES : (row + 1) * ROW_MOVES])]
        assert ways == pytest.approx(STEPS_MM)
    assert 10 <= min(x_mm) < max(x_mm) < 20
    assert 9 <= min(y_mm) < max(y_mm) < 50


def test_a_row_counts_where_it_lies_wholly_inside() -> None:
    found = _Rows()
    found.take([(0.1 * number, 0.1 * (number + 1)) for number in range(4 * ROW_MOVES)])
    row_s = 0.1 * ROW_MOVES
    assert found.between(0.0, 100.0) == pytest.approx([row_s] * 3)
    assert found.between(1.5 * row_s, 100.0) == pytest.approx([row_s] * 2)
    assert found.between(1.5 * row_s, 3.5 * row_s) == pytest.approx([row_s])
    assert found.dry_s(0.0, 100.0) == 0


def test_a_planner_that_ran_dry_is_seen_across_two_looks() -> None:
    found = _Rows()
    found.take([(0.0, 1.0), (1.0, 2.0)])
    found.take([(2.5, 3.0), (3.0, 4.0)])
    assert found.dry_s(0.0, 10.0) == pytest.approx(0.5)
    assert found.dry_s(2.6, 10.0) == 0
