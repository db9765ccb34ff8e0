"""The fast way through a program against the careful one: the same motion, the same state, to the last bit."""

from collections.abc import Iterator
from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gcode.interpret
from gcode.columns import read_columns
from gcode.interpret import Reading, segments_of
from gcode.interpreter import Interpreter
from gcode.lines import pieces, split_lines
from gcode.profile import load_profile, profile_names
from gcode.segments import CCW, CW, FEED, RAPID, Segments
from gcode.state import State
from gcode.words import decode_line, parse_block
from tests.harness.effort import more
from tests.harness.programs import corpus_files, program_lines, quick, thorough


@pytest.fixture(autouse=True)
def short_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fast way wherever it is possible, in windows that end everywhere."""
    monkeypatch.setattr(gcode.interpret, "SHORTEST_RUN", 1)
    monkeypatch.setattr(gcode.interpret, "FIRST_WINDOW", 3)


def careful(lines: list[str], profile: str, *, laser: bool = False) -> tuple[Segments, Interpreter]:
    interpreter = Interpreter(load_profile(profile), laser=laser)
    for number, line in enumerate(lines, 1):
        block = parse_block(line)
        if block.words:
            interpreter.step(number, block)
    return interpreter.take(), interpreter


def fast(lines: list[str], profile: str, *, laser: bool = False) -> tuple[Segments, Reading]:
    reading = Reading(load_profile(profile), laser=laser)
    return reading.read(read_columns("\n".join(lines).encode() + b"\n")), reading


def assert_same(one: Segments, other: Segments) -> None:
    assert len(one) == len(other)
    for field in fields(one):
        left, right = getattr(one, field.name), getattr(other, field.name)
        if isinstance(left, np.ndarray) and field.name != "frame":
            np.testing.assert_array_equal(left, right, field.name)
    left_frames = np.array(one.frames, float).reshape(-1, len(one.axes))[one.frame]
    np.testing.assert_array_equal(left_frames, np.array(other.frames, float).reshape(-1, len(other.axes))[other.frame])


def comparable(state: State) -> list[object]:
    values = {field.name: getattr(state, field.name) for field in fields(state)}
    values["position"] = [at + 0.0 for at in state.position]  # -0.0 is 0.0
    return [repr(value) for value in values.values()]


coordinates = st.sampled_from(("0", "1", "10", "-5.25", "+3.", ".5", "12.345"))
words = st.builds(lambda letter, number: letter + number, st.sampled_from("XYZAIJKRFSP"), coordinates)
codes = st.sampled_from(
    (
        "G0",
        "G1",
        "G2",
        "G3",
        "G90",
        "G91",
        "G17",
        "G18",
        "G20",
        "G21",
        "G93",
        "G94",
        "G95",
        "G54",
        "G55",
        "G92",
        "G80",
        "G40",
        "M3",
        "M4",
        "M5",
        "M8",
        "M9",
        "G4 P1",
        "G28",
        "G53",
        "G81",
        "G10 L2 P1",
        "T1",
        "M6",
        "M30",
        "G91.1",
        "G90.1",
    )
)
motions = st.sampled_from(("G0", "G1", "G1", "G2", "G3", ""))
blocks = st.builds(
    lambda code, motion, values, more: " ".join([*code, motion, *dict.fromkeys(values), *more]),
    st.lists(codes, max_size=1),
    motions,
    st.lists(words, max_size=4),
    st.lists(codes, max_size=1),
)
arcs = st.builds(
    lambda motion, x, y, i, j: f"{motion} X{x} Y{y} I{i} J{j} F100",
    st.sampled_from(("G2", "G3", "")),
    coordinates,
    coordinates,
    coordinates,
    coordinates,
)
moves = st.builds(lambda motion, x, z: f"{motion} X{x} Z{z}", motions, coordinates, coordinates)
rasters = st.builds(lambda x, s: f"X{x} S{s}", coordinates, st.sampled_from(("0", "100", "250")))
program = st.lists(st.one_of(moves, moves, moves, rasters, arcs, blocks, program_lines), max_size=25)


@given(program, st.sampled_from(profile_names()), st.booleans())
@thorough
def test_both_ways_give_the_same(lines: list[str], profile: str, laser: bool) -> None:
    expected, interpreter = careful(lines, profile, laser=laser)
    found, reading = fast(lines, profile, laser=laser)
    assert_same(expected, found)
    assert comparable(interpreter.state) == comparable(reading.state)
    assert interpreter.notes == reading.notes


@given(program, st.lists(st.integers(1, 40), max_size=3), st.sampled_from(profile_names()))
@quick
def test_where_a_piece_ends_does_not_matter(lines: list[str], cuts: list[int], profile: str) -> None:
    whole, _ = fast(lines, profile)
    reading = Reading(load_profile(profile))
    bounds = [0, *sorted(min(cut, len(lines)) for cut in cuts), len(lines)]
    parts = []
    for begin, end in pairwise(bounds):
        text = "".join(line + "\n" for line in lines[begin:end]).encode()
        parts.append(reading.read(read_columns(text, begin + 1)))
    assert_same(whole, gcode.interpret.joined(parts))


def test_a_plain_program() -> None:
    lines = [
        "G21 G90",
        "G0 X0 Y0 Z5",
        "G1 Z-1 F300",
        "X10",
        "Y10 F600",
        "G2 X20 Y0 I0 J-10",
        "(remark)",
        "G0 Z5",
        "M30",
    ]
    found, reading = fast(lines, "grbl-1.1")
    assert found.line.tolist() == [2, 3, 4, 5, 6, 8]
    assert found.kind.tolist() == [RAPID, FEED, FEED, FEED, CW, RAPID]
    assert found.end[:, 1:].T.tolist() == [[0, 0, -1], [10, 0, -1], [10, 10, -1], [20, 0, -1], [20, 0, 5]]
    assert found.feed[1:].tolist() == [300, 300, 600, 600, 600]
    assert reading.state.place() == {"x": 20, "y": 0, "z": 5}


@pytest.mark.parametrize("profile", ["elvinto", "grbl-1.1", "rs274ngc"])
def test_the_fast_way_is_taken(profile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand plain lines with a header: hardly any goes through the interpreter."""
    steps = 0
    step = Interpreter.step

    def counted(self: Interpreter, *arguments: object) -> None:
        nonlocal steps
        steps += 1
        step(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(gcode.interpret, "FIRST_WINDOW", 512)
    monkeypatch.setattr(Interpreter, "step", counted)
    lines = ["G21 G90 G17", "M3 S1000", "G0 X0 Y0 Z5 F300"]
    lines += [f"N{n} G90 G1 X{n % 100}.5 Y{n % 7} F{300 + n % 3} S{n % 50}" for n in range(1000)]
    lines += [f"G3 X{n}.5 Y0 I1 J0" for n in range(1000)]
    found, _ = fast([*lines, "M5", "M30"], profile)
    assert np.count_nonzero(found.kind == CCW) == 1000
    assert steps < 60


def every_line(path_bytes: bytes) -> Iterator[tuple[int, str]]:
    for number, raw in enumerate(split_lines([path_bytes]), 1):
        yield number, decode_line(raw)


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["elvinto", "grbl-1.1", "rs274ngc"])
def test_the_corpus_goes_both_ways(profile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gcode.interpret, "FIRST_WINDOW", 64)
    monkeypatch.setattr(gcode.interpret, "SHORTEST_RUN", 4)
    for path in corpus_files():
        data = b"\n".join(list(split_lines([path.read_bytes()]))[: more(600)])
        interpreter = Interpreter(load_profile(profile))
        for number, line in every_line(data):
            block = parse_block(line)
            if block.words:
                interpreter.step(number, block)
        found = gcode.interpret.joined(list(segments_of(pieces([data], 4096), load_profile(profile))))
        assert_same(interpreter.take(), found)


def test_unknown_coordinates_stay_unknown() -> None:
    found, reading = fast(["G90", "G1 X1 F100", "Y2", "X3"], "elvinto")
    assert np.isnan(found.start[:, 0]).all()
    assert found.end[:2, -1].tolist() == [3, 2]
    assert reading.state.place() == {"x": 3, "y": 2}
    assert CW not in found.kind
