"""How fast programs are read, checked and planned, beside a plain regular expression over the same lines.

The expression finds words and does nothing else: no comments, no faults, no numbers. It is the yardstick of this
computer at this moment, so the ratios can be compared between computers, the lines a second cannot.
"""

import re
import time
from collections.abc import Callable, Iterator

from bench.programs import part, relief
from bench.report import Figure, Report
from bench.wire import batches
from gcode.check import check_program
from gcode.motion import Motion
from gcode.profile import load_profile
from gcode.words import decode_line, parse_block

TITLE = "reading: lines a second beside a plain regular expression"
SEED = 13
WORD = re.compile(r"([A-Za-z])\s*([-+]?[0-9.]+)")


def yardstick(lines: list[bytes]) -> int:
    """Words found by the expression alone."""
    return sum(len(WORD.findall(raw.decode())) for raw in lines)


def read(lines: list[bytes]) -> int:
    """Words found by the reader."""
    return sum(len(parse_block(decode_line(raw)).words) for raw in lines)


def check(lines: list[bytes]) -> int:
    """Lines that were checked."""
    return check_program(lines, load_profile("elvinto"), Motion()).lines


def plan(lines: list[bytes]) -> int:
    """Blocks that were planned."""
    return sum(len(batch.blocks) for batch in batches(lines, compact=True))


def _cpu_s(work: Callable[[list[bytes]], int], lines: list[bytes]) -> float:
    began_s = time.process_time()
    assert work(lines) > 0
    return time.process_time() - began_s


def compare(lines: list[bytes]) -> Iterator[Figure]:
    """One program; processor time, so that neighbours do not count."""
    yard_s = max(_cpu_s(yardstick, lines), 1e-6)
    yield Figure("regular expression", len(lines) / yard_s, "lines/s", digits=0)
    for name, work in (("reader", read), ("check", check), ("planner", plan)):
        work_s = max(_cpu_s(work, lines), 1e-6)
        yield Figure(name, len(lines) / work_s, "lines/s", digits=0)
        yield Figure(f"{name} / regular expression, time", work_s / yard_s, "x", digits=1)


def run(*, relief_lines: int = 25_000, features: int = 400) -> Report:
    """Both kinds of program."""
    programs = {
        "fine relief": [line.encode() for line in relief(SEED, relief_lines)],
        "ordinary part": [line.encode() for line in part(SEED, features)],
    }
    return Report.of(TITLE, [(name, compare(lines)) for name, lines in programs.items()])
