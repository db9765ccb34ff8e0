"""The rules of a machine, and the profile that they make."""

from math import isnan

import pytest

from gcode.ncframe.rules import FrameRules, profile_for, state_for
from tests.harness.frameprograms import LATHE


@pytest.mark.parametrize(
    "wrong",
    [
        {"resolution_mm": 0.0},
        {"resolution_mm": float("nan")},
        {"resolution_mm": 1e-300},
        {"resolution_mm": float("inf")},
        {"tool_radius_mm": float("nan")},
        {"tool_radius_mm": float("inf"), "compensation": "offset"},
        {"tools": {1: float("-inf")}},
        {"systems": {2: {"x": float("nan")}}},
        {"feed_unit_mm_min": -1.0},
        {"speed_unit_rpm": 0.0},
        {"feed_table_mm_min": (1.0, -1.0)},
        {"feed_table_mm_min": (1.0,) * 257},
        {"systems": {10: {"x": 1.0}}},
    ],
)
def test_numbers_that_no_machine_has_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        FrameRules(**wrong)  # type: ignore[arg-type]


def test_ranges_of_f_and_s_are_those_of_their_bytes() -> None:
    assert profile_for(LATHE, FrameRules()).ranges["F"] == (0.0, 255.0)
    made = profile_for(LATHE, FrameRules(feed_unit_mm_min=10, speed_unit_rpm=20))
    assert (made.ranges["F"], made.ranges["S"]) == ((0.0, 2550.0), (0.0, 5100.0))
    assert profile_for(LATHE, FrameRules(feed_table_mm_min=(5.0, 40.0, 20.0))).ranges["F"] == (0.0, 40.0)


def test_the_interpreter_guides_tools_of_their_radius_or_none() -> None:
    rules = FrameRules(tool_radius_mm=0.4, tools={3: 0.8})
    assert rules.radius_of(3) == 0.8
    assert rules.radius_of(4) == 0.4
    diameters = profile_for(LATHE, rules).initial["diameters"]
    assert (diameters[3], diameters[4], len(diameters)) == (1.6, 0.8, 256)
    offset = FrameRules(tools={3: 0.8}, compensation="offset")
    assert profile_for(LATHE, offset).initial["diameters"] == {3: 0.0}


def test_the_state_knows_what_was_told() -> None:
    state = state_for(profile_for(LATHE, FrameRules(systems={2: {"x": 5.0}})), {"z": 4.0})
    assert isnan(state.position[0])
    assert state.position[1] == 4.0
    assert state.systems == {1: [0.0, 0.0], 2: [5.0, 0.0]}
    first = state_for(profile_for(LATHE, FrameRules(systems={1: {"x": 5.0}})), None)
    assert first.frame == (5.0, 0.0)


def test_two_states_share_nothing_that_changes() -> None:
    profile = profile_for(LATHE, FrameRules(tool_radius_mm=1.0))
    one, other = state_for(profile, None), state_for(profile, None)
    one.diameters[1] = 9.0
    assert other.diameters[1] == 2.0
