"""What lines leave behind: the state of the careful interpreter at any line, and what a state has no place for."""

import pytest

from gcode.interpreter import Interpreter, power_on
from gcode.past import Saying, past_of, state_before
from gcode.profile import load_profile
from gcode.words import parse_block

LINES = [
    *(
        "G21 G90 G17",
        "M3 S500",
        "G0 X1 Y2 Z3",
        "G1 X5 F300",
        "Y7",
        "G2 X9 Y9 R8",
        "G91",
        "G1 X1",
        "G20",
        "X1",
        "/G0 X9",
    ),
    *("G55", "G92 X0", "M8", "G81 X1 Y1 Z-1 R1", "X2", "G80", "M5"),
]


def pieces(lines: list[str], at: int) -> list[bytes]:
    return ["\n".join(part).encode() + b"\n" for part in (lines[:at], lines[at:]) if part]


@pytest.mark.parametrize("cut", [1, 5, 11, len(LINES)])
def test_the_state_is_that_of_the_careful_way_at_every_line(cut: int) -> None:
    profile = load_profile("grblhal")
    careful = Interpreter(profile)
    for line, text in enumerate(LINES, 1):
        found = state_before(pieces(LINES, cut), line, profile)
        assert repr(found) == repr(careful.state), line
        careful.step(line, parse_block(text))
    assert repr(state_before(pieces(LINES, cut), 10**9, profile)) == repr(careful.state)


def test_lines_of_the_block_delete_switch_are_left_out() -> None:
    profile, lines = load_profile("rs274ngc"), ["G90 G0 X1 G64 P1", "/G0 X9 G61"]
    text = ["\n".join(lines).encode()]
    assert past_of(text, 3, profile).said["path"].name == "G61"
    past = past_of(text, 3, profile, state=power_on(profile), skip_deleted=True)
    assert (past.state.position[0], past.said["path"].name) == (1.0, "G64")


def test_what_a_state_does_not_hold_is_kept_as_it_was_said_last() -> None:
    lines = ["G61", "G20 G64 P0.1 Q0.2", "g43 h7 (G61)", "M49", "G96 D900 S50", "M62 P1", "G10 L2 P1 X3", "T1 M6"]
    said = past_of(["\n".join(lines).encode()], 99, load_profile("rs274ngc")).said
    assert said["path"] == Saying("G64", (("P", pytest.approx(2.54)), ("Q", pytest.approx(5.08))))
    assert said["length"] == Saying("G43", (("H", 7.0),))
    assert said["override"] == Saying("M49")
    assert said["spindle_mode"] == Saying("G96", (("D", 900.0),))
    assert {"io", "data", "tool"} <= said.keys()


def test_compensation_holds_until_the_straight_move_behind_g40() -> None:
    lines = ["G90 F9", "G0 X1 Y1", "G41.1 D2", "G1 X5", "G1 Y9", "G40", "S5", "G1 X20", "X30"]
    text, profile = ["\n".join(lines).encode()], load_profile("rs274ngc")
    found = [past_of(text, line, profile).compensating for line in range(1, 10)]
    assert found == [False, False, False, True, True, True, True, True, False]
