"""What the lines before a line leave behind: the machine's state, and what `State` has no place for.

Reads the fast way (interpret.py) and stops at the line; nothing is planned here, that is resume.py. The one rule: only
what the lines say is told; what they never said stays unsaid, and is not made up from a power-on default.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode.columns import Columns, read_columns
from gcode.executor import MM_PER_INCH, Note
from gcode.interpret import Reading
from gcode.interpreter import power_on
from gcode.profile import Code, Profile
from gcode.segments import FEED, RAPID, Floats, Ints, Segments
from gcode.state import State
from gcode.words import Block, code_name

SAID_GROUPS = frozenset(("path", "override", "spindle_mode", "plasma", "length", "scaling", "io", "tool"))
"""Modal groups whose last code is kept as it was said: State does not hold them, or not how they came about."""

_OWN_WORDS: Mapping[str, str] = {"G64": "PQ", "G96": "D", "G43": "H", "G43.2": "H", "M50": "P", "M51": "P", "M56": "P"}
_LENGTHS: Mapping[str, str] = {"G64": "PQ"}
"""Words of a code, and those of them that are lengths."""

_COMPENSATION = ("compensation_left", "compensation_right")


class Saying(NamedTuple):
    """A code and the words that belong to it: `(letter, value)`, lengths in mm."""

    name: str
    words: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Past:
    """`state` before a line. `said`: the last code of each of SAID_GROUPS, by group, and `data` for G10.

    `compensating`: the tool is beside the programmed way, in G41 or G42, or since G40 without a straight move.
    `notes`: what was wrong with the lines before, so that the state is what our reading makes of them.
    """

    state: State
    said: Mapping[str, Saying] = field(default_factory=dict)
    compensating: bool = False
    notes: tuple[Note, ...] = ()


def state_before(
    pieces: Iterable[bytes],
    line: int,
    profile: Profile,
    *,
    state: State | None = None,
    laser: bool = False,
    skip_deleted: bool = False,
    encoding: str = "utf-8",
) -> State:
    """The machine's state before `line` (from 1): that behind the last line where there are fewer.

    `pieces` are whole lines (gcode.lines.pieces). `state`: before the first line, changed in place; that of power-on
    where there is none. `skip_deleted`: the operator's switch for `/` lines is on.
    """
    return past_of(pieces, line, profile, state=state, laser=laser, skip_deleted=skip_deleted, encoding=encoding).state


def past_of(
    pieces: Iterable[bytes],
    line: int,
    profile: Profile,
    *,
    state: State | None = None,
    laser: bool = False,
    skip_deleted: bool = False,
    encoding: str = "utf-8",
) -> Past:
    """The same, with what a state does not hold: what `plan_reentry` wants to know."""
    state = power_on(profile) if state is None else state
    reading = Reading(profile, state, laser=laser, skip_deleted=skip_deleted)
    memory = _Memory(profile, inches=state.inches, skip_deleted=skip_deleted)
    first_line = 1
    for piece in pieces:
        if first_line >= line:
            break
        columns = read_columns(piece, first_line, encoding)
        rows = min(columns.lines, line - first_line)
        segments = reading.read(columns, end=rows)
        memory.follow(columns, rows, segments)
        first_line += columns.lines
    state = reading.state
    return Past(state, memory.said, memory.compensating or state.compensation != 40, tuple(reading.notes))


class _Memory:
    """Looks only at the rows that have a code of interest: a program has few of them."""

    def __init__(self, profile: Profile, *, inches: bool, skip_deleted: bool) -> None:
        self.said: dict[str, Saying] = {}
        self._codes: dict[str, Code] = {}
        self._inches = inches
        self._skip_deleted = skip_deleted
        self._ends_at: int | None = None
        self._has_begun = False
        for name, code in profile.codes.items():
            if code.status != "missing" and self._wants(code):
                self._codes[name] = code
        letters = np.array([ord(name[0]) for name in self._codes], np.uint8)
        self._letters = np.unique(letters)
        self._keys = _keys(letters, np.array([float(name[1:]) for name in self._codes], np.float64))

    @staticmethod
    def _wants(code: Code) -> bool:
        units = code.effect in ("inches", "millimetres")
        return code.group in SAID_GROUPS or units or code.group == "compensation" or code.effect == "set_data"

    @property
    def compensating(self) -> bool:
        """G40 has been said, but the straight move that leads the tool back onto the programmed way has not."""
        return self._ends_at is not None

    def follow(self, columns: Columns, rows: int, segments: Segments) -> None:
        """The rows before `rows` of these columns, and their motion."""
        for row in self._rows(columns, rows).tolist():
            block = columns.block(row)
            if not (self._skip_deleted and block.deleted):
                self._take(block, columns.first_line + row)
        if self._ends_at is not None:
            straight = (segments.kind == FEED) | (segments.kind == RAPID)
            if np.any(segments.line[straight] >= self._ends_at):
                self._ends_at = None

    def _rows(self, columns: Columns, rows: int) -> Ints:
        words = slice(0, int(np.searchsorted(columns.row, rows)))
        codes = np.flatnonzero(np.isin(columns.letter[words], self._letters))
        found = np.isin(_keys(columns.letter[codes], columns.value[codes]), self._keys)
        return np.unique(columns.row[codes[found]]).astype(np.int64)

    def _take(self, block: Block, line: int) -> None:
        codes = [code for word in block.words if (code := self._codes.get(code_name(word.letter, word.text)))]
        for code in codes:
            if code.effect in ("inches", "millimetres"):
                self._inches = code.effect == "inches"
        for code in codes:
            if code.sets in _COMPENSATION:
                self._has_begun, self._ends_at = True, None
            elif code.sets == "compensation_off" and self._has_begun:
                self._has_begun, self._ends_at = False, line
            elif code.effect == "set_data":
                self.said["data"] = Saying(code.name)
            elif code.group in SAID_GROUPS:
                self.said[code.group] = self._saying(code.name, block)

    def _saying(self, name: str, block: Block) -> Saying:
        own, lengths = _OWN_WORDS.get(name, ""), _LENGTHS.get(name, "")
        words = [
            (word.letter, word.value * MM_PER_INCH if self._inches and word.letter in lengths else word.value)
            for word in block.words
            if word.letter in own
        ]
        return Saying(name, tuple(words))


def _keys(letter: NDArray[np.uint8], value: Floats) -> Floats:
    """One number for a code: those of a profile have two decimals at most."""
    keys: Floats = letter * _LETTER + np.round(value, 2)
    return keys


_LETTER = 1e10
"""Over every number that a word may have."""
