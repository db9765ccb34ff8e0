"""Arcs as Grbl makes them: chords whose ends lie on the circle, as many as the arc tolerance asks for (spec gcode §5).

The one rule: the last chord ends exactly at the target, so a radius that is slightly off is made good there.
"""

import math
from typing import Final

from sim.grbl.simsettings import Point

_FULL_CIRCLE_RAD: Final = 5e-7
"""A sweep smaller than this is the whole circle."""


def chords(
    start: Point,
    target: Point,
    offset: tuple[float, float],
    axes: tuple[int, int, int],
    *,
    clockwise: bool,
    tolerance_mm: float,
) -> list[Point]:
    """The ends of the chords. `offset` is the centre from the start in the plane of the first two `axes`."""
    first, second, across = axes
    centre = start[first] + offset[0], start[second] + offset[1]
    radius = math.hypot(*offset)
    from_angle = math.atan2(-offset[1], -offset[0])
    to_angle = math.atan2(target[second] - centre[1], target[first] - centre[0])
    sweep = math.remainder(to_angle - from_angle, math.tau)
    if clockwise and sweep >= -_FULL_CIRCLE_RAD:
        sweep -= math.tau
    elif not clockwise and sweep <= _FULL_CIRCLE_RAD:
        sweep += math.tau
    inside = tolerance_mm * (2 * radius - tolerance_mm)
    count = math.floor(abs(0.5 * sweep * radius) / math.sqrt(inside)) if inside > 0 else 0
    ends: list[Point] = []
    for nth in range(1, count):
        angle = from_angle + sweep * nth / count
        place = [0.0, 0.0, 0.0]
        place[first] = centre[0] + radius * math.cos(angle)
        place[second] = centre[1] + radius * math.sin(angle)
        place[across] = start[across] + (target[across] - start[across]) * nth / count
        ends.append((place[0], place[1], place[2]))
    return [*ends, target]
