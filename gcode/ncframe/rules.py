"""What a machine behind NC frames is like: its step, its tools, what a byte of F and S means (ncframe §2, §3).

Not a configuration file: whoever has one makes these of it. The one rule: a number that could mean two things has a
default here that is written down in docs/ncframe.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any, Literal

from gcode.ncframe.items import BYTE
from gcode.offsets import SYSTEMS
from gcode.profile import Profile
from gcode.state import State

Compensation = Literal["contour", "offset"]
Semicolon = Literal["end", "remark"]

RESOLUTION_MM = (0.00001, 1000.0)
"""One count: finer than any drive, and coarser than any lathe."""

NO_TOOL_NAMED = 0
"""The tool before the first T."""

G54 = 1
"""The number of the first coordinate system."""


@dataclass(frozen=True, slots=True)
class FrameRules:
    """`resolution_mm` is one count of X, Z and R.

    `compensation`: what G41 and G42 do, `contour` guides the tool along the contour, `offset` adds its radius to X
    and Z. `tools`: radius in mm by T (or D) number, `tool_radius_mm` that of all others, None: not known.
    `feed_table_mm_min`: the feed of each F byte, from 0 up; without one F counts in `feed_unit_mm_min`.
    `speed_unit_rpm`: what S counts in; None: S is a step of the gearbox and goes out as it is written.
    `systems`: the zero of G54 (1) to G59 (6) from the host's zero, mm by lower-case axis.
    `semicolon`: whether `;` ends a block, with another one behind it, or begins a remark.
    """

    resolution_mm: float = 0.001
    compensation: Compensation = "contour"
    tool_radius_mm: float | None = None
    tools: Mapping[int, float] = field(default_factory=dict)
    diameter_programming: bool = False
    feed_unit_mm_min: float = 1.0
    feed_table_mm_min: tuple[float, ...] = ()
    speed_unit_rpm: float | None = None
    systems: Mapping[int, Mapping[str, float]] = field(default_factory=dict)
    semicolon: Semicolon = "end"
    block_delete: bool = False
    encoding: str = "utf-8"

    def __post_init__(self) -> None:
        """Raises ValueError for numbers that no machine has."""
        for name in ("feed_unit_mm_min", "speed_unit_rpm"):
            value = getattr(self, name)
            if value is not None and not (isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value}: it must be over 0")
        low, high = RESOLUTION_MM
        if not low <= self.resolution_mm <= high:
            raise ValueError(f"resolution_mm = {self.resolution_mm}: it must be from {low:g} to {high:g}")
        lengths = [("tool_radius_mm", self.tool_radius_mm), *((f"tools: {n}", mm) for n, mm in self.tools.items())]
        lengths += [(f"systems: {n}", mm) for n, zero in self.systems.items() for mm in zero.values()]
        for name, mm in lengths:
            if mm is not None and not isfinite(mm):
                raise ValueError(f"{name} = {mm}: it is no length")
        if any(not isfinite(feed) or feed < 0 for feed in self.feed_table_mm_min):
            raise ValueError("feed_table_mm_min: a feed is a number from 0 up")
        if len(self.feed_table_mm_min) > BYTE[1] + 1:
            raise ValueError(f"feed_table_mm_min has {len(self.feed_table_mm_min)} feeds, F has {BYTE[1] + 1} values")
        if unknown := set(self.systems) - set(SYSTEMS):
            raise ValueError(f"systems: there is no coordinate system {min(unknown)}")

    @property
    def fastest_feed_mm_min(self) -> float:
        """What the highest F says."""
        return max(self.feed_table_mm_min) if self.feed_table_mm_min else BYTE[1] * self.feed_unit_mm_min

    @property
    def highest_speed(self) -> float:
        """The highest S that a program may have."""
        return BYTE[1] * (1.0 if self.speed_unit_rpm is None else self.speed_unit_rpm)

    def radius_of(self, tool: int) -> float | None:
        """Of the tool with this number, mm; None where nobody has told it."""
        return self.tools.get(tool, self.tool_radius_mm)


def profile_for(profile: Profile, rules: FrameRules) -> Profile:
    """`profile` as the controller is with these rules: for the check, and for the translation itself.

    In "offset" the interpreter's own compensation is given tools of radius 0: it guides nothing then, and still
    refuses what may not stand between G41 and G40.
    """
    radii = {tool: rules.radius_of(tool) for tool in range(BYTE[1] + 1)}
    guided = 0.0 if rules.compensation == "offset" else 2.0
    initial: dict[str, Any] = dict(profile.initial)
    initial["tool"] = NO_TOOL_NAMED
    initial["diameter_mode"] = rules.diameter_programming
    initial["diameters"] = {tool: guided * radius for tool, radius in radii.items() if radius is not None}
    initial["systems"] = systems = _systems(profile, rules)
    initial["frame"] = tuple(systems.get(initial.get("system", G54), ()))
    ranges = {**profile.ranges, "F": (0.0, rules.fastest_feed_mm_min), "S": (0.0, rules.highest_speed)}
    return replace(profile, initial=initial, ranges=ranges)


def _systems(profile: Profile, rules: FrameRules) -> dict[int, list[float]]:
    """The offsets that have been told. G54 is the host's own zero where it is not among them."""
    if not rules.systems:
        return {}
    told = {G54: {}, **rules.systems}
    return {number: [float(zero.get(axis, 0.0)) for axis in profile.axes] for number, zero in told.items()}


def state_for(profile: Profile, position: Mapping[str, float] | None) -> State:
    """The state of a controller that has just been switched on; `position` in mm, lower-case axes, may lack some."""
    state = State.unknown("".join(profile.axes).upper())
    state = replace(state, **profile.initial).copy()
    place = position or {}
    state.position = [place.get(axis.lower(), value) for axis, value in zip(state.axes, state.position, strict=True)]
    return state
