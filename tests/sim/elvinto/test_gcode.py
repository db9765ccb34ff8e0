"""Blocks as this controller reads them."""

from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.elvinto.gcode import (
    ERR_BAD_WORD,
    ERR_UNKNOWN_CODE,
    BlockError,
    Words,
    read_block,
    read_words,
    sd_blocks,
    split_batch,
)


@pytest.mark.parametrize(
    ("text", "codes", "values"),
    [
        ("G1X10Y-5.5F300", ("G1",), {"X": 10.0, "Y": -5.5, "F": 300.0}),
        ("G01 X.5 Y5. Z+2", ("G1",), {"X": 0.5, "Y": 5.0, "Z": 2.0}),
        ("g90g1x1 ", ("G90", "G1"), {"X": 1.0}),
        ("G81.99X1", ("G81.99",), {"X": 1.0}),
        ("M06T3", ("M6",), {"T": 3.0}),
        ("W95", ("W95",), {}),
        (" \tx 1  y-2 ", (), {"X": 1.0, "Y": -2.0}),
        ("", (), {}),
        ("G0 G28", ("G0", "G28"), {}),
    ],
)
def test_reads(text: str, codes: tuple[str, ...], values: dict[str, float]) -> None:
    words = read_block(text)
    assert words.codes == codes
    assert words.values == values


@pytest.mark.parametrize("code", ["G4P1", "G20", "G43", "G53", "G98", "M0", "M2", "M9", "W1", "G1.5", "G28.1", "G0G-0"])
def test_codes_that_do_not_exist_here(code: str) -> None:
    with pytest.raises(BlockError) as caught:
        read_block(code)
    assert caught.value.num == ERR_UNKNOWN_CODE


@pytest.mark.parametrize(
    "text",
    [
        "X",
        "G1X1X2",
        "(note)",
        "G1 X1 ;",
        "%",
        "N10G1",
        "G1X1e5",
        "G1X--1",
        "O100",
        "X9999999999",
        "X" + "9" * 400,
        "G0G1X1",
        "G28G92",
        "Ж1",
        "X1?Y2",
        "?X1",
        "E1",
        "X\u0661",
    ],
)
def test_blocks_that_are_none(text: str) -> None:
    with pytest.raises(BlockError) as caught:
        read_block(text)
    assert caught.value.num == ERR_BAD_WORD


@given(st.text(max_size=30))
def test_any_text_raises_nothing_but_a_block_error(text: str) -> None:
    with suppress(BlockError):
        read_block(text)


def test_nothing_between_two_bars_is_no_block() -> None:
    assert split_batch("G1X1|| G1X2 |") == ["G1X1", "G1X2"]
    assert split_batch("") == []


def test_a_file_on_the_card() -> None:
    content = "%\nO100 (name)\nN10 G1 X1 (there)\r\n; note\nG1X2;end\nM30\n%\n".encode("cp1251")
    assert list(sd_blocks(content, "cp1251")) == ["G1 X1", "G1X2", "M30"]


plain = st.builds(
    "".join,
    st.lists(
        st.sampled_from(
            ["G0", "G1", "G01", "G", "X1", "X-2.5", "X+3.", "X.5", "Y", "Y000012", "Z-0", "F300", "F1e3", " ", "M3"]
        ),
        max_size=5,
    ),
)


@given(st.one_of(plain, plain, st.text("GXYZF0123456789.+- ", max_size=20)))
@settings(max_examples=500, derandomize=True, deadline=None)
def test_the_usual_block_is_read_in_one_go_to_the_same_words(text: str) -> None:
    assert outcome(read_block, text) == outcome(read_words, text)


def outcome(read: Callable[[str], Words], text: str) -> Words | int:
    try:
        return read(text)
    except BlockError as error:
        return error.num
