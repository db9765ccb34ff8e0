"""One reader over one file, in a process of its own: `python -m bench.reader KIND FILE` prints what it took as JSON.

A process for each, so that the peak of its memory is its own. The one rule: every kind reads the file from the disk and
does all of its work; nothing is warm from another.
"""

import json
import re
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from gcode.check import check_source
from gcode.columns import read_columns
from gcode.interpret import Reading
from gcode.lines import pieces
from gcode.motion import Motion
from gcode.profile import load_profile

CHUNK_BYTES = 1 << 16
WORD = re.compile(r"([A-Za-z])\s*([-+]?[0-9.]+)")
PROFILE = "grblhal"  # it has a fourth axis


def _chunks(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            yield chunk


def expression(path: Path) -> int:
    """The yardstick: words by a regular expression, and their numbers."""
    lines = 0
    with path.open(encoding="utf-8") as file:
        for line in file:
            lines += 1
            for _, number in WORD.findall(line):
                float(number)
    return lines


def words(path: Path) -> int:
    """Words alone, as columns."""
    return sum(read_columns(piece).lines for piece in pieces(_chunks(path)))


def motion(path: Path) -> int:
    """Words, modal state, motion."""
    reading, lines = Reading(load_profile(PROFILE)), 0
    for piece in pieces(_chunks(path)):
        columns = read_columns(piece, lines + 1)
        reading.read(columns)
        lines += columns.lines
    return lines


def check(path: Path) -> int:
    """The whole check: words, modal state, bounds, time."""
    return check_source(_chunks(path), load_profile(PROFILE), Motion()).lines


KINDS: dict[str, Callable[[Path], int]] = {
    "expression": expression,
    "words": words,
    "motion": motion,
    "check": check,
}


def main(kind: str, path: str) -> None:
    """Runs it and prints lines, processor seconds and the peak of memory."""
    began_s = time.process_time()
    lines = KINDS[kind](Path(path))
    cpu_s = time.process_time() - began_s
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"lines": lines, "cpu_s": cpu_s, "peak_mb": peak_mb}))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
