"""G20 programs in millimetres, exactly."""

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from gcode.clean import clean
from gcode.inches import InchConverter
from gcode.words import parse_block
from tests.harness.programs import thorough


def converted(*lines: str) -> list[str]:
    converter = InchConverter()
    return [clean(converter.convert(parse_block(line))) for line in lines]


def test_lengths_and_feeds_become_millimetres() -> None:
    assert converted("G0 X1", "G20", "G1 X1 Y-.5 F10", "G2 I1 J0 R2 A90 S1000", "G21 X1", "X1") == [
        "G0X1",
        "G21",
        "G1X25.4Y-12.70F254.0",
        "G2I25.4J0.0R50.8A90S1000",
        "G21X1",
        "X1",
    ]


def test_units_hold_for_their_own_line() -> None:
    assert converted("G20 G1 X2") == ["G21G1X50.8"]


@given(st.from_regex(r"-?([0-9]{1,9}(\.[0-9]{0,15})?|\.[0-9]{1,15})", fullmatch=True))
@thorough
def test_nothing_is_rounded(number: str) -> None:
    converter = InchConverter()
    converter.convert(parse_block("G20"))
    (word,) = converter.convert(parse_block(f"X{number}")).words
    exact = Fraction(number.rstrip(".")) if not number.startswith((".", "-.")) else Fraction(number.replace(".", "0."))
    assert Fraction(word.text) == exact * Fraction("25.4")
    assert word.value == float(word.text)
