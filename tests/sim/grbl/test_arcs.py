"""Arcs to chords (spec gcode §5)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.grbl.arcs import chords

XY = (0, 1, 2)


def test_as_many_chords_as_the_tolerance_asks_for() -> None:
    # Half a circle of 10 mm at 0.002 mm: floor(0.5·π·10 / sqrt(0.002·(20 − 0.002)))
    ends = chords((0, 0, 0), (20, 0, 0), (10, 0), XY, clockwise=True, tolerance_mm=0.002)
    assert len(ends) == math.floor(0.5 * math.pi * 10 / math.sqrt(0.002 * 19.998)) == 78
    assert ends[-1] == (20, 0, 0)


@pytest.mark.parametrize(("clockwise", "quarter"), [(True, (10, 10, -2.5)), (False, (10, -10, -2.5))])
def test_full_circles(clockwise: bool, quarter: tuple[float, float, float]) -> None:
    ends = chords((0, 0, 0), (0, 0, -10), (10, 0), XY, clockwise=clockwise, tolerance_mm=0.002)
    assert any(math.dist(end, quarter) < 0.4 for end in ends)
    assert ends[-1] == (0, 0, -10)


def test_an_arc_smaller_than_the_tolerance_is_one_line() -> None:
    assert chords((0, 0, 0), (0.001, 0, 0), (0.0005, 0), XY, clockwise=True, tolerance_mm=0.002) == [(0.001, 0, 0)]


@given(st.floats(0.1, 500), st.floats(0.01, 6.2), st.floats(0, 6.28), st.booleans())
def test_no_chord_is_further_from_the_circle_than_twice_the_tolerance(
    radius: float, sweep: float, begin: float, clockwise: bool
) -> None:
    sign = -1 if clockwise else 1
    start = (radius * math.cos(begin), radius * math.sin(begin), 0.0)
    end = (radius * math.cos(begin + sign * sweep), radius * math.sin(begin + sign * sweep), 0.0)
    ends = chords(start, end, (-start[0], -start[1]), XY, clockwise=clockwise, tolerance_mm=0.002)
    last = start
    for place in ends:
        middle = math.hypot((place[0] + last[0]) / 2, (place[1] + last[1]) / 2)
        assert math.hypot(*place[:2]) == pytest.approx(radius, rel=1e-9)
        if len(ends) > 3:
            assert radius - middle < 0.004
        last = place
