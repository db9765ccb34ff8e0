"""Programs for NC frames: translated, and what a machine would make of the frames by itself.

The machine here knows increments and R and nothing else, as the microcontroller of the source does: no modes of the
host, no offsets, no compensation.
"""

from cmath import exp
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import atan2, pi, sqrt
from typing import Any

from gcode.executor import Note
from gcode.ncframe.frame import Frame
from gcode.ncframe.items import Items
from gcode.ncframe.rules import FrameRules
from gcode.ncframe.source import blocks_of_lines
from gcode.ncframe.translate import Translator
from gcode.profile import load_profile
from gcode.words import parse_block

ORIGIN = {"x": 0.0, "z": 0.0}
LATHE = load_profile("ncframe-lathe")


@dataclass
class Translation:
    """Frames and errors of a program."""

    frames: list[Frame] = field(default_factory=list)
    errors: list[Note] = field(default_factory=list)

    @property
    def texts(self) -> list[str]:
        return [frame.items.text() for frame in self.frames]

    @property
    def lines(self) -> list[int]:
        return [frame.line for frame in self.frames]


def translation(program: str, position: Mapping[str, float] | None = ORIGIN, **rules: Any) -> Translation:
    """A program (`|` or a line feed between lines) from the origin, errors and all."""
    told = FrameRules(**rules)
    translator = Translator(LATHE, told, position)
    found = Translation(errors=translator.errors)
    lines = enumerate(program.replace("|", "\n").encode().split(b"\n"), 1)
    for number, raw in blocks_of_lines(lines, told.semicolon):
        found.frames += translator.step(number, parse_block(raw.decode()))
    found.frames += translator.finish()
    return found


def frames(program: str, position: Mapping[str, float] | None = ORIGIN, **rules: Any) -> list[str]:
    """The items of each frame of a program that has no errors."""
    found = translation(program, position, **rules)
    assert found.errors == []
    return found.texts


def errors(program: str, position: Mapping[str, float] | None = ORIGIN, **rules: Any) -> list[tuple[int, str]]:
    """Line and code of each error."""
    return [(note.line, note.code) for note in translation(program, position, **rules).errors]


@dataclass(frozen=True)
class Way:
    """One executed motion in counts, (Z, X) as complex numbers; `centre` of an arc, `sweep` positive for G3."""

    start: complex
    end: complex
    g: int
    centre: complex | None = None
    sweep: float = 0.0

    def at(self, share: float) -> complex:
        """The point so far along."""
        if self.centre is None:
            return self.start + (self.end - self.start) * share
        return self.centre + (self.start - self.centre) * exp(1j * self.sweep * share)


class Machine:
    """Executes frames from where it stands, in counts."""

    def __init__(self) -> None:
        self.z = self.x = 0
        self.g: int | None = None
        self.ways: list[Way] = []

    def run(self, items: Items) -> None:
        if items.g == 4:
            return
        self.g = self.g if items.g is None else items.g
        start = complex(self.z, self.x)
        self.x += items.x or 0
        self.z += items.z or 0
        end = complex(self.z, self.x)
        if end == start:
            return
        assert self.g is not None
        if self.g in (2, 3):
            assert items.r is not None
            self.ways.append(self._arc(start, end, items.r))
        else:
            assert items.r is None
            self.ways.append(Way(start, end, self.g))

    def _arc(self, start: complex, end: complex, r: int) -> Way:
        """By the school's book: of the two circles through both ends that one whose arc is short (R > 0) or long."""
        chord = end - start
        half = abs(chord) / 2
        assert half <= abs(r), "no machine makes an arc of that"
        height = sqrt(max(0.0, r * r - half * half))
        left = 1j * chord / abs(chord)
        middle = (start + end) / 2
        found = []
        for centre in (middle + left * height, middle - left * height):
            a, b = start - centre, end - centre
            turn = atan2(b.imag, b.real) - atan2(a.imag, a.real)
            sweep = turn % (2 * pi) if self.g == 3 else -((-turn) % (2 * pi))
            found.append((abs(sweep), centre, sweep))
        _, centre, sweep = min(found, key=lambda one: one[0]) if r > 0 else max(found, key=lambda one: one[0])
        assert self.g is not None
        return Way(start, end, self.g, centre, sweep)


def executed(found: Translation) -> Machine:
    """A machine that has executed all frames."""
    machine = Machine()
    for frame in found.frames:
        machine.run(frame.items)
    return machine
