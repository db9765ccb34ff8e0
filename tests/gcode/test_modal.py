"""Where a program leads: positions, lengths and times, and what is not known."""

from math import pi
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.modal import Step, Tracker
from gcode.motion import Motion, Position
from gcode.profile import Effect
from gcode.words import parse_block
from tests.harness.programs import elvinto, positions, program_lines, thorough

HERE = {"x": 1.0, "y": 2.0, "z": 3.0}


def follow(*lines: str, position: Position | None = HERE, absolute: bool | None = True) -> tuple[Tracker, Step]:
    tracker = Tracker(elvinto(), Motion(), position, absolute=absolute)
    step = Step()
    for line in lines:
        step = tracker.step(parse_block(line))
    return tracker, step


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
    tracker, _ = follow(*lines)
    assert tracker.position == position


@pytest.mark.parametrize(("absolute", "x"), [(True, 5.0), (False, 6.0), (None, None)])
def test_the_distance_mode_at_the_start_decides(absolute: bool | None, x: float | None) -> None:
    tracker, step = follow("G0 X5", absolute=absolute)
    assert tracker.position.get("x") == x
    assert step.exact == (absolute is not None)


def test_an_absolute_move_makes_an_unknown_axis_known() -> None:
    tracker, step = follow("G0 X5", "Y6", position={})
    assert tracker.position == {"x": 5, "y": 6}
    assert (step.moves, step.exact) == (True, False)
    _, relative = follow("G91 G0 X5", position={})
    assert relative.exact
    assert relative.length_mm == 5


def test_lengths_and_times() -> None:
    _, line = follow("G1 X4 Y6 F300")
    assert (line.kind, line.length_mm, line.seconds) == ("feed", 5, 1)
    _, turn = follow("G1 A90 F180", position={"a": 0.0})
    assert (turn.length_mm, turn.seconds) == (90, 30)
    _, arc = follow("G2 X1 Y2 I10 J0 F600")
    assert arc.kind == "arc"
    assert arc.length_mm == pytest.approx(20 * pi)
    assert arc.seconds == pytest.approx(2 * pi)
    _, helix = follow("G3 X1 Y2 Z7 I10 J0 F600")
    assert helix.length_mm == pytest.approx((400 * pi * pi + 16) ** 0.5)
    _, dwell = follow("G4 P2.5")
    assert (dwell.kind, dwell.seconds, dwell.moves) == ("dwell", 2.5, False)


def test_axes_limit_the_feed_and_rapids_begin_from_rest() -> None:
    slow_z = Motion(max_rate={"x": 6000, "z": 60}, acceleration={"x": 100, "z": 100})
    tracker = Tracker(elvinto(), slow_z, {"x": 0.0, "y": 0.0, "z": 0.0})
    assert tracker.step(parse_block("G1 Z-10 F1000")).seconds == 10
    # 100 mm/s at 100 mm/s²: 1 s and 50 mm to gain speed, the same to lose it.
    assert tracker.step(parse_block("G0 X200")).seconds == pytest.approx(3)
    assert tracker.step(parse_block("G0 X201")).seconds == pytest.approx(0.2)


def test_peck_drilling_remembers_its_hole() -> None:
    tracker, first = follow("G83 X5 Y5 Z-9 R1 Q2 F100")
    second = tracker.step(parse_block("X15"))
    assert second.kind == "cycle"
    assert second.seconds > 6
    assert tracker.step(parse_block("G0 X0")).kind == "rapid"
    assert first.seconds > 6


def test_a_still_block_is_still() -> None:
    for line in ("M3 S100", "G1 F500", "G90", "N10", "G80", "T4"):
        _, step = follow("G1 X1", line)
        assert (step.moves, step.seconds) == (False, 0)


def test_modal_state() -> None:
    tracker, _ = follow("G91 G1 X1 F250", "T7", "W70")
    modal = tracker.modal
    assert (modal.motion, modal.absolute, modal.feed_mm_min, modal.tool) == ("G1", False, 250, 7)
    tracker.step(parse_block("M30"))
    assert (tracker.modal.motion, tracker.modal.absolute) == (None, None)


@given(st.lists(program_lines, max_size=12), st.lists(program_lines, max_size=6), positions)
@thorough
def test_a_copy_goes_its_own_way(lines: list[str], more: list[str], position: Position) -> None:
    tracker, _ = follow(*lines, position=position)
    twin, still = tracker.copy(), tracker.copy()
    before = (dict(tracker.position), tracker.modal)
    steps = [twin.step(parse_block(line)) for line in more]
    assert (tracker.position, tracker.modal) == before
    assert [still.step(parse_block(line)) for line in more] == steps


@given(st.lists(program_lines | st.text(max_size=20), max_size=15), positions, st.sampled_from((True, False, None)))
@thorough
def test_any_program_can_be_followed(lines: list[str], position: Position, absolute: bool | None) -> None:
    tracker = Tracker(elvinto(), Motion(), position, absolute=absolute)
    for line in lines:
        held = tracker.position
        copy = dict(held)
        step = tracker.step(parse_block(line))
        assert held == copy, "a position that was handed out must stay true"
        assert step.seconds >= 0
        assert step.length_mm >= 0
        assert step.end == tracker.position or not step.moves


@given(st.lists(program_lines, max_size=15), positions)
@thorough
def test_what_is_known_with_less_is_the_same_with_more(lines: list[str], position: Position) -> None:
    """Knowing less about the start may only make coordinates absent, never different."""
    full, blind = Tracker(elvinto(), Motion(), {**HERE, "a": 0.0, **position}), Tracker(elvinto(), Motion(), {})
    for line in lines:
        full.step(parse_block(line))
        blind.step(parse_block(line))
        for axis, value in blind.position.items():
            assert full.position[axis] == value


def test_every_effect_has_a_rule() -> None:
    tracker, _ = follow()
    codes = elvinto().codes.values()
    assert {code.effect for code in codes} <= set(get_args(Effect))
    for code in codes:
        tracker.copy().step(parse_block(f"{code.name} X1 Y2 Z3 R4 I5 P1 Q1 F100"))
