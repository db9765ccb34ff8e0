"""Starting in the middle of a program: what is said again first, and where that is refused."""

import pytest

from gcode.motion import Motion
from gcode.profile import load_profile
from gcode.words import parse_block
from jobs.batch import BatchLimits, BatchPlanner
from jobs.restart import CannotStartError, Switches, first_block, prologue, with_prologue

PROFILE = load_profile("elvinto")


def blocks_before(lines: list[str], first: str = "G1 X1", *, convert_inches: bool = False) -> list[str]:
    numbered = [(number, line.encode()) for number, line in enumerate(lines, 1)]
    switches = Switches(numbered, "utf-8")
    scout = BatchPlanner(
        switches, PROFILE, Motion(), BatchLimits(), skip_to=len(lines) + 1, convert_inches=convert_inches
    )
    return prologue(scout.state, switches, PROFILE, parse_block(first), in_inches=scout.in_inches)


def test_distance_mode_motion_feed_and_spindle_are_said_again() -> None:
    lines = ["G91", "M3 S12000", "G1 X1 F600", "S8000", "G0 X5"]
    assert blocks_before(lines) == ["G91", "G0", "F600", "M3 S8000"]


def test_what_was_switched_off_is_not_switched_on() -> None:
    assert blocks_before(["G90", "M3 S1000", "M7", "M8", "M5"]) == ["G90", "M5 S1000"]


def test_plasma_that_burns_burns_again() -> None:
    assert blocks_before(["G90", "M07"]) == ["G90", "M7"]


@pytest.mark.parametrize("mode", ["G2 X2 Y2 I1 J1 F100", "G3 X2 Y2 I1 J1 F100", "G81 X1 Y1 Z-1 R1 F100"])
def test_an_arc_or_a_cycle_that_goes_on_cannot_be_taken_up(mode: str) -> None:
    with pytest.raises(CannotStartError, match="names its own motion"):
        blocks_before(["G90", mode], "X5 Y5")
    assert blocks_before(["G90", mode], "G1 X5 Y5") == ["G90", "F100"]


def test_comments_say_nothing() -> None:
    assert blocks_before(["G90", "(M3 S5000)", "; M7"]) == ["G90"]


def test_blocks_in_mm_stand_outside_the_inches_of_the_program() -> None:
    lines = ["G20 G90", "G1 X1 F10"]
    assert blocks_before(lines, convert_inches=True) == ["G21", "G90", "G1", "F254", "G20"]


def test_the_prologue_stands_before_the_line_and_the_rest_follows() -> None:
    before = [(1, b"G90"), (2, b"G1 X1 F600")]
    lines = with_prologue(before, 3, ["G90", "G1", "F600"], [(3, b"X2"), (4, b"X3")])
    planner = BatchPlanner(lines, PROFILE, Motion(), BatchLimits(), skip_to=2)
    planner.relocate({"x": 1.0})
    planned = planner.next()
    assert planned is not None
    assert (planned.first_line, planned.last_line) == (2, 4)
    assert planned.blocks == ("G90", "G1", "F600", "X2", "X3")


def test_the_first_block_with_words() -> None:
    found = first_block([(1, b"(hello)"), (2, b""), (3, b"N3 G1 X1")], "utf-8")
    assert found is not None
    assert found.text == "N3 G1 X1"
    assert first_block([(1, b"%")], "utf-8") is None
