"""Numbers in a buffer are those of `float`, to the last bit and to the sign of zero."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.decimals import PAD_BYTES, read_decimals
from tests.harness.programs import thorough

whole = st.text("0123456789", max_size=9)
fraction = st.text("0123456789", max_size=15)
texts = st.tuples(st.sampled_from(("", "-")), whole, st.sampled_from(("", ".")), fraction).map(
    lambda parts: "".join(parts if parts[2] else parts[:2])
)
numbers = texts.filter(lambda text: any(char.isdigit() for char in text))


def read(*numbers: str) -> list[float]:
    """All in one buffer, with digits between them that belong to none."""
    buffer = b"9" * PAD_BYTES
    ends = []
    for number in numbers:
        buffer += number.encode()
        ends.append(len(buffer))
        buffer += b"7"
    unsigned = [number.lstrip("-") for number in numbers]
    values = read_decimals(
        buffer,
        np.array(ends, np.int32),
        np.array([len(number) for number in unsigned], np.int32),
        np.array([len(number.partition(".")[2]) for number in unsigned], np.int32),
        np.array(["." in number for number in unsigned], np.bool_),
        np.array([number.startswith("-") for number in numbers], np.bool_),
    )
    return values.tolist()


@given(st.lists(numbers, min_size=1, max_size=20))
@thorough
def test_values_are_those_of_float(numbers: list[str]) -> None:
    assert [value.hex() for value in read(*numbers)] == [float(number).hex() for number in numbers]


@pytest.mark.parametrize(
    "number",
    [
        *("0", "-0", "-.0", "7.", ".7", "0.1", "12345678", "1234567.", ".1234567", "1234.567", "-123.4567"),
        *("123456789", "12345678.9", "123456789.", ".123456789012345", "123456789.123456789012345"),
        # Around 2**53, where a mantissa is not exact any more, and halfway between two floats.
        *("9007199.254740991", "9007199.254740992", "9007199.254740993", "90071992.54740993", "9.007199254740993"),
        *("000000000.000000000000000", "-000000000.000000000000000", "000000001.000000000000001"),
    ],
)
def test_edges(number: str) -> None:
    assert read(number, "-3.25") == [float(number), -3.25]
    assert read(number)[0].hex() == float(number).hex()


def test_short_and_long_ones_side_by_side() -> None:
    side_by_side = ("1.5", "123456.789", "-2", "-123456789.123456789012345", "0.300000000000004")
    assert read(*side_by_side) == [float(number) for number in side_by_side]
