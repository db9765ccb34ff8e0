"""Time passes: trapezoids to the millisecond, by hand and by the planner of the project (spec gcode §5)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.grbl.stepper import Piece, profile
from tests.harness.grblconsole import Console

IDLE_LOCK_S = 0.025


def seconds(text: str, **settings: object) -> float:
    """From the start of the motion to its end, without the lock of the motors."""
    console = Console(**settings)  # type: ignore[arg-type]
    console.tell(text)
    console.rest()
    moves = [move for line in console.machine.executed for move in line.moves]
    assert moves[0].began_at is not None
    assert moves[-1].ended_at is not None
    return moves[-1].ended_at - moves[0].began_at


def test_a_trapezoid() -> None:
    # 6000 mm/min is 100 mm/s, at 200 mm/s² reached in 0.5 s and 25 mm.
    assert seconds("G1X100F6000\n") == pytest.approx(0.5 + 50 / 100 + 0.5)


def test_a_triangle() -> None:
    assert seconds("G1X20F6000\n") == pytest.approx(2 * math.sqrt(20 / 200))


def test_collinear_pieces_are_one_motion() -> None:
    assert seconds("".join(f"G1X{x}F6000\n" for x in range(10, 101, 10))) == pytest.approx(1.5)


def test_a_reversal_is_a_stop() -> None:
    assert seconds("G1X50F6000\nG1X0\n") == pytest.approx(2 * 1.0)


def test_a_right_angle() -> None:
    corner = math.sqrt(math.sqrt(2) * 200 * 0.01 * math.sqrt(0.5) / (1 - math.sqrt(0.5)))
    one_side = (100 - 0) / 200 + (100 - corner) / 200
    cruise = (100 - 100**2 / 400 - (100**2 - corner**2) / 400) / 100
    assert seconds("G1X100F6000\nG1Y100\n") == pytest.approx(2 * (one_side + cruise))


def test_the_speed_factor() -> None:
    assert seconds("G1X100F6000\n", speed_factor=10.0) == pytest.approx(0.15)


def test_look_ahead_is_bounded_by_the_queue() -> None:
    """With fifteen blocks of 1 mm one must always be able to stop within fourteen of them."""
    console = Console()
    for x in range(1, 16):
        console.tell(f"G1X{x}F6000\n")
    most = 0.0
    for x in range(16, 200):
        console.tell(f"G1X{x}F6000\n")
        console.rest() if x % 50 == 0 else console.wait(0.02)
        text = console.field("FS")
        assert text is not None
        most = max(most, float(text.split(",")[0]) / 60)
    assert most <= math.sqrt(2 * 200 * 15) + 0.5


def test_the_motors_stay_locked_for_a_moment_and_the_processor_waits() -> None:
    console = Console()
    console.tell("G1X20F6000\n")
    end = 2 * math.sqrt(20 / 200)
    console.wait(end + 0.01)
    assert console.tell("?") == []
    said = console.timeline(1.0)
    assert said[0][0] == pytest.approx(end + IDLE_LOCK_S)
    console = Console(dollar={1: 255})
    console.tell("G1X20F6000\n")
    console.wait(end + 0.001)
    assert console.state() == "Idle"


@given(st.floats(0.001, 500), st.floats(0, 200), st.floats(0.1, 200), st.floats(0, 200), st.floats(1, 2000))
def test_profiles_cover_their_length(
    length: float, speed: float, nominal: float, leave: float, acceleration: float
) -> None:
    leave = min(leave, nominal)
    pieces = profile(length, speed, nominal, leave, acceleration)
    assert sum(piece.length_mm for piece in pieces) == pytest.approx(length, rel=1e-6, abs=1e-6)
    at = speed
    for piece in pieces:
        assert piece.seconds >= 0
        assert piece.speed == pytest.approx(at, abs=1e-6)
        assert abs(piece.acceleration) <= acceleration * (1 + 1e-9)
        at = piece.speed + piece.acceleration * piece.seconds
        assert at <= max(speed, nominal) + 1e-6


def test_a_piece_says_when_a_place_is_passed() -> None:
    piece = Piece(2.0, 10.0, -5.0)
    for t in (0.0, 0.5, 1.9):
        assert piece.when(piece.covered(t)) == pytest.approx(t)
    assert Piece(1.0, 4.0, 0.0).when(2.0) == 0.5
