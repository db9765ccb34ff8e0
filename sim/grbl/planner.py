"""The queue of motion: junction speeds and look-ahead by Grbl's rules (spec gcode §5), in millimetres and seconds.

Every new block changes the speeds at which those before it may end; the block that is being executed counts with what
is left of it. The one rule: the queue only plans, time passes in `stepper.py`.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from sim.grbl.events import Move
from sim.grbl.nonvolatile import Nonvolatile
from sim.grbl.simsettings import ORIGIN, Point

_STRAIGHT: Final = 0.999999
"""Cosine from which on two blocks count as one line, or as there and back."""
_UNLIMITED: Final = 1e38
_SLOWEST_MM_S: Final = 1.0 / 60


@dataclass(slots=True)
class PlanBlock:
    """One straight line. Speeds mm/s, squares of them in (mm/s)²; `done_mm` of `length_mm` are made."""

    move: Move
    start: Point
    end: Point
    length_mm: float
    unit: Point
    rapid: bool
    programmed_mm_s: float
    limit_mm_s: float
    acceleration: float
    junction_sqr: float
    overridable: bool
    line_number: int = 0
    done_mm: float = 0.0
    nominal_mm_s: float = 0.0
    max_entry_sqr: float = 0.0
    entry_sqr: float = 0.0

    @property
    def left_mm(self) -> float:
        return self.length_mm - self.done_mm

    def at(self, done_mm: float) -> Point:
        if done_mm >= self.length_mm:
            return self.end
        x, y, z = (s + u * done_mm for s, u in zip(self.start, self.unit, strict=True))
        return x, y, z


class Planner:
    """`blocks[0]` is the one that is being executed, or will be next."""

    def __init__(self, memory: Nonvolatile, capacity: int) -> None:
        self.blocks: deque[PlanBlock] = deque()
        self.capacity = capacity
        self.feed_override = 100
        self.rapid_override = 100
        self.position: Point = ORIGIN
        """Where the last block ends."""
        self._memory = memory
        self._last_unit: Point = ORIGIN
        self._last_nominal_sqr = 0.0

    @property
    def full(self) -> bool:
        return len(self.blocks) >= self.capacity

    @property
    def free(self) -> int:
        return self.capacity - len(self.blocks)

    def reset(self, position: Point) -> None:
        self.blocks.clear()
        self.position = position
        self._last_unit = ORIGIN
        self._last_nominal_sqr = 0.0

    def add(
        self,
        target: Point,
        move: Move,
        *,
        feed_mm_min: float,
        inverse_time: bool = False,
        overridable: bool = True,
        line_number: int = 0,
    ) -> PlanBlock | None:
        """A block from the end of the last one; None when it is shorter than a step. Call `plan` afterwards."""
        steps = self._memory.axes(100)
        delta = [(round(t * s) - round(p * s)) / s for t, p, s in zip(target, self.position, steps, strict=True)]
        length_mm = math.hypot(*delta)
        if length_mm == 0.0:
            return None
        unit: Point = (delta[0] / length_mm, delta[1] / length_mm, delta[2] / length_mm)
        limit = self._limit(110, unit) / 60
        rapid = move.kind == "rapid"
        programmed = limit if rapid else (feed_mm_min * (length_mm if inverse_time else 1.0)) / 60
        block = PlanBlock(
            move,
            start=self.position,
            end=target,
            length_mm=length_mm,
            unit=unit,
            rapid=rapid,
            programmed_mm_s=programmed,
            limit_mm_s=limit,
            acceleration=self._limit(120, unit),
            junction_sqr=0.0,
            overridable=overridable,
            line_number=line_number,
        )
        move.rate_mm_min = programmed * 60
        if self.blocks:
            block.junction_sqr = self._junction(unit)
        self._nominal(block)
        self._last_unit, self._last_nominal_sqr = unit, block.nominal_mm_s**2
        self.blocks.append(block)
        self.position = target
        return block

    def plan(self, speed_mm_s: float) -> None:
        """Look-ahead over the whole queue; the first block goes `speed_mm_s` where it is now."""
        blocks = self.blocks
        if not blocks:
            return
        last = blocks[-1]
        after = 0.0
        for block in reversed(blocks):
            after = min(block.max_entry_sqr, after + 2 * block.acceleration * block.left_mm)
            block.entry_sqr = after
        first = blocks[0]
        first.entry_sqr = speed_mm_s**2
        before: PlanBlock | None = None
        for block in blocks:
            if before is not None:
                reach = before.entry_sqr + 2 * before.acceleration * before.left_mm
                block.entry_sqr = min(block.entry_sqr, reach)
            before = block
        assert before is last

    def override(self, *, feed: int, rapid: int) -> bool:
        """New overrides, percent. True when they changed; then every speed is worked out anew."""
        if (feed, rapid) == (self.feed_override, self.rapid_override):
            return False
        self.feed_override, self.rapid_override = feed, rapid
        self._last_nominal_sqr = 0.0
        for block in self.blocks:
            self._nominal(block)
            self._last_nominal_sqr = block.nominal_mm_s**2
        return True

    def exit_mm_s(self) -> float:
        """The speed at which the first block is to end."""
        return math.sqrt(self.blocks[1].entry_sqr) if len(self.blocks) > 1 else 0.0

    def _nominal(self, block: PlanBlock) -> None:
        speed = block.programmed_mm_s
        if block.rapid:
            speed *= self.rapid_override / 100
        elif block.overridable:
            speed *= self.feed_override / 100
        block.nominal_mm_s = max(min(speed, block.limit_mm_s), _SLOWEST_MM_S)
        block.max_entry_sqr = min(block.junction_sqr, block.nominal_mm_s**2, self._last_nominal_sqr)

    def _limit(self, first: int, unit: Point) -> float:
        """The most along `unit` that no axis gets more than its setting."""
        limits = self._memory.axes(first)
        return min((limit / abs(u) for limit, u in zip(limits, unit, strict=True) if u), default=0.0)

    def _junction(self, unit: Point) -> float:
        """Speed² at a corner from the junction deviation: s/(1-s) with the sine of half the angle between the lines."""
        cosine = -sum(a * b for a, b in zip(self._last_unit, unit, strict=True))
        if cosine > _STRAIGHT:
            return 0.0
        if cosine < -_STRAIGHT:
            return _UNLIMITED
        change = [b - a for a, b in zip(self._last_unit, unit, strict=True)]
        size = math.hypot(*change)
        across: Point = (change[0] / size, change[1] / size, change[2] / size)
        half = math.sqrt(0.5 * (1 - cosine))
        return self._limit(120, across) * self._memory[11] * half / (1 - half)
