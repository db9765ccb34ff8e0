"""The check before a run: each rule, and that nothing escapes it."""

import tracemalloc
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check import check_program, source
from gcode.findings import Report
from gcode.lines import MAX_LINE_BYTES
from gcode.motion import Motion
from tests.harness.programs import elvinto, program_lines, thorough

TRAVEL = Motion(travel={"x": (0.0, 100.0), "y": (0.0, 100.0), "z": (-50.0, 50.0)})
HEAD = "G21 G90|W72|M3 S1000|G0 X0 Y0 Z5 F100|"
END = "|M30"


def check(program: str, **options: object) -> Report:
    lines = [line.encode() for line in program.split("|")]
    return check_program(lines, elvinto(), options.pop("motion", None), **options)  # type: ignore[arg-type]


def kinds(report: Report) -> dict[str, list[tuple[int, int, str]]]:
    return {
        level: [(f.line, f.column, f.code) for f in found]
        for level, found in (("error", report.errors), ("warning", report.warnings), ("info", report.infos))
        if found
    }


def test_a_clean_program_has_nothing_to_say() -> None:
    report = check(HEAD + "G1 X30 Y40 F3000|G0 Z15" + END, position={"x": 0, "y": 0, "z": 5})
    assert kinds(report) == {}
    assert report.ok
    assert (report.lines, report.blocks) == (7, 7)
    assert report.bounds == {"x": (0, 30), "y": (0, 40), "z": (5, 15)}
    assert (report.cut_mm, report.rapid_mm) == (50, 10)
    assert report.seconds > 1
    assert (report.feeds, report.tools) == ((100, 3000), ())


@pytest.mark.parametrize(
    ("block", "level", "expected"),
    [
        # elvinto §6: what is outside the table, what is ignored, what differs.
        ("G55", "error", (5, 1, "unknown_code")),
        ("G1 X1 W5", "error", (5, 7, "unknown_code")),
        ("G20", "error", (5, 1, "unknown_code")),
        ("M0", "error", (5, 1, "unknown_code")),
        ("G4 P1", "error", (5, 1, "unknown_code")),
        ("G1 X1 E5", "error", (5, 7, "unknown_word")),
        ("G1 X1 K5", "error", (5, 7, "unknown_word")),
        ("G54", "warning", (5, 1, "ignored")),
        ("M01", "warning", (5, 1, "ignored")),
        ("G41 D1", "warning", (5, 5, "ignored")),
        ("M8", "warning", (5, 1, "differs")),
        ("G28", "warning", (5, 1, "differs")),
        ("M4 S1", "warning", (5, 1, "differs")),
        # The reader's faults keep their names and columns.
        ("G1 X1 $", "error", (5, 7, "system_command")),
        ("G1 X[1]", "error", (5, 5, "expression")),
        # rs274 §1 and §2.
        ("G0 G1 X1", "error", (5, 1, "group_conflict")),
        ("G90 G91", "error", (5, 1, "group_conflict")),
        ("G1 X1 X2", "error", (5, 7, "word_twice")),
        # Arcs.
        ("G2 X5 Y5", "error", (5, 1, "arc_without_centre")),
        ("G2 X5 Y0 R1", "error", (5, 1, "arc_impossible")),
        ("G2 X5 Y5 I0 J0", "error", (5, 1, "arc_impossible")),
        ("G2 X5 Y5 I2 J0", "error", (5, 10, "arc_not_closed")),
        ("G18 G2 X5 Y0 I2.5", "error", (5, 1, "arc_plane")),
        ("G1 X1 F0", "error", (5, 7, "feed_missing")),
        ("G80|X5", "error", (6, 1, "motion_not_set")),
    ],
)
def test_rules_of_blocks(block: str, level: str, expected: tuple[int, int, str]) -> None:
    assert expected in kinds(check(HEAD + block + END, position={"x": 0, "y": 0, "z": 5})).get(level, [])


@pytest.mark.parametrize(
    ("program", "level", "expected"),
    [
        ("G0 X1|M30", "warning", (1, 1, "distance_not_set")),
        ("G0 X1|M30", "warning", (1, 1, "units_not_set")),
        ("G0 X1|M30", "warning", (1, 1, "envelope_off")),
        ("G90|X5", "error", (2, 1, "motion_not_set")),
        ("G1 X1", "error", (1, 1, "feed_missing")),
        ("G1 X1 F5|M3", "warning", (1, 1, "spindle_off")),
        ("M5|G1 X1 F5", "warning", (2, 1, "spindle_off")),
        ("G0 X1|M5", "warning", (2, 1, "no_end")),
        ("M30|G0 X1", "warning", (2, 1, "after_end")),
        ("(nothing)|%", "error", (1, 0, "no_blocks")),
    ],
)
def test_rules_of_programs(program: str, level: str, expected: tuple[int, int, str]) -> None:
    assert expected in kinds(check(program))[level]


def test_what_the_program_says_in_time_is_no_finding() -> None:
    for program in ("G90 G21 W72 G0 X1|M30", "G28|G90 G21 G0 X1|M30"):
        found = {code for _, _, code in kinds(check(program)).get("warning", [])}
        assert found <= {"differs"}
    assert kinds(check("G90 G21 G0 X1|M30", envelope=True)) == {}
    assert ("spindle_off" in str(kinds(check(HEAD + "G1 X1 M3" + END)))) is False


def test_messages_say_what_this_controller_does() -> None:
    report = check(HEAD + "M8|G43 H1" + END)
    assert "plasma" in report.warnings[0].message
    assert report.errors[0].message == "G43 does not exist on ElVinto v11"


def test_inches_are_an_error_or_converted() -> None:
    program = HEAD + "G20|G1 X1 F10" + END
    assert kinds(check(program))["error"] == [(5, 1, "unknown_code")]
    report = check(program, convert_inches=True, position={"x": 0, "y": 0, "z": 5})
    assert kinds(report) == {"info": [(5, 1, "converted")]}
    assert report.bounds["x"] == (0, 25.4)


def test_travel() -> None:
    program = HEAD + "X50 Y50|X120|X150|X130|G2 X130 Y50 I0 J60" + END
    report = check(program, motion=TRAVEL)
    assert [(f.line, f.code, f.count) for f in report.errors] == [(6, "outside_travel", 4), (9, "outside_travel", 1)]
    assert "150.000" in report.errors[0].message or "190.000" in report.errors[0].message
    without_envelope = check(program.replace("W72", "M5"), motion=TRAVEL)
    assert without_envelope.ok
    assert {f.code for f in without_envelope.warnings} == {"outside_travel", "envelope_off"}
    # After G92 the program's coordinates are not the machine's.
    shifted = check(HEAD + "G92 X500|G0 X510" + END, motion=TRAVEL)
    assert "outside_travel" not in str(shifted)


def test_arcs_reach_as_far_as_they_bulge() -> None:
    report = check(HEAD + "X10 Y10|G3 X10 Y10 I10 J0 F100" + END)
    assert report.bounds["x"] == pytest.approx((0, 30))
    assert report.bounds["y"] == pytest.approx((0, 20))


def test_block_delete() -> None:
    program = HEAD + "/G55" + END
    assert not check(program).ok
    assert check(program, block_delete=True).ok


def test_a_block_that_does_not_fit() -> None:
    long = "G1 X1.000000000 Y2.000000000 Z3.00000000"
    assert kinds(check(HEAD + long + END, max_block_bytes=30))["error"] == [(5, 1, "block_too_long")]
    assert check(HEAD + long + " (" + "x" * 600 + ")" + END).ok
    zeros = "G1 X1." + "0" * 600
    assert kinds(check(HEAD + zeros + END))["error"] == [(5, 1, "block_too_long")]
    assert check(HEAD + zeros + END, max_block_bytes=1000).ok


def test_a_line_without_end_is_reported() -> None:
    report = check_program([b"(" + b"x" * MAX_LINE_BYTES + b")"], elvinto())
    assert (1, 0, "line_too_long") in kinds(report)["error"]


def test_lines_count_from_where_the_reader_began() -> None:
    report = check_program([b"G55"], elvinto(), first_line=41)
    assert report.errors[0].line == 41


@given(st.lists(st.binary(max_size=40) | program_lines.map(str.encode), max_size=15), st.booleans(), st.booleans())
@thorough
def test_any_bytes_raise_nothing(lines: list[bytes], inches: bool, delete: bool) -> None:
    report = check_program(lines, elvinto(), TRAVEL, convert_inches=inches, block_delete=delete)
    assert report.lines == len(lines)
    assert report.seconds >= 0
    assert report.to_json()["lines"] == len(lines)


def test_memory_does_not_grow_with_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "PIECE_BYTES", 8_000)

    def lines(count: int) -> Iterator[bytes]:
        for number in range(count):
            yield b"G1 X%d.%d Y1 F%d G5%d M8 E%d" % (number, number, number, number, number)

    peaks = []
    for count in (1_000, 3_000):
        tracemalloc.start()
        check_program(lines(count), elvinto())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] * 1.5
