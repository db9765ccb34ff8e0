"""Coarser levels: fewer corners, the bound kept, nothing lost that tells what was done."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode.detail import Thinning
from gcode.segments import CCW, CW, FEED, RAPID
from gcode.vertices import START, Arcs, Vertices

BASE = 50_000


def path(
    points: list[tuple[int, ...]],
    *,
    kind: list[int] | None = None,
    unknown: list[int] | None = None,
    bulge: float = 0.0,
) -> Vertices:
    """Arcs, by `kind`, run `bulge` counts beside their chord."""
    count = len(points)
    at = np.flatnonzero(np.isin(kind or [FEED] * count, (CW, CCW)))
    return Vertices(
        np.array(points, np.int32).T,
        np.arange(1, count + 1, dtype=np.int32),
        np.array(kind or [FEED] * count, np.uint8),
        np.full(count, 600.0, np.float32),
        np.zeros(count, np.int32),
        np.zeros(count, np.int32),
        np.array(unknown or [0] * count, np.uint16),
        Arcs(
            at,
            np.array([at, at], np.int32),
            np.ones(len(at), np.float32),
            np.full(len(at), 17, np.uint8),
            np.full(len(at), bulge),
        ),
    )


def farthest(points: np.ndarray, chosen: np.ndarray) -> float:  # type: ignore[type-arg]
    """How far a path runs from the edges that stand for it, mm, measured at points along it."""
    worst = 0.0
    for first, last in itertools.pairwise(chosen):
        a, b = points[first].astype(float), points[last].astype(float)
        way = b - a
        for left in range(first, last):
            for share in (0.0, 0.3, 0.7, 1.0):
                p = points[left] + (points[left + 1] - points[left]).astype(float) * share
                t = np.clip(np.dot(p - a, way) / (np.dot(way, way) or 1.0), 0.0, 1.0)
                worst = max(worst, float(np.linalg.norm(p - a - way * t)))
    return worst / 1000


steps = st.tuples(*[st.integers(-300, 300)] * 3)


@settings(max_examples=60, deadline=None)
@given(st.lists(steps, min_size=2, max_size=60), st.floats(0.001, 1.0))
def test_the_bound_is_kept(walk: list[tuple[int, int, int]], tolerance_mm: float) -> None:
    points = np.cumsum(walk, axis=0)
    thinning = Thinning(path([tuple(point) for point in points]))
    for tolerance in (tolerance_mm / 4, tolerance_mm):
        chosen = thinning.thin(tolerance)
        assert chosen[0] == 0
        assert chosen[-1] == len(points) - 1
        assert np.all(np.diff(chosen) > 0)
        assert farthest(points, chosen) <= tolerance + 1e-9


def test_a_straight_line_is_its_ends_and_a_circle_few_corners() -> None:
    line = Thinning(path([(at, 2 * at, 0) for at in range(1001)]))
    assert len(line.thin(0.001)) < 10
    angles = np.linspace(0, 2 * np.pi, 2000)
    ring = Thinning(path([(round(BASE * np.cos(a)), round(BASE * np.sin(a)), 0) for a in angles]))
    # Nothing can do with fewer chords than the arc itself asks for; this does with less than four times as many.
    assert len(ring.thin(0.1)) < 4 * np.pi / np.arccos(1 - 0.1 / 50)


def test_there_and_back_is_not_a_point() -> None:
    points = [(0, 0, 0), (10_000, 0, 0), (0, 0, 0)]
    assert Thinning(path(points)).thin(1.0).tolist() == [0, 1, 2]


def test_points_on_one_place_fall_into_one() -> None:
    assert Thinning(path([(5, 5, 5)] * 9)).thin(0.02).tolist() == [0, 8]


@pytest.mark.parametrize(
    ("kind", "unknown", "stay"),
    [
        ([FEED] * 7, None, [0, 6]),
        ([START | FEED, FEED, FEED, RAPID, RAPID, RAPID, RAPID], None, [0, 2, 6]),
        ([FEED, FEED, FEED, START | FEED, FEED, FEED, FEED], None, [0, 2, 3, 6]),
        ([FEED, FEED, CW, CW, CCW, FEED, FEED], None, [0, 6]),
        ([FEED] * 7, [1, 1, 1, 0, 0, 0, 0], [0, 2, 3, 6]),
    ],
)
def test_corners_that_tell_something_stay(kind: list[int], unknown: list[int] | None, stay: list[int]) -> None:
    found = Thinning(path([(at * 100, 0, 0) for at in range(7)], kind=kind, unknown=unknown)).thin(5.0)
    assert found.tolist() == stay


@pytest.mark.parametrize("column", ["tool", "frame"])
def test_changes_of_tool_and_frame_stay(column: str) -> None:
    vertices = path([(at * 100, 0, 0) for at in range(7)])
    getattr(vertices, column)[3:] = 1
    assert Thinning(vertices).thin(5.0).tolist() == [0, 2, 6]


def test_feeds_may_fall_together() -> None:
    vertices = path([(at * 100, 0, 0) for at in range(7)])
    vertices.feed[:] = range(7)
    thinning = Thinning(vertices)
    thinning.thin(5.0)
    assert thinning.left().feed.tolist() == [0, 6]


def test_an_arc_stays_until_its_bulge_is_within_the_tolerance() -> None:
    kind = [START | FEED, FEED, CW, CCW, FEED, FEED, FEED]
    thinning = Thinning(path([(at * 100, 0, 0) for at in range(7)], kind=kind, bulge=400.0))
    assert thinning.thin(0.39).tolist() == [0, 1, 2, 3, 6]
    left = thinning.left()
    assert left.kind.tolist() == [START | FEED, FEED, CW, CCW, FEED]
    assert left.arcs.at.tolist() == [2, 3]
    assert left.arcs.centre[0].tolist() == [2, 3], "those of vertices 2 and 3"
    assert thinning.thin(0.5).tolist() == [0, 6]
    assert (thinning.left().kind.tolist(), len(thinning.left().arcs)) == ([START | FEED, FEED], 0)


def test_what_an_arc_is_off_counts_when_a_corner_goes() -> None:
    points = [(0, 0, 0), (1000, 0, 0), (2000, 300, 0), (3000, 0, 0), (4000, 0, 0)]
    kind = [START | FEED, FEED, CW, FEED, FEED]
    assert Thinning(path(points, kind=kind, bulge=50.0)).thin(0.4).tolist() == [0, 2, 4]
    assert Thinning(path(points, kind=kind, bulge=350.0)).thin(0.4).tolist() == [0, 1, 2, 4]


def test_an_arc_that_cannot_be_is_a_start_and_stays() -> None:
    vertices = path([(at * 100, 0, 0) for at in range(5)], kind=[START | FEED, FEED, START | CW, FEED, FEED])
    assert Thinning(vertices).thin(5.0).tolist() == [0, 1, 2, 4]


def test_a_piece_of_one_or_two() -> None:
    for count in (1, 2):
        assert len(Thinning(path([(0, 0, 0)] * count)).thin(1.0)) == count
