"""The check of a program for NC frames before a run: the rules of every check, and the translation of all of it.

Not a second opinion on either. The one rule: whatever would stop the translation in the middle of a job is an error
here, and the program is gone through once, in constant memory.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Unpack

from gcode.check import CheckOptions, check_numbered
from gcode.check.source import Fingerprint
from gcode.findings import Finding, Findings, Report
from gcode.lines import split_lines
from gcode.motion import Motion
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.ncframe.source import blocks_of_line
from gcode.ncframe.translate import Translator
from gcode.profile import Profile
from gcode.words import decode_line, parse_block

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
    going = _Through(Translator(profile, rules, position), rules)
    # The check counts X in radii, as the frames do.
    options["position"] = {
        axis: value / 2 if axis == "x" and rules.diameter_programming else value for axis, value in position.items()
    }
    report = check_numbered(going.through(lines), profile_for(profile, rules), motion, **options)
    going.close()
    errors = sorted([*report.errors, *_unsaid(report.errors, going.found)], key=lambda one: (one.line, one.column))
    return replace(report, errors=tuple(errors), lines=going.lines)


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


class _Through:
    """The translation of lines on their way to the check."""

    def __init__(self, translator: Translator, rules: FrameRules) -> None:
        self.found = Findings()
        self.lines = 0
        self._translator = translator
        self._rules = rules

    def through(self, lines: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
        """The same lines as blocks; each has been translated when it comes."""
        for number, raw in lines:
            self.lines += 1
            for block in blocks_of_line(raw, self._rules.semicolon):
                self._translator.step(number, parse_block(decode_line(block, self._rules.encoding)))
                self._collect()
                yield number, block

    def close(self) -> None:
        """The program is over."""
        self._translator.finish()
        self._collect()

    def _collect(self) -> None:
        for note in self._translator.errors:
            self.found.add("error", note.line, note.column, note.code, note.message)
        self._translator.errors.clear()
