"""Compensation "offset": when an axis takes it and when it leaves it."""

from gcode.ncframe.offset import Offset
from gcode.ncframe.rules import FrameRules
from gcode.segments import CW, FEED
from tests.harness.frameprograms import LATHE

ON, OFF, END = (LATHE.codes[name] for name in ("G42", "G40", "M30"))
RULES = FrameRules(compensation="offset", tool_radius_mm=0.4, tools={7: 0.8})


def test_each_axis_takes_it_with_its_own_words_or_steps() -> None:
    offset = Offset(RULES, "XZ")
    offset.take([ON], {}, 1)
    assert offset.applied == (0.0, 0.0)
    assert offset.apply({"F": 5.0}, [FEED])
    assert offset.applied == (0.0, 0.0)
    assert offset.apply({"U": 5.0}, [FEED])
    assert offset.applied == (0.4, 0.0)
    assert not offset.apply({"X": 1.0, "Z": 5.0}, [CW])
    assert offset.apply({"Z": 5.0}, [FEED])
    assert offset.apply({"X": 1.0, "Z": 5.0}, [CW])
    assert offset.applied == (0.4, 0.4)


def test_words_that_are_no_way_take_nothing() -> None:
    offset = Offset(RULES, "XZ")
    offset.take([ON], {}, 1)
    assert offset.apply({"X": 5.0}, [])
    assert offset.applied == (0.0, 0.0)


def test_the_radius_is_that_of_d_or_of_the_tool() -> None:
    for values, tool, radius in (({}, 7, 0.8), ({"D": 7.0}, 1, 0.8), ({"D": 0.0}, 7, 0.0), ({}, 1, 0.4)):
        offset = Offset(RULES, "XZ")
        offset.take([ON], values, tool)
        offset.apply({"X": 1.0, "Z": 1.0}, [FEED])
        assert offset.applied == (radius, radius)


def test_it_ends_with_g40_and_with_the_program() -> None:
    for code in (OFF, END):
        offset = Offset(RULES, "XZ")
        offset.take([ON], {}, 1)
        offset.apply({"X": 1.0, "Z": 1.0}, [FEED])
        offset.take([code], {}, 1)
        offset.apply({"X": 1.0}, [FEED])
        assert offset.applied == (0.0, 0.4)


def test_along_the_contour_nothing_is_added() -> None:
    offset = Offset(FrameRules(tool_radius_mm=0.4), "XZ")
    offset.take([ON], {}, 1)
    assert offset.apply({"X": 1.0, "Z": 1.0}, [FEED])
    assert offset.applied == (0.0, 0.0)
