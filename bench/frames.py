"""NC frames: how many a second are translated, and their bytes beside the G-code text that they stand for.

Turning as CAM writes it, with and without arcs and compensation. The text is what another machine would get: without
blanks, remarks and line numbers, a line end each; once as written and once with everything left out that changes
nothing (compact).
"""

import math
import re
import time
from collections.abc import Iterator
from random import Random

from bench.report import Figure, Report
from gcode.clean import clean
from gcode.compact import Compactor
from gcode.motion import Motion
from gcode.ncframe.check import ORIGIN
from gcode.ncframe.reader import FrameBlock, FrameReader
from gcode.ncframe.rules import FrameRules
from gcode.profile import load_profile
from gcode.words import parse_block
from protocol.ncframe.codec import Frame

TITLE = "frames: NC frames translated a second, their bytes beside the text"
SEED = 15
LINES_AT_ONCE = 256
GOAL_FRAMES_S = 2_000.0
"""A link of 115200 bit/s carries 1,280 frames of nine bytes a second, were there no answer to wait for."""
BAUD = 115_200
BITS_A_BYTE = 10
RULES = FrameRules(tool_radius_mm=0.4, feed_unit_mm_min=10.0, speed_unit_rpm=20.0)
_WORD = re.compile(r"([A-Z])([+-]?[0-9.]+)")


def turning(seed: int, lines: int, *, arcs: bool = True, compensated: bool = False) -> Iterator[str]:
    """Passes along a wavy shaft, from the tailstock to the chuck, a little deeper each."""
    random = Random(seed)
    yield from ("%", "(shaft)", "G21 G90 G18 G94", "T1 M6", "M3 S1200", "G0 X60 Z5")
    left = lines - 8
    depth = 50.0
    while left > 0:
        depth = depth - 0.5 if depth > 10 else 50.0
        on, off = ("G42 ", "G40 ") if compensated else ("", "")
        block = [f"G0 X{depth + 8:.3f} Z4.000", f"{on}G1 X{depth:.3f} Z1.000 F240"]
        z = 1.0
        for step in range(min(max(left - 5, 1), 60)):
            z -= 1.5
            if arcs and step % 3 == 2:
                radius = random.uniform(1.5, 9)
                block.append(f"G{2 + step % 2} X{depth + step % 2:.3f} Z{z:.3f} R{radius:.3f}")
            else:
                wave = 0.6 * math.sin(z / 7) + random.uniform(0, 0.02)
                block.append(f"G1 X{depth + wave:.3f} Z{z:.3f} F240")
        block += [f"G1 X{depth + 6:.3f} Z{z - 2:.3f}", f"{off}G0 X{depth + 9:.3f} Z{z - 2:.3f}"]
        yield from block[:left] if not compensated else block
        left -= len(block)
    yield from ("M5", "M30")


def translated(lines: list[str]) -> Iterator[FrameBlock]:
    """All frames of a program, as the daemon would ask for them."""
    reader = FrameReader(
        enumerate((line.encode() for line in lines), 1), load_profile("ncframe-lathe"), Motion(), RULES, ORIGIN
    )
    while not reader.ended:
        yield from reader.more(LINES_AT_ONCE)[0]


def text_bytes(lines: list[str]) -> tuple[int, int]:
    """Of the blocks as text, as written and compacted, a line end each."""
    compactor = Compactor(load_profile("ncframe-lathe"))
    written = compact = 0
    for line in lines:
        block = parse_block(line)
        written += len(clean(block)) + 1 if block.words else 0
        short = compactor.compact(block)
        compact += len(short) + 1 if short else 0
    return written, compact


def compare(lines: list[str]) -> Iterator[Figure]:
    """One program."""
    began_s = time.process_time()
    words = sum(len(_WORD.findall(line)) for line in lines)
    yard_s = max(time.process_time() - began_s, 1e-6)
    began_s = time.process_time()
    blocks = list(translated(lines))
    took_s = max(time.process_time() - began_s, 1e-6)
    frame_bytes = sum(len(Frame.from_text(block.text).sendable.to_bytes()) for block in blocks)
    yield Figure("frames translated", len(blocks) / took_s, "frames/s", goal=GOAL_FRAMES_S, sense="least", digits=0)
    yield Figure("an expression that only finds words / translated", yard_s / took_s, "x as fast", digits=3)
    yield Figure("words a line", words / len(lines), digits=1)
    yield Figure("frames a line", len(blocks) / len(lines))
    written, compact = text_bytes(lines)
    yield Figure("bytes a line, frames", frame_bytes / len(lines), digits=1)
    yield Figure("bytes a line, text", written / len(lines), digits=1)
    yield Figure("bytes a line, text with compact", compact / len(lines), digits=1)
    yield Figure("frames / text", frame_bytes / written, "x")
    yield Figure("frames / text with compact", frame_bytes / compact, "x")
    # A check byte each, and one byte of answer; the counter of the default dialect asks six bytes more.
    wire = (frame_bytes + 2 * len(blocks)) * BITS_A_BYTE / BAUD
    yield Figure(f"frames a second that {BAUD} bit/s can carry", len(blocks) / wire, "frames/s", digits=0)


def run(*, lines: int = 20_000) -> Report:
    """Each kind of program."""
    programs = {
        "straights and arcs": list(turning(SEED, lines)),
        "straights alone": list(turning(SEED, lines, arcs=False)),
        "guided along the contour (G42)": list(turning(SEED, lines, arcs=False, compensated=True)),
    }
    return Report.of(TITLE, [(name, list(compare(program))) for name, program in programs.items()])
