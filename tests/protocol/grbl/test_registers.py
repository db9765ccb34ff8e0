"""Offsets, start-up blocks and the info text as lines: golden lines, and everything that must be warned of."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.grbl.lines import read_line
from protocol.grbl.registers import SYSTEMS, dangers, kept_text, offset_block, unsendable


@pytest.mark.parametrize(
    ("system", "mode", "axes", "inches", "block"),
    [
        ("G54", "here", {"x": 0.0, "y": 0.0}, False, "G10L20P1X0Y0"),
        ("G59", "absolute", {"x": -120.5, "z": -3.0}, False, "G10L2P6X-120.5Z-3"),
        ("active", "here", {"z": 10.0}, False, "G10L20P0Z10"),
        ("G59.3", "absolute", {"a": 90.0}, False, "G10L2P9A90"),
        ("G54", "here", {"x": 25.4, "y": 1.0}, True, "G10L20P1X1Y0.03937"),
        ("G54", "here", {"x": -0.00001}, False, "G10L20P1X0"),
    ],
)
def test_offsets_as_blocks(system: str, mode: str, axes: dict[str, float], inches: bool, block: str) -> None:
    assert offset_block(system, mode, axes, inches=inches) == block  # type: ignore[arg-type]


@given(
    st.sampled_from(sorted(SYSTEMS)),
    st.dictionaries(st.sampled_from("xyz"), st.floats(-1e5, 1e5), min_size=1),
    st.booleans(),
)
def test_every_offset_is_a_line_that_goes_alone(system: str, axes: dict[str, float], inches: bool) -> None:
    block = offset_block(system, "here", axes, inches=inches)
    assert read_line(block, 79).alone, "the controller is deaf while it stores it"
    for letter, number in re.findall(r"([XYZ])([-0-9.]+)", block):
        assert float(number) * (25.4 if inches else 1.0) == pytest.approx(axes[letter.lower()], abs=1e-4)


@pytest.mark.parametrize(
    ("text", "kept"),
    [("my mill", "MYMILL"), ("A (old) b", "AB"), ("a;b", "A"), ("1/2", "12"), ("", ""), ("a(b", "A"), ("\tA", "A")],
)
def test_what_grbl_keeps_of_a_line(text: str, kept: str) -> None:
    assert kept_text(text) == kept


@pytest.mark.parametrize(
    ("prefix", "text", "wrong"),
    [
        ("$I=", "MYMILL", None),
        ("$I=", "", None),
        ("$I=", "x" * 76, None),
        ("$I=", "x" * 77, "77 characters without blanks; 76 fit"),
        ("$I=", "x " * 76, None),
        ("$I=", "why?", "'?'"),
        ("$I=", "Fräse", "'ä'"),
        ("$I=", "a\nb", r"'\n'"),
        ("$N0=", "x" * 76, "75 fit"),
    ],
)
def test_what_cannot_be_a_line(prefix: str, text: str, wrong: str | None) -> None:
    said = unsendable(prefix, text)
    assert (said is None) if wrong is None else (said is not None and wrong in said)


@pytest.mark.parametrize("block", ["", "G21", "G90 G94", "G54", "M5 M9", "S1000", "F600", "G92 X0 Y0", "G4 P1", "T1"])
def test_blocks_that_do_no_harm(block: str) -> None:
    assert dangers(block) == []


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("G0 X10", ["G0 moves the machine"]),
        ("g1x1f100", ["G1 moves the machine"]),
        ("G28", ["G28 moves the machine"]),
        ("G30", ["G30 moves the machine"]),
        ("G38.2 Z-5 F10", ["G38.2 moves the machine"]),
        ("G81 X1 Z-1 R1", ["G81 moves the machine"]),
        ("X10", ["axis words without a G word move the machine"]),
        ("G54 Z1", ["axis words without a G word move the machine"]),
        ("G10 L2 P1 X0", ["G10 writes the controller's memory"]),
        ("G28.1", ["G28.1 writes the controller's memory"]),
        ("G30.1", ["G30.1 writes the controller's memory"]),
        ("M3 S1000", ["M3 starts the spindle"]),
        ("M4", ["M4 starts the spindle"]),
        ("M8", ["M8 starts the coolant"]),
        ("G0 X1 M3", ["G0 moves the machine", "M3 starts the spindle"]),
        ("$H", ["$H is a command of the controller, no G-code"]),
        ("#1=3", ["#1=3 is not understood; what it does is not known"]),
    ],
)
def test_blocks_that_somebody_must_want(block: str, said: list[str]) -> None:
    assert dangers(block) == said


@given(st.text(max_size=40))
def test_any_text_is_judged_without_raising(text: str) -> None:
    dangers(text)
    unsendable("$N0=", text)
