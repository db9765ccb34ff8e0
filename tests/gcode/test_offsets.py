"""Offsets: the machine never moves by them, and what nobody has told is not known behind a change."""

from math import isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.interpreter import Interpreter, power_on
from gcode.profile import load_profile
from gcode.words import parse_block
from tests.harness.programs import quick


def machine(*lines: str, systems: bool = True, homes: bool = True, known: bool = True) -> Interpreter:
    profile = load_profile("rs274ngc")
    state = power_on(profile)
    zeros = [0.0] * len(state.axes)
    if known:
        state.position = list(zeros)
    if systems:
        state.systems = {number: list(zeros) for number in range(1, 10)}
    if homes:
        state.homes = {28: list(zeros), 30: list(zeros)}
    interpreter = Interpreter(profile, state)
    for number, line in enumerate(lines, 1):
        interpreter.step(number, parse_block(line))
    return interpreter


def place(*lines: str, systems: bool = True, homes: bool = True, known: bool = True) -> dict[str, float]:
    found = machine(*lines, systems=systems, homes=homes, known=known).state.place()
    return {axis: value for axis, value in found.items() if axis in "xyz"}


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["G0 X5 Y5 Z5", "G92 X0"], {"x": 0, "y": 5, "z": 5}),
        (["G0 X5 Y5 Z5", "G92 X0", "G92.1"], {"x": 5, "y": 5, "z": 5}),
        (["G0 X5 Y5 Z5", "G92 X0", "G92.2", "G92.3"], {"x": 0, "y": 5, "z": 5}),
        (["G0 X5 Y5 Z5", "G10 L2 P1 X1 Z2"], {"x": 4, "y": 5, "z": 3}),
        (["G0 X5 Y5 Z5", "G10 L20 P0 X1 Z2"], {"x": 1, "y": 5, "z": 2}),
        (["G0 X5 Y5 Z5", "G10 L20 P3 X1 Z2", "G56"], {"x": 1, "y": 5, "z": 2}),
        (["G0 X5 Y5 Z5", "G43.1 Z2"], {"x": 5, "y": 5, "z": 3}),
        (["G0 X5 Y5 Z5", "G43.1 Z2", "G49"], {"x": 5, "y": 5, "z": 5}),
        (["G0 X5 Y5 Z5", "G52 X1"], {"x": 4, "y": 5, "z": 5}),
        (["G20 G0 X1", "G92 X0 G21", "G0 X1"], {"x": 1, "y": 0, "z": 0}),
    ],
)
def test_known_offsets(lines: list[str], expected: dict[str, float]) -> None:
    assert place(*lines) == pytest.approx(expected)


def test_a_system_that_nobody_has_told() -> None:
    assert place("G0 X5 Y5 Z5", "G54", systems=False) == {"x": 5, "y": 5, "z": 5}
    assert place("G0 X5 Y5 Z5", "G55", systems=False) == {}
    assert place("G0 X5 Y5 Z5", "G55", "G0 X1", systems=False) == {"x": 1}
    # Half of it is told by the program.
    assert place("G0 X5 Y5 Z5", "G10 L2 P1 X1", systems=False) == {"y": 5, "z": 5}
    assert place("G0 X5 Y5 Z5", "G53 G0 X9", systems=False) == {"y": 5, "z": 5}
    assert place("G0 X5 Y5 Z5", "G10 L20 P1 X1", systems=False) == {"x": 1, "y": 5, "z": 5}
    assert place("G0 X5 Y5 Z5", "G10 L20 P2 X1", "G55", systems=False) == {}


def test_g92_anchors_an_unknown_axis_anew() -> None:
    assert place("G92 X7", known=False) == {"x": 7}
    assert place("G10 L20 P1 Y3", known=False) == {"y": 3}
    assert place("G92 X7", "G91 G0 X1 Y1", known=False) == {"x": 8}
    assert place("G92") == {}


def test_tools_that_nobody_has_measured() -> None:
    assert place("G0 X5 Y5 Z5", "G43 H1") == {"x": 5, "y": 5}
    assert place("G0 X5 Y5 Z5", "G10 L1 P1 Z2", "G43 H1") == {"x": 5, "y": 5, "z": 3}
    assert place("G0 X5 Y5 Z5", "G10 L1 P1 X1", "G43 H1") == {"x": 4, "y": 5}
    assert place("G0 X5 Y5 Z5", "G43 H0") == {"x": 5, "y": 5, "z": 5}
    assert place("T4 M6", "G10 L1 P4 Z2", "G43") == {"x": 0, "y": 0, "z": -2}


def test_homes() -> None:
    assert place("G0 X5 Y5 Z5", "G28") == {"x": 0, "y": 0, "z": 0}
    assert place("G0 X5 Y5 Z5", "G28", homes=False) == {}
    assert place("G0 X5 Y5 Z5", "G28 Z9", homes=False) == {"x": 5, "y": 5}
    assert place("G0 X5 Y5 Z5", "G28.1", "G0 X1 Y1", "G28 X3", homes=False) == {"x": 5, "y": 1, "z": 5}


def test_an_anchored_axis_is_lost_with_its_shift() -> None:
    assert place("G92 X1", "G92.1", known=False) == {}
    assert place("G92 X1", "G92.2", "G92.3", known=False) == {}
    assert place("G92 X1", "G92 X5", known=False) == {"x": 5}
    assert place("G92 X1", "G53 G0 X5", known=False) == {}
    assert place("G92 X1", "G28", "G0 X2", known=False) == {"x": 2, "y": 0, "z": 0}


def test_g53_knows_no_offsets() -> None:
    interpreter = machine("G92 X9 Y9", "G1 F100", "G53 G0 X1")
    assert interpreter.state.position[:2] == [1, 0]
    assert [note.code for note in machine("G2 X1 I1", "G53 X2 I1").notes] == ["g53_without_g0_g1"]


def test_what_is_not_followed_is_lost() -> None:
    for line in ("G10 L2 P1 R30", "G10 L11 P1 X1", "G10 P1 X1", "G10 L2 X1", "G10 L2 P77 X1"):
        interpreter = machine(line)
        assert all(isnan(value) for value in interpreter.state.position), line
        assert interpreter.notes, line


changes = st.sampled_from(
    (
        "G92 X1 Y2",
        "G92.1",
        "G92.2",
        "G92.3",
        "G52 X3 Z-1",
        "G43.1 Z2",
        "G49",
        "G54",
        "G55",
        "G59.3",
        "G10 L2 P0 X4",
        "G10 L2 P2 Y-1",
        "G10 L20 P1 Z3",
        "G10 L20 P9 X0 Y0",
        "G20",
        "G21",
    )
)
moves = st.sampled_from(("G90 G0 X1", "G91 G1 Y2 F100", "G90 G1 X3 Z4 F50", "G91 G2 X1 I1 F10", "G53 G90 G0 X5"))


@given(st.lists(changes | moves, max_size=20))
@quick
def test_segments_are_continuous_in_machine_coordinates(lines: list[str]) -> None:
    interpreter = machine(*lines)
    segments = interpreter.take()
    np.testing.assert_array_equal(segments.start[:, 1:], segments.end[:, :-1])
    if len(segments):
        np.testing.assert_array_equal(segments.end[:, -1], interpreter.state.position)


@given(st.lists(changes | moves, max_size=20))
@quick
def test_less_knowledge_is_never_other_knowledge(lines: list[str]) -> None:
    full, blind = machine(*lines), machine(*lines, systems=False, known=False)
    known = full.state.place()
    for axis, value in blind.state.place().items():
        assert value == pytest.approx(known[axis], abs=1e-9)
