"""The tool table: LinuxCNC's format read and written, and where a tool is kept.

Not a file: text in, a frozen `ToolTable` out, and back; who stores it rewrites the file in one piece.
The one rule: any text can be read. A line that is not understood is left out and told as a warning, for the pocket of
a tool guessed wrongly is a crash of the arm.
"""

import re
from dataclasses import dataclass, field, fields, replace
from typing import Final

NUMBER_MAX: Final = 99_999
"""Of tools and pockets, as LinuxCNC's editor takes them."""
TOOLS_MAX: Final = 1_000
"""LinuxCNC has 1,001 places, one of them the spindle; further tools are left out."""
WARNINGS_MAX: Final = 100
"""Told one by one; the rest is counted."""
VALUE_MAX: Final = 1e6
"""Millimetres, inches or degrees: far beyond every tool, and far from where numbers lose their thousandths."""
WORD_MAX: Final = 40
"""Characters of a number; the longest that is ever written has 25."""
COMMENT_MAX: Final = 200
"""Characters of a comment that are kept."""
ORIENTATION_MAX: Final = 9
"""Positions of a lathe tool's tip."""

_WHOLE = re.compile(r"\+?[0-9]{1,10}")
_REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")


@dataclass(frozen=True, slots=True)
class Tool:
    """A line of the table. Lengths in the machine's units, angles in degrees; `orientation` 0 is not given."""

    number: int
    pocket: int
    diameter: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0
    u: float = 0.0
    v: float = 0.0
    w: float = 0.0
    front_angle: float = 0.0
    back_angle: float = 0.0
    orientation: int = 0
    comment: str = ""


LETTERS: Final[dict[str, str]] = {
    "T": "number",
    "P": "pocket",
    "D": "diameter",
    **{axis.upper(): axis for axis in "xyzabcuvw"},
    "I": "front_angle",
    "J": "back_angle",
    "Q": "orientation",
}
_FIELDS = {entry.name for entry in fields(Tool)}
assert set(LETTERS.values()) | {"comment"} == _FIELDS
_WHOLE_MAX: Final = {"T": NUMBER_MAX, "P": NUMBER_MAX, "Q": ORIENTATION_MAX}


@dataclass(frozen=True, slots=True)
class Place:
    """What the prep pins say of a tool: `index` is the order in the file, in a random changer the pocket."""

    number: int
    pocket: int
    index: int


@dataclass(frozen=True, slots=True)
class TableWarning:
    """What was left out, and why. `line` counts from 1."""

    line: int
    message: str


@dataclass(frozen=True, slots=True)
class ToolTable:
    """`random`: a tool goes back to the pocket from which the next one came, and pocket 0 is the spindle.

    Otherwise every tool has its own pocket. `remarks`: the lines that are only comments.
    """

    tools: tuple[Tool, ...] = ()
    random: bool = False
    remarks: tuple[str, ...] = field(default=())

    def find(self, number: int) -> Tool | None:
        return next((tool for tool in self.tools if tool.number == number), None)

    @property
    def numbers(self) -> frozenset[int]:
        """Those that T finds."""
        return frozenset({tool.number for tool in self.tools} | (set() if self.random else {0}))

    def place(self, number: int) -> Place | None:
        """Where T finds this tool; None: it is not in the table. T0 is the empty spindle (seed §3, sheet §2)."""
        if self.random:
            tool = self.find(number)
            return None if tool is None else Place(number, tool.pocket, tool.pocket)
        if number == 0:
            return Place(0, 0, 0)
        for index, tool in enumerate(self.tools, start=1):  # index 0 is the spindle
            if tool.number == number:
                return Place(number, tool.pocket, index)
        return None

    @property
    def in_spindle(self) -> int:
        """The tool in pocket 0 of a random changer; 0: none."""
        return next((tool.number for tool in self.tools if tool.pocket == 0), 0) if self.random else 0

    def exchanged(self, number: int) -> "ToolTable":
        """The table after this tool went into the spindle: it and the one before have changed pockets."""
        taken = self.find(number)
        if not self.random or taken is None or taken.pocket == 0:
            return self
        moved = {0: taken.pocket, taken.pocket: 0}
        return replace(
            self, tools=tuple(replace(tool, pocket=moved.get(tool.pocket, tool.pocket)) for tool in self.tools)
        )


def parse(text: str, *, random: bool = False) -> tuple[ToolTable, tuple[TableWarning, ...]]:
    """A table and what was left out of it. Any text; never raises."""
    tools: dict[int, Tool] = {}
    pockets: set[int] = set()
    remarks: list[str] = []
    warnings: list[TableWarning] = []
    for number, line in enumerate(text.split("\n"), start=1):
        words, semicolon, comment = line.partition(";")
        if not words.strip():
            if semicolon and len(remarks) < TOOLS_MAX:
                remarks.append(_printable(comment))
            continue
        read = _tool(words, _printable(comment))
        if isinstance(read, Tool):
            read = _fits(read, tools, pockets, random=random) or read
        if isinstance(read, str):
            warnings.append(TableWarning(number, read))
            continue
        tools[read.number] = read
        pockets.add(read.pocket)
    if len(warnings) > WARNINGS_MAX:
        more = len(warnings) - WARNINGS_MAX
        warnings[WARNINGS_MAX:] = [TableWarning(warnings[WARNINGS_MAX].line, f"{more} more lines are left out")]
    return ToolTable(tuple(tools.values()), random, tuple(remarks)), tuple(warnings)


def render(table: ToolTable) -> str:
    """The text of a table: what `parse` reads as the same table. What is 0 is not written, as LinuxCNC does."""
    lines = [f"; {remark}".rstrip() for remark in table.remarks]
    lines += [_line(tool) for tool in table.tools]
    return "".join(f"{line}\n" for line in lines)


def _line(tool: Tool) -> str:
    words = [f"T{tool.number}", f"P{tool.pocket}"]
    for letter, name in LETTERS.items():
        value = getattr(tool, name)
        if letter in "TP" or not value:
            continue
        words.append(f"{letter}{value}" if letter == "Q" else f"{letter}{value:+}")
    return " ".join(words) + (f" ;{tool.comment}" if tool.comment else "")


def _tool(words: str, comment: str) -> Tool | str:
    """The tool of a line, or why it is left out."""
    values: dict[str, float | int] = {}
    for word in words.split():
        letter, text = word[0].upper(), word[1:]
        name = LETTERS.get(letter)
        if name is None:
            return f"{_shown(word)} is not known; the line is left out"
        if name in values:
            return f"{letter} stands twice; the line is left out"
        value = _value(letter, text)
        if value is None:
            return f"{_shown(word)} is no value of {letter}; the line is left out"
        values[name] = value
    for letter in "TP":
        if LETTERS[letter] not in values:
            return f"there is no {letter}; the line is left out"
    return Tool(**values, comment=comment)  # type: ignore[arg-type]  # whole numbers for T, P, Q by _value


def _value(letter: str, text: str) -> float | int | None:
    if letter in _WHOLE_MAX:
        whole = int(text) if _WHOLE.fullmatch(text) else -1
        return whole if 0 <= whole <= _WHOLE_MAX[letter] else None
    if len(text) > WORD_MAX or not _REAL.fullmatch(text):
        return None
    value = float(text) + 0.0  # a plain zero of a negative one, which would not be written and so not come back
    return value if abs(value) <= VALUE_MAX else None


def _fits(tool: Tool, tools: dict[int, Tool], pockets: set[int], *, random: bool) -> str | None:
    """Why a sound line has no place in this table."""
    if tool.number in tools:
        return f"T{tool.number} stands twice; the later line is left out"
    if random and tool.pocket in pockets:
        return f"pocket {tool.pocket} is taken; T{tool.number} is left out"
    if len(tools) >= TOOLS_MAX:
        return f"there are more than {TOOLS_MAX} tools; T{tool.number} is left out"
    return None


def _printable(comment: str) -> str:
    return "".join(character if character.isprintable() else " " for character in comment[:COMMENT_MAX]).strip()


def _shown(word: str) -> str:
    return repr(word[:20])
