"""The first pass: what in a program can be jumped to, and what belongs together. Not the jumping.

Memory is bounded by the number of such places (Limits.max_labels), not by the size of the program. The one rule: what
is open at the end, closed twice or not within each other is an ExpandError before the first line comes out.
"""

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, Protocol

from gcode.expand.arithmetic import Dialect
from gcode.expand.errors import ExpandError, Limits
from gcode.expand.reading import Source, read_source
from gcode.expand.statements import (
    COMPUTED_FLOW,
    FLOW,
    NUMBERED,
    SEQUENCE,
    Flow,
    Loop,
    LoopEnd,
    ProgramNumber,
    parse_statements,
    plain_number,
)

Place = tuple[int, int]
"""Line number and which statement on it, from 0."""

MAIN = ""
"""The section before the first O-number."""


class Program(Protocol):
    """Lines of a program, in any order."""

    @property
    def count(self) -> int:
        """How many lines there are."""

    def line(self, number: int) -> bytes | None:
        """Line `number`, from 1, with or without its end; None behind the last one."""


@dataclass(slots=True)
class Link:
    """A block of O-words. `parts`: its lines from the opening one to the closing one (if, elseif, ..., endif)."""

    kind: str
    label: str
    parts: list[int]

    @property
    def start(self) -> int:
        """The line that opens it."""
        return self.parts[0]

    @property
    def end(self) -> int:
        """The line that closes it."""
        return self.parts[-1]


@dataclass(slots=True)
class MacroLoop:
    """`DO` to `END`, and the loop around it."""

    number: str
    start: Place
    end: Place
    outer: "MacroLoop | None"


@dataclass(slots=True)
class Structure:
    """What the first pass found. `links`: of each line with an O-word the block it belongs to."""

    dialect: Dialect
    links: dict[int, Link] = field(default_factory=dict)
    subs: dict[str, Link] = field(default_factory=dict)
    sections: dict[str, int] = field(default_factory=dict)
    section_lines: list[tuple[int, str]] = field(default_factory=list)
    numbers: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    loops: dict[Place, MacroLoop] = field(default_factory=dict)
    loop_starts: list[Place] = field(default_factory=list)

    def section_of(self, line: int) -> str:
        """The O-number of the program or subprogram that a line is in."""
        at = bisect_right(self.section_lines, line, key=lambda entry: entry[0])
        return self.section_lines[at - 1][1] if at else MAIN

    def loops_around(self, place: Place) -> Iterator[MacroLoop]:
        """The macro loops that a place is in, from the inside."""
        at = bisect_right(self.loop_starts, place)
        # Loops lie within each other: what is around this place is around the last loop that began before it, too.
        loop = self.loops[self.loop_starts[at - 1]] if at else None
        while loop is not None:
            if loop.start <= place <= loop.end:
                yield loop
            loop = loop.outer


_MAY_MATTER = re.compile(rb"[A-Za-z][ \t]*[A-Za-z]|[NnOo:#]|[Mm][ \t0+]*9[ \t]*[89]|[Gg][ \t0+]*6[ \t]*[56]")
CALLS = re.compile(r"M\+?0*9[89](?:\.0*)?(?![0-9.])|G\+?0*6[56](?:\.[0-9]*)?(?![0-9.])")
"""M98, M99, G65, G66, however written."""
_FANUC = re.compile(r"WHILE|DO[1-3]|END[1-3]|IF\[|GOTO")
_LOOP = re.compile(r"DO[0-9]|END[0-9]")
_JUMP = re.compile(r"GOTO|M\+?0*99\.?0*P|P.*M\+?0*99")


@dataclass(slots=True)
class _Survey:
    """What one look at every line gives, whatever the dialect turns out to be."""

    marks: list[int] = field(default_factory=list)
    numbers: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    section: str = MAIN
    linuxcnc: bool = False
    fanuc: bool = False
    jumps: bool = False
    numbers_kept: int = 0


def survey(program: Program, dialect: Dialect | Literal["auto"], limits: Limits, *, block_delete: bool) -> Structure:
    """Look at every line once, and at the marked ones again. With `block_delete` lines with `/` do not count.

    Raises ExpandError.
    """
    seen = _Survey()
    for number in range(1, program.count + 1):
        raw = program.line(number)
        if raw is not None and _MAY_MATTER.search(raw):
            _look(seen, number, raw, limits, block_delete=block_delete)
    chosen: Dialect = dialect if dialect != "auto" else ("fanuc" if seen.fanuc and not seen.linuxcnc else "linuxcnc")
    structure = Structure(chosen)
    if seen.jumps:
        # Without a jump to a number it does not matter how many lines have one.
        if seen.numbers_kept > limits.max_labels:
            raise ExpandError(1, 1, "too_many_labels", f"a GOTO among more than {limits.max_labels} line numbers")
        structure.numbers = seen.numbers
    builder = _Linuxcnc(structure) if chosen == "linuxcnc" else _Fanuc(structure)
    for number in seen.marks:
        builder.add(_marked(program, number, chosen))
    builder.finish()
    return structure


def _look(seen: _Survey, number: int, raw: bytes, limits: Limits, *, block_delete: bool) -> None:
    try:
        source = read_source(number, raw)
    except ExpandError:
        return  # a line that is never reached does no harm; where it is reached it is read again
    if source.deleted and block_delete:
        return
    chars = source.chars
    sequence = SEQUENCE.match(chars)
    at = sequence.end() if sequence else 0
    flow = FLOW.match(chars, at) or COMPUTED_FLOW.match(chars, at)
    seen.linuxcnc |= flow is not None or "#<" in chars
    seen.fanuc |= flow is None and (_FANUC.search(chars) or CALLS.search(chars)) is not None
    seen.jumps |= _JUMP.search(chars) is not None
    opened = None if flow else NUMBERED.match(chars, at)
    if opened:
        seen.section = plain_number(opened[1])
    if flow or opened or _LOOP.search(chars):
        seen.marks.append(number)
        if len(seen.marks) > limits.max_labels:
            raise ExpandError(
                number, 1, "too_many_labels", f"more than {limits.max_labels} lines with O-words or loops"
            )
    if sequence and seen.numbers_kept <= limits.max_labels:
        seen.numbers.setdefault((seen.section, plain_number(sequence[1])), []).append(number)
        seen.numbers_kept += 1


def _marked(program: Program, number: int, dialect: Dialect) -> tuple[Source, tuple[object, ...]]:
    source = read_source(number, program.line(number) or b"")
    try:
        return source, parse_statements(source, dialect)
    except ExpandError:
        return source, ()  # said when, and if, the line is reached


def _open_section(structure: Structure, source: Source, statement: ProgramNumber) -> None:
    if statement.number in structure.sections:
        raise source.error(statement.at, "label_twice", f"O{statement.number} begins a second time")
    structure.sections[statement.number] = source.line
    structure.section_lines.append((source.line, statement.number))


_CLOSES = {
    "ENDIF": ("IF",),
    "ELSE": ("IF",),
    "ELSEIF": ("IF",),
    "ENDWHILE": ("WHILE",),
    "ENDREPEAT": ("REPEAT",),
    "ENDSUB": ("SUB",),
}
# What break and continue work on; LinuxCNC itself refuses them in a repeat, FluidNC does not.
_LOOPS = frozenset({"WHILE", "DO", "REPEAT"})


class _Linuxcnc:
    """Blocks of O-words must lie within each other; LinuxCNC itself looks for labels only, which hides mistakes."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._open: list[tuple[Link, Source, Flow]] = []
        self._elses: set[int] = set()

    def add(self, marked: tuple[Source, tuple[object, ...]]) -> None:
        source, statements = marked
        for statement in statements:
            if isinstance(statement, ProgramNumber):
                _open_section(self._structure, source, statement)
            elif isinstance(statement, Flow):
                self._flow(source, statement)

    def finish(self) -> None:
        if self._open:
            link, source, flow = self._open[-1]
            closing = "while" if link.kind == "DO" else f"end{link.kind.lower()}"
            raise source.error(
                flow.at, "not_closed", f"o{link.label.lower()} {link.kind.lower()} has no {closing} with its label"
            )

    def _flow(self, source: Source, flow: Flow) -> None:
        keyword = flow.keyword
        if keyword == "WHILE" and self._is_open("DO", flow.label):
            self._close(source, flow, ("DO",))
        elif keyword in _CLOSES:
            self._close(source, flow, _CLOSES[keyword])
        elif keyword in ("BREAK", "CONTINUE"):
            self._link_to_loop(source, flow)
        elif keyword == "RETURN":
            self._link_to_sub(source, flow)
        elif keyword != "CALL":
            self._open_block(source, flow)

    def _is_open(self, kind: str, label: str) -> bool:
        return bool(self._open) and self._open[-1][0].kind == kind and self._open[-1][0].label == label

    def _open_block(self, source: Source, flow: Flow) -> None:
        if any(link.label == flow.label and link.kind != "SUB" for link, _, _ in self._open):
            raise source.error(flow.at, "label_twice", f"o{flow.label.lower()} is open already: use another label")
        link = Link(flow.keyword, flow.label, [source.line])
        if flow.keyword == "SUB":
            if self._open:
                raise source.error(flow.at, "not_nested", "a sub cannot begin within another block")
            if flow.label in self._structure.subs:
                raise source.error(flow.at, "label_twice", f"sub o{flow.label.lower()} is defined a second time")
            self._structure.subs[flow.label] = link
        self._structure.links[source.line] = link
        self._open.append((link, source, flow))

    def _close(self, source: Source, flow: Flow, kinds: tuple[str, ...]) -> None:
        link = self._open[-1][0] if self._open else None
        if link is None or link.kind not in kinds or link.label != flow.label:
            inside = f"; o{link.label.lower()} {link.kind.lower()} of line {link.start} is open" if link else ""
            raise source.error(
                flow.at, "not_nested", f"o{flow.label.lower()} {flow.keyword.lower()} closes nothing here{inside}"
            )
        if flow.keyword in ("ELSE", "ELSEIF"):
            if link.start in self._elses:
                raise source.error(flow.at, "not_nested", f"{flow.keyword.lower()} behind the else of the same if")
            if flow.keyword == "ELSE":
                self._elses.add(link.start)
        else:
            self._open.pop()
        link.parts.append(source.line)
        self._structure.links[source.line] = link

    def _link_to_loop(self, source: Source, flow: Flow) -> None:
        for link, _, _ in reversed(self._open):
            if link.kind in _LOOPS and link.label == flow.label:
                self._structure.links[source.line] = link
                return
        raise source.error(flow.at, "not_nested", f"{flow.keyword.lower()} outside a loop o{flow.label.lower()}")

    def _link_to_sub(self, source: Source, flow: Flow) -> None:
        if not self._open or self._open[0][0].kind != "SUB":
            raise source.error(flow.at, "not_nested", "return outside a sub")
        self._structure.links[source.line] = self._open[0][0]


class _Fanuc:
    """DO and END by their numbers, within one program."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        self._open: list[tuple[MacroLoop, Source, Loop]] = []

    def add(self, marked: tuple[Source, tuple[object, ...]]) -> None:
        source, statements = marked
        for index, statement in enumerate(statements):
            place = (source.line, index)
            if isinstance(statement, ProgramNumber):
                self.finish()
                _open_section(self._structure, source, statement)
            elif isinstance(statement, Loop):
                self._begin(source, statement, place)
            elif isinstance(statement, LoopEnd):
                self._end(source, statement, place)

    def finish(self) -> None:
        if self._open:
            loop, source, statement = self._open[-1]
            raise source.error(statement.at, "not_closed", f"DO{loop.number} has no END{loop.number}")

    def _begin(self, source: Source, statement: Loop, place: Place) -> None:
        if any(loop.number == statement.number for loop, _, _ in self._open):
            raise source.error(statement.at, "label_twice", f"DO{statement.number} is open already: use another number")
        loop = MacroLoop(statement.number, place, place, self._open[-1][0] if self._open else None)
        self._open.append((loop, source, statement))
        self._structure.loops[place] = loop
        self._structure.loop_starts.append(place)

    def _end(self, source: Source, statement: LoopEnd, place: Place) -> None:
        if not self._open or self._open[-1][0].number != statement.number:
            raise source.error(statement.at, "not_nested", f"END{statement.number} closes no DO{statement.number} here")
        loop = self._open.pop()[0]
        loop.end = place
        self._structure.loops[place] = loop
