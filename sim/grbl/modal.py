"""The parser's memory between lines: modal groups, F, S, T, the place it has planned to, offsets (grbl II.10).

A reset forgets all of it but the place. The one rule: lengths are millimetres and machine coordinates, whatever the
program's units are.
"""

from dataclasses import dataclass, field
from typing import Final

from sim.grbl.simsettings import ORIGIN, Point

PLANES: Final[dict[str, tuple[int, int, int]]] = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
"""First and second axis of the plane, and the one across."""


@dataclass(slots=True)
class Modal:
    """What `$G` shows, and what the next line builds upon."""

    motion: str = "G0"
    system: str = "G54"
    plane: str = "G17"
    units: str = "G21"
    distance: str = "G90"
    feed_mode: str = "G94"
    flow: str = ""
    """M0, M2 or M30 while it is being executed."""
    spindle: str = "M5"
    flood: bool = False
    mist: bool = False
    retract: str = "G98"
    length: str = "G49"
    tool: int = 0
    """The last T: on 1.1 nothing more than a number."""
    tool_in_spindle: int = 0
    feed: float = 0.0
    """mm/min; under G93 it is not remembered."""
    speed_rpm: float = 0.0
    position: Point = ORIGIN
    """Where the last planned motion ends."""
    system_offset: Point = ORIGIN
    g92: Point = ORIGIN
    tool_length: float = 0.0
    """Along Z."""
    line_number: int = 0
    cycle: dict[str, float] = field(default_factory=dict[str, float])
    """grblHAL: the words of a canned cycle that stay: R, Q, P and the depth."""

    @property
    def offset(self) -> Point:
        """WCO: machine minus work position."""
        x, y, z = (s + g for s, g in zip(self.system_offset, self.g92, strict=True))
        return x, y, z + self.tool_length

    def words(self, *, hal: bool, inches: bool, mist_built: bool) -> str:
        """The inside of `[GC:...]`."""
        coolant = [code for code, on in (("M7", self.mist and mist_built), ("M8", self.flood)) if on] or ["M9"]
        feed = f"{self.feed / 25.4:.1f}" if inches else f"{self.feed:.0f}"
        words = [self.motion, self.system, self.plane, self.units, self.distance, self.feed_mode]
        if hal:
            words += ["G40", self.length, self.retract, "G50"]
        if self.flow:
            words.append(self.flow)
        words += [self.spindle, *coolant, f"T{self.tool}", f"F{feed}", f"S{self.speed_rpm:.0f}{'.' * hal}"]
        return " ".join(words)
