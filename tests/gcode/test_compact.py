"""Compaction: shorter, and never another motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gcode.interpret
from gcode.blocks import Blocks, CodeTable, words_between
from gcode.clean import clean
from gcode.columns import Columns, read_columns
from gcode.compact import Compactor
from gcode.interpret import Reading
from gcode.interpreter import Interpreter, power_on
from gcode.motion import Position
from gcode.profile import load_profile
from gcode.segments import Segments
from gcode.words import Block, parse_block, shortest
from tests.harness.programs import elvinto, motion_lines, positions, program_lines, thorough


def compacted(*lines: str) -> list[str]:
    compactor = Compactor(elvinto())
    return [compactor.compact(parse_block(line)) for line in lines]


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["G01 X10.000 Y+05.50"], ["G1X10Y5.5"]),
        (["G1 X1 F100", "G1 X2 F100", "G1 X3 F200"], ["G1X1F100", "X2", "X3F200"]),
        (["G90 G1 X1 Y1", "G1 X1 Y2", "G1 X1 Y2"], ["G90G1X1Y1", "Y2", "X1"]),
        # Without G90 said, an unchanged coordinate may be a way.
        (["G1 X1 Y1", "G1 X1 Y2"], ["G1X1Y1", "X1Y2"]),
        (["G90", "G91 G1 X1 Y1", "G1 X1 Y1"], ["G90", "G91G1X1Y1", "X1Y1"]),
        (["G90 G1 X1 Y1", "G91 X5", "G90 X1 Y3"], ["G90G1X1Y1", "G91X5", "G90X1Y3"]),
        # Where an arc ends, the machine's arithmetic says.
        (["G90 G1 X0 Y0", "G2 X5 Y0 I2.5 J0", "G1 X0 Y5"], ["G90G1X0Y0", "G2X5Y0I2.5J0", "G1X0Y5"]),
        (["G90 G1 X0 Y0", "G2 X5 Y0 I2.5 J0", "G1 X5 Y5"], ["G90G1X0Y0", "G2X5Y0I2.5J0", "G1X5Y5"]),
        (["G2 X1 Y1 R5", "G2 X2 Y2 R5", "G2 I5"], ["G2X1Y1R5", "X2Y2R5", "G2I5"]),
        # Barriers and everything unusual: nothing is known afterwards but G90.
        (["G90 G1 X1 Y1 F9", "G28", "G1 X1 Y1 F9"], ["G90G1X1Y1F9", "G28", "G1X1Y1F9"]),
        (["G90 G1 X1 Y1 F9", "M06 T02", "G1 X1 Y1 F9", "X1 Y2"], ["G90G1X1Y1F9", "M6T2", "G1X1Y1F9", "Y2"]),
        (["G90 G1 X1 Y1", "W71", "G1 X2 Y2", "X2 Y3"], ["G90G1X1Y1", "W71", "G1X2Y2", "X2Y3"]),
        (["G90 G1 X1 Y1", "M30", "G1 X2 Y2", "X2 Y3"], ["G90G1X1Y1", "M30", "G1X2Y2", "X2Y3"]),
        (["G90 G1 X1 Y1", "G28 G91 Z0", "G1 X2 Y2", "X2 Y3"], ["G90G1X1Y1", "G28G91Z0", "G1X2Y2", "X2Y3"]),
        (["G90 G1 X1 Y1", "G55", "G1 X2 Y2", "X2 Y3"], ["G90G1X1Y1", "G55", "G1X2Y2", "X2Y3"]),
        (["G81 X1 Y1 Z-1 R1 F5", "G81 X2 F5"], ["G81X1Y1Z-1R1F5", "G81X2F5"]),
        # A block that changes nothing stays a block.
        (["G1 F100", "G1 F100", "G1"], ["G1F100", "G1", "G1"]),
        (["M3 S100", "M3 S100"], ["M3S100", "M3S100"]),
        (["G1 G17 X1", "G1 G17 X2"], ["G1G17X1", "G1G17X2"]),
        (["N5 (x)", "%"], ["", ""]),
    ],
)
def test_what_is_left_out(lines: list[str], expected: list[str]) -> None:
    assert compacted(*lines) == expected


def test_forget_drops_nothing_afterwards() -> None:
    compactor = Compactor(elvinto())
    block = parse_block("G90 G1 X1 Y1 F100")
    first = compactor.compact(block)
    assert compactor.compact(block) != first
    compactor.forget()
    assert compactor.compact(block) == first


@given(
    st.lists(program_lines, max_size=25),
    positions,
    st.sampled_from((True, False, None)),
)
@thorough
def test_the_motion_is_the_same(lines: list[str], position: Position, absolute: bool | None) -> None:
    compactor = Compactor(elvinto())
    original, shorter = machine(position, absolute), machine(position, absolute)
    for number, line in enumerate(lines, 1):
        block = parse_block(line)
        text = compactor.compact(block)
        assert not parse_block(text).faults
        original.step(number, block)
        shorter.step(number, parse_block(text))
        assert original.state.modes() == shorter.state.modes(), (line, text)
        assert len(text) <= len(clean(block))
    assert_same_motion(original.take(), shorter.take())


def machine(position: Position, absolute: bool | None) -> Interpreter:
    """A machine that stands there, by the reference interpreter."""
    state = power_on(elvinto())
    state.locate(dict(position))
    state.absolute = absolute
    return Interpreter(elvinto(), state)


def assert_same_motion(before: Segments, after: Segments) -> None:
    for name in ("line", "kind", "start", "end", "feed", "spindle", "sync", "dwell_s", "radius", "sweep", "centre"):
        np.testing.assert_allclose(getattr(before, name), getattr(after, name), rtol=0, atol=1e-9, err_msg=name)


class Rows:
    """Follows a reading: the runs by `kept`, the rest by `compact`."""

    def __init__(self, profile: str) -> None:
        self.table = CodeTable(load_profile(profile))
        self.compactor = Compactor(load_profile(profile))
        self.written: list[str] = []
        self.in_runs = 0

    def run(self, columns: Columns, blocks: Blocks, begin: int, end: int) -> None:
        at = begin
        while at < end:
            stop = self.compactor.first_distance(blocks, self.table, at, end)
            if stop > at:
                kept = self.compactor.kept(columns, blocks, self.table, at, stop)
                for row in range(at, stop):
                    words = columns.words_of(row)
                    offset = words_between(columns, at, stop).start
                    places = [place for place in range(words.start, words.stop) if kept[place - offset]]
                    self.written.append("".join(self._word(columns, place) for place in places))
                    self.in_runs += 1
            if stop < end:
                self.block(stop, columns.block(stop))
            at = stop + 1

    def block(self, row: int, block: Block) -> None:
        self.written.append(self.compactor.compact(block))

    def _word(self, columns: Columns, place: int) -> str:
        text = columns.text[columns.start[place] : columns.end[place]].decode()
        return chr(columns.letter[place]) + shortest(text)


def compacted_in_runs(lines: list[str], profile: str) -> Rows:
    rows = Rows(profile)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gcode.interpret, "SHORTEST_RUN", 1)
        reading = Reading(load_profile(profile))
        reading.read(read_columns("\n".join([*lines, ""]).encode()), follower=rows)
    return rows


@given(st.lists(program_lines, max_size=30))
@thorough
def test_many_rows_at_once_come_out_as_one_by_one(lines: list[str]) -> None:
    compactor = Compactor(elvinto())
    expected = [compactor.compact(parse_block(line)) for line in lines]
    rows = compacted_in_runs(lines, "elvinto")
    assert rows.written == expected
    # And it goes on alike, whatever is known by then.
    for line in ("G1 X10 Y0 F300", "X10 Y0", "G90", "X10 Y0 F300"):
        assert rows.compactor.compact(parse_block(line)) == compactor.compact(parse_block(line))


codes = st.sampled_from(("G20", "G21", "G93", "G94", "G18", "G17", "G54", "G55", "G53", "G4 P1", "G43.1 Z1", "G92 X5"))
grbl_lines = st.one_of(
    program_lines, program_lines, codes, st.builds("{} G1 X{} F300".format, codes, st.integers(0, 3))
)


@given(st.lists(grbl_lines, max_size=30), st.sampled_from(("grbl-1.1", "grblhal", "rs274ngc")))
@thorough
def test_many_rows_at_once_are_the_same_motion(lines: list[str], profile: str) -> None:
    rows = compacted_in_runs(lines, profile)
    original, shorter = Interpreter(load_profile(profile)), Interpreter(load_profile(profile))
    for number, (line, text) in enumerate(zip(lines, rows.written, strict=True), 1):
        original.step(number, parse_block(line))
        shorter.step(number, parse_block(text))
    assert_same_motion(original.take(), shorter.take())


@given(st.lists(motion_lines, min_size=1, max_size=20), st.lists(motion_lines, max_size=20), positions)
@thorough
def test_the_state_of_the_machine_before_does_not_matter(
    before: list[str], lines: list[str], position: Position
) -> None:
    """A machine in any state runs the compacted program as it would run the original."""
    compactor = Compactor(elvinto())
    original = machine(position, None)
    for line in before:
        original.step(1, parse_block(line))
    original.take()
    shorter = Interpreter(elvinto(), original.state.copy())
    for number, line in enumerate(lines, 1):
        original.step(number, parse_block(line))
        shorter.step(number, parse_block(compactor.compact(parse_block(line))))
    assert original.state.modes() == shorter.state.modes()
    assert_same_motion(original.take(), shorter.take())


@given(st.lists(st.text(max_size=25), max_size=10))
@thorough
def test_any_text_can_be_compacted(lines: list[str]) -> None:
    compactor = Compactor(elvinto())
    for line in lines:
        block = parse_block(line)
        assert bool(compactor.compact(block)) == bool(clean(block))
