"""The check of a program for NC frames before a run: the rules of every check, and the translation of all of it.

Not a second opinion on either. The one rule: whatever would stop the translation in the middle of a job is an error
here, and the program is gone through once, in constant memory.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Unpack

from gcode.check.program import Checker, CheckOptions
from gcode.check.source import Fingerprint, gather_numbered
from gcode.columns import Columns, read_columns
from gcode.findings import Finding, Findings, Report
from gcode.lines import split_lines
from gcode.motion import Motion
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.ncframe.source import blocks_of_line
from gcode.ncframe.stretches import Stretches
from gcode.ncframe.translate import Translator
from gcode.profile import Profile
from gcode.segments import Ints

ORIGIN: Mapping[str, float] = {"x": 0.0, "z": 0.0}
"""Where the machine is taken to stand where nobody says: increments need a start, as in the source's example."""


def check_frames(
    lines: Iterable[tuple[int, bytes]],
    profile: Profile,
    motion: Motion,
    rules: FrameRules,
    **options: Unpack[CheckOptions],
) -> Report:
    """Check lines with their numbers. Raises only what `lines` raises."""
    position = options.get("position") or ORIGIN
    # The check counts X in radii, as the frames do.
    options["position"] = {
        axis: value / 2 if axis == "x" and rules.diameter_programming else value for axis, value in position.items()
    }
    translated = _Translated(Translator(profile, rules, position), rules)
    checker = Checker(profile_for(profile, rules), motion, options)
    row = 1
    for piece in gather_numbered(translated.blocks(lines)):
        assert piece.numbers is not None
        columns = read_columns(piece.text, row, rules.encoding)
        for too_long in piece.too_long:
            checker.too_long(int(piece.numbers[too_long]))
        row += columns.lines
        checker.look(columns, piece.numbers)
        translated.look(columns, piece.numbers)
    translated.close()
    report = checker.report()
    errors = sorted([*report.errors, *_unsaid(report.errors, translated.found)], key=lambda one: (one.line, one.column))
    return replace(report, errors=tuple(errors), lines=translated.lines)


def _unsaid(said: Iterable[Finding], found: Findings) -> list[Finding]:
    """What the check has not said of the same word, or with the same code of the same line."""
    codes = {(finding.line, finding.code) for finding in said}
    words = {(finding.line, finding.column) for finding in said if finding.column}
    return [
        finding
        for finding in found.of("error")
        if (finding.line, finding.code) not in codes and (finding.line, finding.column) not in words
    ]


def check_frames_source(
    chunks: Iterable[bytes], profile: Profile, motion: Motion, rules: FrameRules, **options: Unpack[CheckOptions]
) -> Report:
    """Check the bytes of a file in chunks of any size. Raises only what `chunks` raises."""
    file = Fingerprint(rules.encoding)
    lines = enumerate(split_lines(file.through(chunks)), 1)
    report = check_frames(lines, profile, motion, rules, **options)
    return replace(report, encoding=file.encoding, line_ends=file.line_ends, bytes=file.bytes, sha256=file.sha256)


def check_expandable(lines: Iterable[tuple[int, bytes]], rules: FrameRules) -> tuple[Finding, ...]:
    """What is lost of a program that has to be expanded (loops, parameters): there, `;` begins a remark."""
    found = Findings()
    for number, raw in lines:
        for block in list(blocks_of_line(raw, rules.semicolon))[1:]:
            column = len(block) - len(block.lstrip()) + 1
            text = "in a program with O-words, parameters or macros a block behind ; is to have a line of its own"
            found.add("error", number, column, "block_behind_semicolon", text)
    return found.of("error")


class _Translated:
    """The translation of lines beside the check."""

    def __init__(self, translator: Translator, rules: FrameRules) -> None:
        self.found = Findings()
        self.lines = 0
        self._translator = translator
        self._stretches = Stretches(translator, rules)
        self._semicolon = rules.semicolon

    def blocks(self, lines: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
        """Lines as blocks, on their way."""
        for number, raw in lines:
            self.lines += 1
            for block in blocks_of_line(raw, self._semicolon):
                yield number, block

    def look(self, columns: Columns, line: Ints) -> None:
        """The next blocks."""
        self._stretches.look(columns, line)
        self._collect()

    def close(self) -> None:
        """The program is over."""
        self._translator.finish()
        self._collect()

    def _collect(self) -> None:
        for note in self._translator.errors:
            self.found.add("error", note.line, note.column, note.code, note.message)
        self._translator.errors.clear()
