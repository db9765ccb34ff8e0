"""The table of planned seconds: against the sum over the planner, and what overrides make of it."""

from math import inf, isfinite, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode.motion import Motion
from gcode.planner import plan
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, PROBE, RAPID, Segments
from gcode.timeline import PLACES, Overrides, Timeline, TimelineMaker, overrides_of
from tests.harness.planmodel import ODD, ROUTER, SMOOTH, move, segments

few = settings(max_examples=25, deadline=None)

coordinates = st.integers(-200, 200).map(lambda value: value / 4)
moves = st.builds(
    lambda kind, end, feed, dwell_s, centre: move(
        kind, end, feed=feed, dwell_s=dwell_s, **({"centre": centre, "plane": 17} if kind in (CW, CCW) else {})
    ),
    st.sampled_from((FEED, FEED, FEED, RAPID, DWELL, HOMING, PROBE, CW, CCW)),
    st.tuples(coordinates, coordinates, coordinates),
    st.sampled_from((60.0, 600.0, 9000.0, nan, 0.0)),
    st.sampled_from((0.0, 0.25, 1.0)),
    st.tuples(st.floats(0.05, 3), st.floats(-3, 3)),
)


@st.composite
def programs(draw: st.DrawFn) -> tuple[Segments, int]:
    """Segments on ascending lines, several on some and none on others, and how many lines there are."""
    rows = draw(st.lists(moves, min_size=1, max_size=16))
    for before, row in zip([move(FEED, (0.0, 0.0, 0.0)), *rows], rows, strict=False):
        if row["kind"] == DWELL:
            row["end"] = before["end"]
    found = segments(rows)
    spread = draw(st.sampled_from((1, 3, 500)))
    gaps = draw(st.lists(st.integers(0, spread), min_size=len(found), max_size=len(found)))
    found.line = np.cumsum(np.array(gaps, np.int64)) + 1
    return found, int(found.line[-1]) + draw(st.integers(0, spread))


machines = st.sampled_from((ROUTER, ODD, SMOOTH, Motion()))


@few
@given(programs(), machines)
def test_seconds_before_a_line_are_the_sum_of_the_planner(program: tuple[Segments, int], motion: Motion) -> None:
    found, lines = program
    timeline = Timeline.of([found], motion, found.axes, lines)
    seconds = plan(found, motion)
    assert timeline.total_s == pytest.approx(seconds.sum(), rel=1e-9, abs=1e-9)
    step = -(-lines // PLACES)
    for line in range(1, lines + 1, step):  # behind each place nothing is rounded
        assert timeline.seconds_before(line) == pytest.approx(seconds[found.line < line].sum(), rel=1e-9, abs=1e-9)


@few
@given(programs(), st.integers(1, 7))
def test_pieces_of_any_size_give_the_same(program: tuple[Segments, int], size: int) -> None:
    found, lines = program
    pieces = [found.take(slice(at, at + size)) for at in range(0, len(found), size)]
    whole, cut = (Timeline.of(parts, ROUTER, found.axes, lines) for parts in ([found], pieces))
    for line in (1, lines // 2, lines, lines + 1):
        assert cut.seconds_before(line) == pytest.approx(whole.seconds_before(line), rel=1e-9, abs=1e-9)


@few
@given(programs(), st.integers(0, 20_000), st.integers(0, 20_000))
def test_it_never_runs_backwards_and_parts_add_up(program: tuple[Segments, int], one: int, other: int) -> None:
    found, lines = program
    timeline = Timeline.of([found], ROUTER, found.axes, lines)
    first, last = sorted((one, other))
    span = timeline.between(first, last)
    assert min(span.feed_s, span.rapid_s, span.other_s) >= -1e-9
    parts = timeline.between(0, first).seconds() + span.seconds() + timeline.between(last, lines).seconds()
    assert parts == pytest.approx(timeline.between(0, max(lines, last)).seconds(), abs=1e-6)


def cuts(count: int, length_mm: float, feed: float) -> Segments:
    rows = [move(FEED, (length_mm * (number % 2), number * 1.0, 0.0), feed=feed) for number in range(count)]
    rows += [move(RAPID, (100.0 * (number % 2), 0.0, 0.0)) for number in range(count)]
    found = segments(rows)
    found.line = np.arange(1, len(found) + 1)
    return found


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.25, 2.0])
@pytest.mark.parametrize("feed", [300.0, 1200.0])
def test_a_feed_override_changes_what_the_planner_says_it_does(factor: float, feed: float) -> None:
    found = cuts(100, 40.0, feed)
    timeline = Timeline.of([found], ROUTER, found.axes, 200)
    planned = plan(found, ROUTER, feed_override=factor).sum()
    assert timeline.between(0, 200).seconds(Overrides(feed=factor)) == pytest.approx(planned, rel=0.05)


def test_the_feed_override_leaves_rapids_and_dwells_alone() -> None:
    found = segments([move(RAPID, (500.0, 0.0, 0.0)), move(DWELL, (500.0, 0.0, 0.0), dwell_s=30.0)])
    found.line = np.array([1, 2])
    span = Timeline.of([found], ROUTER, found.axes, 2).between(0, 2)
    assert (span.feed_s, span.other_s) == (0.0, pytest.approx(30.0))
    assert span.seconds(Overrides(feed=0.1)) == span.seconds()
    assert span.seconds(Overrides(rapid=0.5)) == pytest.approx(span.rapid_s * 2 + 30.0)


def test_ten_million_lines_are_a_small_table() -> None:
    lines, count = 10_000_000, 1000
    found = cuts(count // 2, 10.0, 600.0)
    found.line = np.linspace(1, lines, count).astype(np.int64)
    timeline = Timeline.of([found], ROUTER, found.axes, lines)
    seconds = plan(found, ROUTER)
    assert timeline._table.nbytes < 64_000
    assert timeline.seconds_before(lines // 2) == pytest.approx(seconds[found.line < lines // 2].sum(), abs=2.0)
    assert timeline.total_s == pytest.approx(seconds.sum())


def test_lines_beyond_the_program_and_no_motion_at_all() -> None:
    nothing = Timeline.of([], ROUTER, "XYZ", 0)
    assert (nothing.total_s, nothing.seconds_before(99)) == (0.0, 0.0)
    found = cuts(2, 10.0, 600.0)
    short = Timeline.of([found], ROUTER, found.axes, 2)  # the program has grown since its lines were counted
    assert short.total_s == pytest.approx(plan(found, ROUTER).sum())
    assert short.between(5, 3).seconds() == 0.0
    assert short.between(-4, 99).seconds() == short.total_s


@pytest.mark.parametrize("odd", [nan, inf, -inf, 1e300])
def test_what_is_no_number_becomes_no_estimate_of_its_own(odd: float) -> None:
    found = segments([move(FEED, (1.0, 0.0, 0.0), feed=60.0), move(FEED, (odd, 0.0, 0.0), feed=odd)])
    found.line = np.array([1, 2])
    timeline = Timeline.of([found], ROUTER, found.axes, 2)
    assert isfinite(timeline.total_s)
    assert timeline.seconds_before(2) == pytest.approx(1.0, rel=0.2)


def test_the_link_is_counted_by_line() -> None:
    maker = TimelineMaker(ROUTER, "XYZ", 4)
    maker.add_link(np.array([1, 2, 4]), np.array([0.5, 0.25, 2.0]))
    timeline = maker.finish()
    assert [timeline.between(0, line).link_s for line in range(5)] == [0.0, 0.5, 0.75, 0.75, 2.75]


def test_overrides_in_per_cent() -> None:
    assert overrides_of({"feed": 150, "spindle": 20}) == Overrides(1.5, 1.0)
    assert overrides_of({"feed": 0, "rapid": nan}) == Overrides()
    assert overrides_of({"rapid": 25}) == Overrides(1.0, 0.25)
