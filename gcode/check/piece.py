"""One piece of a program as the rules see it: its words, a census of its letters and codes, where a row stands.

Not a rule. The one rule: nothing here looks at a row by itself before something is wrong with it; what is asked of a
clean program is asked of whole columns.
"""

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from gcode.columns import Columns
from gcode.findings import Findings, Level
from gcode.segments import Bools, Floats, Ints
from gcode.words import Word, code_name

_UNITS_A_CODE = 100
"""Codes have two decimals at most (G81.99); what has more, or is negative, is looked at by its text."""

_LAST_CODE = 1000

MACHINE_CODES = ("G53", "G28", "G30")
"""Their ways are in machine coordinates, whatever the offsets."""


class Piece:
    """`columns` is the piece; `numbers`, where given, is the line of each row, else they count from `first_line`.

    A motion that compensation has held back belongs to an earlier piece; its row is below 0 and has no words any more.
    `noted`: rows with an error that the interpreter has told; what else is wrong with them follows from it.
    """

    def __init__(self, columns: Columns, code_letters: frozenset[str], numbers: Ints | None = None) -> None:
        self.columns = columns
        self._numbers = numbers
        self._code_letters = code_letters
        self.noted: set[int] = set()
        self._places: dict[str, tuple[Ints, Ints]] = {}  # of a code letter: words and keys

    # --- rows ---------------------------------------------------------------------------------------------------

    def line(self, row: int) -> int:
        """The line of the file that `row` is."""
        return self.columns.first_line + row if self._numbers is None else int(self._numbers[max(row, 0)])

    def lines(self, rows: Ints) -> Ints:
        """The same of many rows."""
        return self.columns.first_line + rows if self._numbers is None else self._numbers[np.maximum(rows, 0)]

    def words(self, row: int) -> tuple[Word, ...]:
        """The words of a row, read again with their columns."""
        return self.columns.block(row).words if row >= 0 else ()

    def column(self, row: int, name: str) -> int:
        """Where the last word of this letter or code stands; the line's beginning where there is none."""
        letter, number = name[:1], name[1:]
        for word in reversed(self.words(row)):
            if word.letter == letter and (not number or word.value == float(number)):
                return word.column
        return 1

    def unnoted(self, rows: Ints) -> Bools:
        """Which of these rows the interpreter has not told of."""
        fresh: Bools = np.ones(len(rows), np.bool_)
        if self.noted:
            fresh = ~np.isin(rows, np.fromiter(self.noted, np.int64))
        return fresh

    # --- census -------------------------------------------------------------------------------------------------

    @cached_property
    def letters(self) -> dict[str, int]:
        """How often each letter is there."""
        counts = np.bincount(self.columns.letter, minlength=128)
        return {chr(letter): int(counts[letter]) for letter in np.flatnonzero(counts)}

    def of_letter(self, letter: str) -> Ints:
        """The words of a letter, in order."""
        if letter not in self.letters:
            return np.zeros(0, np.int64)
        return np.flatnonzero(self.columns.letter == ord(letter))

    def rows_of_letter(self, letter: str) -> Ints:
        """The rows of the words of a letter, ascending, once for every word."""
        return self.columns.row[self.of_letter(letter)].astype(np.int64)

    def values(self, letter: str) -> Floats:
        """Their values."""
        return self.columns.value[self.of_letter(letter)]

    @cached_property
    def codes(self) -> dict[str, int]:
        """How often each code is there, by its name, as `G1`."""
        return dict(self._census())

    def _census(self) -> Iterator[tuple[str, int]]:
        for letter in sorted(self._code_letters & self.letters.keys()):
            words = self.of_letter(letter)
            values = self.columns.value[words]
            keys = np.rint(values * _UNITS_A_CODE)
            sound: Bools = (keys >= 0) & (keys < _LAST_CODE * _UNITS_A_CODE) & (keys / _UNITS_A_CODE == values)
            odd = {}
            if not sound.all():
                odd = self._odd(letter, words[~sound])
            keys = np.where(sound, keys, -1).astype(np.int64) if odd else keys.astype(np.int64)
            self._places[letter] = words, keys
            counts = np.bincount(keys[sound] if odd else keys, minlength=1)
            for key in np.flatnonzero(counts):
                yield code_name(letter, f"{key / _UNITS_A_CODE:.2f}"), int(counts[key])
            yield from odd.items()

    def _odd(self, letter: str, words: Ints) -> dict[str, int]:
        """Codes that no table has: -1, 1234567, 5.123."""
        found: dict[str, int] = {}
        for value, count in zip(*np.unique(self.columns.value[words], return_counts=True), strict=True):
            name = letter + np.format_float_positional(value, trim="-")
            found[name] = found.get(name, 0) + int(count)
        return found

    def rows_of(self, *names: str) -> Ints:
        """The rows with any of these codes, ascending, once for every word."""
        rows = [self.columns.row[self._words_of(name)] for name in names if name in self.codes]
        if not rows:
            return np.zeros(0, np.int64)
        found = rows[0] if len(rows) == 1 else np.sort(np.concatenate(rows))
        return found.astype(np.int64)

    def _words_of(self, name: str) -> Ints:
        words, keys = self._places[name[0]]
        value = float(name[1:])
        key = round(value * _UNITS_A_CODE) if abs(value) < _LAST_CODE else -1
        if 0 <= key < _LAST_CODE * _UNITS_A_CODE and key / _UNITS_A_CODE == value:
            found: Ints = words[keys == key]
        else:
            found = words[self.columns.value[words] == value]
        return found

    # --- what goes out ------------------------------------------------------------------------------------------

    @cached_property
    def sent_bytes(self) -> Ints:
        """How many bytes of each row go out: without comments, blanks, N and O words; 0 where nothing does."""
        return self.columns.sent_bytes().astype(np.int64)


class Reporter:
    """Puts rows into findings: as many as stand in full are looked at, the others counted."""

    def __init__(self, found: Findings) -> None:
        self.found = found
        self._said: set[str] = set()

    def rows(
        self,
        piece: Piece,
        rows: Ints,
        level: Level,
        code: str,
        say: str | Callable[[int], str],
        *,
        at: str | Callable[[int], int] = "",
        subject: str = "",
    ) -> None:
        """A finding for each of `rows`. `say` is the message, or makes it from the place in `rows`.

        `at` names the letter or code whose column is meant, or gives the column of a place in `rows`.
        """
        room = min(len(rows), self.found.room(level, code, subject))
        for place, row in enumerate(rows[:room].tolist()):
            column = (piece.column(row, at) if at else 1) if isinstance(at, str) else at(place)
            message = say if isinstance(say, str) else say(place)
            self.found.add(level, piece.line(row), column, code, message, subject=subject)
        if len(rows) > room:
            self.found.count(level, code, len(rows) - room, subject=subject)

    def once(self, level: Level, line: int, column: int, code: str, message: str) -> None:
        """The first time only."""
        if code not in self._said:
            self._said.add(code)
            self.found.add(level, line, column, code, message)
