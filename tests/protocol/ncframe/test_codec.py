"""Frames as bytes and as text. Golden vectors come from the source and the catalogue of CRCs, not from our encoder."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.ncframe.codec import CAN, ENQ, Check, Frame, FrameError, check_bytes, frame_bytes, seal

GOLDEN = [
    ("G0 M3 X40000 Z165000 F50 S7 T33", "F7 00 03 00 9C 40 02 84 88 32 07 21"),  # the source, 1.2.3
    ("G90", "80 5A"),  # the source, 1.2.2
    ("M3", "40 03"),
    ("X1", "20 00 00 01"),
    ("X-1", "20 FF FF FF"),
    ("Z8388607", "10 7F FF FF"),
    ("Z-8388608", "10 80 00 00"),
    ("G2 X-256 Z256 R-65536", "B8 02 FF FF 00 00 01 00 FF 00 00"),
    ("F0 S255 T1", "07 00 FF 01"),
    ("G99 M99 X0 Z0 R0 F255 S255 T255", "FF 63 63 00 00 00 00 00 00 00 00 00 FF FF FF"),
]


@pytest.mark.parametrize(("text", "written"), GOLDEN)
def test_text_and_bytes_of_the_documents(text: str, written: str) -> None:
    data = bytes.fromhex(written)
    assert Frame.from_text(text).to_bytes() == data
    assert Frame.from_bytes(data).to_text() == text
    assert frame_bytes(data[0]) == len(data)


@pytest.mark.parametrize(("check", "value"), [("none", ""), ("xor", "31"), ("crc8", "F4")])
def test_check_values_of_the_catalogue(check: Check, value: str) -> None:
    assert check_bytes(b"123456789", check) == bytes.fromhex(value)


def test_the_check_byte_stands_behind_the_frame() -> None:
    assert seal(Frame(m=3), "xor") == bytes([0x40, 0x03, 0x43])
    assert seal(Frame(m=3), "none") == bytes([0x40, 0x03])


@pytest.mark.parametrize(
    ("items", "named"),
    [
        ({"g": 100}, "G100 is not from 0 to 99"),
        ({"m": -1}, "M-1"),
        ({"x": 1 << 23}, "X8388608 is not from -8388608 to 8388607"),
        ({"z": -(1 << 23) - 1}, "Z-8388609"),
        ({"r": 1 << 30}, "R1073741824"),
        ({"f": 256}, "F256 is not from 0 to 255"),
        ({"s": 300}, "S300"),
        ({"t": -5}, "T-5"),
        ({}, "without items"),
    ],
)
def test_ranges_name_the_item(items: dict[str, int], named: str) -> None:
    with pytest.raises(FrameError, match=named):
        Frame(**items)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "''"),
        ("G00", "'G00'"),
        ("X+5", r"'X\+5'"),
        ("X-0", "'X-0'"),
        ("X1.5", r"'X1.5'"),
        ("x1", "'x1'"),
        ("G0  X1", "''"),
        (" G0", "''"),
        ("G0\n", "G0"),
        ("A5", "'A5'"),
        ("X1 G0", "out of order: 'G0 X1'"),
        ("X1 X1", "twice"),
        ("X1 X2", "twice"),
        ("X9999999999", "'X9999999999'"),
        ("X٣", "is no item"),
    ],
)
def test_text_is_taken_as_it_must_be_or_not_at_all(text: str, named: str) -> None:
    with pytest.raises(FrameError, match=named):
        Frame.from_text(text)


@pytest.mark.parametrize("written", ["", "00", "80", "80 00 00", "20 00 00", "80 64", "40 FF"])
def test_bytes_that_are_no_frame(written: str) -> None:
    with pytest.raises(FrameError):
        Frame.from_bytes(bytes.fromhex(written))


SIGNED = st.none() | st.integers(-(1 << 23), (1 << 23) - 1)
BYTE = st.none() | st.integers(0, 255)
CODE = st.none() | st.integers(0, 99)
ITEMS = st.tuples(CODE, CODE, SIGNED, SIGNED, SIGNED, BYTE, BYTE, BYTE)
FRAMES = ITEMS.filter(lambda items: any(item is not None for item in items)).map(lambda items: Frame(*items))


@given(FRAMES)
def test_there_and_back(frame: Frame) -> None:
    assert Frame.from_bytes(frame.to_bytes()) == frame
    assert Frame.from_text(frame.to_text()) == frame


@given(FRAMES)
def test_no_frame_that_is_sent_begins_like_a_control_byte(frame: Frame) -> None:
    sent = frame.sendable
    assert sent.head not in (ENQ, CAN)
    assert (sent.x or 0) == (frame.x or 0)
    assert [sent.g, sent.m, sent.z, sent.r, sent.f, sent.s, sent.t] == [
        *(frame.g, frame.m, frame.z, frame.r, frame.f, frame.s, frame.t)
    ]
    assert (sent == frame) == (frame.head not in (ENQ, CAN))


@given(st.binary(max_size=20))
def test_any_bytes_are_a_frame_or_a_frame_error(data: bytes) -> None:
    try:
        frame = Frame.from_bytes(data)
    except FrameError:
        return
    assert frame.to_bytes() == data


@given(st.text(max_size=40))
def test_any_text_is_a_frame_or_a_frame_error(text: str) -> None:
    try:
        frame = Frame.from_text(text)
    except FrameError:
        return
    assert frame.to_text() == text


@given(FRAMES, st.data())
def test_the_crc_sees_up_to_three_flipped_bits(frame: Frame, data: st.DataObject) -> None:
    sealed = bytearray(seal(frame, "crc8"))
    bits = data.draw(st.sets(st.integers(0, 8 * len(sealed) - 1), min_size=1, max_size=3))
    for bit in bits:
        sealed[bit // 8] ^= 1 << bit % 8
    assert check_bytes(bytes(sealed[:-1]), "crc8") != bytes(sealed[-1:])
