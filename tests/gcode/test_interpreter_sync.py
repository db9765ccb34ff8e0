"""When Grbl's queue runs dry (gcode §5; gcode.c and spindle_control.c of 1.1h): only changes do it, always the same."""

import pytest

from gcode.interpreter import Interpreter
from gcode.profile import load_profile
from gcode.words import parse_block


def syncs(*lines: str, laser: bool = False, profile: str = "grbl-1.1") -> list[int]:
    """The lines whose motion begins with an empty queue."""
    interpreter = Interpreter(load_profile(profile), laser=laser)
    for number, line in enumerate(("G21 G90 G1 F100 X0 Y0 Z0", *lines)):
        interpreter.step(number, parse_block(line))
    segments = interpreter.take()
    return sorted(set(segments.line[segments.sync].tolist()))


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["M3 S100", "X1", "X2"], [2]),
        (["M3 S100", "X1", "M3 S100", "X2"], [2]),
        (["M3 S100", "X1", "X2 S200"], [2, 3]),
        (["S100", "X1", "S200", "X2"], []),
        (["M3 S100", "X1", "M4", "X2"], [2, 4]),
        (["M3 S100 X1", "M5 X2", "M5 X3"], [1, 2]),
        (["M8", "X1", "M8", "X2", "M9", "X3"], [2, 6]),
        (["M7", "X1", "M8", "X2"], [2, 4]),
        (["G54", "X1", "G55", "X2", "G55", "X3"], [4]),
        (["G92 X1", "X1", "G92 X1", "X2"], [2, 4]),
        (["G92.1", "X1"], [2]),
        (["G43.1 Z1", "X1", "G43.1 Z1", "X2", "G49", "X3", "G49", "X4"], [2, 6]),
        (["G10 L2 P6 X1", "X1", "G28.1", "X2"], [2, 4]),
        (["G4 P1", "X1"], [1]),
        (["M0", "X1", "M1", "X2"], [2]),
        (["M30", "G1 X1"], [2]),
        (["G38.2 Z-5", "G1 X1"], [1, 2]),
        (["G90 G17 G21 G94 G40 G61", "X1", "T3", "X2", "G53 X3", "G80"], []),
    ],
)
def test_grbl(lines: list[str], expected: list[int]) -> None:
    assert syncs(*lines) == expected


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["M3 S100", "X1 S200", "X2 S300"], [1]),
        (["M4 S100", "X1 S200", "S300", "X2"], [1, 4]),
        (["M3 S100", "X1", "G0", "X2", "G1", "X3"], [2, 4, 6]),
        (["M3 S100", "X1", "G0 X2", "G1 X3"], [2]),
        (["M4 S100", "X1", "G0", "X2"], [2]),
    ],
)
def test_grbl_as_a_laser(lines: list[str], expected: list[int]) -> None:
    if lines[1].startswith("X1 S"):
        expected = [2, *expected[1:]]
    assert syncs(*lines, laser=True) == expected


def test_a_code_that_travels_alone_finds_an_empty_queue() -> None:
    assert syncs("X1", "W90", "X2", "T1", "X3", "M3", "X4", profile="elvinto") == [3, 5]


def test_what_stops_motion_in_linuxcnc() -> None:
    assert syncs("M3 S9", "X1", "G92 X3", "X4", "G4 P1", "X5", "M6", "X6", profile="rs274ngc") == [2, 5, 8]
