"""How a carriage moves in simulated time: straight legs and XY arcs, each with a trapezoid of speed.

It is not a planner: every leg starts and ends at rest, which no real controller is slower than.
The one rule: no clock and no state in here; a leg answers where the carriage is after so many seconds.
"""

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

AXES = "XYZABC"
"""The order of the axes in every point; ElVinto's AXISNUM counts them from 1."""

Point: TypeAlias = tuple[float, float, float, float, float, float]

ORIGIN: Point = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

OUTSIDE_MM = 1e-6
"""Rounding of sums of coordinates; less than this past a border is on the border."""

ARC_SAMPLES = 128
"""An arc is looked at in so many places for the border; a bulge between two of them is under 0.1 % of the radius."""


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Speed over time from rest to rest. Lengths in mm, speed in mm/s, acceleration in mm/s²."""

    length_mm: float
    speed_mm_s: float
    acceleration: float

    @property
    def peak_mm_s(self) -> float:
        return min(self.speed_mm_s, math.sqrt(self.length_mm * self.acceleration))

    @property
    def seconds(self) -> float:
        if self.length_mm <= 0.0:
            return 0.0
        peak = self.peak_mm_s
        return self.length_mm / peak + peak / self.acceleration

    def distance(self, elapsed_s: float) -> float:
        """Millimetres covered after `elapsed_s`; 0 before the start, the whole length after the end."""
        total_s = self.seconds
        if elapsed_s <= 0.0:
            return 0.0
        if elapsed_s >= total_s:
            return self.length_mm
        peak = self.peak_mm_s
        ramp_s = peak / self.acceleration
        if elapsed_s < ramp_s:
            return self.acceleration * elapsed_s**2 / 2
        if elapsed_s <= total_s - ramp_s:
            return peak * (elapsed_s - ramp_s / 2)
        return self.length_mm - self.acceleration * (total_s - elapsed_s) ** 2 / 2


@dataclass(slots=True)  # not frozen: that doubles the time of making one, and there is one a block
class Leg:
    """One straight line, or with a `centre` one arc or helix about it; `sweep_rad` > 0 is counter-clockwise."""

    start: Point
    end: Point
    speed_mm_s: float
    acceleration: float
    centre: tuple[float, float] | None = None
    sweep_rad: float = 0.0
    rebases: bool = False
    """From the start of this leg on, coordinates count from the limit switches (after homing)."""

    @property
    def length_mm(self) -> float:
        """Path length; of a leg that turns rotary axes only, degrees stand for millimetres."""
        dz = self.end[2] - self.start[2]
        if self.centre is not None:
            radius = math.hypot(self.start[0] - self.centre[0], self.start[1] - self.centre[1])
            return math.hypot(radius * abs(self.sweep_rad), dz)
        linear = math.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1], dz)
        if linear > 0.0:
            return linear
        return math.hypot(*(e - s for s, e in zip(self.start[3:], self.end[3:], strict=True)))

    @property
    def seconds(self) -> float:
        return Trapezoid(self.length_mm, self.speed_mm_s, self.acceleration).seconds

    def after(self, elapsed_s: float) -> Point:
        """The place after `elapsed_s` seconds of this leg."""
        length_mm = self.length_mm
        if length_mm <= 0.0:
            return self.end
        covered = Trapezoid(length_mm, self.speed_mm_s, self.acceleration).distance(elapsed_s)
        return self.at(covered / length_mm)

    def at(self, fraction: float) -> Point:
        """The place after that fraction (0 to 1) of the path."""
        if fraction >= 1.0:
            return self.end
        x, y, z, a, b, c = (s + (e - s) * fraction for s, e in zip(self.start, self.end, strict=True))
        if self.centre is not None:
            cx, cy = self.centre
            start_radius = math.hypot(self.start[0] - cx, self.start[1] - cy)
            end_radius = math.hypot(self.end[0] - cx, self.end[1] - cy)
            radius = start_radius + (end_radius - start_radius) * fraction
            angle = math.atan2(self.start[1] - cy, self.start[0] - cx) + self.sweep_rad * fraction
            x, y = cx + radius * math.cos(angle), cy + radius * math.sin(angle)
        return (x, y, z, a, b, c)

    def cut(self, fraction: float) -> "Leg":
        """The first part of this leg."""
        return replace(self, end=self.at(fraction), sweep_rad=self.sweep_rad * fraction)


@dataclass(frozen=True, slots=True)
class Exit:
    """Where a leg leaves the working field: axis index, at its upper (`beyond_end`) or lower border."""

    fraction: float
    axis: int
    beyond_end: bool


def first_exit(leg: Leg, low: Point, high: Point) -> Exit | None:
    """The first place of `leg` outside the box [low, high], or None."""
    if _stays_inside(leg, low, high):
        return None
    if leg.centre is None:
        exits = [found for axis in range(len(AXES)) if (found := _straight_exit(leg, axis, low, high))]
        return min(exits, key=lambda found: found.fraction) if exits else None
    inside = 0.0
    for sample in range(ARC_SAMPLES + 1):
        fraction = sample / ARC_SAMPLES
        if _outside(leg.at(fraction), low, high) is not None:
            return _bisect(leg, inside, fraction, low, high)
        inside = fraction
    return None


def _stays_inside(leg: Leg, low: Point, high: Point) -> bool:
    """True for certain; False is no answer yet. Of an arc the whole circle is looked at, not only its part."""
    start, end = leg.start, leg.end
    if _outside(start, low, high) is not None or _outside(end, low, high) is not None:
        return False
    if leg.centre is None:
        return True
    cx, cy = leg.centre
    radius = max(math.hypot(start[0] - cx, start[1] - cy), math.hypot(end[0] - cx, end[1] - cy))
    return low[0] <= cx - radius and cx + radius <= high[0] and low[1] <= cy - radius and cy + radius <= high[1]


def _straight_exit(leg: Leg, axis: int, low: Point, high: Point) -> Exit | None:
    start, end = leg.start[axis], leg.end[axis]
    for border, sign, beyond_end in ((low[axis], -1.0, False), (high[axis], 1.0, True)):
        if (start - border) * sign > OUTSIDE_MM:
            return Exit(0.0, axis, beyond_end)
        if (end - border) * sign > OUTSIDE_MM:
            return Exit((border - start) / (end - start), axis, beyond_end)
    return None


def _outside(point: Point, low: Point, high: Point) -> tuple[int, bool] | None:
    for axis, value in enumerate(point):
        if value < low[axis] - OUTSIDE_MM:
            return axis, False
        if value > high[axis] + OUTSIDE_MM:
            return axis, True
    return None


def _bisect(leg: Leg, inside: float, outside: float, low: Point, high: Point) -> Exit:
    for _ in range(40):
        middle = (inside + outside) / 2
        if _outside(leg.at(middle), low, high) is None:
            inside = middle
        else:
            outside = middle
    axis, beyond_end = _outside(leg.at(outside), low, high) or (0, False)
    return Exit(inside, axis, beyond_end)


def arc_by_centre(
    start: Point, end: Point, offset: tuple[float, float], *, clockwise: bool
) -> tuple[tuple[float, float], float]:
    """Centre and sweep of an arc given by I, J. A start that is the end means the full circle."""
    cx, cy = start[0] + offset[0], start[1] + offset[1]
    first = math.atan2(start[1] - cy, start[0] - cx)
    last = math.atan2(end[1] - cy, end[0] - cx)
    sweep = (last - first) % math.tau
    if sweep < 1e-9 or math.tau - sweep < 1e-9:
        sweep = math.tau
    if not clockwise:
        return (cx, cy), sweep
    return (cx, cy), sweep - math.tau if sweep < math.tau else -math.tau


def arc_by_radius(start: Point, end: Point, radius_mm: float, *, clockwise: bool) -> tuple[float, float] | None:
    """I, J of an arc given by R; a negative R is the longer way round. None when no such arc exists."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    chord = math.hypot(dx, dy)
    if chord == 0.0 or chord > 2 * abs(radius_mm) + 1e-3:
        return None
    height = math.sqrt(max(0.0, radius_mm**2 - chord**2 / 4))
    side = -1.0 if clockwise == (radius_mm > 0) else 1.0
    return dx / 2 - side * dy / chord * height, dy / 2 + side * dx / chord * height
