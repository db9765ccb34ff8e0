"""Legs and trapezoids against what can be reckoned by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.motion import ORIGIN, Leg, Point, Trapezoid, arc_by_centre, arc_by_radius, first_exit

LOW: Point = (0.0, 0.0, -10.0, -1e9, -1e9, -1e9)
HIGH: Point = (100.0, 100.0, 10.0, 1e9, 1e9, 1e9)


def point(x: float = 0.0, y: float = 0.0, z: float = 0.0, a: float = 0.0) -> Point:
    return (x, y, z, a, 0.0, 0.0)


def test_a_long_way_is_cruised() -> None:
    # 0.1 s up to 50 mm/s, 0.1 s down, each 2.5 mm; 95 mm in between at 50 mm/s.
    ramp = Trapezoid(100.0, 50.0, 500.0)
    assert ramp.seconds == pytest.approx(2.1)
    assert ramp.distance(0.1) == pytest.approx(2.5)
    assert ramp.distance(1.05) == pytest.approx(50.0)
    assert ramp.distance(2.0) == pytest.approx(97.5)
    assert ramp.distance(99.0) == 100.0
    assert ramp.distance(-1.0) == 0.0


def test_a_short_way_never_reaches_its_speed() -> None:
    ramp = Trapezoid(5.0, 1000.0, 500.0)
    assert ramp.seconds == pytest.approx(2 * math.sqrt(5.0 / 500.0))
    assert ramp.peak_mm_s == pytest.approx(50.0)
    assert ramp.distance(ramp.seconds / 2) == pytest.approx(2.5)


def test_no_way_takes_no_time() -> None:
    assert Trapezoid(0.0, 10.0, 10.0).seconds == 0.0
    assert Leg(ORIGIN, ORIGIN, 1.0, 1.0).after(0.0) == ORIGIN


@given(length=st.floats(1e-3, 1e4), speed=st.floats(0.1, 500), acceleration=st.floats(1, 5000), part=st.floats(0, 1))
def test_distance_never_goes_back(length: float, speed: float, acceleration: float, part: float) -> None:
    ramp = Trapezoid(length, speed, acceleration)
    here = ramp.distance(ramp.seconds * part)
    assert -1e-9 <= here <= length * (1 + 1e-9)
    assert ramp.distance(ramp.seconds * part * 0.9) <= here + 1e-9 * length


def test_rotary_degrees_count_when_nothing_else_moves() -> None:
    assert Leg(point(), point(a=90), 1.0, 1.0).length_mm == 90.0
    assert Leg(point(), point(x=3, y=4, a=90), 1.0, 1.0).length_mm == 5.0


@pytest.mark.parametrize(
    ("clockwise", "middle", "length"),
    [(True, (5.0, 5.0), math.pi * 5), (False, (5.0, -5.0), math.pi * 5)],
)
def test_half_circles(clockwise: bool, middle: tuple[float, float], length: float) -> None:
    start, end = point(), point(x=10)
    centre, sweep = arc_by_centre(start, end, (5.0, 0.0), clockwise=clockwise)
    leg = Leg(start, end, 10.0, 500.0, centre, sweep)
    assert leg.length_mm == pytest.approx(length)
    assert leg.at(0.5)[:2] == pytest.approx(middle)
    assert leg.after(leg.seconds) == end


@pytest.mark.parametrize("clockwise", [True, False])
def test_the_full_circle(clockwise: bool) -> None:
    start = point(x=10)
    centre, sweep = arc_by_centre(start, start, (-10.0, 0.0), clockwise=clockwise)
    leg = Leg(start, start, 10.0, 500.0, centre, sweep)
    assert leg.length_mm == pytest.approx(math.tau * 10)
    assert leg.at(0.25)[:2] == pytest.approx((0.0, -10.0 if clockwise else 10.0))


def test_a_helix_is_longer_than_its_circle() -> None:
    centre, sweep = arc_by_centre(point(x=10), point(x=10, z=-3), (-10.0, 0.0), clockwise=True)
    assert Leg(point(x=10), point(x=10, z=-3), 1.0, 1.0, centre, sweep).length_mm == pytest.approx(
        math.hypot(math.tau * 10, 3)
    )


@pytest.mark.parametrize(
    ("radius", "clockwise"),
    [
        (10.0, True),
        (10.0, False),
        (-10.0, True),
        (-10.0, False),
    ],
)
def test_radius_arcs_take_the_way_that_r_says(radius: float, clockwise: bool) -> None:
    start, end = point(), point(x=10, y=10)
    offset = arc_by_radius(start, end, radius, clockwise=clockwise)
    assert offset is not None
    assert math.hypot(*offset) == pytest.approx(10.0)
    _, sweep = arc_by_centre(start, end, offset, clockwise=clockwise)
    assert (sweep < 0) == clockwise
    assert (abs(sweep) < math.pi) == (radius > 0)


@pytest.mark.parametrize(("end", "radius"), [(point(x=30), 10.0), (point(), 10.0)])
def test_radius_arcs_that_do_not_exist(end: Point, radius: float) -> None:
    assert arc_by_radius(point(), end, radius, clockwise=True) is None


def test_a_straight_leg_leaves_where_it_crosses() -> None:
    found = first_exit(Leg(point(50, 50), point(150, 250), 1.0, 1.0), LOW, HIGH)
    assert found is not None
    assert (found.axis, found.beyond_end, found.fraction) == (1, True, pytest.approx(0.25))
    found = first_exit(Leg(point(50, 50), point(-50, 50), 1.0, 1.0), LOW, HIGH)
    assert found is not None
    assert (found.axis, found.beyond_end, found.fraction) == (0, False, pytest.approx(0.5))


def test_the_border_itself_is_inside() -> None:
    assert first_exit(Leg(point(), point(100, 100, 10), 1.0, 1.0), LOW, HIGH) is None


def test_outside_from_the_start() -> None:
    found = first_exit(Leg(point(-5), point(50), 1.0, 1.0), LOW, HIGH)
    assert found is not None
    assert found.fraction == 0.0


def test_an_arc_bulges_over_the_border_between_two_points_inside() -> None:
    start, end = point(10, 50), point(10, 60)
    centre, sweep = arc_by_centre(start, end, (0.0, 5.0), clockwise=True)
    assert first_exit(Leg(start, end, 1.0, 1.0, centre, sweep), LOW, HIGH) is None
    start, end = point(2, 50), point(2, 60)
    centre, sweep = arc_by_centre(start, end, (0.0, 5.0), clockwise=True)
    leg = Leg(start, end, 1.0, 1.0, centre, sweep)
    found = first_exit(leg, LOW, HIGH)
    assert found is not None
    assert (found.axis, found.beyond_end) == (0, False)
    assert leg.cut(found.fraction).end[0] == pytest.approx(0.0, abs=1e-5)


COORDINATE = st.floats(-40, 140).map(lambda value: round(value, 2))


@given(
    start=st.tuples(COORDINATE, COORDINATE, st.floats(-12, 12)),
    end=st.tuples(COORDINATE, COORDINATE, st.floats(-12, 12)),
    offset=st.none() | st.tuples(st.floats(-30, 30), st.floats(-30, 30)),
    clockwise=st.booleans(),
)
def test_a_leg_without_an_exit_stays_in_the_field_and_one_with_an_exit_does_not(
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    offset: tuple[float, float] | None,
    clockwise: bool,
) -> None:
    first, last = point(*start), point(*end)
    leg = Leg(first, last, 1.0, 1.0)
    if offset is not None:
        leg = Leg(first, last, 1.0, 1.0, *arc_by_centre(first, last, offset, clockwise=clockwise))
    places = [leg.at(sample / 128) for sample in range(129)]
    inside = all(
        low - 1e-5 <= value <= high + 1e-5
        for place in places
        for low, value, high in zip(LOW, place, HIGH, strict=True)
    )
    found = first_exit(leg, LOW, HIGH)
    if found is None:
        assert inside
    else:
        beyond = leg.at(min(1.0, found.fraction + 1e-6))[found.axis]
        assert beyond <= LOW[found.axis] + 1e-2 or beyond >= HIGH[found.axis] - 1e-2
