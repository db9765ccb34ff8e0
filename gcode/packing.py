"""A level of a drawing to blocks of packed columns: docs/toolpath.md, "Blocks".

Not the head, and not which levels there are (toolpath.py). The one rule: a block can be read by itself, and each of its
columns has the least width that holds it.
"""

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode.segments import Ints
from gcode.vertices import Vertices

BLOCK_VERTICES = 1024
"""Widths are chosen by the block: one long move makes a thousand neighbours wide, not all."""

SPARSE = 5
"""Width of a column of differences that are nearly all 0, as Z in a pocket: the others with their places."""

_SPARSE_HEAD_BYTES, _SPARSE_BYTES = 6, 6
_BLOCK = struct.Struct("<III")
_ARC_COLUMNS = 4
_KNOWN_WIDTHS = ((-0x80, 0x7F), (-0x8000, 0x7FFF), (-0x80_0000, 0x7F_FFFF))

Integers = NDArray[Any]


class PackedLevel:
    """A level as it is packed, piece by piece."""

    def __init__(self) -> None:
        self.vertices = self.arcs = self.blocks = self.bytes = 0
        self._last: tuple[NDArray[np.int32], int] | None = None

    def add(self, vertices: Vertices, feeds: Integers) -> bytes:
        """The blocks of these vertices. `feeds`, and the tools, are numbers in their tables."""
        count = len(vertices)
        starts = np.arange(0, count, BLOCK_VERTICES)
        before, line = self._last or (vertices.position[:, 0], int(vertices.line[0]))
        self._last = (vertices.position[:, -1].copy(), int(vertices.line[-1]))
        bases = [_behind(base, row) for base, row in zip(before, vertices.position, strict=True)]
        bases.append(_behind(line, vertices.line))
        # Modulo 2^32, as the reader adds them up.
        columns = [_Column(np.diff(base), starts, signed=True) for base in bases]
        described = (vertices.kind, feeds, vertices.tool, vertices.frame, vertices.unknown)
        columns += [_Column(values, starts, signed=False) for values in described]
        curves = _ArcColumns(vertices, starts)
        base_rows = np.array([base[:-1:BLOCK_VERTICES] for base in bases], "<i4").T
        pieces = []
        for number, start in enumerate(starts.tolist()):
            arcs, arc_widths, arc_columns = curves.packed(number)
            widths = bytes([column.widths[number] for column in columns])
            body = b"".join(
                [
                    base_rows[number].tobytes(),
                    padded(widths + arc_widths, 4),
                    *[column.packed(number) for column in columns],
                    *arc_columns,
                ]
            )
            pieces.append(_BLOCK.pack(min(count - start, BLOCK_VERTICES), _BLOCK.size + len(body), arcs) + body)
        data = b"".join(pieces)
        self.vertices += count
        self.arcs += len(vertices.arcs)
        self.blocks += len(starts)
        self.bytes += len(data)
        return data


class _ArcColumns:
    """The arcs of each block; many blocks have none."""

    def __init__(self, vertices: Vertices, starts: Ints) -> None:
        arcs = vertices.arcs
        edges = np.searchsorted(arcs.at, np.append(starts, len(vertices)))
        self._counts: list[int] = np.diff(edges).tolist()
        some = np.flatnonzero(np.diff(edges))
        self._place = dict(zip(some.tolist(), range(len(some)), strict=True))
        firsts = edges[some]
        self._columns = [_Column(row, firsts, signed=True) for row in arcs.centre] if len(some) else []
        if len(some):
            self._columns.append(_Column(arcs.sweep.view(np.uint32), firsts, signed=False))
            self._columns.append(_Column(arcs.plane, firsts, signed=False))

    def packed(self, number: int) -> tuple[int, bytes, list[bytes]]:
        """How many arcs the block has, the widths of their columns, and those."""
        place = self._place.get(number)
        if place is None:
            return 0, bytes(_ARC_COLUMNS), []
        widths = bytes([column.widths[place] for column in self._columns])
        return self._counts[number], widths, [column.packed(place) for column in self._columns]


class _Column:
    """Numbers of which each block takes as many bytes as it needs: 0 (all are the same), 1, 2, 3 or 4, or SPARSE.

    `starts`: where the blocks begin, ascending; none of them is empty.
    """

    def __init__(self, values: Integers, starts: Ints, *, signed: bool) -> None:
        self._values = values
        self._signed = signed
        self._starts: list[int] = [*starts.tolist(), len(values)]
        low, high = _by_block(np.minimum, values, starts), _by_block(np.maximum, values, starts)
        if signed:
            wide = [(low < least) | (high > most) for least, most in _KNOWN_WIDTHS]
            widths = 1 + wide[0].astype(np.int64) + wide[1] + wide[2]
            if np.any(low != high):
                sizes = np.diff(starts, append=len(values))
                rare = _by_block(np.add, values != 0, starts)
                widths = np.where(_SPARSE_HEAD_BYTES + _SPARSE_BYTES * rare < widths * sizes, SPARSE, widths)
        else:
            widths = np.where(high > 0xFFFF, 4, np.where(high > 0xFF, 2, 1))
        self.widths: list[int] = np.where(low == high, 0, widths).tolist()

    def packed(self, number: int) -> bytes:
        width = self.widths[number]
        start, end = self._starts[number], self._starts[number + 1]
        if width == 0:
            return int(self._values[start]).to_bytes(4, "little", signed=self._signed)
        values = self._values[start:end]
        if width == SPARSE:
            places = np.flatnonzero(values)
            count = len(places).to_bytes(4, "little")
            return count + padded(places.astype("<u2").tobytes(), 4) + values[places].astype("<i4").tobytes()
        if width == 3:
            low = (values & 0xFFFF).astype("<u2").tobytes()
            return padded(low, 4) + padded((values >> 16).astype(np.int8).tobytes(), 4)
        return padded(values.astype(_LAYOUTS[self._signed, width]).tobytes(), 4)


_LAYOUTS = {(True, width): f"<i{width}" for width in (1, 2, 4)} | {(False, width): f"<u{width}" for width in (1, 2, 4)}


def padded(data: bytes, unit: int) -> bytes:
    """With zeros up to a multiple of `unit`."""
    return data + bytes(-len(data) % unit)


def _behind(base: Any, row: NDArray[np.int32]) -> NDArray[np.int32]:
    found = np.empty(len(row) + 1, np.int32)
    found[0], found[1:] = base, row
    return found


def _by_block(fold: np.ufunc, values: Integers, starts: Ints) -> NDArray[Any]:
    """One number a block. Blocks of the full size are folded as the rows of a table, which is several times faster."""
    kind = np.int64 if fold is np.add else values.dtype
    rows = len(values) // BLOCK_VERTICES
    if len(starts) < 2 or starts[1] != BLOCK_VERTICES or starts[-1] != (len(starts) - 1) * BLOCK_VERTICES:
        return np.asarray(fold.reduceat(values, starts, dtype=kind))
    table = fold.reduce(values[: rows * BLOCK_VERTICES].reshape(rows, BLOCK_VERTICES), axis=1, dtype=kind)
    if rows == len(starts):
        return np.asarray(table)
    return np.append(table, fold.reduce(values[rows * BLOCK_VERTICES :], dtype=kind))
