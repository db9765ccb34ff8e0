"""What goes out in the place of M6, and what makes the modes those of the program again."""

import pytest

from gcode.interpreter import Interpreter, power_on
from gcode.profile import load_profile
from gcode.toolcodes import with_tool_codes
from gcode.words import parse_block
from jobs.toolblocks import ToolBlocks, leading, rest_of, restoring

PROFILE = with_tool_codes(load_profile("grbl-1.1"), moves=True)
MODES = (
    "absolute",
    "inches",
    "plane",
    "feed_mode",
    "feed",
    "spindle",
    "speed",
    "mist",
    "flood",
    "motion_name",
    "system",
)


@pytest.mark.parametrize(
    "program",
    [
        "G21 G90 G0 X1",
        "G20 G91 G18 G55|G1 X1 F12|M4 S900",
        "G94 G1 X1 F100|M3 S8000|M8",
        "G1 X1 F100|G80",
        "G93",
        "M7",
    ],
)
def test_behind_the_change_the_modes_are_those_of_before(program: str) -> None:
    interpreter = Interpreter(PROFILE, power_on(PROFILE))
    for text in program.split("|"):
        interpreter.step(1, parse_block(text))
    before = interpreter.state.copy()
    blocks = ToolBlocks(("G53 G0 Z-5", "G59 G17"))
    for text in [*leading(blocks, before), *restoring(blocks, before, PROFILE)]:
        interpreter.step(2, parse_block(text))
    assert {name: getattr(interpreter.state, name) for name in MODES} == {name: getattr(before, name) for name in MODES}
    assert not [note for note in interpreter.notes if note.level == "error"]


@pytest.mark.parametrize(
    ("line", "rest"), [("T2 M6", "T2"), ("M06", ""), ("N5 M6 T1 G55 (new)", "T1G55"), ("M61 Q3 M8", "M8")]
)
def test_what_else_stands_in_the_line_is_not_lost(line: str, rest: str) -> None:
    assert rest_of(parse_block(line)) == rest
