"""The expanded program as a file, each line with the number of the line it came from: `G1 X1 Y2 ;@12`.

The one rule: what is written here is read back here; the mark is the last thing on a line, so that no comment of the
program can pass for it.
"""

import re
from collections.abc import Iterable, Iterator

from gcode.expand.blocks import Expanded

_MARK = re.compile(rb";@([1-9][0-9]{0,17})\s*\Z")


def write_expanded(expanded: Iterable[Expanded]) -> Iterator[bytes]:
    """The lines of the file, with their ends."""
    for each in expanded:
        yield f"{each.text} ;@{each.line}\n".encode("utf-8", "replace")


def source_line(raw: bytes) -> int | None:
    """The line of the source that a line of such a file came from; None for a line of any other."""
    found = _MARK.search(raw)
    return int(found[1]) if found else None
