"""Seconds of a program: against the same model written plainly, and against the firmware."""

from math import inf, nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.chords import chord_counts
from gcode.interpreter import Interpreter
from gcode.longarcs import FEWEST_CHORDS
from gcode.motion import Motion
from gcode.planblocks import STOP_S
from gcode.planner import Planner, plan
from gcode.profile import load_profile
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, PROBE, RAPID
from gcode.words import decode_line, parse_block
from tests.harness.planmodel import ODD, ROUTER, SMOOTH, Row, move, seconds_of, segments
from tests.harness.programs import corpus_files, quick

# --- programs ------------------------------------------------------------------------------------------------------

coordinates = st.one_of(
    st.integers(-40, 40).map(lambda value: value / 4), st.integers(-300, 300).map(lambda value: value / 1000)
)
ends = st.tuples(coordinates, coordinates, coordinates)
plain = st.builds(
    lambda kind, end, feed, sync, spindle, dwell_s: move(
        kind, end, feed=feed, sync=sync, spindle=spindle, dwell_s=dwell_s
    ),
    st.sampled_from((FEED, FEED, FEED, FEED, RAPID, HOMING, PROBE, DWELL)),
    ends,
    st.sampled_from((5.0, 60.0, 600.0, 1200.0, 9000.0)),
    st.booleans().flatmap(lambda often: st.booleans() if often else st.just(False)),
    st.sampled_from((0.0, 1000.0, -1000.0)),
    st.sampled_from((0.0, 0.01, 0.25, 1.0)),
)
arcs = st.builds(
    lambda kind, end, centre, plane: move(kind, end, centre=centre, plane=plane),
    st.sampled_from((CW, CCW)),
    ends,
    st.tuples(st.floats(0.05, 3), st.floats(-3, 3)),
    st.sampled_from((17, 18, 19)),
)
programs = st.lists(st.one_of(plain, plain, plain, plain, plain, plain, arcs), min_size=1, max_size=40)
machines = st.builds(
    lambda base, blocks, deviation: Motion(
        base.max_rate, base.acceleration, {}, deviation, 0.02, blocks, base.laser, base.steps_per_mm
    ),
    st.sampled_from((ODD, SMOOTH)),
    st.integers(1, 32),
    st.sampled_from((0.01, 0.0, 0.2)),
)


def still(rows: list[Row]) -> list[Row]:
    """A dwell goes nowhere."""
    for before, row in zip([move(FEED, (0.0, 0.0, 0.0)), *rows], rows, strict=False):
        if row["kind"] == DWELL:
            row["end"] = before["end"]
    return rows


@quick
@given(programs.map(still), machines)
def test_as_the_same_model_block_by_block(rows: list[Row], motion: Motion) -> None:
    program = segments(rows)
    # Chords that are drawn together end on whole steps at their last only (longarcs.py).
    exact = not motion.steps_per_mm or not (chord_counts(program, motion.arc_tolerance_mm) >= FEWEST_CHORDS).any()
    close = 1e-9 if exact else 2e-3
    assert plan(program, motion) == pytest.approx(seconds_of(program, motion), rel=close, abs=close)


@quick
@given(programs.map(still), machines, st.lists(st.integers(0, 12), max_size=12))
def test_pieces_of_any_size_take_the_same(rows: list[Row], motion: Motion, sizes: list[int]) -> None:
    program = segments(rows)
    planner, parts, at = Planner(motion, program.axes), [], 0
    for size in [*sizes, len(program)]:
        parts.append(planner.feed(program.take(slice(at, at + size))))
        at += size
    parts.append(planner.flush())
    assert np.concatenate(parts) == pytest.approx(plan(program, motion), rel=1e-9, abs=1e-12)


# --- by hand -------------------------------------------------------------------------------------------------------


def test_a_trapezoid() -> None:
    # 100 mm at 20 mm/s with 200 mm/s²: 0.1 s and 1 mm each for the ramps, 98 mm level.
    assert plan(segments([move(FEED, (100.0, 0.0, 0.0))]), SMOOTH) == pytest.approx([0.1 + 4.9 + 0.1])


def test_a_triangle() -> None:
    # 0.5 mm up to 10 mm/s and down again: 2 * sqrt(0.5 / 200) s; the feed is never reached.
    assert plan(segments([move(FEED, (0.5, 0.0, 0.0))]), SMOOTH) == pytest.approx([2 * sqrt(0.5 / 200)])


def test_a_rapid_is_as_fast_as_its_slowest_axis_allows() -> None:
    # 45° in XZ: Z brings 2000 mm/min and 100 mm/s², which is √2 times as much along the way.
    length, speed, a = 100 * sqrt(2), 2000 / 60 * sqrt(2), 100 * sqrt(2)
    assert plan(segments([move(RAPID, (100.0, 0.0, 100.0))]), SMOOTH) == pytest.approx([length / speed + speed / a])


def test_a_right_angle_is_taken_at_the_speed_of_the_junction_deviation() -> None:
    a_corner = 200 * sqrt(2)
    corner2 = a_corner * 0.01 * sqrt(0.5) / (1 - sqrt(0.5))
    # Up to 20 mm/s in 0.1 s over 1 mm, down to the corner's speed over (400 - corner2)/400 mm, the rest level.
    level = (100 - 1 - (400 - corner2) / 400) / 20
    side = 0.1 + level + (20 - sqrt(corner2)) / 200
    rows = [move(FEED, (100.0, 0.0, 0.0)), move(FEED, (100.0, 100.0, 0.0))]
    assert plan(segments(rows), SMOOTH) == pytest.approx([side, side])


def test_a_straight_line_in_pieces_takes_no_longer_but_a_stop_between_does() -> None:
    halves = [move(FEED, (50.0, 0.0, 0.0)), move(FEED, (100.0, 0.0, 0.0))]
    assert plan(segments(halves), SMOOTH).sum() == pytest.approx(5.1)
    halves[1]["sync"] = True
    assert plan(segments(halves), SMOOTH).sum() == pytest.approx(5.2 + STOP_S)


def test_short_blocks_are_held_down_by_the_queue() -> None:
    # 14 blocks of 0.1 mm can brake from √(2·200·1.4) mm/s; a longer queue lets it go faster.
    rows = [move(FEED, (0.1 * number, 0.0, 0.0), feed=8000.0) for number in range(1, 400)]
    middle = plan(segments(rows), SMOOTH)[200]
    assert middle == pytest.approx(0.1 / sqrt(2 * 200 * 1.4), rel=2e-2)
    longer = Motion(SMOOTH.max_rate, SMOOTH.acceleration, planner_blocks=64)
    assert plan(segments(rows), longer)[200] < middle / 1.5


def test_one_block_at_a_time_stops_after_each() -> None:
    single = Motion(SMOOTH.max_rate, SMOOTH.acceleration, planner_blocks=1)
    rows = [move(FEED, (10.0 * number, 0.0, 0.0)) for number in range(1, 4)]
    assert plan(segments(rows), single) == pytest.approx([0.6] * 3)


def test_a_dwell_lets_the_queue_run_dry_and_comes_in_steps_of_50_ms() -> None:
    rows = [
        move(FEED, (100.0, 0.0, 0.0)),
        move(DWELL, (100.0, 0.0, 0.0), dwell_s=0.5),
        move(DWELL, (100.0, 0.0, 0.0), dwell_s=0.01),
        move(FEED, (200.0, 0.0, 0.0)),
    ]
    assert plan(segments(rows), SMOOTH) == pytest.approx([5.1, 0.5, 0.05, 5.1 + STOP_S])


def test_overrides_scale_feed_and_rapid_within_what_the_axes_can() -> None:
    rows = [move(FEED, (100.0, 0.0, 0.0)), move(RAPID, (0.0, 0.0, 0.0))]
    half = plan(segments(rows), SMOOTH, feed_override=0.5, rapid_override=0.25)
    assert half == pytest.approx([100 / 10 + 10 / 200, 100 / (8000 / 240) + 8000 / 240 / 200])
    # Double of 6000 mm/min is more than X has.
    double = plan(segments([move(FEED, (100.0, 0.0, 0.0), feed=6000.0)]), SMOOTH, feed_override=2.0)
    assert double == pytest.approx(plan(segments([move(RAPID, (100.0, 0.0, 0.0))]), SMOOTH))
    probe = segments([move(PROBE, (100.0, 0.0, 0.0))])
    assert plan(probe, SMOOTH, feed_override=0.5) == pytest.approx(plan(probe, SMOOTH))


def test_a_feed_of_nothing_is_a_millimetre_a_minute() -> None:
    assert plan(segments([move(FEED, (1.0, 0.0, 0.0), feed=0.0)]), SMOOTH) == pytest.approx([60.0], rel=1e-4)


def test_feeds_slower_than_the_timer_go_as_slow_as_it_can() -> None:
    # 100 steps at 8 · 65535 clocks of 16 MHz, not the minute that F1 asks for.
    assert plan(segments([move(FEED, (1.0, 0.0, 0.0), feed=1.0)]), ROUTER) == pytest.approx([100 * 8 * 65535 / 16e6])


def test_a_way_from_where_nobody_knows_is_reckoned_from_the_zero_of_the_program() -> None:
    program = segments([move(FEED, (100.0, nan, 0.0)), move(FEED, (100.0, 50.0, 0.0))], start=(nan, nan, 0.0))
    assert plan(program, SMOOTH).sum() == pytest.approx(
        plan(segments([move(FEED, (100.0, 0.0, 0.0)), move(FEED, (100.0, 50.0, 0.0))]), SMOOTH).sum()
    )
    program.frames = [[90.0, 40.0, 0.0]]
    assert plan(program, SMOOTH).sum() == pytest.approx(
        plan(segments([move(FEED, (10.0, 0.0, 0.0)), move(FEED, (10.0, 10.0, 0.0))]), SMOOTH).sum()
    )


def test_after_a_gap_it_goes_on_from_the_place_last_known_however_it_is_cut() -> None:
    rows = [move(FEED, (30.0, 0.0, 0.0)), move(FEED, (nan, 0.0, 0.0)), move(FEED, (80.0, 0.0, 0.0))]
    program = segments(rows)
    joined = segments([rows[0], move(FEED, (30.0, 0.0, 0.0)), rows[2]])
    assert plan(program, SMOOTH) == pytest.approx(plan(joined, SMOOTH))
    for size in (1, 2):
        planner = Planner(SMOOTH, program.axes)
        parts = [planner.feed(program.take(slice(at, at + size))) for at in range(0, 3, size)]
        assert np.concatenate([*parts, planner.flush()]) == pytest.approx(plan(joined, SMOOTH))


def test_a_way_to_where_nobody_knows_is_none() -> None:
    assert plan(segments([move(FEED, (nan, nan, 0.0))], start=(nan, 5.0, 0.0)), SMOOTH) == pytest.approx([0.0])


def test_rotary_axes_count_as_any_other() -> None:
    turn = segments([move(FEED, (0.0, 0.0, 0.0, 90.0))], start=(0.0, 0.0, 0.0, 0.0))
    assert plan(turn, Motion({"a": 3000.0}, {"a": 200.0})) == pytest.approx([90 / 20 + 0.1])


def test_a_move_without_any_feed_takes_the_assumed_one() -> None:
    assert plan(segments([move(FEED, (100.0, 0.0, 0.0), feed=nan)]), SMOOTH) == pytest.approx([10.05])


def test_no_faster_than_the_link() -> None:
    rows = [move(FEED, (0.1 * number, 0.0, 0.0)) for number in range(1, 501)]
    program, floor = segments(rows), np.full(500, 0.01)
    assert plan(program, SMOOTH).sum() == pytest.approx(50 / 20 + 0.1)
    assert plan(program, SMOOTH, link_floor_s=floor).sum() == pytest.approx(500 * 0.01, rel=0.02)
    planner = Planner(SMOOTH, program.axes)
    parts = [planner.feed(program.take(slice(at, at + 7)), floor[at : at + 7]) for at in range(0, 500, 7)]
    assert np.concatenate([*parts, planner.flush()]) == pytest.approx(plan(program, SMOOTH, link_floor_s=floor))


# --- the firmware --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "lines", "firmware_s"), [("gsender_mb31.nc", 700, 10.887), ("freecad_latch.nc", 1400, 36.789)]
)
def test_within_half_a_percent_of_what_the_firmware_took(name: str, lines: int, firmware_s: float) -> None:
    path = next((path for path in corpus_files() if path.name == name), None)
    assert path is not None, f"the corpus has no {name}"
    reader = Interpreter(load_profile("grbl-1.1"), laser=True)
    for number, raw in enumerate(path.read_bytes().splitlines()[:lines], 1):
        reader.step(number, parse_block(decode_line(raw)))
    assert plan(reader.take(), ROUTER).sum() == pytest.approx(firmware_s, rel=0.005)


# --- hostile values ------------------------------------------------------------------------------------------------

hostile = st.sampled_from((0.0, 1.0, -1.0, 1e-12, 1e9, -1e9, 1e308, inf, -inf, nan))
hostile_rows = st.builds(
    lambda kind, end, feed, sync, dwell_s, centre: move(
        kind,
        end,
        feed=feed,
        sync=sync,
        dwell_s=dwell_s,
        spindle=feed,
        **({"centre": centre} if kind in (CW, CCW) else {}),
    ),
    st.sampled_from((RAPID, FEED, CW, CCW, DWELL, HOMING, PROBE)),
    st.tuples(hostile, hostile, hostile),
    hostile,
    st.booleans(),
    hostile,
    st.tuples(hostile.filter(lambda value: abs(value) < 1e300), hostile.filter(lambda value: abs(value) < 1e300)),
)
hostile_machines = st.builds(
    lambda rate, a, deviation, tolerance, blocks, steps: Motion(
        {"x": rate}, {"x": a}, {}, deviation, tolerance, blocks, True, {"x": steps, "y": 1e9}
    ),
    *[hostile] * 4,
    st.integers(-1, 2000),
    hostile,
)


@quick
@given(st.lists(hostile_rows, max_size=4), hostile_machines)
def test_nothing_raises_and_every_second_is_one(rows: list[Row], motion: Motion) -> None:
    with np.errstate(all="ignore"):
        program = segments(rows)
    seconds = plan(program, motion, feed_override=1.2)
    assert len(seconds) == len(rows)
    assert np.isfinite(seconds).all()
    assert (seconds >= 0).all()
