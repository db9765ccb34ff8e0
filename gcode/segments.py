"""Motion as columns: what a program makes the axes do, one row a segment. Not the interpreter that makes them.

Positions are machine coordinates as far as they are known, so a change of offset moves nothing and every segment
begins where the one before ended. The one rule: a coordinate that is not certain is NaN, never guessed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

RAPID, FEED, CW, CCW, DWELL, HOMING, PROBE = range(7)
"""Kinds. HOMING: a way of the controller's own, its length unknown; PROBE: a feed move that may end anywhere."""

CUTS = (FEED, CW, CCW, PROBE)

LINEAR_AXES = "XYZUVW"
ROTARY_AXES = "ABC"

PLANE_AXES = {17: ("X", "Y", "Z"), 18: ("Z", "X", "Y"), 19: ("Y", "Z", "X")}
"""First and second axis of a plane, and the one that stands on it (rs274 §2, group 2)."""


@dataclass(slots=True)
class Segments:
    """Columns of n segments; `axes` names the rows of `start` and `end`, which have the shape (axes, n).

    `line`: of the file, from 1. `feed`: mm/min in force, NaN where none was ever set; in G93 what the block comes to.
    `spindle`: rpm, negative counter-clockwise, 0 off. `tool`: in the spindle, -1 unknown. `dwell_s`: of a DWELL.
    `sync`: the controller's queue runs dry before this segment (gcode §5). `frame`: row of `frames`, each the
    offset of every axis in mm: program coordinate = machine coordinate - offset.
    Arcs: `plane` 17, 18, 19; `centre` (2, n) from the start, in the plane's first and second axis, NaN where no arc
    of these words exists; `radius`, `end_radius` in mm, which differ where the arc does not close; `sweep` in rad,
    positive counter-clockwise, full turns included. For all else `plane` is 0 and these are NaN.
    """

    axes: str
    line: Ints
    kind: NDArray[np.uint8]
    start: Floats
    end: Floats
    feed: Floats
    spindle: Floats
    tool: NDArray[np.int32]
    dwell_s: Floats
    sync: Bools
    frame: NDArray[np.int32]
    frames: Sequence[Sequence[float]]
    plane: NDArray[np.uint8]
    centre: Floats
    radius: Floats
    end_radius: Floats
    sweep: Floats

    def __len__(self) -> int:
        return len(self.line)

    @property
    def is_arc(self) -> Bools:
        """Which segments are arcs, those that cannot be included."""
        arcs: Bools = (self.kind == CW) | (self.kind == CCW)
        return arcs

    @property
    def way(self) -> Floats:
        """End minus start, (axes, n) in mm or degrees; NaN where either is not known."""
        return self.end - self.start

    def row(self, axis: str) -> int | None:
        """The row of `axis` in `start` and `end`."""
        found = self.axes.find(axis)
        return None if found < 0 else found

    def lengths(self) -> Floats:
        """Length of each way in mm; of a turn without any linear axis, in degrees. Unknown axes count nothing."""
        way = np.nan_to_num(self.way)
        linear = [row for row, axis in enumerate(self.axes) if axis in LINEAR_AXES]
        rotary = [row for row, axis in enumerate(self.axes) if axis in ROTARY_AXES]
        length: Floats = np.sqrt(np.sum(way[linear] ** 2, axis=0))
        if rotary:
            length = np.where(length > 0.0, length, np.sqrt(np.sum(way[rotary] ** 2, axis=0)))
        arcs = np.flatnonzero(self.is_arc & ~np.isnan(self.radius))
        if len(arcs):
            flat = np.abs(self.sweep[arcs]) * self.radius[arcs]
            length[arcs] = np.hypot(flat, self.rise(arcs))
        return length

    def rise(self, arcs: Ints) -> Floats:
        """How far these arcs go along the axis that stands on their plane, mm; 0 where it is not known."""
        rise = np.zeros(len(arcs))
        for plane, (_, _, axis) in PLANE_AXES.items():
            row = self.row(axis)
            if row is not None:
                here = self.plane[arcs] == plane
                rise[here] = np.nan_to_num(self.end[row, arcs[here]] - self.start[row, arcs[here]])
        return rise

    def take(self, where: slice) -> "Segments":
        """Consecutive segments, as views."""
        columns: dict[str, Any] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            columns[field.name] = value[..., where] if isinstance(value, np.ndarray) else value
        return Segments(**columns)


def joined(parts: Sequence[Segments]) -> Segments:
    """Segments one after the other; the parts share `axes`, and the `frames` of each go on from those before it."""
    first, last = parts[0], parts[-1]
    if len(parts) == 1:
        return first
    columns: dict[str, Any] = {}
    for field in fields(first):
        value = getattr(first, field.name)
        if isinstance(value, np.ndarray):
            columns[field.name] = np.concatenate([getattr(part, field.name) for part in parts], axis=-1)
        else:
            columns[field.name] = getattr(last, field.name)
    return Segments(**columns)
