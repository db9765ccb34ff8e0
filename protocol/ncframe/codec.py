"""NC frames as bytes and as text, the check byte, the control bytes (ncframe §2, §4). No times, no state.

A frame is a head of eight bits, one for each item that is there, and the items in the order of the bits. The one rule:
what comes out of `to_bytes` and `to_text` goes back in and is the same; anything else is a FrameError that says what.
"""

import re
from dataclasses import dataclass, fields, replace
from typing import Final, Literal

from protocol.errors import MillstreamError

Check = Literal["none", "xor", "crc8"]

ENQ: Final = 0x05
"""Host: are you there, and how many frames have you executed?"""
ACK: Final = 0x06
"""Machine: the frame is executed, send the next; also the answer to ENQ."""
XON: Final = 0x11
XOFF: Final = 0x13
NAK: Final = 0x15
"""Machine: what came was no good frame; it was not executed."""
CAN: Final = 0x18
"""Both: everything stops, nothing of it goes on."""

COUNT_BYTES: Final = 4
"""Of the counter in the answer to ENQ: frames executed since the machine's start, modulo 2**32, big endian."""
COUNT_MODULUS: Final = 1 << 8 * COUNT_BYTES

CODE_MOST: Final = 99
"""G and M: a hundred codes each (the source, 1.2)."""
COUNTS_MOST: Final = (1 << 23) - 1
"""X, Z and R: 24 bits, two's complement."""
BYTE_MOST: Final = 255
"""F, S and T."""

CRC8_POLYNOMIAL: Final = 0x07

_WORD: Final = re.compile(r"([GMXZRFST])(0|-?[1-9][0-9]{0,8})")


class FrameError(MillstreamError, ValueError):
    """This is no frame; the message names the item or the byte."""


@dataclass(frozen=True, slots=True)
class _Item:
    """One item: its letter, its bit in the head, its bytes, its range. `width` 3 is signed."""

    letter: str
    bit: int
    width: int
    least: int
    most: int


_ITEMS: Final = tuple(
    _Item(letter, 0x80 >> place, width, least, most)
    for place, (letter, width, least, most) in enumerate(
        (
            ("G", 1, 0, CODE_MOST),
            ("M", 1, 0, CODE_MOST),
            ("X", 3, -COUNTS_MOST - 1, COUNTS_MOST),
            ("Z", 3, -COUNTS_MOST - 1, COUNTS_MOST),
            ("R", 3, -COUNTS_MOST - 1, COUNTS_MOST),
            ("F", 1, 0, BYTE_MOST),
            ("S", 1, 0, BYTE_MOST),
            ("T", 1, 0, BYTE_MOST),
        )
    )
)


@dataclass(frozen=True, slots=True)
class Frame:
    """One block. None: the item is not in the frame, because it has not changed. `x`, `z`, `r` are increments and the
    radius in counts of the machine's resolution; `f`, `s`, `t` one byte each. Raises FrameError."""

    g: int | None = None
    m: int | None = None
    x: int | None = None
    z: int | None = None
    r: int | None = None
    f: int | None = None
    s: int | None = None
    t: int | None = None

    def __post_init__(self) -> None:
        for item, value in zip(_ITEMS, self._values(), strict=True):
            if value is not None and not item.least <= value <= item.most:
                raise FrameError(f"{item.letter}{value} is not from {item.least} to {item.most}")
        if self.head == 0:
            raise FrameError("a frame without items: nothing would be executed")

    def _values(self) -> tuple[int | None, ...]:
        return (self.g, self.m, self.x, self.z, self.r, self.f, self.s, self.t)

    @property
    def head(self) -> int:
        """The first byte: which items follow."""
        return sum(item.bit for item, value in zip(_ITEMS, self._values(), strict=True) if value is not None)

    @property
    def sendable(self) -> "Frame":
        """The same to the machine, with a head that is not taken for ENQ (F and T alone) or CAN (Z and R alone): an X
        increment of zero stands in it."""
        return replace(self, x=0) if self.head in (ENQ, CAN) else self

    def to_bytes(self) -> bytes:
        """Without a check byte."""
        parts = [bytes([self.head])]
        for item, value in zip(_ITEMS, self._values(), strict=True):
            if value is not None:
                parts.append(value.to_bytes(item.width, "big", signed=item.width > 1))
        return b"".join(parts)

    @classmethod
    def from_bytes(cls, data: bytes) -> "Frame":
        """A whole frame without a check byte and nothing else. Raises FrameError."""
        if not data:
            raise FrameError("no byte is no frame")
        if len(data) != frame_bytes(data[0]):
            raise FrameError(f"head {data[0]:02X} makes a frame of {frame_bytes(data[0])} bytes, not of {len(data)}")
        values: dict[str, int] = {}
        at = 1
        for item in _ITEMS:
            if data[0] & item.bit:
                values[item.letter.lower()] = int.from_bytes(data[at : at + item.width], "big", signed=item.width > 1)
                at += item.width
        return cls(**values)

    def to_text(self) -> str:
        """`G0 M3 X40000 Z165000 F50 S7 T33`: the items that are there, in their order."""
        return " ".join(
            f"{item.letter}{value}" for item, value in zip(_ITEMS, self._values(), strict=True) if value is not None
        )

    @classmethod
    def from_text(cls, text: str) -> "Frame":
        """The way back, exactly: `to_text` of the result is `text`. Raises FrameError."""
        values: dict[str, int] = {}
        words = text.split(" ")
        for word in words:
            found = _WORD.fullmatch(word)
            if found is None:
                raise FrameError(
                    f"{word[:20]!r} in {text[:80]!r} is no item: a letter of GMXZRFST and a whole number are wanted"
                )
            values.setdefault(found[1].lower(), int(found[2]))
        frame = cls(**values)
        if len(values) != len(words) or frame.to_text() != text:
            raise FrameError(f"{text[:80]!r} has its items twice or out of order: {frame.to_text()!r} is wanted")
        return frame


assert tuple(field.name.upper() for field in fields(Frame)) == tuple(item.letter for item in _ITEMS)


def frame_bytes(head: int) -> int:
    """How long a frame with this head is, without the check byte: 1 (an empty one, which is refused) to 15."""
    return 1 + sum(item.width for item in _ITEMS if head & item.bit)


def check_bytes(data: bytes, check: Check) -> bytes:
    """The check byte over head and items, or nothing. XOR from 0; CRC-8 with polynomial 0x07 from 0, nothing
    reflected or inverted (its check value over "123456789" is 0xF4)."""
    match check:
        case "none":
            return b""
        case "xor":
            value = 0
            for byte in data:
                value ^= byte
        case "crc8":
            value = 0
            for byte in data:
                value = _CRC8[value ^ byte]
    return bytes([value])


def seal(frame: Frame, check: Check) -> bytes:
    """The bytes of a frame on the wire."""
    data = frame.to_bytes()
    return data + check_bytes(data, check)


def _crc8_of(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1) ^ (CRC8_POLYNOMIAL if byte & 0x80 else 0)
    return byte & 0xFF


_CRC8: Final = tuple(_crc8_of(byte) for byte in range(256))
