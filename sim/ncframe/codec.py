"""A block in binary form, read as the lathe's microcontroller reads it. A second reading of the document, from the
machine's side: no line of it is shared with the host's.

The one rule: what the document does not allow is refused with a word for the record, never mended.
"""

from dataclasses import dataclass
from typing import Final

ENQ: Final = b"\x05"
ACK: Final = b"\x06"
XON: Final = b"\x11"
XOFF: Final = b"\x13"
NAK: Final = b"\x15"
CAN: Final = b"\x18"

LETTERS: Final = "GMXZRFST"
"""Bit 7 of the head down to bit 0."""
_LONG: Final = "XZR"


class Refused(Exception):  # noqa: N818 - what the machine does, not an error of ours
    """This is no frame."""


@dataclass(frozen=True, slots=True)
class Block:
    """The words of a frame by letter, in order of the bits."""

    words: tuple[tuple[str, int], ...]

    def get(self, letter: str) -> int | None:
        for each, value in self.words:
            if each == letter:
                return value
        return None

    @property
    def text(self) -> str:
        return " ".join(f"{letter}{value}" for letter, value in self.words)


def length(head: int) -> int:
    """Bytes of a block, head included, check byte not."""
    total = 1
    for bit, letter in enumerate(reversed(LETTERS)):
        if head >> bit & 1:
            total += 3 if letter in _LONG else 1
    return total


def decode(data: bytes, check: str) -> Block:
    """A whole block with its check byte. Raises Refused."""
    if check != "none":
        data, sum_byte = data[:-1], data[-1]
        if remainder(data, check) != sum_byte:
            raise Refused("check")
    if not data or data[0] == 0:
        raise Refused("empty")
    if len(data) != length(data[0]):
        raise Refused("length")
    words: list[tuple[str, int]] = []
    rest = list(data[1:])
    for place, letter in enumerate(LETTERS):
        if not data[0] << place & 0x80:
            continue
        value = rest.pop(0)
        if letter in _LONG:
            value = value << 16 | rest.pop(0) << 8 | rest.pop(0)
            if value >= 1 << 23:
                value -= 1 << 24
        elif letter in "GM" and value > 99:
            raise Refused(f"{letter}{value}")
        words.append((letter, value))
    return Block(tuple(words))


def remainder(data: bytes, check: str) -> int:
    """XOR of all bytes, or what is left of the polynomial division by x^8 + x^2 + x + 1."""
    register = 0
    for byte in data:
        if check == "xor":
            register ^= byte
            continue
        for bit in range(7, -1, -1):
            carry = register >> 7 ^ byte >> bit & 1
            register = register << 1 & 0xFF
            if carry:
                register ^= 0x07
    return register
