"""Segments by hand, one way after the other: for what reads segments, without a program."""

from dataclasses import dataclass, field
from math import atan2, hypot, nan, pi

import numpy as np

from gcode.segments import CCW, CW, FEED, Segments

Place = tuple[float, ...]


@dataclass
class Path:
    """Goes from place to place; `segments()` is what came together. `line` counts by itself."""

    axes: str = "XYZ"
    at: Place = ()
    feed: float = nan
    tool: int = -1
    frame: int = 0
    line: int = 0
    frames: list[tuple[float, ...]] = field(default_factory=list)
    rows: list[dict[str, object]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.at = self.at or (nan,) * len(self.axes)
        self.frames = self.frames or [(0.0,) * len(self.axes)]

    def to(self, *place: float, kind: int = FEED, line: int | None = None, **arc: object) -> "Path":
        """A way to `place`."""
        self.line = self.line + 1 if line is None else line
        row = {
            "line": self.line, "kind": kind, "start": self.at, "end": place, "feed": self.feed, "tool": self.tool,
            "frame": self.frame, "plane": 0, "centre": (nan, nan), "radius": nan, "end_radius": nan, "sweep": nan,
        }  # fmt: skip
        self.rows.append(row | arc)
        self.at = place
        return self

    def arc(self, place: Place, centre: tuple[float, float], *, clockwise: bool, plane: int = 17) -> "Path":
        """An arc in XY, ZX or YZ; `centre` from the start."""
        first, second = {17: (0, 1), 18: (2, 0), 19: (1, 2)}[plane]
        way = (place[first] - self.at[first], place[second] - self.at[second])
        sweep = atan2(way[1] - centre[1], way[0] - centre[0]) - atan2(-centre[1], -centre[0])
        sweep = sweep % (2 * pi) or 2 * pi
        return self.to(
            *place,
            kind=CW if clockwise else CCW,
            plane=plane,
            centre=centre,
            radius=hypot(*centre),
            end_radius=hypot(way[0] - centre[0], way[1] - centre[1]),
            sweep=sweep - 2 * pi if clockwise and sweep < 2 * pi else -sweep if clockwise else sweep,
        )

    def segments(self) -> Segments:
        """As columns."""
        count, axes = len(self.rows), len(self.axes)

        def column(name: str, kind: type) -> "np.ndarray":  # type: ignore[type-arg]
            return np.array([row[name] for row in self.rows], kind)

        def wide(name: str, height: int) -> "np.ndarray":  # type: ignore[type-arg]
            return np.array([row[name] for row in self.rows], float).reshape(count, height).T

        return Segments(
            axes=self.axes,
            line=column("line", np.int64),
            kind=column("kind", np.uint8),
            start=wide("start", axes),
            end=wide("end", axes),
            feed=column("feed", float),
            spindle=np.zeros(count),
            tool=column("tool", np.int32),
            dwell_s=np.zeros(count),
            sync=np.zeros(count, np.bool_),
            frame=column("frame", np.int32),
            frames=self.frames,
            plane=column("plane", np.uint8),
            centre=wide("centre", 2),
            radius=column("radius", float),
            end_radius=column("end_radius", float),
            sweep=column("sweep", float),
        )


def through(points: "np.ndarray", *, axes: str = "XYZ", feed: float = 1800.0) -> Segments:  # type: ignore[type-arg]
    """Straight cuts through (axes, n + 1) points, fast to make: n lines, each a segment."""
    count = points.shape[1] - 1
    nothing = np.full(count, nan)
    return Segments(
        axes=axes,
        line=np.arange(1, count + 1, dtype=np.int64),
        kind=np.full(count, FEED, np.uint8),
        start=points[:, :-1],
        end=points[:, 1:],
        feed=np.full(count, feed),
        spindle=np.zeros(count),
        tool=np.ones(count, np.int32),
        dwell_s=np.zeros(count),
        sync=np.zeros(count, np.bool_),
        frame=np.zeros(count, np.int32),
        frames=[(0.0,) * len(axes)],
        plane=np.zeros(count, np.uint8),
        centre=np.full((2, count), nan),
        radius=nothing,
        end_radius=nothing,
        sweep=nothing,
    )
