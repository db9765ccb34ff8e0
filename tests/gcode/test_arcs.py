"""Arcs: lengths, sweeps and extremes against walking along them."""

from dataclasses import dataclass
from math import cos, hypot, isclose, nan, pi, sin

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gcode.arcs import arcs_from_offsets, arcs_from_radius, extremes_of, reach
from gcode.interpreter import Interpreter
from gcode.profile import load_profile
from gcode.words import parse_block
from tests.harness.programs import thorough

lengths = st.floats(-100, 100).map(lambda value: round(value, 3))
angles = st.floats(0.01, 2 * pi - 0.01)


Pair = tuple[float, float]


@dataclass(frozen=True)
class Arc:
    """One arc, taken out of columns of three: its neighbours must not matter."""

    way: Pair
    centre: Pair
    radius: float
    end_radius: float
    sweep: float

    @property
    def length(self) -> float:
        return abs(self.sweep) * self.radius

    def extremes(self) -> tuple[list[float], list[float]]:
        columns = [np.array([values] * 3).T for values in (self.centre, self.way)]
        low, high = extremes_of(columns[0], np.full(3, self.radius), np.full(3, self.sweep), columns[1])
        return low[:, 1].tolist(), high[:, 1].tolist()


def arc_from_offsets(way: Pair, centre: Pair, *, clockwise: bool) -> Arc | None:
    ways, centres = np.array([(1.0, 2.0), way, (nan, 0.0)]).T, np.array([(3.0, 4.0), centre, (0.0, 0.0)]).T
    found, radius, end_radius, sweep = arcs_from_offsets(ways, centres, np.array([True, clockwise, False]))
    if np.isnan(sweep[1]):
        return None
    x, y = found[:, 1].tolist()
    return Arc(way, (x, y), float(radius[1]), float(end_radius[1]), float(sweep[1]))


def arc_from_radius(way: Pair, radius: float, *, clockwise: bool) -> Arc | None:
    ways, radii = np.array([(1.0, 2.0), way, (0.0, 0.0)]).T, np.array([3.0, radius, 4.0])
    x, y = arcs_from_radius(ways, radii, np.array([False, clockwise, True]))[:, 1].tolist()
    return None if np.isnan(x) else arc_from_offsets(way, (x, y), clockwise=clockwise)


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


def test_turns_and_what_is_not_known() -> None:
    way = np.array([[0.0, 10.0, nan, 0.0], [0.0, 10.0, 0.0, 0.0]])
    centre = np.array([[5.0, 0.0, 1.0, 0.0], [0.0, 10.0, 1.0, 0.0]])
    _, radius, _, sweep = arcs_from_offsets(way, centre, np.array([True, False, True, False]), np.array([3, 2, 1, 1]))
    assert sweep == pytest.approx([-6 * pi, pi / 2 + 2 * pi, nan, nan], nan_ok=True)
    assert radius == pytest.approx([5, 10, nan, nan], nan_ok=True)


def test_a_circle_whose_end_is_rounded_is_a_full_one() -> None:
    for end in (1e-10, -1e-10, 1e-7):
        way, centre = np.array([[0.0], [end]]), np.array([[5.0], [0.0]])
        for clockwise in (True, False):
            sweep = arcs_from_offsets(way, centre, np.array([clockwise]))[3]
            assert abs(sweep[0]) == pytest.approx(2 * pi, abs=1e-6)


def test_the_reach_of_segments() -> None:
    interpreter = Interpreter(load_profile("rs274ngc"))
    for number, line in enumerate(("G18 G0 X10 Y1 Z0", "G3 X10 Z0 I-10 F9 Y4", "G1 X3", "G17 G2 X3 Y-2 R1"), 1):
        interpreter.step(number, parse_block(line))
    low, high = reach(interpreter.take())
    assert low[:3, 1].tolist() == pytest.approx([-10, 1, -10])
    assert high[:3, 1].tolist() == pytest.approx([10, 4, 10])
    # From nowhere to somewhere: only the end counts. And an arc that cannot be is its ends.
    assert (low[0, 0], high[0, 0]) == (10, 10)
    assert np.isnan(low[3]).all()
    assert (low[1, 3], high[1, 3]) == (-2, 4)
