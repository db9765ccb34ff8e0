"""Where a program leads on an ElVinto machine: positions, segments, and what is not known."""

from math import nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.interpreter import Interpreter, power_on
from gcode.motion import Position
from gcode.profile import load_profile, profile_names
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, RAPID, Segments
from gcode.words import parse_block
from tests.harness.programs import elvinto, positions, program_lines, thorough

HERE = {"x": 1.0, "y": 2.0, "z": 3.0}


def at(position: Position | None = HERE, *, absolute: bool | None = True) -> Interpreter:
    state = power_on(elvinto())
    state.absolute = absolute
    state.locate(dict(position or {}))
    return Interpreter(elvinto(), state)


def follow(*lines: str, position: Position | None = HERE, absolute: bool | None = True) -> tuple[Interpreter, Segments]:
    interpreter = at(position, absolute=absolute)
    for number, line in enumerate(lines, 1):
        interpreter.step(number, parse_block(line))
    return interpreter, interpreter.take()


@pytest.mark.parametrize(
    ("lines", "position"),
    [
        (["G0 X10"], {"x": 10, "y": 2, "z": 3}),
        (["G91 G1 X10 F100", "X10 Z-1"], {"x": 21, "y": 2, "z": 2}),
        (["G0", "X5", "G91", "Y1", "G90 Y7"], {"x": 5, "y": 7, "z": 3}),
        (["G2 X5 Y2 I2 J0 F100"], {"x": 5, "y": 2, "z": 3}),
        (["M3 S100", "G21 G40"], HERE),
        # What shifts or loses coordinates (elvinto §6).
        (["G92 X0 Z9"], {"x": 0, "y": 2, "z": 9}),
        (["G92"], {}),
        (["M200"], {"x": 0, "y": 0, "z": 0}),
        (["M210"], {"x": 1, "y": 2, "z": 0}),
        (["G28"], {"x": 0, "y": 0}),
        (["G28 Z5"], {"x": 0, "y": 0}),
        (["G92 X5 Y5 Z5", "G28"], {"x": 0, "y": 0}),
        (["W93", "G28"], HERE),
        (["W93", "W94", "G28"], {"x": 0, "y": 0}),
        (["G29"], {}),
        (["G27"], {}),
        (["M6 T2"], {"x": 1, "y": 2}),
        (["G0 M6 X9"], {"x": 9, "y": 2}),
        (["G100 X5 Y5"], {}),
        (["G90 G0 A5", "G76 S3"], HERE),
        (["G81 X5 Y6 Z-3 R1 F100"], {"x": 5, "y": 6}),
        (["W70", "G91", "W71", "G0 X5"], {"x": 5, "y": 2, "z": 3}),
        (["W71", "G0 X5"], {"y": 2, "z": 3}),
        # Nobody knows where these lead.
        (["X5"], {"y": 2, "z": 3}),
        (["G80", "X5 Z1"], {"y": 2}),
        (["G0 X5 X6"], {}),
        (["G55 G0 X5"], {}),
        (["G0 G1 X5"], {}),
        (["G28 M6"], {}),
        (["M210 Z4"], {}),
        (["G300"], {}),
        (["M30", "G0 X5"], {"y": 2, "z": 3}),
        (["M30 G0 X5"], {"x": 5, "y": 2, "z": 3}),
    ],
)
def test_position(lines: list[str], position: dict[str, float]) -> None:
    interpreter, _ = follow(*lines)
    assert interpreter.state.place() == pytest.approx(position, abs=1e-12)


@pytest.mark.parametrize(("absolute", "x"), [(True, 5.0), (False, 6.0), (None, None)])
def test_the_distance_mode_at_the_start_decides(absolute: bool | None, x: float | None) -> None:
    interpreter, segments = follow("G0 X5", absolute=absolute)
    assert interpreter.state.place().get("x") == x
    assert list(segments.end[0]) == pytest.approx([nan if x is None else x], nan_ok=True)


def test_an_absolute_move_makes_an_unknown_axis_known() -> None:
    interpreter, segments = follow("G0 X5", "Y6", position={})
    assert interpreter.state.place() == {"x": 5, "y": 6}
    assert np.isnan(segments.start[:, 0]).all()
    _, relative = follow("G91 G0 X5", position={})
    assert np.isnan(relative.end).all()


def test_kinds_feeds_and_spindle() -> None:
    _, segments = follow("M3 S500", "G0 X1", "G1 X4 Y6 F300", "G2 X1 Y2 I10 J0", "G4 P2.5", "M6 T2", "G0 Z1")
    assert list(segments.kind) == [RAPID, FEED, CW, DWELL, HOMING, RAPID]
    assert list(segments.line) == [2, 3, 4, 5, 6, 7]
    assert list(segments.feed) == pytest.approx([nan, 300, 300, 300, 300, 300], nan_ok=True)
    assert set(segments.spindle) == {500.0}
    assert list(segments.tool) == [-1, -1, -1, -1, 2, 2]
    assert segments.dwell_s[3] == 2.5


def test_lengths() -> None:
    _, line = follow("G1 X4 Y6 F300")
    assert line.lengths() == pytest.approx([5])
    _, turn = follow("G1 A90 F180", position={"a": 0.0})
    assert turn.lengths() == pytest.approx([90])
    _, arc = follow("G2 X1 Y2 I10 J0 F600")
    assert arc.lengths() == pytest.approx([20 * pi])
    _, helix = follow("G3 X1 Y2 Z7 I10 J0 F600")
    assert helix.lengths() == pytest.approx([(400 * pi * pi + 16) ** 0.5])


def test_an_arc_is_known_where_the_position_is_not() -> None:
    _, segments = follow("G3 I5", "G91 G2 X5 Y5 I5", position={})
    assert list(segments.kind) == [CCW, CW]
    assert segments.sweep == pytest.approx([2 * pi, -pi / 2])
    assert list(segments.radius) == [5, 5]


def test_peck_drilling_remembers_its_hole() -> None:
    interpreter, first = follow("G83 X5 Y5 Z-9 R1 Q2 F100")
    interpreter.step(2, parse_block("X15"))
    second = interpreter.take()
    assert np.nanmin(first.end[2]) == np.nanmin(second.end[2]) == -9
    assert (second.kind == FEED).sum() == (first.kind == FEED).sum() == 5
    interpreter.step(3, parse_block("G0 X0"))
    assert list(interpreter.take().kind) == [RAPID]
    assert interpreter.state.cycle == {}


def test_a_still_block_is_still() -> None:
    for line in ("M3 S100", "G1 F500", "G90", "N10", "G80", "T4", "", "G92 X7"):
        _, segments = follow("G1 X1", line)
        assert len(segments) == 1


def test_modal_state() -> None:
    interpreter, _ = follow("G91 G1 X1 F250", "T7", "W70")
    state = interpreter.state
    assert (state.motion_name, state.absolute, state.feed, state.selected) == ("G1", False, 250, 7)
    interpreter.step(4, parse_block("M30"))
    assert (state.motion, state.absolute, state.ended) == (None, None, True)


def test_a_plane_that_the_machine_ignores_is_kept_for_the_check() -> None:
    _, segments = follow("G18", "G2 X5 Z3 I2 K0 F100")
    assert list(segments.plane) == [18]


def seen(segments: Segments) -> np.ndarray:
    return np.array([*segments.start, *segments.end, segments.kind, segments.feed, segments.sync], np.float64)


@given(st.lists(program_lines, max_size=12), st.lists(program_lines, max_size=6), positions)
@thorough
def test_a_copy_goes_its_own_way(lines: list[str], more: list[str], position: Position) -> None:
    interpreter, _ = follow(*lines, position=position)
    twin = Interpreter(elvinto(), interpreter.state.copy())
    before = interpreter.state.copy()
    for line in more:
        twin.step(1, parse_block(line))
    assert interpreter.state == before
    for line in more:
        interpreter.step(1, parse_block(line))
    np.testing.assert_array_equal(seen(interpreter.take()), seen(twin.take()))


@given(st.lists(program_lines | st.text(max_size=20), max_size=15), positions, st.sampled_from((True, False, None)))
@thorough
def test_any_program_can_be_followed(lines: list[str], position: Position, absolute: bool | None) -> None:
    interpreter = at(position, absolute=absolute)
    for number, line in enumerate(lines, 1):
        held = interpreter.state.position
        copy = list(held)
        interpreter.step(number, parse_block(line))
        assert held == pytest.approx(copy, nan_ok=True), "a position that was handed out must stay true"
    segments = interpreter.take()
    assert (segments.lengths() >= 0).all()
    assert (segments.dwell_s >= 0).all()
    assert (np.diff(segments.line) >= 0).all()


@given(st.lists(program_lines, max_size=15), positions)
@thorough
def test_what_is_known_with_less_is_the_same_with_more(lines: list[str], position: Position) -> None:
    """Knowing less about the start may only make coordinates unknown, never different."""
    full, blind = at({**HERE, "a": 0.0, **position}), at({})
    for line in lines:
        full.step(1, parse_block(line))
        blind.step(1, parse_block(line))
        known = full.state.place()
        for axis, value in blind.state.place().items():
            assert known[axis] == pytest.approx(value, abs=1e-9)


def test_every_code_of_every_profile_can_be_executed() -> None:
    for name in profile_names():
        profile = load_profile(name)
        for code in profile.codes.values():
            interpreter = Interpreter(profile)
            interpreter.step(1, parse_block(f"{code.name} X1 Y2 Z3 R4 I5 P1 Q1 F100"))
            interpreter.take()
