"""Programs written in one line, checked: for tests of the rules."""

from typing import Any

from gcode.check import check_program
from gcode.findings import Finding, Report
from gcode.motion import Motion
from gcode.profile import load_profile


def checked(program: str, profile: str = "grbl-1.1", motion: Motion | None = None, **options: Any) -> Report:
    """The report of a program whose lines are separated by `|`."""
    return check_program([line.encode() for line in program.split("|")], load_profile(profile), motion, **options)


def found(report: Report, code: str) -> list[Finding]:
    """All findings of a code, of whatever level."""
    return [finding for finding in every(report) if finding.code == code]


def level_of(report: Report, code: str) -> str | None:
    """The level of the findings of a code; None without any."""
    for level, findings in (("error", report.errors), ("warning", report.warnings), ("info", report.infos)):
        if any(finding.code == code for finding in findings):
            return level
    return None


def every(report: Report) -> list[Finding]:
    """All findings."""
    return [*report.errors, *report.warnings, *report.infos]
