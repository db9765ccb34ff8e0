"""`[machine.motion]` as a model: what the axes can do. For estimates of time and for the check before a run.

The one rule: an axis of which a figure is not known is not judged by it.
"""

from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator

from gcode.motion import (
    DEFAULT_ACCELERATION_MM_S2,
    DEFAULT_ARC_TOLERANCE_MM,
    DEFAULT_JUNCTION_DEVIATION_MM,
    DEFAULT_PLANNER_BLOCKS,
    DEFAULT_RATE_MM_MIN,
    Motion,
)
from server.config.section import Allowed, Section, as_tuple, refused

Travel = Annotated[
    tuple[float, float],
    BeforeValidator(as_tuple),
    Allowed("[lowest, highest] in mm (degrees), the lower first"),
]
Rate = Annotated[float, Field(gt=0, le=1_000_000)]

Steps = Annotated[float | None, Field(gt=0, le=1_000_000)]


class RateConfig(Section):
    """`max_rate` by axis, mm/min (degrees/min)."""

    x: Rate = DEFAULT_RATE_MM_MIN
    y: Rate = DEFAULT_RATE_MM_MIN
    z: Rate = DEFAULT_RATE_MM_MIN
    a: Rate = DEFAULT_RATE_MM_MIN
    b: Rate = DEFAULT_RATE_MM_MIN
    c: Rate = DEFAULT_RATE_MM_MIN


class AccelerationConfig(Section):
    """`acceleration` by axis, mm/s² (degrees/s²)."""

    x: Rate = DEFAULT_ACCELERATION_MM_S2
    y: Rate = DEFAULT_ACCELERATION_MM_S2
    z: Rate = DEFAULT_ACCELERATION_MM_S2
    a: Rate = DEFAULT_ACCELERATION_MM_S2
    b: Rate = DEFAULT_ACCELERATION_MM_S2
    c: Rate = DEFAULT_ACCELERATION_MM_S2


class TravelConfig(Section):
    """`travel` by axis, mm (degrees). The reach of an axis without it is not checked."""

    x: Travel | None = None
    y: Travel | None = None
    z: Travel | None = None
    a: Travel | None = None
    b: Travel | None = None
    c: Travel | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for axis, travel in self.known().items():
            if not travel[0] < travel[1]:
                raise refused(axis, list(travel), "[lowest, highest], the lower first")
        return self

    def known(self) -> dict[str, tuple[float, float]]:
        """The axes whose reach is known."""
        return {axis: travel for axis, travel in self if travel is not None}


class StepsConfig(Section):
    """`steps_per_mm` by axis, steps/mm (steps/degree). The ways of an axis without it are not rounded to steps."""

    x: Steps = None
    y: Steps = None
    z: Steps = None
    a: Steps = None
    b: Steps = None
    c: Steps = None

    def known(self) -> dict[str, float]:
        """The axes whose steps are known."""
        return {axis: steps for axis, steps in self if steps is not None}


class MotionConfig(Section):
    """`[machine.motion]`: what the axes can do; for estimates of time and for the check before a run."""

    max_rate: RateConfig = RateConfig()
    acceleration: AccelerationConfig = AccelerationConfig()
    travel: TravelConfig = TravelConfig()
    steps_per_mm: StepsConfig = StepsConfig()
    junction_deviation: Annotated[float, Field(ge=0, le=10)] = DEFAULT_JUNCTION_DEVIATION_MM
    arc_tolerance: Annotated[float, Field(ge=0.00001, le=10)] = DEFAULT_ARC_TOLERANCE_MM
    planner_blocks: Annotated[int, Field(ge=1, le=10_000)] = DEFAULT_PLANNER_BLOCKS
    laser: bool = False

    def motion(self) -> Motion:
        """The same for the core."""
        return Motion(
            max_rate=dict(self.max_rate),
            acceleration=dict(self.acceleration),
            travel=self.travel.known(),
            steps_per_mm=self.steps_per_mm.known(),
            junction_deviation_mm=self.junction_deviation,
            arc_tolerance_mm=self.arc_tolerance,
            planner_blocks=self.planner_blocks,
            laser=self.laser,
        )


class MotionFile(Section):
    """The file of `millstream check --motion`: the table `[motion]`, as `[machine.motion]`."""

    motion: MotionConfig
