"""The check of a program for frames: the rules of every check, and every error of the translation."""

from gcode.findings import Report
from gcode.motion import Motion
from gcode.ncframe.check import check_frames, check_frames_source
from gcode.ncframe.rules import FrameRules
from tests.harness.frameprograms import LATHE


def checked(program: str, **rules: object) -> Report:
    raw = program.replace("|", "\n").encode()
    return check_frames_source([raw], LATHE, Motion(), FrameRules(**rules))  # type: ignore[arg-type]


def found(program: str, **rules: object) -> list[tuple[int, str]]:
    return [(finding.line, finding.code) for finding in checked(program, **rules).errors]


def test_a_good_program_is_good_and_measured() -> None:
    report = checked("G21,G90,T1,M3,S5;|G0 X10 Z2;G1 Z-5 F100,M8,LF|M30")
    assert report.ok
    assert (report.lines, report.cut_mm, report.tools) == (3, 7.0, (1,))
    assert report.bounds == {"x": (10.0, 10.0), "z": (-5.0, 2.0)}
    assert report.line_ends == "lf"
    assert report.bytes is not None
    assert report.sha256 is not None


def test_errors_of_both_stand_in_order_and_once() -> None:
    assert found("G0 X1|G1 X2|Y3|G0 X9999999|S300|G96") == [
        (2, "feed_missing"),
        (3, "unknown_word"),
        (4, "frame_range"),
        (5, "out_of_range"),
        (6, "unknown_code"),
    ]


def test_what_the_rules_say_is_what_is_checked() -> None:
    assert found("F300 G1 X1") != []
    assert found("F300 G1 X1", feed_unit_mm_min=10) == []
    assert found("G42 G1 X5 Z5 F9|Z-5|G40 G0 X9") != []
    assert found("G42 G1 X5 Z5 F9|Z-5|G40 G0 X9", tool_radius_mm=0.4) == []
    assert found("G42 G1 X5 Z5 F9|Z-5|G40 G0 X9", tool_radius_mm=0.4, compensation="offset") == []


def test_a_line_too_long_and_an_empty_file_are_told_as_ever() -> None:
    assert found("") == [(1, "no_blocks")]
    codes = {code for _, code in found("G0 X1|" + "(" + "a" * 300_000)}
    assert "line_too_long" in codes


def test_lines_may_have_numbers_of_their_own() -> None:
    report = check_frames([(7, b"G0 X1"), (7, b"X9999999")], LATHE, Motion(), FrameRules())
    assert [(finding.line, finding.code) for finding in report.errors] == [(7, "frame_range")]


def test_the_position_may_be_told() -> None:
    report = check_frames([(1, b"G0 X1")], LATHE, Motion(), FrameRules(), position={"x": -8388.0, "z": 0.0})
    assert [finding.code for finding in report.errors] == ["frame_range"]
