"""Columns of a program in inches as the columns of the same program in millimetres (elvinto §6, convert_inches).

Not the text that goes out; that is gcode/inches.py. The one rule: the words, and how many bytes they have, are what
that one gives for each block.
"""

from dataclasses import dataclass, fields

import numpy as np

from gcode.columns import Columns
from gcode.inches import InchConverter
from gcode.segments import Bools, Ints
from gcode.words import Block

MM_PER_INCH = 25.4

_IS_LENGTH = np.zeros(128, np.bool_)
_IS_LENGTH[[ord(letter) for letter in "XYZIJKRQF"]] = True

_G, _POINT, _MINUS = ord("G"), ord("."), ord("-")


@dataclass(slots=True)
class Millimetres(Columns):
    """`before`, `active`: whether inches are in force before each row, and for it.
    `is_g20`: the words that were G20.

    Units on a line hold for that line already (rs274 §3).
    """

    before: Bools
    active: Bools
    is_g20: Bools

    def block(self, row: int) -> Block:
        """The careful reading of a line, converted; the columns of its words are those of the line as it is."""
        converter = InchConverter()
        converter.active = bool(self.before[row])
        return converter.convert(Columns.block(self, row))

    def sent_bytes(self) -> "np.ndarray[tuple[int], np.dtype[np.int32]]":
        """As of the converted words: a product has one decimal more than the inches, and the whole digits it needs."""
        text = np.frombuffer(self.text, np.uint8)
        words = np.flatnonzero(_IS_LENGTH[self.letter] & self.active[self.row])
        begin, end = self.start[words], self.end[words]
        points = np.append(np.flatnonzero(text == _POINT), len(text))
        point = points[np.searchsorted(points, begin)]
        decimals = np.where(point < end, end - point - 1, 0)
        whole = np.ones(len(words), np.int64)
        for power in range(1, 12):
            whole += np.abs(self.value[words]) >= 10.0**power
        grown = np.zeros(len(self.row))
        grown[words] = (text[begin] == _MINUS) + whole + 1 + decimals + 1 - (end - begin)
        grown[self.is_g20] = 2 - (self.end - self.start)[self.is_g20]
        more = np.bincount(self.row, weights=grown, minlength=self.lines).astype(np.int32)
        return Columns.sent_bytes(self) + more

    def rows_of_g20(self) -> Ints:
        """The rows in which G20 stood, once for each."""
        return self.row[self.is_g20].astype(np.int64)

    def column_of_g20(self, row: int) -> int:
        """Where the first of them stands."""
        words = Columns.block(self, row).words
        return next((word.column for word in words if word.letter == "G" and word.value == 20.0), 1)


class Converter:
    """Follows G20 and G21 through the pieces of a program."""

    def __init__(self) -> None:
        self._active = False

    def convert(self, columns: Columns) -> Columns:
        """The columns in mm: themselves where no inches are in force."""
        is_g20: Bools = (columns.letter == _G) & (columns.value == 20.0)
        if not self._active and not is_g20.any():
            return columns
        named = np.flatnonzero((columns.letter == _G) & ((columns.value == 20.0) | (columns.value == 21.0)))
        states = np.concatenate(([self._active], columns.value[named] == 20.0))
        # The last one in a row counts.
        active: Bools = states[np.searchsorted(columns.row[named], np.arange(columns.lines), side="right")]
        before = np.concatenate(([self._active], active[:-1]))
        self._active = bool(states[-1])
        scaled = _IS_LENGTH[columns.letter] & active[columns.row]
        table = {field.name: getattr(columns, field.name) for field in fields(columns)}
        table["value"] = np.where(is_g20, 21.0, np.where(scaled, columns.value * MM_PER_INCH, columns.value))
        return Millimetres(**table, before=before, active=active, is_g20=is_g20)
