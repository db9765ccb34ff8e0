"""The findings of every file of the corpus with every profile, as a table of counts: what the check says of real files.

`python -m tests.gcode.corpus_findings > tests/gcode/corpus_findings.tsv` writes it anew, from the root of the
repository, where the corpus lies beside it. Whoever changes a rule looks at the difference, file by file. The one
rule: the table says what the check says, nothing is left out.
"""

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from gcode.check import check_source
from gcode.findings import Report
from gcode.lines import split_lines
from gcode.motion import Motion
from gcode.profile import Profile, load_profile, profile_names
from tests.harness.programs import CORPUS

TABLE = Path(__file__).with_suffix(".tsv")
HEAD = "file\tprofile\terrors\twarnings\tinfos\n"

MAX_LINES = 1_000
"""Of each file: the shapes repeat, the time of the tests is better spent elsewhere."""

MOTION = Motion(
    max_rate={"x": 8000.0, "y": 8000.0, "z": 2000.0},
    travel={"x": (-500.0, 500.0), "y": (-500.0, 500.0), "z": (-100.0, 100.0)},
)
"""A machine that fits most of them, so that travel and rates are judged too."""


def begin_of(path: Path) -> bytes:
    """The first MAX_LINES lines of a file, with the line ends as they are where the file is not longer."""
    raw = path.read_bytes()
    lines = list(split_lines([raw]))
    return raw if len(lines) <= MAX_LINES else b"\n".join(lines[:MAX_LINES]) + b"\n"


def report_of(text: bytes, profile: Profile) -> Report:
    """The check as the table has it."""
    return check_source([text], profile, MOTION, baud=115200)


def row_of(name: str, profile: str, report: Report) -> str:
    """One line of the table: the codes with how often they were found."""
    columns = []
    for found in (report.errors, report.warnings, report.infos):
        counts: Counter[str] = Counter()
        for finding in found:
            counts[finding.code] += finding.count
        columns.append(" ".join(f"{code}:{count}" for code, count in sorted(counts.items())))
    return "\t".join((name, profile, *columns)) + "\n"


def rows_of(path: Path) -> Iterator[str]:
    """The lines of one file, a profile each."""
    text = begin_of(path)
    for name in profile_names():
        yield row_of(path.name, name, report_of(text, load_profile(name)))


def main() -> None:
    """Write the table to standard output."""
    sys.stdout.write(HEAD)
    for path in sorted(path for path in CORPUS.iterdir() if path.suffix not in (".md", ".tsv")):
        sys.stdout.writelines(rows_of(path))


if __name__ == "__main__":
    main()
