"""What a controller says of itself becomes the state that a program begins in; what it does not say stays unknown."""

from math import isnan

import pytest

from gcode.held import Held, state_of
from gcode.interpreter import Interpreter, power_on
from gcode.profile import load_profile
from gcode.words import parse_block

GRBL = load_profile("grbl-1.1")
NOTHING: dict[str, dict[str, float]] = {"G92": {"x": 0.0, "y": 0.0, "z": 0.0}, "TLO": {"z": 0.0}}
AT_RESET = ("G0", "G54", "G17", "G21", "G90", "G94", "M5", "M9", "T0", "F0", "S0")


def test_every_mode_is_taken_over() -> None:
    words = ("G1", "G56", "G18", "G20", "G91", "G93", "M4", "M8", "T3", "F10", "S1200")
    state = state_of(Held(words, NOTHING), GRBL)
    assert (state.motion, state.motion_name, state.system, state.plane) == ("feed", "G1", 3, 18)
    assert (state.inches, state.absolute, state.feed_mode) == (True, False, 93)
    assert (state.spindle, state.speed, state.flood, state.mist, state.selected) == (-1, 1200.0, True, False, 3)


def test_a_feed_in_inches_is_one_in_mm_here() -> None:
    assert state_of(Held(("G0", "G20", "G94", "F10.0"), NOTHING), GRBL).feed == pytest.approx(254.0)


def test_as_it_is_switched_on_it_is_as_the_profile_says() -> None:
    assert state_of(Held(AT_RESET, NOTHING), GRBL).modes() == power_on(GRBL).modes()


@pytest.mark.parametrize("word", ["M0", "M30", "G43.1", "G99.9", "M8 M9", "what", "", "S", "G2", "G38.2"])
def test_a_word_that_says_nothing_of_the_modes_is_harmless(word: str) -> None:
    state = state_of(Held(("G91", word), NOTHING, {"x": 1.0}), GRBL)
    assert (state.absolute, state.ended, state.place()) == (False, False, {"x": 1.0})


def test_machine_and_program_coordinates_are_told_apart() -> None:
    offsets = {
        "G54": {"x": 100.0, "y": 0.0, "z": -40.0},
        "G55": {"x": 7.0, "y": 8.0, "z": 9.0},
        "G28": {"x": 1.0, "y": 2.0, "z": 3.0},
        "G92": {"x": 0.0, "y": 5.0, "z": 0.0},
        "TLO": {"z": 2.5},
    }
    state = state_of(Held(AT_RESET, offsets, {"x": 1.0, "y": 2.0, "z": 3.0}), GRBL)
    assert state.position == [101.0, 7.0, -34.5]
    assert (state.systems[2], state.homes, state.shift_active) == ([7.0, 8.0, 9.0], {28: [1.0, 2.0, 3.0]}, True)
    assert state.place() == {"x": 1.0, "y": 2.0, "z": 3.0}


def test_a_shift_that_nobody_has_told_is_not_one_of_nothing() -> None:
    """The program says G92.1: where it stands then hangs on a shift that may have been set by hand."""
    held = Held(AT_RESET, None, {"x": 1.0, "y": 2.0, "z": 3.0})
    for code, lost in (("G92.1", "xyz"), ("G49", "xyz"), ("G55", "xyz"), ("G90", "")):
        interpreter = Interpreter(GRBL, state_of(held, GRBL))
        interpreter.step(1, parse_block(code))
        assert set("xyz") - set(interpreter.state.place()) == set(lost), code
    interpreter = Interpreter(GRBL, state_of(held, GRBL, assume=True))
    interpreter.step(1, parse_block("G92.1"))
    assert interpreter.state.place() == held.position


def test_a_controller_that_has_told_nothing_is_one_that_was_just_switched_on() -> None:
    state = state_of(Held(), GRBL)
    assert all(map(isnan, state.position))
    assert state.modes() == power_on(GRBL).modes()


def test_it_is_the_same_after_a_while_in_the_history() -> None:
    for held in (Held(), Held(AT_RESET, NOTHING, {"x": 1.5})):
        assert Held.from_json(held.to_json()) == held


def test_a_beginning_once_more_has_its_own_shift_and_homes_and_the_systems_of_now() -> None:
    then = {"G54": {"x": 1.0}, "G28": {"x": 7.0}, "G92": {"x": 5.0}, "TLO": {"z": 2.0}}
    here = {"G54": {"x": 9.0}, "G28": {"x": 8.0}, "G92": {"x": 0.0}, "TLO": {"z": 0.0}}
    began, now = Held(("G91",), then, {"x": 3.0}), Held(AT_RESET, here, {"x": 0.0})
    # A home that the program has stored (G28.1) was not that home before.
    assert began.again(now) == Held(("G91",), then | {"G54": {"x": 9.0}}, {"x": 3.0})
    assert began.again(Held()) == began
