"""What must be said before a move, before a cut, before the end; and what comes behind it."""

import pytest

from gcode.motion import Motion
from tests.harness.checks import checked, every, found, level_of

CLEAN = "G21 G90 G94|M3 S1000|G0 Z5|G0 X0 Y0|G1 Z-1 F100|X10|Y10|G0 Z5|M5|M30"


@pytest.mark.parametrize("profile", ["grbl-1.1", "grblhal", "rs274ngc"])
def test_a_clean_program_has_nothing_to_say(profile: str) -> None:
    assert every(checked(CLEAN, profile)) == []


@pytest.mark.parametrize(
    ("program", "code", "line"),
    [
        ("G0 X1|M30", "distance_not_set", 1),
        ("G0 X1|M30", "units_not_set", 1),
        ("G21|G0 X1|G90|M30", "distance_not_set", 2),
        ("G90|G0 X1|G21|M30", "units_not_set", 2),
        ("G21 G90|G1 X1 F10|M3 S10|M30", "spindle_off", 2),
        ("G21 G90|M5|G1 X1 F10|M30", "spindle_off", 3),
        ("G21 G90|M3 S0|M30", "spindle_zero", 2),
        ("G21 G90|S0|S100|S0 (off)|M4|M30", "spindle_zero", 5),
        ("G21 G90|G0 X1|G20|G0 X2|M30", "units_mixed", 3),
        ("G20 G90|G0 X1|G20|G21|G21|M30", "units_mixed", 4),
        ("G21 G90|G0 X1", "no_end", 2),
        ("G21 G90|M2|(nothing)|N10|G0 X1", "after_end", 5),
        ("G21 G90|G0 X1|G92 X0|M30", "offset_left", 4),
    ],
)
def test_warnings(program: str, code: str, line: int) -> None:
    report = checked(program, position={"x": 5.0, "y": 0.0, "z": 0.0})
    assert [finding.line for finding in found(report, code)] == [line]
    assert level_of(report, code) == "warning"


@pytest.mark.parametrize(
    ("program", "code"),
    [
        ("G0 X1 G90|M30", "distance_not_set"),
        ("G0 X1 G20|M30", "units_not_set"),
        ("G1 X1 F10 M3 S10|M30", "spindle_off"),
        ("M3 S0 S0|M30", "spindle_off"),
        ("S100|M3|S0|M30", "spindle_zero"),
        ("M3|M30", "spindle_zero"),
        ("G21|G21|G0 X1|M30", "units_mixed"),
        ("M30|%|(end)|", "after_end"),
        ("G92 X0|G92.1|M30", "offset_left"),
        ("G10 L2 P1 X5|G92 X5|G92 X0|M30", "no_end"),
    ],
)
def test_what_is_said_in_time_is_no_finding(program: str, code: str) -> None:
    assert found(checked(program, position={"x": 0.0, "y": 0.0, "z": 0.0}), code) == []


def test_a_laser_is_switched_on_with_s0() -> None:
    assert found(checked("G21 G90|M4 S0|M30", motion=Motion(laser=True)), "spindle_zero") == []


def test_a_program_of_remarks_is_none() -> None:
    report = checked("(nothing)|%|N10")
    assert [(finding.line, finding.code) for finding in report.errors] == [(1, "no_blocks")]
    assert found(report, "no_end") == []
    assert [finding.code for finding in checked("").errors] == ["no_blocks"]


def test_what_the_controller_keeps_is_told_with_its_lines() -> None:
    report = checked("G21 G90|G10 L20 P1 X0|G0 X1 Y1|G28.1|G92 X0|G30.1|G92.1|M30", "grbl-1.1")
    assert [(finding.line, finding.message.split()[4]) for finding in found(report, "stored")] == [
        (2, "G10"),
        (4, "G28.1"),
        (6, "G30.1"),
    ]
    assert level_of(report, "stored") == "info"
    assert found(checked("G21 G90|G28|G30|G92 X0|G92.1|M30", "grbl-1.1"), "stored") == []
