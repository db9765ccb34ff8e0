"""The findings of the traps, file by file and line by line, with every profile: a table to be read by people.

`python -m tests.gcode.trap_findings > tests/gcode/traps/expected.tsv` writes it anew. Each trap is a small file of
our own for one thing that real programs have (the first column of the table says which). The one rule: every row of
the table has been looked at by somebody who knows what the controller does.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from gcode.check import check_source
from gcode.findings import Finding
from gcode.motion import Motion
from gcode.profile import load_profile, profile_names

TRAPS = Path(__file__).parent / "traps"
TABLE = TRAPS / "expected.tsv"
FEATURES = TRAPS / "features.json"
HEAD = "feature\tfile\tprofile\terrors\twarnings\tinfos\n"

MOTION = Motion(max_rate={"x": 8000.0, "y": 8000.0, "z": 2000.0})


def features() -> dict[str, str]:
    """What each file is a trap for."""
    table: dict[str, str] = json.loads(FEATURES.read_text(encoding="utf-8"))
    return table


def rows() -> Iterator[str]:
    """The lines of the table. Profiles with the same findings stand together."""
    for name, feature in sorted(features().items()):
        text = (TRAPS / name).read_bytes()
        same: dict[tuple[str, ...], list[str]] = {}
        for profile in profile_names():
            report = check_source([text], load_profile(profile), MOTION)
            columns = tuple(" ".join(map(_told, found)) for found in (report.errors, report.warnings, report.infos))
            same.setdefault(columns, []).append(profile)
        for columns, profiles in same.items():
            yield "\t".join((feature, name, " ".join(profiles), *columns)) + "\n"


def _told(finding: Finding) -> str:
    times = f"x{finding.count}" if finding.count > 1 else ""
    return f"{finding.line}:{finding.column}:{finding.code}{times}"


def main() -> None:
    """Write the table to standard output."""
    sys.stdout.write(HEAD)
    sys.stdout.writelines(rows())


if __name__ == "__main__":
    main()
