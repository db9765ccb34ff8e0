"""What goes out of a block: words only."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.clean import clean
from gcode.words import parse_block
from tests.harness.programs import program_lines, thorough


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("N10 G1 X10.000 (fast) Y+5 ; end", "G1X10.000Y+5"),
        ("O1234", ""),
        ("%", ""),
        ("(Привет)", ""),
        ("/G0 X1", "G0X1"),
        ("g1 x 1 0", "G1X10"),
    ],
)
def test_clean(text: str, expected: str) -> None:
    assert clean(parse_block(text)) == expected


def test_block_delete_is_a_switch() -> None:
    assert clean(parse_block("/G0 X1"), block_delete=True) == ""
    assert clean(parse_block("G0 X1"), block_delete=True) == "G0X1"


@given(st.text(max_size=40) | program_lines)
@thorough
def test_the_wire_never_sees_anything_but_words(text: str) -> None:
    sent = clean(parse_block(text))
    assert set(sent) <= set("ABCDEFGHIJKLMPQRSTUVWXYZ0123456789.+-")
    again = parse_block(sent)
    assert not again.faults
    assert clean(again) == sent
