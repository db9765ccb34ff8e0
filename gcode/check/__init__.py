"""The check before a run (preflight): what is wrong with a program for a controller, and what it will do.

`check_source` takes the bytes of a file in chunks of any size and is the fast way; `check_program` takes lines;
`check_numbered` lines with numbers of their own, as when loops have been written out. All go through the same rules
(words.py, course.py, motion.py, travel.py, height.py, link.py) and never raise on any bytes. The one rule: every word
of the program is either understood by the profile or stands in a finding with its line and column.
"""

from collections.abc import Iterable
from typing import Unpack

from gcode.check.program import Checker, CheckOptions
from gcode.check.source import Fingerprint, Gathered, gather, gather_numbered
from gcode.columns import read_columns
from gcode.findings import Report
from gcode.lines import PIECE_BYTES, pieces
from gcode.motion import Motion
from gcode.profile import Profile

__all__ = ["CheckOptions", "check_numbered", "check_program", "check_source"]


def check_source(
    chunks: Iterable[bytes], profile: Profile, motion: Motion | None = None, **options: Unpack[CheckOptions]
) -> Report:
    """Check the bytes of a file. `motion` brings rates and travel. Raises only what `chunks` raises."""
    encoding = options.get("encoding", "utf-8")
    fingerprint = Fingerprint(encoding)
    checker = Checker(profile, motion or Motion(), options)
    line = options.get("first_line", 1)
    for piece in pieces(fingerprint.through(chunks), options.get("piece_bytes", PIECE_BYTES)):
        columns = read_columns(piece, line, encoding)
        line += columns.lines
        checker.look(columns)
    return checker.report(fingerprint)


def check_program(
    lines: Iterable[bytes], profile: Profile, motion: Motion | None = None, **options: Unpack[CheckOptions]
) -> Report:
    """Check lines, as from `gcode.lines.split_lines` or `ProgramStore.lines`."""
    return _check(gather(lines), profile, motion, options)


def check_numbered(
    lines: Iterable[tuple[int, bytes]], profile: Profile, motion: Motion | None = None, **options: Unpack[CheckOptions]
) -> Report:
    """Check lines whose numbers need not count up: findings name the numbers that are given."""
    return _check(gather_numbered(lines), profile, motion, options)


def _check(gathered: Iterable[Gathered], profile: Profile, motion: Motion | None, options: CheckOptions) -> Report:
    checker = Checker(profile, motion or Motion(), options)
    line, encoding = options.get("first_line", 1), options.get("encoding", "utf-8")
    for piece in gathered:
        columns = read_columns(piece.text, line, encoding)
        for row in piece.too_long:
            checker.too_long(line + row if piece.numbers is None else int(piece.numbers[row]))
        line += columns.lines
        checker.look(columns, piece.numbers)
    return checker.report()
