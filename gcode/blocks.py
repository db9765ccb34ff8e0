"""Words by row: the columns of a piece of program, each letter a dense column, and which rows are not plain.

A plain row has nothing but G0-G3, coordinates, I J K R, F, S and modal codes of groups that only set something. What
it does is left to runs.py, and whether its modal codes change anything to the state at that place. The one rule: a
row that this file calls plain means the same to the interpreter, word for word; in doubt it is special.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode.columns import Columns
from gcode.profile import Code, Profile
from gcode.segments import CCW, CW, FEED, RAPID, Bools, Floats, Ints

MOTIONS = {"rapid": RAPID, "feed": FEED, "arc_cw": CW, "arc_ccw": CCW}
"""The effects that a run may have, and the kinds of segments that they make."""

SETTING_GROUPS = frozenset(
    ("plane", "units", "distance", "arc_distance", "feed_mode", "compensation", "coordinates")
) | {"path", "return", "spindle", "coolant"}
"""Modal groups whose codes can be tried: alone in a block they show whether they change anything (rs274 §2)."""

PLAIN_LETTERS = "FSIJKR"
"""Letters beside the axes that a plain row may have."""

DROPPED_LETTERS = "NO"

_CODES_A_UNIT = 100
_LAST_CODE = 1000


@dataclass(frozen=True, slots=True)
class Letter:
    """One letter over all rows: `values` where `has`, 0 elsewhere."""

    values: Floats
    has: Bools


class CodeTable:
    """The codes of a profile by number, so that a whole column of code words is looked up at once.

    Ids count from 1; 0 is a code that the profile does not have.
    """

    def __init__(self, profile: Profile) -> None:
        self.codes = [Code(""), *profile.codes.values()]
        letters = sorted(profile.code_letters)
        self._slot = np.zeros(128, np.int64)
        self._slot[[ord(letter) for letter in letters]] = np.arange(len(letters))
        self._ids = np.zeros((len(letters), _LAST_CODE * _CODES_A_UNIT), np.int16)
        for number, code in enumerate(self.codes):
            if number and (key := _key(code.name)) is not None:
                self._ids[letters.index(code.name[0]), key] = number
        self.is_code = _flags(profile.code_letters)
        self.is_plain = _flags([*(axis.upper() for axis in profile.axes), *PLAIN_LETTERS])
        self.is_dropped = _flags(DROPPED_LETTERS)
        self.motion = np.array([_motion(code) for code in self.codes], np.uint8)
        self.settable = np.array([_settable(code) for code in self.codes], np.bool_)
        names = sorted({code.group for code in self.codes})
        self.group = np.array([names.index(code.group) for code in self.codes], np.int16)
        self.groups = names

    def ids(self, letters: NDArray[Any], values: Floats) -> Ints:
        """The codes of these words."""
        keys = np.rint(values * _CODES_A_UNIT)
        sound = (keys >= 0) & (keys < _LAST_CODE * _CODES_A_UNIT) & (keys / _CODES_A_UNIT == values)
        keys = np.where(sound, keys, 0.0).astype(np.int64)
        found: Ints = np.where(sound, self._ids[self._slot[letters], keys], 0)
        return found


@dataclass(slots=True)
class Blocks:
    """The rows of one piece. `motion` is the kind + 1 of the row's motion code, 0 without one.

    `special`: rows that are not plain, ascending. `settings`: the rows of each modal code of a plain kind, by id.
    """

    count: int
    letters: dict[str, Letter] = field(default_factory=dict)
    motion: NDArray[Any] = field(default_factory=lambda: np.zeros(0, np.uint8))
    special: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    settings: dict[int, Ints] = field(default_factory=dict)

    def part(self, letter: str, begin: int, end: int) -> Letter:
        """A letter in the rows [begin, end)."""
        whole = self.letters.get(letter)
        if whole is None:
            return Letter(np.zeros(end - begin), np.zeros(end - begin, np.bool_))
        return Letter(whole.values[begin:end], whole.has[begin:end])


def words_between(columns: Columns, begin: int, end: int) -> slice:
    """The words of the rows [begin, end)."""
    first, after = np.searchsorted(columns.row, (begin, end))
    return slice(int(first), int(after))


def filled(values: NDArray[Any], has: Bools, initial: float) -> Floats:
    """Each value where there is one, else the last one before, else `initial`."""
    if has.all():
        return values
    index = np.maximum.accumulate(np.where(has, np.arange(1, len(has) + 1), 0))
    found: Floats = np.concatenate(([initial], values))[index]
    return found


def blocks_of(columns: Columns, table: CodeTable, *, skip_deleted: bool = False) -> Blocks:
    """Sort the words of a piece by letter."""
    row, letter, value = columns.row, columns.letter, columns.value
    if skip_deleted and len(columns.deleted):
        stays = ~np.isin(row, columns.deleted)
        row, letter, value = row[stays], letter[stays], value[stays]
    found = Blocks(columns.lines)
    special: list[NDArray[Any]] = [np.array([place for place, _ in columns.faults], np.int64)]
    special += [columns.deleted] if skip_deleted else []
    # The words of each letter, one after the other, in the order of the rows.
    order = np.argsort(letter, kind="stable")
    behind = np.cumsum(np.bincount(letter, minlength=128))
    codes: list[Ints] = [np.zeros(0, np.int64)]
    for code in np.flatnonzero(np.diff(behind, prepend=0)):
        where = order[behind[code - 1] : behind[code]]
        if table.is_code[code]:
            codes.append(where)
        elif not table.is_plain[code]:
            special += [] if table.is_dropped[code] else [row[where]]
        else:
            rows = row[where]
            twice = rows[1:][rows[1:] == rows[:-1]]
            special.append(twice)
            if len(rows) == columns.lines and not len(twice):  # each row has one
                found.letters[chr(code)] = Letter(value[where], np.ones(columns.lines, np.bool_))
                continue
            values, has = np.zeros(columns.lines), np.zeros(columns.lines, np.bool_)
            values[rows] = value[where]
            has[rows] = True
            found.letters[chr(code)] = Letter(values, has)
    where = np.sort(np.concatenate(codes))
    _sort_codes(found, table, row[where], table.ids(letter[where], value[where]), special)
    found.special = np.unique(np.concatenate(special)).astype(np.int64)
    return found


def _sort_codes(found: Blocks, table: CodeTable, rows: NDArray[Any], ids: Ints, special: list[NDArray[Any]]) -> None:
    """What the codes `ids` say that stand in these rows."""
    found.motion = np.zeros(found.count, np.uint8)
    moving = table.motion[ids]
    found.motion[rows[moving > 0]] = moving[moving > 0]
    special.append(rows[(moving == 0) & ~table.settable[ids]])
    for number in np.flatnonzero(np.bincount(ids, minlength=1)):
        if table.settable[number]:
            found.settings[int(number)] = rows[ids == number]
    # Two of one modal group contradict each other, and one twice is no better (rs274 §2).
    groups = table.group[ids]
    for group in np.flatnonzero(np.bincount(groups, minlength=1)):
        if table.groups[group]:
            same = rows[groups == group]
            special.append(same[1:][same[1:] == same[:-1]])


def _flags(letters: "list[str] | str | frozenset[str]") -> Bools:
    flags = np.zeros(128, np.bool_)
    flags[[ord(letter) for letter in letters]] = True
    return flags


def _key(name: str) -> int | None:
    number = round(float(name[1:]) * _CODES_A_UNIT)
    return number if 0 <= number < _LAST_CODE * _CODES_A_UNIT and number / _CODES_A_UNIT == float(name[1:]) else None


def _motion(code: Code) -> int:
    kind = MOTIONS.get(code.effect)
    return 0 if kind is None or code.barrier else kind + 1


def _settable(code: Code) -> bool:
    return code.group in SETTING_GROUPS and not code.barrier and not code.locate
