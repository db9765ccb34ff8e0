"""What is reckoned with where the start is not known, and that nothing is judged by it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check import check_source
from gcode.check.program import Checker
from gcode.columns import read_columns
from gcode.findings import Report
from gcode.interpret import Reading
from gcode.interpreter import power_on
from gcode.lines import pieces
from gcode.motion import Motion
from gcode.planner import plan
from gcode.profile import load_profile
from gcode.segments import joined
from tests.harness.programs import arc_blocks, move_blocks, quick


def check(program: str, **options: object) -> Report:
    motion = Motion(travel={"x": (0.0, 50.0), "y": (0.0, 50.0), "z": (-50.0, -1.0)})
    text = program.replace("|", "\n").encode()
    return check_source([text], load_profile("grbl-1.1"), motion, **options)  # type: ignore[arg-type]


def test_steps_from_nowhere_have_a_length_and_a_time() -> None:
    report = check("G21 G91|M3 S1000|G1 F600 X10|Y10|G2 X5 Y5 I5 J0|M30")
    assert report.cut_mm == pytest.approx(20 + 2.5 * np.pi)
    assert report.seconds == pytest.approx(report.cut_mm / 10, rel=0.15)
    assert report.bounds == {}
    assert not report.errors


def test_the_place_that_is_assumed_leaves_no_travel() -> None:
    """Z0 would be outside here: but where Z stands at the start nobody knows."""
    report = check("G21 G90|M3 S1000|G0 Z-5|G0 X10 Y10|G1 X20 F600|M30", envelope=True)
    assert report.errors == ()
    assert report.bounds == {"x": (10.0, 20.0), "y": (10.0, 10.0), "z": (-5.0, -5.0)}
    outside = check("G21 G90|M3 S1000|G0 Z5|G0 X10 Y10|G1 X20 F600|M30", envelope=True)
    assert [finding.code for finding in outside.errors] == ["outside_travel"]


def test_an_arc_from_nowhere_is_not_said_to_be_open() -> None:
    report = check("G21 G90 G17|M3 S1000|G0 Z-5|G2 X30 Y40 I3 J4 F600|G2 X20 Y20 I3 J4|M30")
    assert [(finding.line, finding.code) for finding in report.errors] == [(5, "arc_not_closed")]


def test_home_is_where_a_new_controller_has_it() -> None:
    report = check("G21 G90|M3 S1000|G0 X10 Y10 Z-5|G28|G1 X20 F600|M30")
    assert report.rapid_mm == pytest.approx(2 * 15.0)
    assert report.cut_mm == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("pieces_of_it", "length_mm"),
    [((b"G0 X10\n", b"G55\nG28\n"), 20.0), ((b"G0 X10\n", b"G0 X30\nG55\n", b"G0 X0\n"), 60.0)],
)
def test_another_coordinate_system_forgets_no_place(pieces_of_it: tuple[bytes, ...], length_mm: float) -> None:
    """It names no axis, and the place was known until then: in the piece before, or in the same one."""
    profile = load_profile("grbl-1.1")
    checker, line = Checker(profile, Motion(), {}), 1
    for text in pieces_of_it:
        columns = read_columns(text, line)
        checker.look(columns)
        line += columns.lines
    assert checker.report().rapid_mm == pytest.approx(length_mm)


lines_of_grbl = st.one_of(move_blocks, move_blocks, arc_blocks, st.sampled_from(("G28", "G28 Z0", "G54", "G55", "G91")))


@given(st.lists(lines_of_grbl, max_size=30), st.integers(16, 200))
@quick
def test_sums_are_those_of_a_controller_at_its_zero(lines: list[str], size: int) -> None:
    """Whichever pieces it is read in: everything known from the start gives the same time."""
    profile = load_profile("grbl-1.1")
    text = "\n".join([*lines, ""]).encode()
    reading = Reading(profile, power_on(profile).assumed())
    segments = joined([reading.read(read_columns(text)), reading.finish()])
    checker, line = Checker(profile, Motion(), {}), 1
    for piece in pieces([text], size):
        columns = read_columns(piece, line)
        checker.look(columns)
        line += columns.lines
    report = checker.report()
    assert report.seconds == pytest.approx(float(plan(segments, Motion()).sum()), rel=1e-6, abs=1e-6)
    assert report.cut_mm + report.rapid_mm == pytest.approx(float(segments.lengths().sum()), abs=1e-6)


def test_compensation_that_is_left_on_is_cut_to_its_end_and_said() -> None:
    program = "G21 G90 G17|M3 S1000|G0 X0 Y0 Z0|G41.1 D6|G1 X20 Y0 F600|X40|Y30"
    text = (program.replace("|", "\n") + "\nM30\n").encode()
    report = check_source([text], load_profile("rs274ngc"), Motion())
    open_end = check_source([text.replace(b"M30\n", b"")], load_profile("rs274ngc"), Motion())
    assert report.cut_mm == pytest.approx(open_end.cut_mm)
    assert "compensation_left" in {finding.code for finding in open_end.warnings}
