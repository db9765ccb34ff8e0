"""The check of a program that has to be expanded: what comes out of it goes through the rules of gcode/check.

Not the expansion, and not the rules. The one rule: every finding names a line of the program as it was written; a
program that cannot be expanded has an error at the place where that shows, beside what was found before it, and
nothing is said of an end that was not reached.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Unpack

from gcode.check import CheckOptions, check_numbered
from gcode.check.source import Fingerprint
from gcode.expand.detection import needs_expansion
from gcode.expand.errors import ExpandError, Limits
from gcode.expand.expander import Expander
from gcode.expand.structure import Program
from gcode.findings import Finding, Report
from gcode.motion import Motion
from gcode.profile import Profile

_OF_THE_END = frozenset({"no_blocks", "no_end", "offset_left"})
"""Codes that say what is missing at the end of a program."""


def check_expanded(
    program: Program,
    chunks: Iterable[bytes],
    profile: Profile,
    motion: Motion | None = None,
    *,
    limits: Limits | None = None,
    **options: Unpack[CheckOptions],
) -> Report:
    """Expand and check a program for which needs_expansion says yes; `chunks` are its bytes, as they are in the file.

    `options` as for check_source; the first line is 1 always. Raises only what `program` and `chunks` raise.
    """
    source = Fingerprint(options.get("encoding", "utf-8"))
    for _ in source.through(chunks):
        pass
    lines = _Lines(Expander(limits=limits, block_delete=options.get("block_delete", False)), program)
    # What comes out is text that was decoded already.
    options["encoding"], options["first_line"] = "utf-8", 1
    report = check_numbered(lines, profile, motion, **options)
    report = replace(
        report,
        errors=_as_written(report.errors, program),
        warnings=_as_written(report.warnings, program),
        infos=_as_written(report.infos, program),
        lines=program.count,
        encoding=source.encoding,
        line_ends=source.line_ends,
        bytes=source.bytes,
        sha256=source.sha256,
        expanded_lines=lines.count,
    )
    if lines.error is not None:
        return _broken_off(report, lines.error)
    message = f"the program is executed as the {lines.count} plain lines that it stands for"
    return replace(report, infos=(Finding(1, 0, "expanded", message), *report.infos))


class _Lines:
    """The plain lines, each with the number of the line it came from, up to an error."""

    def __init__(self, expander: Expander, program: Program) -> None:
        self._expander = expander
        self._program = program
        self.count = 0
        self.error: ExpandError | None = None

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        try:
            for expanded in self._expander.expand(self._program):
                self.count += 1
                yield expanded.line, expanded.text.encode("utf-8", "replace")
        except ExpandError as error:
            self.error = error


def _as_written(findings: tuple[Finding, ...], program: Program) -> tuple[Finding, ...]:
    """Columns of the line as it was written, 0 where it came out changed; the turns of a loop are one finding."""
    counts: dict[Finding, int] = {}
    for finding in findings:
        raw = program.line(finding.line) or b""
        column = finding.column
        if column:
            # Lines come out without the blanks before them.
            column = 0 if b"#" in raw or needs_expansion([raw]) else column + len(raw) - len(raw.lstrip())
        place = replace(finding, column=column, count=1)
        counts[place] = counts.get(place, 0) + finding.count
    merged = [replace(place, count=count) for place, count in counts.items()]
    return tuple(sorted(merged, key=lambda finding: (finding.line, finding.column)))


def _broken_off(report: Report, error: ExpandError) -> Report:
    told = Finding(error.line, error.column, error.code, error.message)
    errors = [*(found for found in report.errors if found.code not in _OF_THE_END), told]
    return replace(
        report,
        errors=tuple(sorted(errors, key=lambda finding: (finding.line, finding.column))),
        warnings=tuple(found for found in report.warnings if found.code not in _OF_THE_END),
        expanded_lines=None,
    )
