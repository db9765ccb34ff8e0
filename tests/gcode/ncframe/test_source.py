"""Lines to blocks: commas, `;`, LF, brackets, and columns that stay what they were."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.ncframe.source import MAX_PADDING, Semicolon, blocks_of_line, blocks_of_lines
from gcode.words import parse_block
from tests.harness.programs import quick


def blocks(raw: bytes, semicolon: Semicolon = "end") -> list[bytes]:
    return [block.strip() for block in blocks_of_line(raw, semicolon)]


@pytest.mark.parametrize(
    ("raw", "found"),
    [
        (b"G1 X1", [b"G1 X1"]),
        (b"G00,X1,Z2,LF", [b"G00 X1 Z2"]),
        (b"G0 X1;G1 Z2;", [b"G0 X1", b"G1 Z2"]),
        (b"G0 X1lf G1 Z2", [*[b"G0 X1lf G1 Z2"][:0], b"G0 X1", b"G1 Z2"]),
        (b"G0 (a;b,c LF) X1", [b"G0 (a;b,c LF) X1"]),
        (b"G0 (open ; X1, Z2", [b"G0 (open ; X1, Z2"]),
        (b"; a remark, G1 X5", [b""]),
        (b"  ;G1 X5", [b""]),
        (b"% a; b", [b"% a; b"]),
        (b"// a; G1", [b"// a; G1"]),
        (b"LF", [b""]),
        (b";;;", [b""]),
        (b",", [b""]),
        (b"", [b""]),
        (b"L1F2", [b"L1F2"]),
        (b"XLF", [b"XLF"]),
    ],
)
def test_what_ends_a_block(raw: bytes, found: list[bytes]) -> None:
    assert blocks(raw) == found


def test_a_semicolon_may_begin_a_remark_instead() -> None:
    assert blocks(b"G0,X1 ; fast; G1 X2", "remark") == [b"G0 X1"]


def test_the_mark_of_an_expanded_line_is_no_block() -> None:
    assert blocks(b"G0 X1 ;@12") == [b"G0 X1"]
    assert blocks(b"G0 X1;X2 ;@3") == [b"G0 X1", b"X2"]


def test_columns_stay_those_of_the_line() -> None:
    raw = b"G0,X1;G1 Z2,F9"
    words = [word for block in blocks_of_line(raw, "end") for word in parse_block(block.decode()).words]
    assert [raw[word.column - 1 : word.column].decode() for word in words] == [word.letter for word in words]


def test_every_block_has_the_number_of_its_line() -> None:
    assert list(blocks_of_lines([(4, b"G0;X1"), (9, b"X2")], "end")) == [(4, b"G0"), (4, b"   X1"), (9, b"X2")]


def test_a_hostile_line_makes_no_square_of_itself() -> None:
    made = list(blocks_of_line(b"X;" * 50_000, "end"))
    assert len(made) == 50_000
    assert sum(map(len, made)) < 50_000 + MAX_PADDING * MAX_PADDING


@quick
@given(st.binary(max_size=60), st.sampled_from(["end", "remark"]))
def test_any_bytes_are_blocks(raw: bytes, semicolon: Semicolon) -> None:
    made = list(blocks_of_line(raw, semicolon))
    assert made
    if (
        not raw.strip().startswith((b";", b"%", b"//"))
        and b";" not in raw
        and b"," not in raw
        and b"f" not in raw.lower()
    ):
        assert made == [raw if raw.strip() else b""] or made == [raw]
