"""The carriage and the modes of the lathe: how long a block takes and where it leads. Whole counts, no clock.

The one rule: positions are sums of increments in whole numbers; times may be fractions.
"""

import math
from dataclasses import dataclass

from sim.ncframe.codec import Block
from sim.ncframe.settings import SimSettings

DWELL = 4
DWELL_UNIT_S = 0.001
"""G4 X1500: a second and a half."""


class Impossible(Exception):  # noqa: N818 - what the block is, not an error of ours
    """No arc of this radius joins the two places."""


@dataclass(slots=True)
class Carriage:
    """`x`, `z` in counts from the place at power-on."""

    settings: SimSettings
    x: int = 0
    z: int = 0
    motion: int = 0
    feed_mm_min: float = 0.0

    def take(self, block: Block) -> tuple[int, int, float]:
        """Modes change now; answers where the block leads and the seconds that it takes. Raises Impossible."""
        g, f = block.get("G"), block.get("F")
        if g is not None and g <= 3:
            self.motion = g
        if f is not None:
            self.feed_mm_min = f * self.settings.feed_unit_mm_min
        dx, dz = block.get("X") or 0, block.get("Z") or 0
        seconds = self.settings.auxiliary_s if block.get("M") is not None or block.get("T") is not None else 0.0
        if g == DWELL:
            return self.x, self.z, seconds + abs(dx) * DWELL_UNIT_S
        speed = self.settings.rapid_mm_min if self.motion == 0 else self.feed_mm_min
        way_mm = self._way(dx, dz, block.get("R")) * self.settings.resolution_mm
        seconds += way_mm / (speed or self.settings.default_feed_mm_min) * 60.0
        return self.x + dx, self.z + dz, seconds

    def within(self, x: int, z: int) -> bool:
        """No limit switch is hit there."""
        ends = ((x, self.settings.travel_x_mm), (z, self.settings.travel_z_mm))
        return all(not most or abs(at) * self.settings.resolution_mm <= most for at, most in ends)

    def _way(self, dx: int, dz: int, r: int | None) -> float:
        """Counts along the path; an arc of more than half a circle has a negative radius."""
        chord = math.hypot(dx, dz)
        if self.motion not in (2, 3) or not chord:
            return chord
        if not r or chord > 2 * abs(r) + 2:  # the end and the radius are rounded to counts
            raise Impossible
        half = math.asin(min(1.0, chord / (2 * abs(r))))
        return abs(r) * 2 * (math.pi - half if r < 0 else half)
