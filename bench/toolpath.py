"""How long it takes from a program to the packed drawing of it, and how large that is, beside a plain word reader.

The word reader is a regular expression over the same bytes that finds words and turns their numbers into floats: the
yardstick of this computer at this moment. Segments are made anew for each measurement, nothing is kept in between.
"""

import re
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from bench.programs import arcs, as_bytes, four_axis, part, raster, relief
from bench.report import Figure, Report
from gcode.interpret import segments_of
from gcode.lines import pieces
from gcode.profile import load_profile
from gcode.segments import Segments
from gcode.toolpath import HEAD, head_bytes, levels_in, toolpath

TITLE = "toolpath: from a program to the packed drawing"
SEED = 17
WORD = re.compile(rb"([A-Za-z])\s*([-+]?[0-9.]+)")
GOAL_S = 2.0
GOAL_BYTES = 12.0
MILLION = 1e6
READ_BYTES = 65_536

T = TypeVar("T")


def yardstick(data: bytes) -> int:
    """Words with numbers, found by the expression alone."""
    return sum(1 for _, number in WORD.findall(data) if float(number) is not None)


def interpreted(data: bytes) -> list[Segments]:
    """The motion of a program, read as a file is."""
    chunks = (data[at : at + READ_BYTES] for at in range(0, len(data), READ_BYTES))
    return list(segments_of(pieces(chunks), load_profile("elvinto")))


def drawn(segments: Sequence[Segments]) -> bytes:
    """The head and all levels."""
    return toolpath(segments, segments[0].axes)


def _cpu_s(work: Callable[[], T]) -> tuple[T, float]:
    began_s = time.process_time()
    result = work()
    return result, max(time.process_time() - began_s, 1e-6)


def compare(data: bytes) -> Iterator[Figure]:
    """One program; processor time, so that neighbours do not count. Goals are for a million segments."""
    _, yard_s = _cpu_s(lambda: yardstick(data))
    segments, reading_s = _cpu_s(lambda: interpreted(data))
    packed, drawing_s = _cpu_s(lambda: drawn(segments))
    count = sum(len(piece) for piece in segments)
    scale = MILLION / count
    levels = levels_in(packed[: head_bytes(packed[: HEAD.size])])
    whole_s = reading_s + drawing_s
    yield Figure("segments", count, digits=0)
    yield Figure("of them arcs", levels[0].arcs, digits=0)
    yield Figure("for a million segments: word reader alone", yard_s * scale, "s")
    yield Figure("for a million segments: bytes to segments", reading_s * scale, "s")
    yield Figure("for a million segments: segments to drawing", drawing_s * scale, "s")
    yield Figure("for a million segments: bytes to drawing", whole_s * scale, "s", goal=GOAL_S)
    yield Figure("bytes to drawing / word reader, time", whole_s / yard_s, "x")
    yield Figure("all levels, for a segment", len(packed) / count, "bytes", goal=GOAL_BYTES, digits=1)
    for number, level in enumerate(levels):
        yield Figure(f"level {number}, {level.tolerance_mm:g} mm", level.bytes / MILLION, "MB")


def run(*, relief_lines: int = 1_000_010, features: int = 10_000, other_lines: int = 300_000) -> Report:
    """A fine relief, as wordy as CAM writes it, an ordinary part with arcs, and `other_lines` of the less ordinary."""
    programs = {
        "fine relief": as_bytes(relief(SEED, relief_lines)),
        "ordinary part": as_bytes(part(SEED, features)),
        "every second move an arc": as_bytes(arcs(SEED, other_lines)),
        "four axes": as_bytes(four_axis(SEED, other_lines)),
        "raster by laser": as_bytes(raster(SEED, other_lines)),
    }
    return Report.of(TITLE, [(name, compare(data)) for name, data in programs.items()])
