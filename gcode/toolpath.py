"""Segments to the binary drawing of docs/toolpath.md: a head, and levels of detail in blocks of packed columns.

Not the corners (vertices.py), not their thinning (detail.py). What comes out is to be kept in files by whoever asks,
for a long program is not held here. The one rule: what a reader needs to know is in docs/toolpath.md, to the byte;
a change of it is a new FORMAT_VERSION.
"""

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

from gcode.detail import TOLERANCES_MM, Thinning, coarser
from gcode.segments import Floats, Ints, Segments
from gcode.vertices import CHORD_TOLERANCE_MM, UNIT, VertexMaker, Vertices

FORMAT_VERSION = 1
MAGIC = b"MSTP"
BLOCK_VERTICES = 1024
"""Widths are chosen by the block: one long move makes a thousand neighbours wide, not all."""

GATHERED_VERTICES = 65_536
"""Are encoded at once. The first and the last of them are in every level."""

LEVEL_SHARE = 3
"""A level has at most one in so many vertices of the level before, else it is not worth its place."""

MAX_VERTICES = 100_000_000
"""Of the finest level: 0.7 to 1.2 GB, which no browser draws. A GET must not fill the disk."""

MAX_LEVEL = len(TOLERANCES_MM)

EXACT_FEEDS = 32_768
"""Different feeds that are kept as they are. When more come, those have three digits, so that a number of two bytes
reaches them all: with inverse time each line has a feed of its own."""

OUT_OF_RANGE, COARSE_ARCS, ROUNDED_FEEDS = 1, 2, 4
"""Bits of `flags` in the head."""

HEAD = struct.Struct("<4sHHIBBHIIIIddQII")
"""Magic, version, level, bytes of the head, axes, levels, flags, known axes, tools, feeds, frames, unit, chord
tolerance, segments, last line, 0."""

LEVEL = struct.Struct("<dIIQ")
"""Tolerance in mm, vertices, blocks, bytes."""

SPARSE = 5
"""Width of a column of differences that are nearly all 0, as Z in a pocket: the others with their places."""

_SPARSE_HEAD_BYTES, _SPARSE_BYTES = 6, 6
_BLOCK = struct.Struct("<II")
_LEVEL_AT = 6
_FEED_BOUNDS = (1e-9, 1e9)
_KNOWN_WIDTHS = ((-0x80, 0x7F), (-0x8000, 0x7FFF), (-0x80_0000, 0x7F_FFFF))


class ToolpathTooLongError(ValueError):
    """The program makes more than MAX_VERTICES."""


@dataclass(frozen=True, slots=True)
class Level:
    """`tolerance_mm`: how far its path may run from the finest one."""

    tolerance_mm: float
    vertices: int
    blocks: int
    bytes: int


class ToolpathEncoder:
    """Takes segments in order; gives out (rung, bytes) to be kept apart by rung, and in the end which rungs count."""

    def __init__(self, axes: str, *, chord_tolerance_mm: float = CHORD_TOLERANCE_MM) -> None:
        self._axes = axes
        self._chord_tolerance_mm = chord_tolerance_mm
        self._maker = VertexMaker(axes, chord_tolerance_mm=chord_tolerance_mm)
        self._waiting: list[Vertices] = []
        self._waiting_count = 0
        self._rungs = [_Rung(tolerance_mm) for tolerance_mm in (0.0, *TOLERANCES_MM)]
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
        for number, rung in enumerate(self._rungs):
            if number and rung.vertices * LEVEL_SHARE <= self._rungs[kept[-1]].vertices and rung.vertices:
                kept.append(number)
        return kept

    def head(self) -> bytes:
        """Stands before the levels; see `for_level`."""
        levels = [self._rungs[number].level() for number in self.rungs()]
        maker, axes = self._maker, len(self._axes)
        tables = b"".join(LEVEL.pack(level.tolerance_mm, level.vertices, level.blocks, level.bytes) for level in levels)
        box = np.array([maker.box.low, maker.box.high, maker.cuts.low, maker.cuts.high]) * UNIT
        tables += box.T.astype("<f8").tobytes()
        frames = np.array(self._frames, "<f8").reshape(-1, axes) if axes else np.empty((0, 0), "<f8")
        tables += frames.tobytes()
        tables += np.array(self._tools.values, "<i4").tobytes()
        tables += np.array(self._feeds.values, "<f4").tobytes()
        tables = _padded(tables + self._axes.encode("ascii"), 8)
        flags = OUT_OF_RANGE * maker.out_of_range | COARSE_ARCS * maker.coarse | ROUNDED_FEEDS * self._feeds.rounded
        fixed = HEAD.pack(
            MAGIC,
            FORMAT_VERSION,
            0,
            HEAD.size + len(tables),
            axes,
            len(levels),
            flags,
            maker.known,
            len(self._tools.values),
            len(self._feeds.values),
            len(frames),
            UNIT,
            self._chord_tolerance_mm,
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
        feeds = self._feeds.ids(gathered.feed)
        gathered.tool = self._tools.ids(gathered.tool.astype(np.float64))
        thinning = Thinning(gathered)
        done = [(0, self._rungs[0].add(gathered, feeds))]
        for number, rung in enumerate(self._rungs[1:], 1):
            chosen = thinning.thin(rung.tolerance_mm)
            done.append((number, rung.add(coarser(gathered, chosen), feeds[chosen])))
        return done


def joined(parts: Sequence[Vertices]) -> Vertices:
    """One after the other."""
    if len(parts) == 1:
        return parts[0]
    return Vertices(
        np.concatenate([part.position for part in parts], axis=1),
        np.concatenate([part.line for part in parts]),
        np.concatenate([part.kind for part in parts]),
        np.concatenate([part.feed for part in parts]),
        np.concatenate([part.tool for part in parts]),
        np.concatenate([part.frame for part in parts]),
        np.concatenate([part.unknown for part in parts]),
    )


def toolpath(parts: Iterable[Segments], axes: str, *, chord_tolerance_mm: float = CHORD_TOLERANCE_MM) -> bytes:
    """All at once, in memory: the head and every level. `for_level` and `levels_in` tell them apart."""
    encoder = ToolpathEncoder(axes, chord_tolerance_mm=chord_tolerance_mm)
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
    return [Level(*LEVEL.unpack_from(head, HEAD.size + number * LEVEL.size)) for number in range(count)]


def for_level(head: bytes, level: int) -> bytes:
    """The head of a file that holds this level alone."""
    return head[:_LEVEL_AT] + struct.pack("<H", level) + head[_LEVEL_AT + 2 :]


class _Table:
    """Different values in the order in which they came."""

    def __init__(self, *values: float) -> None:
        self.values: list[float] = list(values)
        self._known: dict[float, int] = {}

    def ids(self, column: Floats) -> Ints:
        """The place of each value in the table; looks at the runs of equal ones only."""
        starts = np.concatenate(([0], np.flatnonzero(column[1:] != column[:-1]) + 1))
        firsts: Floats
        firsts, inverse = np.unique(column[starts], return_inverse=True)
        return np.repeat(self._ids(firsts)[inverse], np.diff(starts, append=len(column)))

    def _ids(self, different: Floats) -> Ints:
        return np.array([self._id(value) for value in different.tolist()], np.int64)

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

    def ids(self, column: Floats) -> Ints:
        kept: Floats = np.minimum(np.maximum(column, -1.0), _FEED_BOUNDS[1])
        return super().ids(kept.astype(np.float32).astype(np.float64))

    def _ids(self, different: Floats) -> Ints:
        fresh = np.array([value not in self._known for value in different.tolist()], np.bool_)
        if len(self.values) + np.count_nonzero(fresh) > EXACT_FEEDS:
            self.rounded = True
            different = np.where(fresh, _three_digits(different), different)
        return super()._ids(different)


def _three_digits(values: Floats) -> Floats:
    size = np.maximum(values, _FEED_BOUNDS[0])
    unit = 10.0 ** (np.floor(np.log10(size)) - 2.0)
    return (np.rint(size / unit) * unit).astype(np.float32).astype(np.float64)


class _Rung:
    """A level as it is encoded, piece by piece."""

    def __init__(self, tolerance_mm: float) -> None:
        self.tolerance_mm = tolerance_mm
        self.vertices = self.blocks = self.bytes = 0
        self._last: tuple[NDArray[np.int32], int] | None = None

    def level(self) -> Level:
        return Level(self.tolerance_mm, self.vertices, self.blocks, self.bytes)

    def add(self, vertices: Vertices, feeds: Ints) -> bytes:
        """The blocks of these vertices. Feeds and tools are numbers in their tables already."""
        count = len(vertices)
        before, line = self._last or (vertices.position[:, 0], int(vertices.line[0]))
        self._last = (vertices.position[:, -1].copy(), int(vertices.line[-1]))
        bases = [np.concatenate(([base], row)) for base, row in zip(before, vertices.position, strict=True)]
        bases.append(np.concatenate(([line], vertices.line)).astype(np.int32))
        # Modulo 2^32, as the reader adds them up.
        columns = [_Column(np.diff(base), signed=True) for base in bases]
        described = (vertices.kind, feeds, vertices.tool, vertices.frame, vertices.unknown)
        columns += [_Column(values, signed=False) for values in described]
        starts = range(0, count, BLOCK_VERTICES)
        base_rows = np.array([base[:-1:BLOCK_VERTICES] for base in bases], "<i4").T
        pieces = []
        for number, start in enumerate(starts):
            end = min(start + BLOCK_VERTICES, count)
            widths = bytes(column.widths[number] for column in columns)
            packed = [column.packed(number, start, end) for column in columns]
            body = base_rows[number].tobytes() + _padded(widths, 4) + b"".join(packed)
            pieces.append(_BLOCK.pack(end - start, _BLOCK.size + len(body)) + body)
        data = b"".join(pieces)
        self.vertices += count
        self.blocks += len(starts)
        self.bytes += len(data)
        return data


class _Column:
    """Numbers of which each block takes as many bytes as it needs: 0 (all are the same), 1, 2, 3 or 4, or SPARSE."""

    def __init__(self, values: "NDArray[np.integer]", *, signed: bool) -> None:
        self._values = values
        self._signed = signed
        starts = np.arange(0, len(values), BLOCK_VERTICES)
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        if signed:
            wide = [(low < least) | (high > most) for least, most in _KNOWN_WIDTHS]
            widths = 1 + wide[0].astype(np.int64) + wide[1] + wide[2]
            rare = np.add.reduceat((values != 0).astype(np.int64), starts)
            sizes = np.diff(starts, append=len(values))
            widths = np.where(_SPARSE_HEAD_BYTES + _SPARSE_BYTES * rare < widths * sizes, SPARSE, widths)
        else:
            widths = np.where(high > 0xFFFF, 4, np.where(high > 0xFF, 2, 1))
        self.widths: list[int] = np.where(low == high, 0, widths).tolist()

    def packed(self, number: int, start: int, end: int) -> bytes:
        width = self.widths[number]
        if width == 0:
            return int(self._values[start]).to_bytes(4, "little", signed=self._signed)
        values = self._values[start:end]
        if width == SPARSE:
            places = np.flatnonzero(values)
            count = len(places).to_bytes(4, "little")
            return count + _padded(places.astype("<u2").tobytes(), 4) + values[places].astype("<i4").tobytes()
        if width == 3:
            low = (values & 0xFFFF).astype("<u2").tobytes()
            return _padded(low, 4) + _padded((values >> 16).astype(np.int8).tobytes(), 4)
        return _padded(values.astype(f"<{'i' if self._signed else 'u'}{width}").tobytes(), 4)


def _padded(data: bytes, unit: int) -> bytes:
    return data + bytes(-len(data) % unit)
