"""Canned cycles, hole by hole; the same against LinuxCNC in test_rs274_oracle.py."""

from math import nan

import pytest

from gcode.cycles import CLEARANCE_MM, CYCLES, MAX_MOVES, Hole, count_of, cycle_moves
from gcode.interpreter import Interpreter, power_on
from gcode.profile import load_profile
from gcode.segments import DWELL, FEED, RAPID
from gcode.words import parse_block

HOLE = Hole(0, 0, 10, 5, 6, 1, 2, 2, -4, 10, return_to_top=False, repeats=1)


def heights(effect: str, hole: Hole) -> list[tuple[int, float]]:
    return [(move.kind, move.c) for move in cycle_moves(effect, hole)]


def test_drill_and_return() -> None:
    assert heights("drill", HOLE) == [(RAPID, 10), (RAPID, 2), (FEED, -4), (RAPID, 10)]
    assert heights("drill", HOLE._replace(return_to_top=True))[-1] == (RAPID, 2)
    # From below the R plane: up first, where it stands.
    assert heights("drill", HOLE._replace(now=0, level=0)) == [(RAPID, 2), (RAPID, 2), (FEED, -4), (RAPID, 2)]


def test_repeats_go_on_by_their_steps() -> None:
    moves = list(cycle_moves("drill", HOLE._replace(repeats=3)))
    assert [(move.a, move.b) for move in moves if move.kind == FEED] == [(5, 6), (6, 8), (7, 10)]


def test_pecks() -> None:
    hole = HOLE._replace(peck=2.5)
    rest = -0.5 + CLEARANCE_MM
    deep = -3.0 + CLEARANCE_MM
    pecks = [(FEED, -0.5), (RAPID, 2), (RAPID, rest), (FEED, -3), (RAPID, 2), (RAPID, deep), (FEED, -4), (RAPID, 10)]
    assert [height for _, height in heights("peck", hole)[2:]] == pytest.approx([height for _, height in pecks])
    assert [kind for kind, _ in heights("peck", hole)[2:]] == [kind for kind, _ in pecks]
    assert [height for _, height in heights("chip_break", hole)[2:]] == pytest.approx([-0.5, rest, -3, deep, -4, 10])


def test_what_is_unknown_stays_unknown() -> None:
    for effect in CYCLES:
        moves = list(cycle_moves(effect, HOLE._replace(bottom=nan, peck=1.0)))
        assert 3 <= len(moves) < 12
    assert heights("drill", HOLE._replace(now=nan, level=nan))[-1][1] != heights("drill", HOLE)[-1][1]


@pytest.mark.parametrize("effect", sorted(CYCLES))
def test_the_count_bounds_the_moves(effect: str) -> None:
    for repeats in (1, 4):
        hole = HOLE._replace(peck=0.01, repeats=repeats)
        assert len(list(cycle_moves(effect, hole))) <= count_of(effect, hole)


def machine(*lines: str) -> Interpreter:
    profile = load_profile("rs274ngc")
    state = power_on(profile)
    state.position = [0.0] * len(state.axes)
    interpreter = Interpreter(profile, state)
    for number, line in enumerate(lines, 1):
        interpreter.step(number, parse_block(line))
    return interpreter


@pytest.mark.parametrize(
    ("line", "level"),
    [
        ("G81 X1 Z-1", "error"),
        ("G81 X1 R1", "error"),
        ("G82 X1 Z-1 R1", "error"),
        ("G83 X1 Z-1 R1 Q0", "error"),
        ("G83 X1 Z-1 R1", "error"),
        ("G73 X1 Z-1 R1 Q-1", "error"),
        ("G83 X1 Z-9 R1 Q.0001", "error"),
        ("G81 X1 Z-1 R1 L1000000", "error"),
        ("G87 X1 Z-1 R1", "error"),
        ("G81 X1 Z1 R-1", "warning"),
        ("G81 X1 Z-1 R1 L0", "warning"),
    ],
)
def test_notes(line: str, level: str) -> None:
    interpreter = machine("G21 F100", line)
    assert [(note.line, note.code, note.level) for note in interpreter.notes] == [(2, "cycle_words", level)]
    assert len(interpreter.rows) <= MAX_MOVES


def test_a_cycle_that_cannot_be_leaves_the_position_unknown() -> None:
    interpreter = machine("G0 X1 Y1 Z1 A1", "G83 X5 Z-1 R1 Q0")
    assert interpreter.state.place() == {"a": 1, "b": 0, "c": 0, "u": 0, "v": 0, "w": 0}


def test_sticky_words_hold_for_the_same_cycle_only() -> None:
    interpreter = machine("F100", "G82 X1 Z-3 R1 P.5", "X2", "G81 X3 Z-4")
    dwells = interpreter.take()
    assert list(dwells.line[dwells.kind == DWELL]) == [2, 3]
    assert [(note.line, note.code) for note in interpreter.notes] == [(4, "cycle_words")]


def test_tapping_turns_back_and_lets_the_queue_run_dry() -> None:
    segments = machine("F100 M3 S300", "G84 X1 Z-3 R1").take()
    feeds = segments.kind == FEED
    assert list(segments.spindle[feeds]) == [300, -300]


def test_g88_leaves_the_height_to_the_operator() -> None:
    interpreter = machine("F100 M3 S300", "G88 X1 Z-3 R1 P1")
    assert "z" not in interpreter.state.place()
