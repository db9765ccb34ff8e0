"""What the program will do, in numbers."""

import hashlib
from statistics import median

import pytest

from gcode.check import check_source
from gcode.findings import ToolUse
from gcode.motion import Motion
from gcode.profile import load_profile
from tests.harness.checks import checked

HEAD = "G21 G90 G94|M3 S1000|G0 Z5|G0 X0 Y0 F600|"
AT_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}


def test_ways() -> None:
    report = checked(HEAD + "G1 Z-1|X10|Y10 Z-2|G0 Z5|G2 X20 I5|M30", position=AT_ZERO)
    assert report.cut_mm == pytest.approx(6 + 10 + 101**0.5 + 5 * 3.14159265)
    assert report.rapid_mm == pytest.approx(5 + 7)
    assert report.plunge_mm == pytest.approx(6)
    assert (report.segments, report.arcs) == (7, 1)
    assert report.shortest_mm == pytest.approx(6)


def test_the_median_is_true_to_two_percent() -> None:
    lengths = [0.013 * 1.07**number for number in range(151)]
    x, lines = 0.0, []
    for length in lengths:
        x += length
        lines.append(f"G1 X{x:.6f}")
    report = checked(HEAD + "|".join(lines) + "|M30", position=AT_ZERO)
    assert report.median_mm == pytest.approx(median(lengths), rel=0.016)
    assert report.shortest_mm == pytest.approx(0.013)


def test_nothing_cut_has_no_median() -> None:
    report = checked(HEAD + "M30")
    assert (report.median_mm, report.shortest_mm, report.cut_mm) == (None, None, 0.0)


def test_tools_feeds_and_speeds() -> None:
    program = "G21 G90|T1 M6|M3 S1000|G0 X0 Y0|G1 X10 F600|T2 M6|S2000|G1 X30 F1200|G0 X0|M30"
    report = checked(program, "rs274ngc", position=AT_ZERO)
    assert (report.tools, report.feeds, report.spindle) == ((1, 2), (600.0, 1200.0), (1000.0, 2000.0))
    ways = [(use.tool, use.cut_mm, use.rapid_mm) for use in report.by_tool if use.cut_mm]
    assert ways == [(1, 10.0, 0.0), (2, 20.0, 30.0)]
    assert sum(use.seconds for use in report.by_tool) == pytest.approx(report.seconds)


def test_many_tools_and_feeds_are_not_all_listed() -> None:
    program = "G21 G90|M3 S1|" + "|".join(f"T{n} M6|G1 X{n} F{n}" for n in range(1, 300)) + "|M30"
    report = checked(program, "rs274ngc")
    assert len(report.tools) == len(report.feeds) == 100
    assert len(report.by_tool) <= 100
    assert all(isinstance(use, ToolUse) for use in report.by_tool)


def test_times_with_dwells_and_overrides() -> None:
    motion = Motion(max_rate={"x": 3000.0}, acceleration={"x": 100_000.0})
    program = HEAD + "G1 X600|G4 P2.5|M30"
    report = checked(program, motion=motion, position=AT_ZERO)
    assert report.dwell_seconds == 2.5
    assert report.seconds == pytest.approx(62.5, rel=0.01)
    assert report.seconds_overridden is None
    faster = checked(program, motion=motion, position=AT_ZERO, feed_override=2.0)
    assert faster.seconds == report.seconds
    assert faster.seconds_overridden == pytest.approx(32.5, rel=0.02)


def test_bytes_are_those_that_go_out() -> None:
    report = checked("N1 G21 G90 (a)|(b)|G0 X1|M30")
    assert report.wire_bytes == len("G21G90\nG0X1\nM30\n")
    assert report.blocks == 3


def test_what_the_file_is() -> None:
    report = check_source([b"\xef\xbb\xbfG21 G90\r", b"\nM30\r\n"], load_profile("elvinto"))
    assert (report.encoding, report.line_ends, report.bytes, report.lines) == ("utf-8 with BOM", "crlf", 17, 2)
    assert report.sha256 == hashlib.sha256(b"\xef\xbb\xbfG21 G90\r\nM30\r\n").hexdigest()
    assert checked("M30").sha256 is None
