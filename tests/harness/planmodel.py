"""A controller's planner for tests: segments from plain rows, and the model of gcode.md §5 written block by block.

Written from the formulas, not from gcode/: two readings of the same text have to agree.
"""

from itertools import pairwise
from math import atan2, ceil, copysign, cos, floor, hypot, inf, isfinite, nan, pi, sin, sqrt
from typing import Any

import numpy as np

from gcode.motion import Motion
from gcode.segments import CCW, CW, DWELL, HOMING, PROBE, RAPID, Segments

ROUTER = Motion(
    max_rate={"x": 8000.0, "y": 8000.0, "z": 2000.0},
    acceleration={"x": 200.0, "y": 200.0, "z": 100.0},
    steps_per_mm={"x": 100.0, "y": 100.0, "z": 100.0},
    laser=True,
)
"""The machine whose firmware was measured: Grbl 1.1h, $11=0.010, $12=0.002, $32=1."""

ODD = Motion(ROUTER.max_rate, ROUTER.acceleration, laser=True, steps_per_mm={"x": 97.13, "y": 98.71, "z": 401.9})
"""Steps on which no point of an arc ends by chance half-way: the last bit would decide where it goes."""

SMOOTH = Motion(max_rate=ROUTER.max_rate, acceleration=ROUTER.acceleration)

Row = dict[str, Any]


def move(kind: int, end: tuple[float, ...], **more: Any) -> Row:
    """A row of a program: `end` in mm; `feed`, `sync`, `dwell_s`, `spindle`; `centre` (from the start) and `turns`."""
    return {"kind": kind, "end": end, **more}


def segments(rows: list[Row], start: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Segments:
    """Rows one after the other, each from where the one before ended."""
    ends = np.array([row["end"] for row in rows], float).reshape(len(rows), len(start)).T
    starts = np.concatenate((np.array(start, float)[:, None], ends[:, :-1]), axis=1)[:, : len(rows)]
    none = np.zeros(len(rows))
    arc = {name: np.full(len(rows), nan) for name in ("radius", "end_radius", "sweep")}
    centre = np.full((2, len(rows)), nan)
    plane = np.zeros(len(rows), np.uint8)
    for at, row in enumerate(rows):
        if "centre" not in row:
            continue
        first, second = {17: (0, 1), 18: (2, 0), 19: (1, 2)}[row.get("plane", 17)]
        plane[at], centre[:, at] = row.get("plane", 17), row["centre"]
        across, up = row["centre"]
        to_across, to_up = ends[first, at] - starts[first, at] - across, ends[second, at] - starts[second, at] - up
        turn = (atan2(to_up, to_across) - atan2(-up, -across)) % (2 * pi) or 2 * pi
        arc["radius"][at], arc["end_radius"][at] = hypot(across, up), hypot(to_across, to_up)
        arc["sweep"][at] = turn if row["kind"] == CCW else turn - 2 * pi or -2 * pi
    return Segments(
        axes="XYZABC"[: len(start)],
        line=np.arange(1, len(rows) + 1),
        kind=np.array([row["kind"] for row in rows], np.uint8),
        start=starts,
        end=ends,
        feed=np.array([row.get("feed", 1200.0) for row in rows], float),
        spindle=np.array([row.get("spindle", 0.0) for row in rows], float),
        tool=np.full(len(rows), -1, np.int32),
        dwell_s=np.array([row.get("dwell_s", 0.0) for row in rows], float),
        sync=np.array([row.get("sync", False) for row in rows], bool),
        frame=none.astype(np.int32),
        frames=[[0.0] * len(start)],
        plane=plane,
        centre=centre,
        radius=arc["radius"],
        end_radius=arc["end_radius"],
        sweep=arc["sweep"],
    )


class Block:
    """One block of the planner, by the formulas of gcode.md §5."""

    def __init__(self, row: int, way: list[float], motion: Motion, kind: int, feed: float, at_rest: bool) -> None:
        self.row, self.at_rest = row, at_rest
        self.length = sqrt(sum(part * part for part in way))
        self.unit = [part / self.length for part in way]
        self.a = self.along(self.unit, [motion.acceleration_mm_s2(axis) for axis in "xyzabc"])
        self.rapid = self.along(self.unit, [motion.rate_mm_min(axis) / 60 for axis in "xyzabc"])
        wanted = self.rapid if kind in (RAPID, HOMING) else min(feed / 60, self.rapid)
        self.speed = max(wanted, 1 / 60)
        steps = [abs(part) * motion.steps_per_mm.get(axis, 0.0) for part, axis in zip(way, "xyzabc", strict=False)]
        self.longest = max(steps) * 8 * 65535 / 16e6 if max(steps) > 0 else inf
        self.enter2 = 0.0

    @staticmethod
    def along(unit: list[float], most: list[float]) -> float:
        return min(limit / abs(part) for part, limit in zip(unit, most, strict=False) if part)

    def corner2(self, before: "Block", motion: Motion) -> float:
        if self.at_rest:
            return 0.0
        slower = min(self.speed, before.speed) ** 2
        cosine = sum(one * other for one, other in zip(self.unit, before.unit, strict=True))
        if cosine > 0.999999:
            return slower
        if cosine < -0.999999:
            return 0.0
        half_sine = sqrt((1 + cosine) / 2)
        turn = [one - other for one, other in zip(self.unit, before.unit, strict=True)]
        size = sqrt(sum(part * part for part in turn))
        a = self.along([part / size for part in turn], [motion.acceleration_mm_s2(axis) for axis in "xyzabc"])
        return min(slower, a * motion.junction_deviation_mm * half_sine / (1 - half_sine))


def lines_of(program: Segments, at: int, tolerance: float) -> list[list[float]]:
    """The ends of the straight lines that make segment `at`."""
    start, end = [list(column) for column in (program.start[:, at], program.end[:, at])]
    if program.kind[at] not in (CW, CCW) or not isfinite(program.radius[at]):
        return [end]
    radius, sweep = program.radius[at], program.sweep[at]
    under = tolerance * (2 * radius - tolerance)
    count = max(1, floor(abs(sweep * radius / 2) / sqrt(under))) if under > 0 else 1
    first, second = {17: (0, 1), 18: (2, 0), 19: (1, 2)}[int(program.plane[at])]
    across, up = program.centre[:, at]
    points = []
    for number in range(1, count):
        point = [from_ + (to - from_) * number / count for from_, to in zip(start, end, strict=True)]
        angle = sweep * number / count
        point[first] = start[first] + across - across * cos(angle) + up * sin(angle)
        point[second] = start[second] + up - across * sin(angle) - up * cos(angle)
        points.append(point)
    return [*points, end]


def on_step(value: float, steps_per_mm: float) -> float:
    steps = value * steps_per_mm
    return copysign(floor(abs(steps) + 0.5), steps) / steps_per_mm if steps_per_mm else value


def blocks_of(program: Segments, motion: Motion) -> list[Block]:
    blocks: list[Block] = []
    at_rest = True
    for at in range(len(program)):
        kind = int(program.kind[at])
        at_rest = at_rest or bool(program.sync[at]) or kind in (DWELL, HOMING, PROBE)
        here = list(program.start[:, at])
        for point in lines_of(program, at, motion.arc_tolerance_mm):
            axes = zip(point, here, "xyzabc", strict=False)
            steps = motion.steps_per_mm
            way = [on_step(to, steps.get(axis, 0)) - on_step(from_, steps.get(axis, 0)) for to, from_, axis in axes]
            way = [part if isfinite(part) else 0.0 for part in way]
            here = point
            if hypot(*way) > 1e-9:
                blocks.append(Block(at, way, motion, kind, program.feed[at], at_rest))
                at_rest = False
            elif motion.laser and program.spindle[at] > 0:
                at_rest = True
        at_rest = at_rest or kind in (DWELL, HOMING, PROBE)
    return blocks


def seconds_of(program: Segments, motion: Motion) -> list[float]:
    """Block by block as the ring of the controller has it: for each, the queue behind it planned down to a stop."""
    blocks = blocks_of(program, motion)
    limit2 = [0.0, *(block.corner2(before, motion) for before, block in pairwise(blocks))]
    seconds = [
        ceil(s / 0.05 - 1e-6) * 0.05 if k == DWELL else 0.0 for s, k in zip(program.dwell_s, program.kind, strict=True)
    ]
    enter2 = 0.0
    for at, block in enumerate(blocks):
        queue = range(at + 1, min(at + max(motion.planner_blocks - 1, 1), len(blocks)))
        leave2 = 0.0
        for later in reversed(queue):
            leave2 = min(limit2[later], leave2 + 2 * blocks[later].a * blocks[later].length)
        leave2 = min(leave2, enter2 + 2 * block.a * block.length)
        seconds[block.row] += min(trapezoid(block, enter2, leave2), block.longest)
        seconds[block.row] += 0.027 if at and block.at_rest else 0.0
        enter2 = leave2
    return seconds


def trapezoid(block: Block, enter2: float, leave2: float) -> float:
    top = min(block.speed, sqrt((enter2 + leave2) / 2 + block.a * block.length))
    up, down = (top * top - enter2) / (2 * block.a), (top * top - leave2) / (2 * block.a)
    level = max(block.length - up - down, 0.0) / top
    return (top - sqrt(enter2)) / block.a + (top - sqrt(leave2)) / block.a + level
