"""Speeds over a row of planner blocks, and how long each takes: arithmetic on columns. Not what the blocks are.

v² in (mm/s)², energy = 2·a·L in the same unit: what a block can add to v² or take from it (gcode.md §5). Sums run only
over a few neighbours or by doubling, never from the beginning of the program, so that no digit is lost in a long one.
The one rule: a block that stands here gets the same figures wherever the row was cut.
"""

from math import inf

import numpy as np

from gcode.segments import Floats


def backward_limits(limit2: Floats, energy: Floats, ahead: int, weight: Floats | None = None) -> Floats:
    """v² at which each block may be entered so that it and the `ahead - 1` after it can still brake to a stop.

    `limit2`: v² at most at the beginning of each block. Only the first n - ahead + 1 of n blocks are right, for only
    those are followed by enough of them, and that many are returned. With `ahead` 0 every block is entered at rest.
    `weight`: how many alike blocks each stands for. What stands further off than `ahead` of those binds less than the
    stop behind them does, so only that is reckoned by weight.
    """
    if ahead <= 0:
        return np.zeros_like(limit2)
    held, spent, width = limit2, energy, 1
    best, sums, done = np.full(len(limit2), inf), np.zeros(len(limit2)), 0
    left = ahead
    while left:
        if left & 1:
            # The windows stand one behind the other: `done` blocks from here, then `width` more.
            count = len(limit2) - done - width + 1
            best = np.minimum(best[:count], sums[:count] + held[done : done + count])
            sums = sums[:count] + spent[done : done + count]
            done += width
        left >>= 1
        if left:
            held = np.minimum(held[:-width], spent[:-width] + held[width:])
            spent = spent[:-width] + spent[width:]
            width *= 2
    if weight is not None and (weight > 1.0).any():
        sums = np.minimum(sums, _reach(energy, weight, ahead)[: len(sums)])
    limits: Floats = np.minimum(best, sums)
    return limits


def _reach(energy: Floats, weight: Floats, ahead: int) -> Floats:
    """What `ahead` blocks from the beginning of each can take from v², those within a heavier one in proportion."""
    places = np.concatenate(([0.0], np.cumsum(weight)))
    spent = np.concatenate(([0.0], np.cumsum(energy)))
    reach: Floats = np.interp(places[:-1] + ahead, places, spent) - spent[:-1]
    return reach


def forward_speeds(allowed2: Floats, energy: Floats) -> Floats:
    """v² at which each block is entered: e[0] = allowed2[0], then e[j] = min(allowed2[j], e[j-1] + energy[j-1]).

    By doubling: after the pass of width w everything up to 2w blocks back has been heeded; it ends as soon as a pass
    changes nothing, that is when no acceleration is longer than the pass was wide.
    """
    speeds, sums, width = allowed2.copy(), energy[:-1], 1
    while width < len(speeds):
        reached = speeds[:-width] + sums
        if not (reached < speeds[width:]).any():
            break
        np.minimum(speeds[width:], reached, out=speeds[width:])
        sums = sums[width:] + sums[:-width]
        width *= 2
    return speeds


def durations(entry2: Floats, exit2: Floats, nominal: Floats, acceleration: Floats, length: Floats) -> Floats:
    """Seconds of each trapezoid (or triangle): up with `acceleration`, on with at most `nominal` mm/s, down."""
    peak = np.sqrt(np.minimum(nominal * nominal, (entry2 + exit2) / 2 + acceleration * length))
    speed_change = 2 * peak - np.sqrt(entry2) - np.sqrt(exit2)
    level = length - (peak * peak - (entry2 + exit2) / 2) / acceleration
    seconds: Floats = np.maximum(speed_change, 0.0) / acceleration + np.maximum(level, 0.0) / peak
    return seconds
