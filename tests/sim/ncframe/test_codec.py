"""The lathe's reading of a frame: the documents' vectors, strictness, any bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.ncframe.codec import Block, Refused, decode, length, remainder


@pytest.mark.parametrize(
    ("written", "text"),
    [
        ("F7 00 03 00 9C 40 02 84 88 32 07 21", "G0 M3 X40000 Z165000 F50 S7 T33"),
        ("80 5A", "G90"),
        ("38 FF FF FF 80 00 00 7F FF FF", "X-1 Z-8388608 R8388607"),
        ("07 00 FF 10", "F0 S255 T16"),
    ],
)
def test_frames_of_the_documents(written: str, text: str) -> None:
    block = decode(bytes.fromhex(written), "none")
    assert block.text == text
    assert length(int(written[:2], 16)) == len(written.split())


@pytest.mark.parametrize(("check", "value"), [("xor", 0x31), ("crc8", 0xF4)])
def test_check_values_of_the_catalogue(check: str, value: int) -> None:
    assert remainder(b"123456789", check) == value


def test_the_check_byte_is_looked_at() -> None:
    assert decode(bytes([0x40, 3, 0x43]), "xor") == Block((("M", 3),))
    with pytest.raises(Refused, match="check"):
        decode(bytes([0x40, 3, 0x44]), "xor")


@pytest.mark.parametrize(
    ("written", "why"),
    [("00", "empty"), ("", "empty"), ("80", "length"), ("80 01 02", "length"), ("80 64", "G100"), ("40 FF", "M255")],
)
def test_what_is_no_frame(written: str, why: str) -> None:
    with pytest.raises(Refused, match=why):
        decode(bytes.fromhex(written), "none")


def test_a_word_by_its_letter() -> None:
    block = decode(bytes.fromhex("80 02"), "none")
    assert (block.get("G"), block.get("X")) == (2, None)


@given(st.binary(min_size=1, max_size=20), st.sampled_from(("none", "xor", "crc8")))
def test_any_bytes_are_a_block_or_refused(data: bytes, check: str) -> None:
    try:
        block = decode(data, check)
    except Refused:
        return
    assert block.words
