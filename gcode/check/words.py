"""What is to be said of words as such: what this controller does not have, ignores, or makes something else of.

Not what the words do; that is motion.py, and what contradicts itself in a block is the interpreter's. The one rule:
every word of a program is either understood by the profile or stands in a finding with its line and column.
"""

from collections.abc import Iterator

import numpy as np

from gcode.check.piece import Piece, Reporter
from gcode.clean import DROPPED_LETTERS
from gcode.findings import Level
from gcode.profile import Profile
from gcode.segments import Ints

MAX_PROGRAM_NUMBERS = 10_000
"""So many O-numbers and calls are remembered; no program of this world has more."""

MAX_VERDICTS = 1_000
"""A hostile file could make up ever new codes; beyond this they are judged each time anew."""

_SHOWN = 24

Verdict = tuple[Level, str, str]


def judge(profile: Profile, name: str) -> Verdict | None:
    """What is to be said of a letter (`X`) or code (`G41`), whatever its line: level, code, message; None: nothing."""
    letter = name[:1]
    if letter in DROPPED_LETTERS:
        return None  # They are never sent.
    shown = name if len(name) <= _SHOWN else name[:_SHOWN] + "..."
    if letter not in profile.code_letters:
        if letter in profile.letters:
            return None
        if text := profile.ignored_letters.get(letter):
            return "warning", "ignored", f"{letter} words are ignored by {profile.title}: {text}"
        return "error", "unknown_word", f"{profile.title} has no {letter} words"
    if name == "M6" and "no_tool_changer" in profile.features:
        return "error", "no_tool_changer", "M6: this machine has no tool changer"
    code = profile.codes.get(name)
    if code is None or code.status == "missing":
        reason = f": {code.text}" if code and code.text else ""
        return "error", "unknown_code", f"{shown} does not exist on {profile.title}{reason}"
    if code.status == "ignored":
        return "warning", "ignored", f"{shown} is ignored by {profile.title}: {code.text}"
    if code.status == "differs":
        return "warning", "differs", f"{shown} means something else on {profile.title}: {code.text}"
    return None


class WordRules:
    """Letters, codes, faults, length of blocks, and calls of subprograms."""

    def __init__(self, profile: Profile, reporter: Reporter, max_block_bytes: int) -> None:
        self._profile = profile
        self._reporter = reporter
        self._max_block_bytes = max_block_bytes
        self._verdicts: dict[str, Verdict | None] = {}
        self._numbers: set[int] = set()
        self._calls: dict[int, int] = {}  # program number: line of its first call

    def look(self, piece: Piece) -> None:
        """One piece of the program."""
        self._faults(piece)
        code_letters = self._profile.code_letters
        for letter in piece.letters:
            if letter not in code_letters and (verdict := self._verdict(letter)):
                self._report(piece, letter, piece.rows_of_letter(letter), verdict)
        for name in piece.codes:
            if verdict := self._verdict(name):
                rows = piece.rows_of(name)
                self._report(piece, name, rows, verdict)
                if verdict[0] == "error":
                    # Where a code leads that nobody knows is anyone's guess: nothing more is said of its motion.
                    piece.noted.update(rows.tolist())
        self._ranges(piece)
        self._lengths(piece)
        self._programs(piece)

    def close(self) -> None:
        """At the end of the program."""
        for number, line in self._calls.items():
            if number not in self._numbers:
                text = f"M98 calls O{number}, which is not in this file"
                self._reporter.found.add("warning", line, 1, "call_without_target", text, subject=str(number))

    def _verdict(self, name: str) -> Verdict | None:
        if name not in self._verdicts:
            if len(self._verdicts) >= MAX_VERDICTS:
                return judge(self._profile, name)
            self._verdicts[name] = judge(self._profile, name)
        return self._verdicts[name]

    def _report(self, piece: Piece, name: str, rows: Ints, verdict: Verdict) -> None:
        level, code, message = verdict
        columns = _places(piece, name, rows)
        self._reporter.rows(piece, rows, level, code, message, at=lambda _: next(columns, 1), subject=name)

    def _faults(self, piece: Piece) -> None:
        found = self._reporter.found
        for row, fault in piece.columns.faults:
            found.add("error", piece.line(row), fault.column, fault.code, fault.message)

    def _ranges(self, piece: Piece) -> None:
        """Numbers that the controller refuses: a feed below 0, a tool over its table."""
        for letter in sorted(self._profile.ranges.keys() & piece.letters.keys() - DROPPED_LETTERS):
            lowest, highest = self._profile.ranges[letter]
            values = piece.values(letter)
            if lowest <= values.min() and values.max() <= highest:
                continue
            rows = piece.rows_of_letter(letter)[(values < lowest) | (values > highest)]
            text = f"{letter} is from {lowest:.12g} to {highest:.12g} on {self._profile.title}"
            self._reporter.rows(piece, rows, "error", "out_of_range", text, at=letter, subject=letter)

    def _lengths(self, piece: Piece) -> None:
        sizes = piece.sent_bytes
        if not len(sizes) or sizes.max() <= self._max_block_bytes:
            return
        rows = np.flatnonzero(sizes > self._max_block_bytes)

        def message(place: int) -> str:
            size, most = sizes[rows[place]], self._max_block_bytes
            return f"the block has {size} bytes without comments, the machine takes {most}"

        self._reporter.rows(piece, rows, "error", "block_too_long", message)

    def _programs(self, piece: Piece) -> None:
        """O-numbers of the file, and M98 with a P that none of them has."""
        if "O" in piece.letters and len(self._numbers) < MAX_PROGRAM_NUMBERS:
            self._numbers.update(map(int, np.unique(piece.values("O"))))
        if "M98" not in piece.codes:
            return
        for row in np.unique(piece.rows_of("M98"))[:MAX_PROGRAM_NUMBERS].tolist():
            targets = [word.value for word in piece.words(row) if word.letter == "P"]
            if not targets:
                text = "M98 without a P that says which program it calls"
                self._reporter.found.add(
                    "warning", piece.line(row), piece.column(row, "M98"), "call_without_target", text
                )
            elif len(self._calls) < MAX_PROGRAM_NUMBERS:
                # Fanuc writes the number of repeats before the last four digits: P31234.
                self._calls.setdefault(int(targets[0]) % 10_000 or int(targets[0]), piece.line(row))


def _places(piece: Piece, name: str, rows: Ints) -> Iterator[int]:
    """The column of each of these words; a word that stands twice in a row has its two columns."""
    before = -1
    letter, number = name[:1], name[1:]
    for row in rows.tolist():
        if row == before:
            continue
        before = row
        for word in piece.words(row):
            if word.letter == letter and (not number or word.value == float(number)):
                yield word.column
