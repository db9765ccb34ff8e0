"""The whole check: the ways into it say the same, pieces do not matter, nothing raises, memory stays."""

import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.check import check_numbered, check_program, check_source, source
from gcode.findings import Report
from gcode.motion import Motion
from gcode.profile import load_profile, profile_names
from tests.harness.programs import program_lines, quick

TRAVEL = Motion(travel={"x": (0.0, 100.0), "y": (0.0, 100.0), "z": (-50.0, 50.0)}, max_rate={"x": 1000.0})
any_lines = st.lists(st.binary(max_size=40) | program_lines.map(str.encode), max_size=15)


def without_file(report: Report) -> Report:
    return replace(report, encoding=None, line_ends=None, bytes=None, sha256=None)


@given(any_lines, st.sampled_from(profile_names()), st.booleans(), st.booleans(), st.booleans())
@quick
def test_any_bytes_raise_nothing(lines: list[bytes], name: str, inches: bool, delete: bool, envelope: bool) -> None:
    report = check_program(
        lines,
        load_profile(name),
        TRAVEL,
        convert_inches=inches,
        block_delete=delete,
        envelope=envelope,
        baud=115200,
        feed_override=1.5,
    )
    assert report.lines == len(lines)
    assert report.seconds >= 0
    assert report.to_json()["lines"] == len(lines)


@given(any_lines, st.sampled_from(profile_names()), st.booleans())
@quick
def test_lines_and_bytes_and_numbered_lines_say_the_same(lines: list[bytes], name: str, delete: bool) -> None:
    lines = [line.replace(b"\n", b" ").replace(b"\r", b" ").removeprefix(b"\xef\xbb\xbf") for line in lines]
    profile = load_profile(name)
    whole = check_program(lines, profile, TRAVEL, block_delete=delete)
    text = b"".join(line + b"\n" for line in lines)
    chunks = [text[at : at + 7] for at in range(0, len(text), 7)]
    assert without_file(check_source(chunks, profile, TRAVEL, block_delete=delete)) == whole
    assert check_numbered(enumerate(lines, 1), profile, TRAVEL, block_delete=delete) == whole


def mixed_program(count: int) -> list[bytes]:
    """A part with all that rules remember: depths, units, tools, arcs, ends."""
    dice = Random(11)
    lines = [b"G21 G90 G17", b"M3 S1000", b"G0 Z5", b"G0 X0 Y0 F600"]
    for number in range(count):
        x, y, z = dice.uniform(0, 120), dice.uniform(0, 120), dice.uniform(-3, 1)
        lines.append(
            dice.choice(
                [
                    b"G1 X%.3f Y%.3f F%d" % (x, y, dice.choice((300, 600, 2000))),
                    b"G0 Z%.3f" % z,
                    b"G0 X%.3f" % x,
                    b"G2 X%.3f Y%.3f I%.3f J2" % (x, y, z),
                    b"G1 Z%.3f" % z,
                    b"/G1 X%.3f" % x,
                    b"T%d M6" % dice.randrange(3),
                    b"G55 E%d" % number,
                    b"G4 P0.1",
                    b"G92 X%d" % dice.randrange(5),
                    b"M3 S0",
                    b"G20" if number % 50 == 7 else b"(nothing)",
                    b"G18" if number % 50 == 9 else b"G17",
                ]
            )
        )
    return [*lines, b"M30", b"G0 X1"]


@pytest.mark.parametrize("name", ["elvinto", "grbl-1.1", "rs274ngc"])
def test_pieces_do_not_matter(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    lines = mixed_program(1500)
    whole = check_program(lines, load_profile(name), TRAVEL, baud=115200)
    monkeypatch.setattr(source, "PIECE_BYTES", 2_000)
    parts = check_program(lines, load_profile(name), TRAVEL, baud=115200)
    for level in ("errors", "warnings", "infos"):
        assert set(getattr(parts, level)) == set(getattr(whole, level)), level
    assert parts.bounds == whole.bounds
    for field in ("seconds", "cut_mm", "rapid_mm", "plunge_mm", "dwell_seconds", "median_mm", "shortest_mm"):
        assert getattr(parts, field) == pytest.approx(getattr(whole, field)), field
    for field in ("lines", "blocks", "segments", "arcs", "tools", "feeds", "spindle", "wire_bytes", "link_seconds"):
        assert getattr(parts, field) == getattr(whole, field), field


def test_numbered_lines_are_named_by_their_numbers() -> None:
    lines = [(7, b"G21 G90"), (7, b"E1"), (3, b"G1 X5"), (3, b"G1 X5 E1"), (900, b"G0 X1")]
    report = check_numbered(lines, load_profile("grbl-1.1"))
    assert [(f.line, f.column) for f in report.errors if f.code == "unknown_word"] == [(3, 7), (7, 1)]
    assert [f.line for f in report.errors if f.code == "feed_missing"] == [3, 3]
    assert [f.line for f in report.warnings if f.code == "no_end"] == [900]


def test_block_delete_leaves_lines_out_and_keeps_their_numbers() -> None:
    lines = [b"G21 G90", b"/E5 $", b"G0 X1", b"E7", b"M30"]
    left_out = check_program(lines, load_profile("grbl-1.1"), block_delete=True)
    assert [f.line for f in left_out.errors] == [4]
    executed = check_program(lines, load_profile("grbl-1.1"))
    assert {f.line for f in executed.errors} == {2, 4}


def test_memory_does_not_grow_with_the_program() -> None:
    def chunks(count: int) -> Iterator[bytes]:
        for number in range(count):
            yield b"".join(b"G1 X%d.%d Y1 F%d\n" % (number, line, number % 900 + 1) for line in range(5_000))

    peaks = []
    for count in (12, 48):
        tracemalloc.start()
        check_source(chunks(count), load_profile("grbl-1.1"))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] * 1.2
    assert peaks[1] < 100e6
