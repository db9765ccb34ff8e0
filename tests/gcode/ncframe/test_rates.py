"""F and S as bytes: units, a table, and what has no byte."""

import pytest

from gcode.ncframe.rates import RateError, feed_byte, speed_byte
from gcode.ncframe.rules import FrameRules

TABLE = FrameRules(feed_table_mm_min=(0.0, 10.0, 25.0, 60.0))


@pytest.mark.parametrize(
    ("feed", "unit", "byte"), [(50, 1, 50), (50.4, 1, 50), (50.6, 1, 51), (1000, 10, 100), (0.5, 0.1, 5), (255, 1, 255)]
)
def test_a_feed_in_its_unit(feed: float, unit: float, byte: int) -> None:
    assert feed_byte(feed, FrameRules(feed_unit_mm_min=unit)) == byte


@pytest.mark.parametrize(("feed", "byte"), [(10, 1), (24.9, 1), (25, 2), (60, 3)])
def test_of_a_table_never_a_faster_feed_than_the_programs(feed: float, byte: int) -> None:
    assert feed_byte(feed, TABLE) == byte


@pytest.mark.parametrize(
    ("feed", "rules", "says"),
    [
        (256, FrameRules(), "up to 255"),
        (0.4, FrameRules(), "nothing in steps of 1"),
        (61, TABLE, "up to 60"),
        (9, TABLE, "none slower than 10"),
        (float("inf"), FrameRules(), "up to 255"),
    ],
)
def test_a_feed_that_has_no_byte(feed: float, rules: FrameRules, says: str) -> None:
    with pytest.raises(RateError, match=says):
        feed_byte(feed, rules)


@pytest.mark.parametrize(
    ("speed", "unit", "byte"), [(7, None, 7), (0, None, 0), (1200, 10, 120), (0, 10, 0), (2550, 10, 255)]
)
def test_a_speed_is_a_step_or_counts_in_its_unit(speed: float, unit: float | None, byte: int) -> None:
    assert speed_byte(speed, FrameRules(speed_unit_rpm=unit)) == byte


@pytest.mark.parametrize(
    ("speed", "unit", "says"),
    [
        (256, None, "0 to 255"),
        (-1, None, "0 to 255"),
        (7.5, None, "number of a step"),
        (2600, 10, "0 to 2550"),
        (4, 10, "nothing"),
    ],
)
def test_a_speed_that_has_no_byte(speed: float, unit: float | None, says: str) -> None:
    with pytest.raises(RateError, match=says):
        speed_byte(speed, FrameRules(speed_unit_rpm=unit))
