"""Bytes to a timeline: as long as the check says, up to the end of the program, never faster than the link."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check import check_source
from gcode.interpret import segments_of
from gcode.lines import pieces, split_lines
from gcode.measure import Sending, measure
from gcode.motion import Motion
from gcode.planner import plan
from gcode.profile import load_profile
from gcode.segments import joined
from gcode.state import State
from gcode.timeline import Timeline
from gcode.words import decode_line, parse_block
from tests.harness.planmodel import SMOOTH
from tests.harness.programs import corpus_files, quick

GRBL = load_profile("grbl-1.1")
ELVINTO = load_profile("elvinto")
PLAIN = Sending()
LONGEST_BYTES = 30_000


def timeline(program: bytes, sending: Sending = PLAIN, *, size: int = 1 << 20, motion: Motion = SMOOTH) -> Timeline:
    return measure(pieces([program], size), GRBL, motion, program.count(b"\n") + 1, sending)


def zigzag(lines: int, step_mm: float = 1.0) -> bytes:
    return b"G21 G90\nG1 F6000\n" + b"".join(b"X%.3f Y%d\n" % (i * step_mm, i % 2) for i in range(lines))


def end_of(program: bytes) -> float:
    """The line of the first M2 or M30, by the careful reader."""
    for line, raw in enumerate(split_lines([program]), 1):
        if any(word.letter == "M" and word.value in (2, 30) for word in parse_block(decode_line(raw)).words):
            return line
    return inf


def test_real_programs_take_what_the_planner_says_up_to_their_end() -> None:
    compared = 0
    for path in corpus_files():
        program = path.read_bytes()
        if len(program) > LONGEST_BYTES:
            continue
        state = State.unknown("".join(GRBL.axes).upper())
        state.absolute = True
        motion = joined(list(segments_of(pieces([program]), GRBL, state)))
        seconds = plan(motion.take(slice(0, int(np.searchsorted(motion.line, end_of(program), "right")))), SMOOTH)
        found = timeline(program)
        assert found.total_s == pytest.approx(float(seconds.sum()), rel=1e-9, abs=1e-6), path.name
        compared += 1
    assert compared > 20


@quick
@given(st.binary(max_size=200), st.sampled_from((None, 9600)), st.booleans(), st.booleans())
def test_any_bytes_have_a_timeline(program: bytes, baud: int | None, compact: bool, inches: bool) -> None:
    sending = Sending(baud=baud, compact=compact, convert_inches=inches)
    total_s = measure(pieces([program]), ELVINTO, SMOOTH, program.count(b"\n") + 1, sending).total_s
    assert 0.0 <= total_s < float("inf")


@pytest.mark.parametrize("sending", [PLAIN, Sending(baud=300), Sending(baud=2400, compact=True)])
def test_pieces_of_any_size_give_the_same(sending: Sending) -> None:
    program = zigzag(300) + b"G4 P2\n(a remark)\nM3 S100\nG0 Z5\nM30\nG1 X900\n"
    whole, cut = timeline(program, sending), timeline(program, sending, size=64)
    for line in range(0, whole.lines, 7):
        assert cut.seconds_before(line) == pytest.approx(whole.seconds_before(line), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("end", [b"M2", b"M30", b"m 3 0"])
def test_nothing_takes_time_behind_the_end_of_the_program(end: bytes) -> None:
    program = zigzag(50)
    behind = program + end + b"\nG1 X0 F1\nG4 P1000\n"
    for size in (1 << 20, 40):
        assert timeline(behind, size=size).total_s == pytest.approx(timeline(program + end).total_s)
    sent = timeline(behind, Sending(baud=9600))
    assert sent.between(0, sent.lines).link_s == pytest.approx(
        timeline(program + end, Sending(baud=9600)).between(0, 99).link_s
    )


def test_a_slow_link_makes_the_program_take_what_its_bytes_do() -> None:
    program = b"G21 G90\nG1 F6000\n" + b"".join(b"X%.2f\n" % (i * 0.1) for i in range(400))
    slow = timeline(program, Sending(baud=1200)).between(0, 402)
    report = check_source([program], GRBL, SMOOTH, baud=1200)
    assert slow.link_s == pytest.approx(report.link_seconds)
    assert slow.seconds() == pytest.approx(slow.link_s, rel=0.05)
    assert timeline(program).total_s < slow.link_s / 2
    fast = timeline(program, Sending(baud=10_000_000)).total_s
    assert fast == pytest.approx(timeline(program).total_s, rel=1e-3)


def test_what_compaction_leaves_out_does_not_go_over_the_link() -> None:
    program = b"G21 G90\nG1 F600\n" + b"".join(b"G1 X%.4f Y5.0000 F600\n" % i for i in range(100))
    whole, compact = (
        timeline(program, Sending(baud=9600, compact=compact)).between(0, 102).link_s for compact in (False, True)
    )
    assert compact < whole / 3


def test_inches_take_as_long_as_the_same_in_millimetres() -> None:
    inches = b"G20 G90\nG1 F10\nX1\nY2\nX0\n"
    metric = b"G21 G90\nG1 F254\nX25.4\nY50.8\nX0\n"
    converted = measure(pieces([inches]), ELVINTO, SMOOTH, 5, Sending(convert_inches=True))
    assert converted.total_s == pytest.approx(measure(pieces([metric]), ELVINTO, SMOOTH, 5).total_s)
