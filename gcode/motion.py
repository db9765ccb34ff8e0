"""What the axes of a machine can do: numbers for estimates and for the check. Not a planner.

The one rule: lengths in mm (degrees for rotary axes), rates per minute, accelerations per second squared, by
lower-case axis name.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

Position = Mapping[str, float]
"""Coordinates in mm (degrees for rotary axes) by lower-case axis name; an axis that is not known is absent."""

DEFAULT_RATE_MM_MIN = 3000.0
"""For an axis without a figure; a usual hobby router."""

DEFAULT_ACCELERATION_MM_S2 = 200.0
"""For an axis without a figure; on the slow side, so that an estimate is rather too long."""

ASSUMED_FEED_MM_MIN = 600.0
"""For a feed move before any F: the controller has some feed of its own, nobody knows which."""

DEFAULT_JUNCTION_DEVIATION_MM = 0.01
"""How far a corner may be cut in thought, which bounds the speed through it; Grbl's own default ($11)."""

DEFAULT_ARC_TOLERANCE_MM = 0.002
"""How far the chords of an arc may stand off it; Grbl's own default ($12)."""

DEFAULT_PLANNER_BLOCKS = 16
"""Slots of the planner's ring, one of them always free; Grbl's BLOCK_BUFFER_SIZE on an Uno."""


@dataclass(frozen=True, slots=True)
class Motion:
    """`max_rate` mm/min, `acceleration` mm/s², `travel` (lowest, highest) mm; an axis may be absent from each.

    `steps_per_mm`: ways end on whole steps; an axis that is absent is not rounded. `planner_blocks`: slots of the
    planner's queue, of which all but one look ahead; 1 is a controller that stops after every block. `laser`: the
    power follows the program without a stop (Grbl's $32).
    """

    max_rate: Mapping[str, float] = field(default_factory=dict)
    acceleration: Mapping[str, float] = field(default_factory=dict)
    travel: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    junction_deviation_mm: float = DEFAULT_JUNCTION_DEVIATION_MM
    arc_tolerance_mm: float = DEFAULT_ARC_TOLERANCE_MM
    planner_blocks: int = DEFAULT_PLANNER_BLOCKS
    laser: bool = False
    steps_per_mm: Mapping[str, float] = field(default_factory=dict)

    def rate_mm_min(self, axis: str) -> float:
        """The fastest that `axis` moves."""
        return self.max_rate.get(axis, DEFAULT_RATE_MM_MIN)

    def acceleration_mm_s2(self, axis: str) -> float:
        """How fast `axis` gains speed."""
        return self.acceleration.get(axis, DEFAULT_ACCELERATION_MM_S2)
