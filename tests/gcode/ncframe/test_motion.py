"""What is drawn and estimated of a program for frames is what its frames do."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from gcode.motion import Motion
from gcode.ncframe.motion import measure_frames, motion_of_frames
from gcode.ncframe.rates import RateError, feed_byte, feeds_of_bytes
from gcode.ncframe.reader import FrameReader
from gcode.ncframe.rules import FrameRules
from gcode.segments import CW, Segments, joined
from tests.harness.frameprograms import LATHE, ORIGIN

CONTOUR = (
    "G21,G90,G94,F100;S5 M3|G0 X20 Z5|G42 G1 X10 Z2|Z-10|G2 X14 Z-14 I4 K0,F80;G1 Z-20|X20 Z-24|G40 G1 X30|M30|G1 X9"
)
PROGRAMS = [
    (CONTOUR, {"tool_radius_mm": 0.8}),
    ("G90|F50 G41 G1 X10 Z10|X20|G40 G1 X5 Z5|M30", {"tool_radius_mm": 2.5, "compensation": "offset"}),
    ("G90|F60 G1 U-3 W-4|X10 Z1|G3 X14 Z-1 R2|G1 X0|G4 P2|M2", {"diameter_programming": True}),
    ("G95 F.2 S500 M3|G1 X10 Z-3|Z-20 F.1|S250|X12|M30", {"speed_unit_rpm": 10.0}),
    ("G55 G90 G0 X1 Z1|G1 X2 F25|G54 X0 Z0|M30", {"systems": {2: {"x": 5.0}}, "feed_table_mm_min": (0.0, 10.0, 30.0)}),
]


def numbered(program: str) -> Iterable[tuple[int, bytes]]:
    return list(enumerate(program.encode().split(b"|"), 1))


def drawn(program: str, **rules: Any) -> Segments:
    return joined(list(motion_of_frames(numbered(program), LATHE, FrameRules(**rules), to_its_end=True)))


@pytest.mark.parametrize(("program", "rules"), PROGRAMS)
def test_it_leads_where_the_frames_lead(program: str, rules: dict[str, Any]) -> None:
    told = FrameRules(**rules)
    reader = FrameReader(numbered(program), LATHE, Motion(), told, ORIGIN)
    ends = []
    while not reader.ended:
        found, _ = reader.more(100)
        ends += [(block.line, block.end) for block in found if block.moves]
        if found and found[-1].barrier is not None and found[-1].barrier.ends_program:
            break
    scale = 2.0 if told.diameter_programming else 1.0
    motion = drawn(program, **rules)
    moving = motion.lengths() > 0
    passed = [
        (line, (x * scale, z))
        for line, x, z in zip(motion.line[moving].tolist(), *motion.end[:, moving].tolist(), strict=True)
    ]
    # An arc may be several frames: its end is that of the last.
    places = [place for _, place in ends]
    for line, place in passed:
        near = [other for other in places if np.allclose(other, place, rtol=0, atol=told.resolution_mm * scale)]
        assert near, (line, place, ends)
    assert [line for line, _ in passed] == [line for line, _ in ends]
    np.testing.assert_array_equal(motion.start[:, 1:], motion.end[:, :-1])


@pytest.mark.parametrize(("program", "rules"), PROGRAMS)
def test_it_takes_as_long_as_the_frames(program: str, rules: dict[str, Any]) -> None:
    told, motion = FrameRules(**rules), Motion(planner_blocks=1)
    reader = FrameReader(numbered(program), LATHE, motion, told, ORIGIN)
    seconds, frames = 0.0, 0
    while not reader.ended:
        found, _ = reader.more(100)
        seconds += sum(block.seconds for block in found)
        frames += sum(block.moves or block.seconds > 0 for block in found)
        if found and found[-1].barrier is not None and found[-1].barrier.ends_program:
            break
    count = program.count("|") + 1
    timeline = measure_frames(numbered(program), LATHE, motion, told, count)
    assert timeline.total_s == pytest.approx(seconds, rel=0.005)
    with_link = measure_frames(numbered(program), LATHE, motion, told, count, turn_s=0.5)
    assert with_link.total_s == pytest.approx(timeline.total_s + 0.5 * frames, abs=1e-6)


def test_rapids_go_at_the_rate_of_the_lathe_and_feeds_at_that_of_their_byte() -> None:
    motion = Motion(planner_blocks=1, max_rate={"x": 1000.0, "z": 6000.0}, acceleration={"x": 1e9, "z": 1e9})
    slow = measure_frames(numbered("G0 X100|M30"), LATHE, motion, FrameRules(), 2)
    quick = measure_frames(numbered("G0 Z100|M30"), LATHE, motion, FrameRules(), 2)
    assert slow.total_s == pytest.approx(6.0, rel=1e-3)
    assert quick.total_s == pytest.approx(1.0, rel=1e-3)
    table = FrameRules(feed_table_mm_min=(0.0, 10.0, 30.0))
    cut = measure_frames(numbered("G1 X10 F25|M30"), LATHE, motion, table, 2)
    assert cut.total_s == pytest.approx(60.0, rel=1e-3), "10 mm at 10 mm/min"


def test_compensation_is_drawn() -> None:
    motion = drawn(CONTOUR, tool_radius_mm=0.8)
    arc = motion.kind == CW
    assert abs(motion.radius[arc][0] - 4.0) == pytest.approx(0.8)
    along = motion.line == 4
    assert abs(motion.end[0, along][0] - 10.0) == pytest.approx(0.8), "the tool is its radius away"


@pytest.mark.parametrize(
    "rules", [FrameRules(), FrameRules(feed_unit_mm_min=0.7), FrameRules(feed_table_mm_min=(0, 10.0, 25.0))]
)
def test_the_feeds_of_bytes_are_those_that_are_sent(rules: FrameRules) -> None:
    feeds = [0.1, 0.5, 9.9, 10.0, 24.0, 25.0, 100.4, 254.9, 300.0, float("nan")]
    for feed, gone_at in zip(feeds, feeds_of_bytes(np.array(feeds), rules).tolist(), strict=True):
        try:
            byte = feed_byte(feed, rules) if feed > 0 else None
        except RateError:
            byte = None
        if byte is None:
            assert gone_at == feed or feed != feed
        else:
            table = rules.feed_table_mm_min
            assert gone_at == pytest.approx(table[byte] if table else byte * rules.feed_unit_mm_min)
