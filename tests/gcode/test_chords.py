"""Arcs as chords and ends on steps: by hand, through the seconds that they take."""

from math import floor, hypot, nan, pi, sin, sqrt

import pytest

from gcode.motion import Motion
from gcode.planner import plan
from gcode.segments import CCW, CW, FEED
from tests.harness.planmodel import ROUTER, SMOOTH, move, segments


def test_ways_shorter_than_half_a_step_are_no_blocks_but_add_up() -> None:
    rows = [move(FEED, (0.002 * number, 0.0, 0.0)) for number in range(1, 501)]
    seconds = plan(segments(rows), ROUTER)
    assert (seconds > 0).sum() == 100
    assert seconds.sum() > 0.1


def test_a_full_circle_is_its_chords() -> None:
    circle = segments([move(CCW, (0.0, 0.0, 0.0), centre=(10.0, 0.0))])
    count = floor(2 * pi * 10 / 2 / sqrt(0.002 * (20 - 0.002)))
    length = count * 2 * 10 * sin(pi / count)
    assert plan(circle, SMOOTH)[0] == pytest.approx(length / 20 + 0.1, rel=2e-3)
    assert plan(circle, SMOOTH)[0] > length / 20 + 0.09


def test_a_helix_in_each_plane_takes_the_same_where_the_axes_are_alike() -> None:
    alike = Motion(dict.fromkeys("xyz", 3000.0), dict.fromkeys("xyz", 200.0))
    ways = {17: (0.0, 0.0, 5.0), 18: (0.0, 5.0, 0.0), 19: (5.0, 0.0, 0.0)}
    took = [plan(segments([move(CW, end, centre=(3.0, 1.0), plane=at)]), alike)[0] for at, end in ways.items()]
    assert took == pytest.approx([took[0]] * 3)
    assert took[0] > hypot(2 * pi * hypot(3, 1), 5) / 20


def test_an_arc_from_an_unknown_place_is_known_all_the_same() -> None:
    rows = [move(CCW, (nan, nan, nan), centre=(10.0, 0.0))]
    unknown = segments(rows, start=(nan, nan, nan))
    unknown.radius[:], unknown.sweep[:] = 10.0, 2 * pi
    known = segments([move(CCW, (0.0, 0.0, 0.0), centre=(10.0, 0.0))])
    assert plan(unknown, SMOOTH) == pytest.approx(plan(known, SMOOTH))
