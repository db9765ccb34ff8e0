"""What kind of lathe is simulated: what its link is like, how it finds the end of a frame, its pace and its mechanics.

The one rule: every field has a default, and the defaults together are the machine of docs/ncframe.md.
"""

from dataclasses import dataclass
from typing import Final, Literal

CHECKS: Final = ("none", "xor", "crc8")
FRAMINGS: Final = ("length", "gap")


@dataclass(frozen=True, slots=True)
class SimSettings:
    """Times in seconds of the outer clock; `speed_factor` is for motion, dwell and auxiliary functions only."""

    check: Literal["none", "xor", "crc8"] = "crc8"
    counter: bool = True
    """ENQ is answered with the number of frames executed since power-on."""
    framing: Literal["length", "gap"] = "length"
    """A frame ends where its head says so, or it must also be all that came between two silences."""
    gap_s: float = 0.02
    """No byte for so long: what is left of a bad frame is dropped, and NAK is said."""
    rx_bytes: int = 64
    """What is kept of the bytes that come while a frame is executed; more are lost."""

    speed_factor: float = 1.0
    instant: bool = False
    """Frames take no time at all."""
    frame_s: float = 0.001
    """Between two frames: the microcontroller decodes and prepares."""
    boot_s: float = 0.5
    resolution_mm: float = 0.001
    """Of a count of X, Z and R."""
    feed_unit_mm_min: float = 1.0
    default_feed_mm_min: float = 100.0
    """As long as no F was sent, or F0."""
    rapid_mm_min: float = 3000.0
    auxiliary_s: float = 0.5
    """A spindle that starts or stops, a turret that turns: frames with M or T."""
    travel_x_mm: float = 0.0
    travel_z_mm: float = 0.0
    """Way from the place at power-on to the limit switches on both sides; 0: there are none."""
    start_count: int = 0
    """Counter at the first power-on, as if it had worked before."""

    executed_limit: int = 0
    """Keep at least the last so many executed frames in memory; 0: all."""

    def __post_init__(self) -> None:
        """Raises ValueError for a value no machine can have."""
        for name, allowed in (("check", CHECKS), ("framing", FRAMINGS)):
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, not {getattr(self, name)!r}")
        for name in (
            "gap_s",
            "speed_factor",
            "resolution_mm",
            "feed_unit_mm_min",
            "default_feed_mm_min",
            "rapid_mm_min",
        ):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be more than 0, not {getattr(self, name)}")
        for name in ("frame_s", "boot_s", "auxiliary_s", "travel_x_mm", "travel_z_mm", "executed_limit"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        if self.rx_bytes < 16:
            raise ValueError(f"rx_bytes must be at least 16, not {self.rx_bytes}: no frame fits")
        if not 0 <= self.start_count < 1 << 32:
            raise ValueError(f"start_count must be from 0 to 2**32 - 1, not {self.start_count}")
