"""A second reading of docs/toolpath.md, number by number: what the encoder is tested against. Slow and plain.

The one rule: nothing of `gcode` is imported here; only the page counts.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import atan2, cos, hypot, sin
from typing import Any

START = 0x80
PLANES = {17: "XY", 18: "ZX", 19: "YZ"}


@dataclass(frozen=True)
class Arc:
    """Centre in mm from the vertex before, sweep in rad."""

    centre: tuple[float, float]
    sweep: float
    plane: int


@dataclass
class Drawing:
    """The head by name, and the columns of the level as lists; `places` in mm, one tuple a vertex."""

    head: dict[str, Any]
    places: list[tuple[float, ...]] = field(default_factory=list)
    line: list[int] = field(default_factory=list)
    kind: list[int] = field(default_factory=list)
    feed: list[float] = field(default_factory=list)
    tool: list[int] = field(default_factory=list)
    frame: list[int] = field(default_factory=list)
    unknown: list[int] = field(default_factory=list)
    arcs: dict[int, Arc] = field(default_factory=dict)
    """By the vertex to which each leads."""

    def along(self, vertex: int, parts: int) -> Iterator[tuple[float, ...]]:
        """Places on the edge that leads to a vertex, the last at its end."""
        begin, end = self.places[vertex - 1], self.places[vertex]
        arc = self.arcs.get(vertex)
        for part in range(1, parts):
            share = part / parts
            place = [a + (b - a) * share for a, b in zip(begin, end, strict=True)]
            if arc is not None:
                first, second = (self.head["axes"].index(letter) for letter in PLANES[arc.plane])
                x, y = begin[first] + arc.centre[0], begin[second] + arc.centre[1]
                radius, last = hypot(*arc.centre), hypot(end[first] - x, end[second] - y)
                radius += (last - radius) * share
                angle = atan2(-arc.centre[1], -arc.centre[0]) + arc.sweep * share
                place[first], place[second] = x + radius * cos(angle), y + radius * sin(angle)
            yield tuple(place)
        yield end

    def edges(self) -> list[int]:
        """The vertices to which an edge leads that may be drawn."""
        axes, known = self.head["axes"], self.head["known_axes"]
        harmless = sum(1 << row for row, axis in enumerate(axes) if axis in "ZABC" or not known >> row & 1)
        return [
            at
            for at in range(1, len(self.line))
            if not self.kind[at] & START
            and self.unknown[at] == self.unknown[at - 1]
            and not self.unknown[at] & ~harmless
        ]


class Cursor:
    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, layout: str) -> tuple[Any, ...]:
        values = struct.unpack_from("<" + layout, self.data, self.at)
        self.at += struct.calcsize("<" + layout)
        return values

    def align(self, unit: int) -> None:
        while self.at % unit:
            assert self.data[self.at] == 0
            self.at += 1


def read_head(cursor: Cursor) -> dict[str, Any]:
    magic, version, level, length, axes, levels, flags = cursor.take("4sHHIBBH")
    assert (magic, version) == (b"MSTP", 2)
    known, tools, feeds, frames = cursor.take("4I")
    unit, segments, last_line, zero = cursor.take("dQII")
    assert zero == 0
    head: dict[str, Any] = {
        "level": level, "flags": flags, "known_axes": known, "unit": unit, "segments": segments, "last_line": last_line,
    }  # fmt: skip
    head["levels"] = [read_level(cursor) for _ in range(levels)]
    head["bounds"] = [cursor.take("4d") for _ in range(axes)]
    head["frames"] = [cursor.take(f"{axes}d") for _ in range(frames)]
    head["tools"] = cursor.take(f"{tools}i")
    head["feeds"] = cursor.take(f"{feeds}f")
    head["axes"] = cursor.take(f"{axes}s")[0].decode("ascii")
    cursor.align(8)
    assert cursor.at == length
    return head


def read_level(cursor: Cursor) -> dict[str, Any]:
    tolerance, size, vertices, arcs, blocks, zero = cursor.take("dQIIII")
    assert zero == 0
    return {"tolerance": tolerance, "bytes": size, "vertices": vertices, "arcs": arcs, "blocks": blocks}


def read_column(cursor: Cursor, width: int, count: int, *, signed: bool) -> list[int]:
    if width == 0:
        return list(cursor.take("i" if signed else "I")) * count
    if width == 3:
        assert signed
        low = cursor.take(f"{count}H")
        cursor.align(4)
        high = cursor.take(f"{count}b")
        cursor.align(4)
        return [a + 65536 * b for a, b in zip(low, high, strict=True)]
    if width == 5:
        assert signed
        (rare,) = cursor.take("I")
        places = cursor.take(f"{rare}H")
        cursor.align(4)
        assert sorted(set(places)) == list(places)
        found = dict(zip(places, cursor.take(f"{rare}i"), strict=True))
        return [found.get(at, 0) for at in range(count)]
    letter = {1: "b", 2: "h", 4: "i"}[width]
    values = list(cursor.take(f"{count}{letter if signed else letter.upper()}"))
    cursor.align(4)
    return values


def read_arcs(cursor: Cursor, widths: tuple[int, ...], count: int, unit: float) -> list[Arc]:
    first, second, sweeps, planes = (
        read_column(cursor, width, count, signed=number < 2) for number, width in enumerate(widths)
    )
    turned = [struct.unpack("<f", struct.pack("<I", bits))[0] for bits in sweeps]
    return [Arc((a * unit, b * unit), c, d) for a, b, c, d in zip(first, second, turned, planes, strict=True)]


def summed(base: int, differences: list[int]) -> list[int]:
    sums = []
    for difference in differences:
        base = (base + difference + 2**31) % 2**32 - 2**31
        sums.append(base)
    return sums


def read_toolpath(data: bytes) -> Drawing:
    """A file as the route gives it."""
    cursor = Cursor(data)
    drawing = Drawing(read_head(cursor))
    head = drawing.head
    axes = len(head["axes"])
    level = head["levels"][head["level"]]
    assert len(data) - cursor.at == level["bytes"]
    for _ in range(level["blocks"]):
        begin, first = cursor.at, len(drawing.line)
        count, length, arc_count = cursor.take("III")
        assert 0 < count <= 1024
        bases = cursor.take(f"{axes}i")
        (line,) = cursor.take("i")
        widths = cursor.take(f"{axes + 10}B")
        cursor.align(4)
        rows = []
        for base, width in zip((*bases, line), widths[: axes + 1], strict=True):
            rows.append(summed(base, read_column(cursor, width, count, signed=True)))
        kind, feed, tool, frame, unknown = (
            read_column(cursor, width, count, signed=False) for width in widths[axes + 1 : axes + 6]
        )
        curved = [first + at for at, number in enumerate(kind) if number in (2, 3)]
        assert len(curved) == arc_count
        if arc_count:
            drawing.arcs |= zip(curved, read_arcs(cursor, widths[-4:], arc_count, head["unit"]), strict=True)
        else:
            assert not any(widths[-4:])
        assert cursor.at - begin == length
        drawing.places += zip(*([value * head["unit"] for value in row] for row in rows[:axes]), strict=True)
        drawing.line += rows[axes]
        drawing.kind += kind
        drawing.feed += [head["feeds"][number] for number in feed]
        drawing.tool += [head["tools"][number] for number in tool]
        drawing.frame += frame
        drawing.unknown += unknown
    assert cursor.at == len(data)
    assert (len(drawing.line), len(drawing.arcs)) == (level["vertices"], level["arcs"])
    return drawing
