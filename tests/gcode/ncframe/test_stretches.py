"""The errors of a translation by stretches are those of the translation block by block, whatever stands in it."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gcode.interpret
import gcode.ncframe.stretches
from gcode.columns import read_columns
from gcode.interpret import Reading
from gcode.interpreter import Interpreter
from gcode.motion import Motion
from gcode.ncframe.check import check_frames
from gcode.ncframe.frame import Frame
from gcode.ncframe.rates import RateError, feed_byte, feeds_have_bytes
from gcode.ncframe.reader import FrameReader, TranslationError
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.ncframe.stretches import Stretches, first_error
from gcode.ncframe.translate import Translator
from gcode.words import Block, parse_block
from tests.harness.frameprograms import LATHE, ORIGIN
from tests.harness.programs import quick, thorough

numbers = st.sampled_from(("0", "1", "10", "-5.25", "12.345", "-.0004", "8000", "-9000", "250.5", "16777", "90000"))
axes = st.builds(lambda letter, value: letter + value, st.sampled_from("XZXZUW"), numbers)
others = st.sampled_from(
    ("F100", "F0", "F300", "F.1", "F.2", "F2000", "S5", "S300", "S2.5", "R5", "R9000", "R-5", "I3", "K-3", "I8000")
) | st.sampled_from(("J1", "Y1", "T1", "T300", "P1", "N7", "D1", "G21", "G20", "G95", "G94", "M3", "M5", "M8", "G40"))
motions = st.sampled_from(("", "", "G0", "G1", "G1", "G2", "G3"))
moves = st.builds(
    lambda motion, words: " ".join([motion, *dict.fromkeys(words)]), motions, st.lists(axes | others, max_size=4)
)
plain = st.builds(lambda motion, x, z: f"{motion} X{x} Z{z}", motions, numbers, numbers)
single = st.sampled_from(
    (
        "G90",
        "G91",
        "G41 D1",
        "G42",
        "G92 X0 Z0",
        "G54",
        "G55",
        "G4 P1",
        "M30",
        "M6",
        "/G1 X5",
        "",
        "(so)",
        "G18",
        "G95 F.1",
    )
)
small = st.sampled_from(("1.5", "3", "-2", "-4.25", "0", ".3", "7", "-6.125"))
step = st.builds(lambda motion, x, z: f"{motion} X{x} Z{z}".strip(), st.sampled_from(("", "G1", "G0")), small, small)
bow = st.builds(lambda g, x, z, r: f"G{g} X{x} Z{z} R{r}", st.sampled_from("23"), small, small, st.sampled_from("369"))
beside = st.sampled_from(
    ("", "F200", "G1", "X1", "Z2", "G1 F300 X5", "M8", "G4 P1", "G1 X9000", "G91", "G2 X1 Z1 I1 K0")
)
contour = st.builds(
    lambda begin, rows, end: [*begin, *rows, *end],
    st.sampled_from((["G91 F100", "G41 D1 G1 X5"], ["G91 F100", "G42 G1 Z-4"], ["F100", "G41", "G1 X5 Z9"])),
    st.lists(st.one_of(step, step, step, bow, beside), max_size=20),
    st.sampled_from((["G40 G1 X9"], ["G40", "G0 X3 Z3"], [])),
)
program = contour | st.lists(st.one_of(plain, plain, moves, moves, single), max_size=25)
RULES = (
    FrameRules(tool_radius_mm=0.4),
    FrameRules(tool_radius_mm=0.4, compensation="offset", block_delete=True),
    FrameRules(diameter_programming=True, speed_unit_rpm=10.0, feed_unit_mm_min=10.0),
    FrameRules(resolution_mm=1.0, feed_table_mm_min=(0.0, 10.0, 100.0, 300.0)),
)


@pytest.fixture(autouse=True)
def short_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stretches wherever they are possible, in windows that end everywhere."""
    for module in (gcode.interpret, gcode.ncframe.stretches):
        monkeypatch.setattr(module, "SHORTEST_RUN", 1)
        monkeypatch.setattr(module, "FIRST_WINDOW", 3)
    monkeypatch.setattr(gcode.ncframe.stretches, "CAREFUL_ROWS", 2)


def outcome(translator: Translator) -> list[object]:
    state = translator.state
    return [
        *(repr(getattr(state, one.name)) for one in fields(state) if one.name != "sync"),
        translator.counts,
        translator.added,
        translator.errors,
    ]


@given(program, st.sampled_from(RULES), st.sampled_from((ORIGIN, {}, {"x": 3.0}, {"x": -8388.0, "z": 0.5})))
@thorough
def test_the_errors_are_those_of_block_by_block(
    lines: list[str], rules: FrameRules, position: dict[str, float]
) -> None:
    slow = Translator(LATHE, rules, position)
    for number, line in enumerate(lines, 1):
        slow.step(number, parse_block(line))
    fast = Translator(LATHE, rules, position)
    text = "".join(line + "\n" for line in lines).encode()
    Stretches(fast, rules).look(read_columns(text), np.arange(1, len(lines) + 1))
    assert outcome(fast) == outcome(slow)
    slow.finish()
    fast.finish()
    assert outcome(fast) == outcome(slow)


@given(program, st.sampled_from(RULES))
@quick
def test_the_motion_of_a_lathe_is_that_of_block_by_block(lines: list[str], rules: FrameRules) -> None:
    """Diameters and feeds per turn are in the fast way of gcode/runs.py, too."""
    profile = profile_for(LATHE, rules)
    careful = Interpreter(profile)
    for number, line in enumerate(lines, 1):
        if (block := parse_block(line)).words:
            careful.step(number, block)
    expected = careful.take()
    reading = Reading(profile)
    found = reading.read(read_columns("".join(line + "\n" for line in lines).encode()))
    for name in ("line", "kind", "start", "end", "feed", "spindle", "radius", "end_radius", "sweep", "centre"):
        np.testing.assert_array_equal(getattr(expected, name), getattr(found, name), name)
    assert repr(careful.state) == repr(reading.state)


def test_a_long_plain_program_does_not_go_block_by_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    stepped: list[int] = []
    step = Translator.step

    def counted(self: Translator, line: int, block: Block) -> list[Frame]:
        stepped.append(line)
        return step(self, line, block)

    monkeypatch.setattr(Translator, "step", counted)
    lines = [
        "F100 G1",
        *[f"X{n % 97}.5 Z-{n % 89}" for n in range(3000)],
        "G2 X10 Z-10 R300",
        "G3 X0 Z0 I-60 K0",
        "M30",
    ]
    check_frames(
        [(number, line.encode()) for number, line in enumerate(lines, 1)], LATHE, Motion(), FrameRules(), tools=None
    )
    assert len(stepped) < 60, stepped


def test_a_long_contour_does_not_go_block_by_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    stepped: list[int] = []
    step = Translator.step

    def counted(self: Translator, line: int, block: Block) -> list[Frame]:
        stepped.append(line)
        return step(self, line, block)

    monkeypatch.setattr(Translator, "step", counted)
    contour = [
        f"G1 X{20 + n % 2 * 3} Z{-4 * n}" if n % 3 else f"G3 X{20 + n % 2 * 3} Z{-4 * n} R9" for n in range(1, 900)
    ]
    lines = ["G42 G1 X20 Z0 F100", *contour, "G40 G1 X90", "M30"]
    assert (
        first_error(enumerate((line.encode() for line in lines), 1), LATHE, FrameRules(tool_radius_mm=0.4), ORIGIN)
        is None
    )
    assert len(stepped) < 60, stepped


@pytest.mark.parametrize(("line", "column"), [("F9 G41 X5 Z5", 4), ("G1 G42 X5 D7", 11)])
def test_a_radius_that_is_not_known_is_said_where_it_is_asked_for(line: str, column: int) -> None:
    found = first_error([(1, line.encode())], LATHE, FrameRules(tools={1: 0.4}), ORIGIN)
    assert found is not None
    assert (found.column, "the radius of the tool is not known" in found.message) == (column, True)


@given(st.lists(st.floats(0, 400) | st.sampled_from((float("nan"), float("inf"), -1.0, 255.0, 0.5, 255.0000000001))))
@quick
def test_the_feeds_that_have_bytes_are_those_that_raise_nothing(feeds: list[float]) -> None:
    tables = (FrameRules(), FrameRules(feed_table_mm_min=(0.0, 10.0, 300.0)), FrameRules(feed_table_mm_min=(0.0,)))
    for rules in (*tables, FrameRules(feed_unit_mm_min=0.1)):
        found = feeds_have_bytes(np.array(feeds, float), rules)
        for feed, has in zip(feeds, found.tolist(), strict=True):
            assert has == has_byte(feed, rules), (feed, rules)


def has_byte(feed: float, rules: FrameRules) -> bool:
    if not feed > 0.0:
        return False
    try:
        feed_byte(feed, rules)
    except RateError:
        return False
    return True


@pytest.mark.parametrize(
    ("program", "line"),
    [
        ("G1 X1 F100|X2|M30|Q9", None),
        ("G1 X1 F100|X2|Q9|M30", 3),
        ("G1 X1 F100|X9999|X2 F900|M30", 2),
        ("G41 G1 X5 Z5 F9 D7|X3", 1),
        ("G1 X1 F100|G1 X5 Z5 F9,Y2;M30", 2),
        ("G1 X1 F100|(" + "a" * 300_000, 2),
    ],
)
def test_the_first_error_before_the_end_is_what_stops_a_job(program: str, line: int | None) -> None:
    lines = list(enumerate(program.encode().split(b"|"), 1))
    found = first_error(lines, LATHE, FrameRules(tools={1: 0.4}), ORIGIN)
    assert (None if found is None else found.line) == line


@given(program, st.sampled_from(RULES))
@quick
def test_what_has_no_first_error_is_read_to_its_end(lines: list[str], rules: FrameRules) -> None:
    numbered = [(number, line.encode()) for number, line in enumerate(lines, 1)]
    assert first_error_said(numbered, rules) == first_error_met(numbered, rules)


def first_error_said(numbered: list[tuple[int, bytes]], rules: FrameRules) -> str | None:
    error = first_error(numbered, LATHE, rules, ORIGIN)
    return None if error is None else f"line {error.line}: column {error.column}: {error.message}"


def first_error_met(numbered: list[tuple[int, bytes]], rules: FrameRules) -> str | None:
    """By a job that runs to the program's end."""
    reader = FrameReader(numbered, LATHE, Motion(), rules, ORIGIN)
    try:
        while not reader.ended:
            found, _ = reader.more(7)
            if found and found[-1].barrier is not None and found[-1].barrier.ends_program:
                break
    except TranslationError as broken:
        return str(broken)
    return None
