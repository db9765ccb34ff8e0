"""The interpreter over every profile: modes, words that contradict each other or are left over, any block at all."""

from math import nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.interpreter import Interpreter, power_on
from gcode.profile import load_profile, profile_names
from gcode.segments import CCW, CW, FEED, PROBE, RAPID, Segments
from gcode.words import parse_block
from tests.harness.programs import quick


def machine(*lines: str, profile: str = "grbl-1.1", at: float = 0.0) -> Interpreter:
    state = power_on(load_profile(profile))
    state.position = [at] * len(state.axes)
    interpreter = Interpreter(load_profile(profile), state)
    for number, line in enumerate(lines, 1):
        interpreter.step(number, parse_block(line))
    return interpreter


def segments(*lines: str, profile: str = "grbl-1.1") -> Segments:
    return machine(*lines, profile=profile).take()


def notes(*lines: str, profile: str = "grbl-1.1") -> list[str]:
    return [note.code for note in machine(*lines, profile=profile).notes]


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["G0 G1 X1"], ["group_conflict"]),
        (["G17 G18"], ["group_conflict"]),
        (["G0 G80 X1"], ["group_conflict"]),
        (["M3 M5"], ["group_conflict"]),
        (["G0 X1 X2"], ["word_twice"]),
        (["G0 G92 X1"], ["axis_conflict"]),
        (["G28 G1 X1 F1"], ["axis_conflict"]),
        (["G80", "X1"], ["motion_not_set"]),
        (["G0 X1 P3"], ["word_left_over"]),
        (["G1 X1 R2 F1"], ["word_left_over"]),
        (["G4 P1 K3"], ["word_left_over"]),
        (["G2 X1 R1 I1 F1"], ["word_left_over"]),
        (["G2 G53 X1 I1 F1"], ["g53_without_g0_g1"]),
        (["G2 X1 F1"], ["arc_without_centre"]),
        (["G18", "G2 X1 J1 F1"], ["arc_without_centre", "word_left_over"]),
        (["G2 I5 F1"], ["arc_without_axis"]),
        (["G18", "G2 Y1 I5 F1"], ["arc_without_axis"]),
        (["G93", "G1 X1"], ["feed_missing"]),
        (["G93", "G1 X1 F2", "G0 X2", "G2 X3 I1"], ["feed_missing"]),
        (["G4"], ["word_missing"]),
        (["G92"], ["axis_words_missing"]),
        (["G10 L2 X1"], ["word_missing"]),
        # Sound blocks.
        (["G21 G90 G94 G17 G40 G49 G54 G61", "T1 M3 S100", "N5 G1 X1 Y1 F9", "M9 M5", "M30"], []),
        (["G2 X1 I1 J2 K3 F1", "G3 X2 R5", "G4 P.1", "G38.2 Z-1 F9", "G28", "G30 X1", "G92.1"], []),
    ],
)
def test_notes(lines: list[str], expected: list[str]) -> None:
    assert notes(*lines) == expected


def test_notes_say_where() -> None:
    note = machine("G0 X1", "G0 X1 P3").notes[0]
    assert (note.line, note.column, note.level) == (2, 7, "error")


def test_lenient_machines_ignore_what_is_left_over() -> None:
    assert notes("G1 X5 P3 F100", "G28 X5", profile="elvinto") == []
    assert notes("G0 G80 G90", "G2 I5 F1", "G80 G0 X1", profile="rs274ngc") == []


def test_units_hold_for_the_words_of_their_own_block() -> None:
    found = segments("G20 G1 X1 F10", "G21 X1", "G20 G0 A90", profile="rs274ngc")
    assert found.end[0].tolist() == [25.4, 1.0, 1.0]
    assert found.feed.tolist() == [254.0, 254.0, 254.0]
    assert found.end[3, 2] == 90


def test_feed_modes() -> None:
    found = segments("G93 G1 X10 F2", "G0 X0", "G94 G1 X1", "F50", "X2")
    assert found.feed == pytest.approx([20, nan, nan, 50], nan_ok=True)
    turning = segments("M3 S500 G95 G1 X1 F.1", "S100 X2", profile="rs274ngc")
    assert turning.feed.tolist() == [50, 10]


def test_order_of_execution() -> None:
    found = segments("M3 S100", "G1 X1 F10 M5 S5", "G91 X1 M30", "X1")
    assert found.spindle.tolist() == [0, 0, 0]
    assert found.end[0].tolist() == [1, 2, 1]


def test_dwell_comes_before_the_motion() -> None:
    found = segments("G90 F10 G1", "X1 G4 P2")
    assert found.dwell_s.tolist() == [2, 0]


def test_the_end_of_a_program() -> None:
    state = machine("G91 G18 G93 G55 M3 S5 M8", "M2").state
    assert (state.motion_name, state.absolute, state.plane, state.feed_mode) == ("G1", True, 17, 94)
    assert (state.spindle, state.flood, state.system, state.ended) == (0, False, 1, True)


def test_an_arc_in_each_plane_and_both_ways() -> None:
    found = segments("F9 G17 G2 X1 Y1 J1", "G18 G2 X2 Z1 I1", "G19 G3 Y2 Z2 K1")
    assert found.kind.tolist() == [CW, CW, CCW]
    assert found.plane.tolist() == [17, 18, 19]
    assert np.abs(found.sweep) == pytest.approx([3 * pi / 2, 3 * pi / 2, pi / 2])


def test_a_probe_ends_anywhere() -> None:
    interpreter = machine("G0 X1", "G38.2 Z-5 F10", "G0 Z1", at=0.0)
    found = interpreter.take()
    assert found.kind.tolist() == [RAPID, PROBE, RAPID]
    assert found.end[2, 1] == -5
    assert np.isnan(found.start[2, 2])
    assert found.start[0, 2] == 1


def test_modes_can_be_kept_and_taken_back() -> None:
    state = machine("G91 G20 F1", "M70", "G90 G21 G18 G55", "M72", profile="rs274ngc").state
    assert (state.absolute, state.inches, state.plane, state.system) == (False, True, 17, 1)


def test_what_is_not_followed_is_not_known() -> None:
    for line in ("G5.1 X1 Y1 I1 J1", "G76 P1 Z-1 I1 J1 K1", "M98 P5", "G17.1", "G999 X1"):
        state = machine("F9", line, profile="rs274ngc").state
        assert any(np.isnan(state.position)), line


def test_threads_follow_the_spindle() -> None:
    found = segments("M3 S100 F5", "G33 Z-3 K.5", "G33.1 Z-9 K2", profile="rs274ngc")
    assert found.feed.tolist() == [50, 200, 200]
    assert found.end[2].tolist() == [-3, -9, -3]
    assert found.spindle.tolist() == [100, 100, -100]


def test_a_lathe_with_steps_in_u_and_w() -> None:
    found = segments("G1 X10 Z5 F50", "U-2 W3", "G90 X1 W1", "G2 X3 Z7 I0 K-2", profile="ncframe-lathe")
    assert found.axes == "XZ"
    assert found.end.tolist() == [[10, 8, 1, 3], [5, 8, 9, 7]]
    assert found.plane.tolist() == [0, 0, 0, 18]
    assert notes("G1 U1 F5", "G50 X5 Z5", "G4 P1", profile="ncframe-lathe") == []


def test_diameters() -> None:
    found = segments("G7 G1 X10 F5", "G91 X4", "G8 X1", profile="rs274ngc")
    assert found.end[0].tolist() == [5, 7, 8]


def test_compensation_makes_another_way() -> None:
    lines = ("F100 G41.1 D2", "G1 X10", "Y10", "X0", "G40", "G0 X0 Y20")
    interpreter = machine(*lines, profile="rs274ngc")
    interpreter.finish()
    found = interpreter.take()
    assert not interpreter.notes
    assert not interpreter.compensating
    # To the left of the way: a corner to the left is an inside corner.
    assert found.end[0].tolist() == pytest.approx([9, 9, 0, 0])
    assert found.end[1].tolist() == pytest.approx([1, 9, 9, 20])
    np.testing.assert_array_equal(found.start[:, 1:], found.end[:, :-1])


def test_compensation_wants_a_radius_and_a_place() -> None:
    assert notes("F100 G41 D7", "G1 X10", profile="rs274ngc") == ["compensation"]
    lost = Interpreter(load_profile("rs274ngc"))
    for number, line in enumerate(("F9 G41.1 D2", "G1 X5"), 1):
        lost.step(number, parse_block(line))
    assert [note.code for note in lost.notes] == ["compensation_unknown"]


letters = st.sampled_from("GMTSFNOXYZABCUVWIJKRPQLHDEW")
NUMBERS = """0 1 2 3 -1 4 10 28 30 17 18 20 33 38.2 41.1 42 43 43.1 53 54 59.3 73 76 80 81 83 84 87 88 90 91 90.1 92
92.2 92.3 93 95 98 99 .5 -3.25 999999999 6 61 70 72 100 210 8 7 5"""
values = st.sampled_from(NUMBERS.split())
random_blocks = st.lists(st.builds(lambda letter, value: letter + value, letters, values), max_size=7).map(" ".join)


@pytest.mark.parametrize("profile", profile_names())
@given(lines=st.lists(random_blocks | st.text(max_size=12), max_size=12), known=st.booleans(), laser=st.booleans())
@quick
def test_any_block_can_be_executed(profile: str, lines: list[str], known: bool, laser: bool) -> None:
    state = power_on(load_profile(profile))
    if known:
        state.position = [0.0] * len(state.axes)
    interpreter = Interpreter(load_profile(profile), state, laser=laser)
    for number, line in enumerate(lines, 1):
        interpreter.step(number, parse_block(line))
    interpreter.finish()
    found = interpreter.take()
    assert (np.diff(found.line) >= 0).all()
    assert set(found.kind.tolist()) <= set(range(7))
    assert (found.frame < len(found.frames)).all()
    assert not len(interpreter.rows)
    assert FEED not in found.kind or found.lengths().min() >= 0
