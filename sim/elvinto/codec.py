"""The wire as the machine reads and writes it: messages up to `;`, parameters, the check header (standard §1, §2).

It knows no command and no ID rule. The one rule: whatever bytes come, `Reader` raises nothing and stays bounded.
"""

import base64
import binascii
import hashlib
from dataclasses import dataclass

BLANKS = b" \t\r\n"
_MARKS = frozenset(";,<")


def checksum(data: bytes) -> int:
    """The standard's `getCRC16` (§2), the summing inside the loop, `char` unsigned."""
    return sum(data.translate(_LOW)) + (data.translate(_HIGH).count(1) << 8) & 0xFFFF


def _term(byte: int) -> int:
    """What one byte adds; it fills nine bits."""
    doubled = byte << 1
    return doubled ^ (doubled & 0xFF00) >> 8


_LOW = bytes(_term(byte) & 0xFF for byte in range(256))
_HIGH = bytes(_term(byte) >> 8 for byte in range(256))
"""The terms of all bytes in two tables, so that a message is looked up and added up in one go each."""


def md5_hex(data: bytes) -> str:
    return hashlib.md5(data, usedforsecurity=False).hexdigest()


class MalformedError(Exception):
    """A message that does not keep to §1."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message taken apart; values are bytes, because Base64 may carry anything."""

    name: str
    params: dict[str, bytes]


def parse(raw: bytes) -> Message:
    """One message, with or without its `;`. Raises MalformedError."""
    name, *fields = raw.removesuffix(b";").split(b",")
    params: dict[str, bytes] = {}
    for text in fields:
        written, less, value = text.partition(b"<")
        key = written.strip(BLANKS).decode("latin-1")
        if not less or not key:
            raise MalformedError("a parameter without key or `<`")
        if key in params:
            raise MalformedError("a key twice")
        value = value.strip(BLANKS)
        params[key] = value[1:] if value.startswith(b"#") else _decoded(value)
    name = name.strip(BLANKS)
    if not name:
        raise MalformedError("no name")
    return Message(name.decode("latin-1"), params)


def _decoded(text: bytes) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise MalformedError("neither `#` nor Base64") from error


def message(name: str, *params: tuple[str, str], encoding: str = "utf-8") -> bytes:
    """A message to send. A value that is not plain printable ASCII free of `;` `,` `<` goes as Base64."""
    parts = [name.encode("ascii")]
    for key, value in params:
        data = value.encode(encoding)
        plain = data.isascii() and value.isprintable() and value == value.strip() and _MARKS.isdisjoint(value)
        parts.append(key.encode("ascii") + (b"<#" + data if plain else b"<" + base64.b64encode(data)))
    return b",".join(parts) + b";"


@dataclass(frozen=True, slots=True)
class CheckHeader:
    """What a header promises about the message right behind it. `id` is None when it carries none."""

    value: int
    md5: str
    id: int | None

    @classmethod
    def of(cls, found: Message, radix: int) -> "CheckHeader":
        """Raises MalformedError when VALUE or MD5 is missing or no number stands where one must."""
        try:
            wire_id = found.params.get("ID")
            value = found.params["VALUE"]
            # int() would also take blanks, signs and `_`.
            if not value.isalnum() or not (wire_id is None or wire_id.isalnum()):
                raise MalformedError("a number with signs in it")
            return cls(
                value=int(value, radix),
                md5=found.params["MD5"].decode("ascii").lower(),
                id=None if wire_id is None else int(wire_id),
            )
        except (KeyError, ValueError) as error:
            raise MalformedError("header without a readable VALUE and MD5") from error

    def covers(self, data: bytes) -> bool:
        """Both must match: VALUE alone is no protection against swapped bytes."""
        return self.value == checksum(data) and self.md5 == md5_hex(data)


def with_header(data: bytes, *, name: str, radix: int) -> bytes:
    """The header of the machine's own messages has no ID: it numbers nothing (§5)."""
    value = format(checksum(data), "x" if radix == 16 else "d")
    return f"{name},VALUE<#{value},MD5<#{md5_hex(data)};".encode("ascii") + data


class Reader:
    """Bytes in any pieces → whole messages with their `;`, blanks before them taken off. Counts what was too long."""

    def __init__(self, limit_bytes: int) -> None:
        self.overlong = 0
        self._limit_bytes = limit_bytes
        self._rest = b""
        self._skipping = False

    def clear(self) -> None:
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """An over-long message comes out as b"" at its `;`: it still stands between a header and what follows."""
        *whole, self._rest = (self._rest + data).split(b";")
        messages: list[bytes] = []
        for text in whole:
            if self._skipping or len(text) >= self._limit_bytes:
                self.overlong += 1
                self._skipping = False
                messages.append(b"")
            else:
                messages.append(text.lstrip(BLANKS) + b";")
        if len(self._rest) >= self._limit_bytes:
            self._rest = b""
            self._skipping = True
        return messages
