"""Junctions and look-ahead (spec gcode §5): worked out by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.grbl.events import Move
from sim.grbl.nonvolatile import Nonvolatile
from sim.grbl.planner import Planner
from sim.grbl.simsettings import ORIGIN, Point, SimSettings

LIMITS = {110: 6000, 111: 3000, 112: 600, 120: 200, 121: 100, 122: 50, 11: 0.02}


def planner(capacity: int = 15) -> Planner:
    return Planner(Nonvolatile(SimSettings(dollar=LIMITS)), capacity)


def add(queue: Planner, *target: float, feed: float = 600.0, kind: str = "feed") -> None:
    place: Point = (target[0], target[1], target[2])
    queue.add(place, Move(kind, queue.position, place, feed), feed_mm_min=feed)  # type: ignore[arg-type]
    queue.plan(0.0)


def test_the_slowest_axis_sets_rate_and_acceleration() -> None:
    queue = planner()
    add(queue, 30, 40, 0, kind="rapid")
    (block,) = queue.blocks
    assert block.length_mm == pytest.approx(50)
    assert block.nominal_mm_s == pytest.approx(50 / 0.8), "Y: 3000 mm/min along 0.8"
    assert block.acceleration == pytest.approx(100 / 0.8)


def test_no_feed_is_faster_than_the_axes() -> None:
    queue = planner()
    add(queue, 0, 0, 10, feed=6000)
    assert queue.blocks[0].nominal_mm_s == pytest.approx(10)


def test_a_corner_by_the_junction_deviation() -> None:
    queue = planner()
    add(queue, 50, 0, 0, feed=3000)
    add(queue, 50, 50, 0, feed=3000)
    half = math.sqrt(0.5)  # sine of half of 90°
    acceleration = 100 / half  # along (-1, 1)/√2 Y is the slower one
    assert queue.blocks[1].junction_sqr == pytest.approx(acceleration * 0.02 * half / (1 - half))
    assert queue.blocks[1].entry_sqr == pytest.approx(queue.blocks[1].junction_sqr)


def test_straight_on_is_limited_by_the_speeds_only_and_back_is_a_stop() -> None:
    queue = planner()
    add(queue, 50, 0, 0, feed=3000)
    add(queue, 60, 0, 0, feed=1200)
    add(queue, 50, 0, 0, feed=1200)
    _, second, third = queue.blocks
    assert second.entry_sqr == pytest.approx(20.0**2)
    assert third.entry_sqr == 0.0


def test_the_last_block_must_be_able_to_stop() -> None:
    queue = planner()
    for x in (1, 2, 3):
        add(queue, x, 0, 0, feed=6000)
    assert [block.entry_sqr for block in queue.blocks] == pytest.approx([0.0, 400.0, 400.0])


def test_a_motion_shorter_than_a_step_is_none() -> None:
    queue = planner()
    add(queue, 0.001, 0, 0)
    assert not queue.blocks
    assert queue.position == ORIGIN


def test_inverse_time() -> None:
    queue = planner()
    queue.add((10, 0, 0), Move("feed", ORIGIN, (10, 0, 0), 30), feed_mm_min=30, inverse_time=True)
    assert queue.blocks[0].nominal_mm_s == pytest.approx(5.0), "30 times a minute is 2 s for 10 mm"


def test_overrides_change_what_is_planned() -> None:
    queue = planner()
    add(queue, 50, 0, 0, feed=1200)
    add(queue, 100, 0, 0, feed=1200)
    assert queue.override(feed=50, rapid=100)
    queue.plan(0.0)
    assert [block.nominal_mm_s for block in queue.blocks] == [10.0, 10.0]
    assert queue.blocks[1].entry_sqr == pytest.approx(100.0)
    assert not queue.override(feed=50, rapid=100)


@given(
    st.lists(
        st.tuples(*(st.floats(-20, 20) for _ in range(3)), st.floats(60, 6000), st.sampled_from(["feed", "rapid"])),
        min_size=1,
        max_size=15,
    )
)
def test_every_plan_can_be_driven(blocks: list[tuple[float, float, float, float, str]]) -> None:
    queue = planner()
    for x, y, z, feed, kind in blocks:
        add(queue, x, y, z, feed=feed, kind=kind)
    speeds = [block.entry_sqr for block in queue.blocks] + [0.0]
    for block, enters, leaves in zip(queue.blocks, speeds, speeds[1:], strict=False):
        assert enters <= block.nominal_mm_s**2 + 1e-9
        assert enters <= block.junction_sqr + 1e-9
        assert abs(leaves - enters) <= 2 * block.acceleration * block.length_mm * (1 + 1e-9)
