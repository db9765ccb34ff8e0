"""Compaction: shorter, and never another motion."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.clean import clean
from gcode.compact import Compactor
from gcode.modal import Tracker
from gcode.motion import Motion, Position
from gcode.words import parse_block
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
    original = Tracker(elvinto(), Motion(), position, absolute=absolute)
    shorter = Tracker(elvinto(), Motion(), position, absolute=absolute)
    for line in lines:
        block = parse_block(line)
        text = compactor.compact(block)
        again = parse_block(text)
        assert not again.faults
        step, step_again = original.step(block), shorter.step(again)
        assert (step.moves, step.kind, step.end, step.arc) == (
            step_again.moves,
            step_again.kind,
            step_again.end,
            step_again.arc,
        ), (line, text)
        assert step.seconds == pytest.approx(step_again.seconds, abs=1e-9)
        assert step.length_mm == pytest.approx(step_again.length_mm, abs=1e-9)
        assert original.position == shorter.position
        assert original.modal == shorter.modal
        assert len(text) <= len(clean(block))


@given(st.lists(motion_lines, min_size=1, max_size=20), st.lists(motion_lines, max_size=20), positions)
@thorough
def test_the_state_of_the_machine_before_does_not_matter(
    before: list[str], lines: list[str], position: Position
) -> None:
    """A machine in any state runs the compacted program as it would run the original."""
    compactor = Compactor(elvinto())
    original = Tracker(elvinto(), Motion(), position, absolute=None)
    for line in before:
        original.step(parse_block(line))
    shorter = original.copy()
    for line in lines:
        original.step(parse_block(line))
        shorter.step(parse_block(compactor.compact(parse_block(line))))
    assert (original.position, original.modal) == (shorter.position, shorter.modal)


@given(st.lists(st.text(max_size=25), max_size=10))
@thorough
def test_any_text_can_be_compacted(lines: list[str]) -> None:
    compactor = Compactor(elvinto())
    for line in lines:
        block = parse_block(line)
        assert bool(compactor.compact(block)) == bool(clean(block))
