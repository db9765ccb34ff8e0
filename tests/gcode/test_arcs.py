"""Arcs: lengths, sweeps and extremes against walking along them."""

from math import cos, hypot, isclose, pi, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gcode.arcs import Arc, arc_from_offsets, arc_from_radius
from tests.harness.programs import thorough

lengths = st.floats(-100, 100).map(lambda value: round(value, 3))
angles = st.floats(0.01, 2 * pi - 0.01)


def walk(arc: Arc, steps: int = 2000) -> list[tuple[float, float]]:
    """Points along the arc, from its start."""
    x, y = -arc.centre[0], -arc.centre[1]
    turns = [arc.sweep * n / steps for n in range(steps + 1)]
    return [(arc.centre[0] + x * cos(t) - y * sin(t), arc.centre[1] + x * sin(t) + y * cos(t)) for t in turns]


def test_quarter_turns() -> None:
    arc = arc_from_offsets((10, 10), (0, 10), clockwise=False)
    assert arc is not None
    assert isclose(arc.sweep, pi / 2)
    assert isclose(arc.length, 5 * pi)
    other_way = arc_from_offsets((10, 10), (0, 10), clockwise=True)
    assert other_way is not None
    assert isclose(other_way.sweep, -3 * pi / 2)


@pytest.mark.parametrize("clockwise", [True, False])
def test_the_same_start_and_end_make_a_full_circle(clockwise: bool) -> None:
    arc = arc_from_offsets((0, 0), (5, 0), clockwise=clockwise)
    assert arc is not None
    assert isclose(arc.length, 10 * pi)
    low, high = arc.extremes()
    assert low == pytest.approx((0, -5))
    assert high == pytest.approx((10, 5))


def test_arcs_that_cannot_be() -> None:
    assert arc_from_offsets((1, 0), (0, 0), clockwise=True) is None
    assert arc_from_radius((0, 0), 5, clockwise=True) is None
    assert arc_from_radius((10, 0), 4.9, clockwise=True) is None
    assert arc_from_radius((10, 0), 5, clockwise=True) is not None


@given(st.floats(0.5, 50), angles, angles, st.booleans())
@thorough
def test_extremes_are_those_of_walking(radius: float, from_angle: float, turn: float, clockwise: bool) -> None:
    to_angle = from_angle - turn if clockwise else from_angle + turn
    start = (radius * cos(from_angle), radius * sin(from_angle))
    way = (radius * cos(to_angle) - start[0], radius * sin(to_angle) - start[1])
    arc = arc_from_offsets(way, (-start[0], -start[1]), clockwise=clockwise)
    assert arc is not None
    assert isclose(arc.length, radius * turn, rel_tol=1e-6)
    points = walk(arc)
    assert points[-1] == pytest.approx(way, abs=1e-6)
    low, high = arc.extremes()
    for axis in (0, 1):
        values = [point[axis] for point in points]
        assert low[axis] == pytest.approx(min(values), abs=1e-3 * radius)
        assert high[axis] == pytest.approx(max(values), abs=1e-3 * radius)


@given(lengths, lengths, st.floats(1.001, 5), st.booleans(), st.booleans())
@thorough
def test_radius_form_chooses_by_its_sign(x: float, y: float, factor: float, clockwise: bool, negative: bool) -> None:
    assume(hypot(x, y) > 0.1)
    radius = hypot(x, y) / 2 * factor * (-1 if negative else 1)
    arc = arc_from_radius((x, y), radius, clockwise=clockwise)
    assert arc is not None
    assert isclose(arc.radius, abs(radius), rel_tol=1e-6)
    assert isclose(arc.end_radius, abs(radius), rel_tol=1e-6)
    assert (abs(arc.sweep) > pi) == negative
    assert (arc.sweep < 0) == clockwise
