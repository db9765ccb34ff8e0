"""How long a frame runs and where it leads, as far as the frames so far tell. Not a planner: no acceleration.

It follows what is modal in frames: G0 to G3 and F. The one rule: what is not known is None, never a guess.
"""

import math
from collections.abc import Mapping
from typing import Final

from protocol.commands import Position
from protocol.ncframe.codec import Frame
from protocol.ncframe.dialect import Dialect

_MOTIONS: Final = frozenset({0, 1, 2, 3})
DWELL: Final = 4
"""G4: what stands in X is a time (docs/ncframe.md), and nothing moves."""
DWELL_UNIT_S: Final = 0.001


class Pace:
    """Modal state of one epoch. At its beginning nothing is known: the machine may have kept its own."""

    def __init__(self, dialect: Dialect) -> None:
        self._dialect = dialect
        self._motion: int | None = None
        self._feed_mm_min: float | None = None

    def take(self, frame: Frame) -> float | None:
        """Follow the frame that goes out now; answers its run time in seconds, None where that is not known."""
        if frame.g in _MOTIONS:
            self._motion = frame.g
        if frame.f is not None:
            self._feed_mm_min = self._feed(frame.f)
        if frame.g == DWELL:
            return (frame.x or 0) * DWELL_UNIT_S
        if frame.g is not None and frame.g not in _MOTIONS:
            return None
        length_mm = self._length_mm(frame)
        if length_mm == 0.0:
            return 0.0
        speed_mm_min = self._dialect.rapid_mm_min if self._motion == 0 else self._feed_mm_min
        if self._motion is None or not speed_mm_min:
            return None
        return length_mm / speed_mm_min * 60.0

    def forget(self) -> None:
        """The machine has lost its modes."""
        self._motion = self._feed_mm_min = None

    def moved(self, frame: Frame, position: Position) -> dict[str, float]:
        """Where the machine stands after `frame`, mm, by the axes that were known before it."""
        if frame.g == DWELL:
            return dict(position)
        return {axis: round(at + self.steps(frame).get(axis, 0.0), 6) for axis, at in position.items()}

    def steps(self, frame: Frame) -> Mapping[str, float]:
        """The frame's increments in mm, as positions are told."""
        if frame.g == DWELL:
            return {}
        scale = self._dialect.resolution_mm
        return {"x": (frame.x or 0) * scale * (2 if self._dialect.diameter else 1), "z": (frame.z or 0) * scale}

    def _feed(self, f: int) -> float | None:
        table = self._dialect.feed_table
        if not table:
            return f * self._dialect.feed_unit_mm_min
        return table[f] if f < len(table) else None

    def _length_mm(self, frame: Frame) -> float:
        chord = math.hypot(frame.x or 0, frame.z or 0)
        if self._motion in (2, 3) and frame.r:
            radius = abs(frame.r)
            angle = 2 * math.asin(min(1.0, chord / (2 * radius)))
            chord = radius * (2 * math.pi - angle if frame.r < 0 else angle)
        return chord * self._dialect.resolution_mm
