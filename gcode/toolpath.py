"""Segments to the binary drawing of docs/toolpath.md: a head, and levels of detail in blocks of packed columns.

Not the corners (vertices.py), not their thinning (detail.py), not the packing of a level (blocks of them:
packing.py). What comes out is to be kept in files by whoever asks,
for a long program is not held here. The one rule: what a reader needs to know is in docs/toolpath.md, to the byte;
a change of it is a new FORMAT_VERSION.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode.detail import TOLERANCES_MM, Thinning
from gcode.packing import PackedLevel, padded
from gcode.segments import Floats, Segments
from gcode.vertices import UNIT, VertexMaker, Vertices, joined

FORMAT_VERSION = 2
MAGIC = b"MSTP"

GATHERED_VERTICES = 65_536
"""Are encoded at once. The first and the last of them are in every level."""

LEVEL_SHARE = 3
"""A level has at most one in so many vertices of the level before, else it is not worth its place."""

JUDGED_VERTICES, HOPELESS_SHARE = 131_072, 2
"""From so many vertices of the finest level on, a rung with more than one in so many of them is given up: packing it
would be for nothing."""

MAX_VERTICES = 100_000_000
"""Of the finest level: 0.7 to 1.2 GB, which no browser draws. A GET must not fill the disk."""

MAX_LEVEL = len(TOLERANCES_MM)

_TOLERANCES_MM = (0.0, *TOLERANCES_MM)

EXACT_FEEDS = 32_768
"""Different feeds that are kept as they are. When more come, those have three digits, so that a number of two bytes
reaches them all: with inverse time each line has a feed of its own."""

OUT_OF_RANGE, STRAIGHT_ARCS, ROUNDED_FEEDS = 1, 2, 4
"""Bits of `flags` in the head."""

HEAD = struct.Struct("<4sHHIBBHIIIIdQII")
"""Magic, version, level, bytes of the head, axes, levels, flags, known axes, tools, feeds, frames, unit, segments, last
line, 0."""

LEVEL = struct.Struct("<dQIIII")
"""Tolerance in mm, bytes, vertices, arcs, blocks, 0."""

_LEVEL_AT = 6
_FEED_BOUNDS = (1e-9, 1e9)


class ToolpathTooLongError(ValueError):
    """The program makes more than MAX_VERTICES."""


@dataclass(frozen=True, slots=True)
class Level:
    """`tolerance_mm`: how far its path may run from the finest one."""

    tolerance_mm: float
    bytes: int
    vertices: int
    arcs: int
    blocks: int


class ToolpathEncoder:
    """Takes segments in order; gives out (rung, bytes) to be kept apart by rung, and in the end which rungs count."""

    def __init__(self, axes: str) -> None:
        self._axes = axes
        self._maker = VertexMaker(axes)
        self._waiting: list[Vertices] = []
        self._waiting_count = 0
        self._rungs = [PackedLevel() for _ in _TOLERANCES_MM]
        self._wanted = list(range(1, len(_TOLERANCES_MM)))
        self._feeds = _Feeds()
        self._tools = _Table()
        self._frames: Sequence[Sequence[float]] = ()
        self._last_line = 0

    def add(self, segments: Segments) -> list[tuple[int, bytes]]:
        """The next segments. Raises ToolpathTooLongError."""
        done: list[tuple[int, bytes]] = []
        self._frames = segments.frames
        for vertices in self._maker.vertices(segments):
            self._waiting.append(vertices)
            self._waiting_count += len(vertices)
            if self._waiting_count >= GATHERED_VERTICES:
                done += self._encode()
        return done

    def finish(self) -> list[tuple[int, bytes]]:
        """There are no more segments."""
        return self._encode() if self._waiting_count else []

    def rungs(self) -> list[int]:
        """The rungs that are worth keeping, the finest first: those are the levels 0, 1, ..."""
        kept = [0]
        for number in self._wanted:
            vertices = self._rungs[number].vertices
            if vertices and vertices * LEVEL_SHARE <= self._rungs[kept[-1]].vertices:
                kept.append(number)
        return kept

    def head(self) -> bytes:
        """Stands before the levels; see `for_level`."""
        kept = self.rungs()
        maker, axes = self._maker, len(self._axes)
        tables = b"".join(
            LEVEL.pack(_TOLERANCES_MM[number], rung.bytes, rung.vertices, rung.arcs, rung.blocks, 0)
            for number, rung in ((number, self._rungs[number]) for number in kept)
        )
        box = np.array([maker.box.low, maker.box.high, maker.cuts.low, maker.cuts.high]) * UNIT
        tables += box.T.astype("<f8").tobytes()
        frames = np.array(self._frames, "<f8").reshape(-1, axes) if axes else np.empty((0, 0), "<f8")
        tables += frames.tobytes()
        tables += np.array(self._tools.values, "<i4").tobytes()
        tables += np.array(self._feeds.values, "<f4").tobytes()
        tables = padded(tables + self._axes.encode("ascii"), 8)
        flags = (
            OUT_OF_RANGE * maker.out_of_range | STRAIGHT_ARCS * maker.straightened | ROUNDED_FEEDS * self._feeds.rounded
        )
        fixed = HEAD.pack(
            MAGIC,
            FORMAT_VERSION,
            0,
            HEAD.size + len(tables),
            axes,
            len(kept),
            flags,
            maker.known,
            len(self._tools.values),
            len(self._feeds.values),
            len(frames),
            UNIT,
            maker.segments,
            self._last_line,
            0,
        )
        return fixed + tables

    def _encode(self) -> list[tuple[int, bytes]]:
        gathered, self._waiting, self._waiting_count = joined(self._waiting), [], 0
        self._last_line = max(self._last_line, int(gathered.line.max()))
        if self._rungs[0].vertices + len(gathered) > MAX_VERTICES:
            raise ToolpathTooLongError(f"line {gathered.line[0]}: more than {MAX_VERTICES:,} vertices up to here")
        self._give_up()
        feeds = self._feeds.ids(gathered.feed)
        gathered.tool = self._tools.ids(gathered.tool)
        thinning = Thinning(gathered)
        done = [(0, self._rungs[0].add(gathered, feeds))]
        for number in self._wanted:
            chosen = thinning.thin(_TOLERANCES_MM[number])
            done.append((number, self._rungs[number].add(thinning.left(), feeds[chosen])))
        return done

    def _give_up(self) -> None:
        """Rungs that after a good part of the program are far from worth keeping; the last may still become it."""
        finest = self._rungs[0].vertices
        if finest >= JUDGED_VERTICES:
            *some, last = self._wanted
            self._wanted = [number for number in some if self._rungs[number].vertices * HOPELESS_SHARE <= finest]
            self._wanted.append(last)


def toolpath(parts: Iterable[Segments], axes: str) -> bytes:
    """All at once, in memory: the head and every level. `for_level` and `levels_in` tell them apart."""
    encoder = ToolpathEncoder(axes)
    kept: list[list[bytes]] = [[] for _ in range(MAX_LEVEL + 1)]
    for segments in parts:
        for rung, data in encoder.add(segments):
            kept[rung].append(data)
    for rung, data in encoder.finish():
        kept[rung].append(data)
    return encoder.head() + b"".join(data for rung in encoder.rungs() for data in kept[rung])


def head_bytes(start: bytes) -> int:
    """Length of the head, from its first HEAD.size bytes. Raises ValueError for anything else."""
    fields = HEAD.unpack_from(start)
    if fields[:2] != (MAGIC, FORMAT_VERSION):
        raise ValueError("this is no toolpath of this version")
    return int(fields[3])


def levels_in(head: bytes) -> list[Level]:
    """The levels, the finest first, in the order in which they follow the head."""
    head_bytes(head)
    count = HEAD.unpack_from(head)[5]
    return [Level(*LEVEL.unpack_from(head, HEAD.size + number * LEVEL.size)[:-1]) for number in range(count)]


def for_level(head: bytes, level: int) -> bytes:
    """The head of a file that holds this level alone."""
    return head[:_LEVEL_AT] + struct.pack("<H", level) + head[_LEVEL_AT + 2 :]


class _Table:
    """Different values in the order in which they came."""

    def __init__(self, *values: float) -> None:
        self.values: list[float] = list(values)
        self._known: dict[float, int] = {}

    def ids(self, column: NDArray[Any]) -> NDArray[np.int32]:
        """The place of each value in the table; looks at the runs of equal ones only."""
        starts = np.concatenate(([0], np.flatnonzero(column[1:] != column[:-1]) + 1))
        firsts, inverse = np.unique(column[starts], return_inverse=True)
        found = self._ids(firsts)[inverse]
        return found if len(starts) == len(column) else np.repeat(found, np.diff(starts, append=len(column)))

    def _ids(self, different: NDArray[Any]) -> NDArray[np.int32]:
        return np.array([self._id(value) for value in different.tolist()], np.int32)

    def _id(self, value: float) -> int:
        number = self._known.setdefault(value, len(self.values))
        if number == len(self.values):
            self.values.append(value)
        return number


class _Feeds(_Table):
    """Feeds as the file has them; number 0 is none, which is -1 in a column."""

    def __init__(self) -> None:
        super().__init__(nan)
        self._known[-1.0] = 0
        self.rounded = False

    def ids(self, column: NDArray[Any]) -> NDArray[np.int32]:
        return super().ids(np.clip(column, np.float32(-1.0), np.float32(_FEED_BOUNDS[1])))

    def _ids(self, different: NDArray[Any]) -> NDArray[np.int32]:
        fresh = np.array([value not in self._known for value in different.tolist()], np.bool_)
        if len(self.values) + np.count_nonzero(fresh) > EXACT_FEEDS:
            self.rounded = True
            different = np.where(fresh, _three_digits(different.astype(np.float64)), different)
        return super()._ids(different)


def _three_digits(values: Floats) -> Floats:
    size = np.maximum(values, _FEED_BOUNDS[0])
    unit = 10.0 ** (np.floor(np.log10(size)) - 2.0)
    return (np.rint(size / unit) * unit).astype(np.float32).astype(np.float64)
