"""F and S of a program to the one byte that a frame has for each (ncframe §2).

The one rule: the machine never cuts faster than the program says for want of a finer byte by more than half a count;
with a table, never faster at all.
"""

import numpy as np

from gcode.ncframe.rules import FrameRules
from gcode.segments import Bools, Floats

_ROUNDING = 1e-9


class RateError(ValueError):
    """There is no byte for this feed or speed."""


def feed_byte(feed_mm_min: float, rules: FrameRules) -> int:
    """The F of a feed over 0. Raises RateError."""
    table = rules.feed_table_mm_min
    if feed_mm_min > rules.fastest_feed_mm_min * (1 + _ROUNDING):
        raise RateError(f"a feed of {feed_mm_min:g} mm/min: the machine has up to {rules.fastest_feed_mm_min:g}")
    if table:
        slower = [feed for feed in table if 0.0 < feed <= feed_mm_min * (1 + _ROUNDING)]
        if not slower:
            least = min((feed for feed in table if feed > 0.0), default=0.0)
            raise RateError(f"a feed of {feed_mm_min:g} mm/min: the machine has none slower than {least:g}")
        return table.index(max(slower))
    count = round(feed_mm_min / rules.feed_unit_mm_min)
    if count == 0:
        raise RateError(f"a feed of {feed_mm_min:g} mm/min is nothing in steps of {rules.feed_unit_mm_min:g}")
    return count


def feeds_have_bytes(feed_mm_min: Floats, rules: FrameRules) -> Bools:
    """Which of these feeds are over 0 and have an F: those for which `feed_byte` raises nothing. NaN has none."""
    least = min((feed for feed in rules.feed_table_mm_min if feed > 0.0), default=0.0)
    found: Bools = (feed_mm_min > 0.0) & (feed_mm_min <= rules.fastest_feed_mm_min * (1 + _ROUNDING))
    if rules.feed_table_mm_min:
        found &= (least <= feed_mm_min * (1 + _ROUNDING)) & (least > 0.0)
    else:
        found &= np.rint(feed_mm_min / rules.feed_unit_mm_min) != 0.0
    return found


def feeds_of_bytes(feed_mm_min: Floats, rules: FrameRules) -> Floats:
    """The feed that the machine goes at when a program says these; as they are where there is no byte for them."""
    if rules.feed_table_mm_min:
        table = np.array(sorted({0.0, *rules.feed_table_mm_min}))
        at = np.searchsorted(table, feed_mm_min * (1 + _ROUNDING), side="right") - 1
        found = table[np.clip(at, 0, len(table) - 1)]
    else:
        found = np.rint(feed_mm_min / rules.feed_unit_mm_min) * rules.feed_unit_mm_min
    feeds: Floats = np.where(feeds_have_bytes(feed_mm_min, rules), found, feed_mm_min)
    return feeds


def speed_byte(speed: float, rules: FrameRules) -> int:
    """The S of a speed in rpm, or of a step number. Raises RateError."""
    if not 0.0 <= speed <= rules.highest_speed * (1 + _ROUNDING):
        raise RateError(f"S{speed:g}: the machine has 0 to {rules.highest_speed:g}")
    if rules.speed_unit_rpm is None:
        if speed != int(speed):
            raise RateError(f"S{speed:g}: S is the number of a step here")
        return int(speed)
    count = round(speed / rules.speed_unit_rpm)
    if count == 0 and speed > 0.0:
        raise RateError(f"S{speed:g} is nothing in steps of {rules.speed_unit_rpm:g} rpm")
    return count
