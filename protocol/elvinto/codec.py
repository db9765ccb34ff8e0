"""Messages of the ElVinto standard: text to bytes and back, checksum, check header. No IDs' meaning, no timing.

The one rule: the reader takes any bytes in any pieces, never raises and never grows past `max_message_bytes`.
Source: ElVinto standard v11, §1 (messages), §2 (check header); docs/elvinto.md.
"""

import base64
import binascii
import hashlib
import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from protocol.elvinto.dialect import Dialect
from protocol.errors import MessageTooLongError
from protocol.events import ProtocolFault

END = b";"
HEADER_NAMES = frozenset({"CRC16", "CRC"})
BLANKS = " \t\r\n"
_BLANKS = BLANKS.encode()
CONSOLE_TEXT_LIMIT = 600
"""Characters of a message kept in a fault's text: a machine that babbles must not fill the log."""

_PLAIN = re.compile(r"[!-~](?:[ -~]*[!-~])?|")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_usual_field = re.compile(r"([A-Za-z][A-Za-z0-9_]*)<#([^<\s]*)").fullmatch
"""A plain value and no blank anywhere: what a machine writes. Everything else is taken apart with more care."""
# elvinto §1: `SPEED<#0 ALARMNUM<#5`: the standard prints the optional fields without a comma.
_MISSING_COMMA = re.compile(r"#\s*([-+.\d]*)\s+([A-Za-z][A-Za-z0-9_]*<.*)", re.DOTALL)
_ASCII = bytes(range(128))


class MalformedError(ValueError):
    """A message is not as the standard demands. Stays inside the codec: readers report a ProtocolFault."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message as it was read: `params` decoded, `text` as it stood on the wire."""

    name: str
    params: Mapping[str, str] = field(default_factory=dict)
    text: str = ""


def checksum(data: bytes) -> int:
    """The standard's simple checksum over `data`, 0-65535.

    §2 adds up each byte shifted left by one, its high byte folded into the low one by XOR. The high byte is 1 where the
    byte is above 127, and the low bit that it meets is 0: so the fold adds 1 for each such byte.
    """
    return 2 * sum(data) + len(data.translate(None, _ASCII)) & 0xFFFF


def encode_message(name: str, params: Mapping[str, str] | None = None, *, encoding: str = "utf-8") -> bytes:
    """One message, its `;` included. Values that cannot stand plain travel as Base64."""
    parts = [name, *(f"{key}<{_encode_value(value, encoding)}" for key, value in (params or {}).items())]
    return ",".join(parts).encode("ascii") + END


def _encode_value(value: str, encoding: str) -> str:
    if _PLAIN.fullmatch(value) and not (";" in value or "," in value or "<" in value):
        return "#" + value
    return base64.b64encode(value.encode(encoding)).decode("ascii")


def encode_gcode(blocks: tuple[str, ...]) -> bytes:
    """`GCODE,DATA<#block|block;`"""
    return encode_message("GCODE", {"DATA": "|".join(blocks)})


def frame(message: bytes, id: int, dialect: Dialect) -> bytes:
    """Check header and message, as they go out. Raises MessageTooLongError past the machine's buffer."""
    if len(message) > dialect.max_message_bytes:
        raise MessageTooLongError(
            f"a message of {len(message)} bytes does not fit the limit of {dialect.max_message_bytes}; "
            "send fewer blocks in one batch"
        )
    covered = _covered(message, dialect)
    value = checksum(covered)
    digits = f"{value:x}" if dialect.crc_radix == 16 else str(value)
    md5 = hashlib.md5(covered, usedforsecurity=False).hexdigest()
    return f"{dialect.header_name},VALUE<#{digits},MD5<#{md5},ID<#{id};".encode("ascii") + message


def _covered(message: bytes, dialect: Dialect) -> bytes:
    """The bytes under the checksum. Scope `gcode` is a literal reading of §2: `G28;` for `GCODE,DATA<#G28;`."""
    if dialect.checksum_scope == "gcode" and message.startswith(b"GCODE,"):
        data = parse_message(message, dialect.encoding).params.get("DATA", "")
        return data.encode(dialect.encoding) + END
    return message


def parse_message(raw: bytes, encoding: str = "utf-8") -> Message:
    """Read one message, its `;` included. Raises MalformedError."""
    text = raw.decode("latin-1").strip(BLANKS)
    name, *fields = text.removesuffix(";").split(",")
    name = name.strip(BLANKS)
    if not _NAME.fullmatch(name):
        raise MalformedError("no message name")
    params: dict[str, str] = {}
    for part in fields:
        usual = _usual_field(part)
        for key, value in _parse_fields(part, encoding) if usual is None else (usual.groups(),):
            if key in params:
                raise MalformedError(f"{key} appears twice")
            params[key] = value
    return Message(name, params, text)


def _parse_fields(part: str, encoding: str) -> list[tuple[str, str]]:
    """The parameter in `part`; more than one where the standard forgot the comma."""
    key, separator, value = part.partition("<")
    key, value = key.strip(BLANKS), value.strip(BLANKS)
    if not separator or not _NAME.fullmatch(key):
        raise MalformedError("a parameter is KEY<VALUE")
    if not value.startswith("#"):
        return [(key, _decode_base64(value, key, encoding))]
    if "<" not in value:
        return [(key, value[1:].strip(BLANKS))]
    split = _MISSING_COMMA.fullmatch(value)
    if split is None:
        raise MalformedError(f"'<' inside the plain value of {key}")
    return [(key, split[1]), *_parse_fields(split[2], encoding)]


def _decode_base64(value: str, key: str, encoding: str) -> str:
    try:
        return base64.b64decode(value, validate=True).decode(encoding, errors="replace")
    except (binascii.Error, ValueError) as error:
        raise MalformedError(f"the value of {key} is neither plain nor Base64") from error


class Decoder:
    """Bytes from the machine → verified messages and faults. One per connection."""

    def __init__(self, dialect: Dialect) -> None:
        self._dialect = dialect
        self._buffer = b""
        self._skipping = False
        self._header: Mapping[str, str] | None = None
        self._items: deque[Message | ProtocolFault] = deque()

    def receive_data(self, data: bytes) -> None:
        """Take bytes in any pieces."""
        *ended, rest = data.split(END)
        for text in ended:
            self._take(text + END)
            raw, self._buffer = self._buffer, b""
            if not self._skipping:
                self._message(raw)
            self._skipping = False
        if rest:
            self._take(rest)

    def _take(self, text: bytes) -> None:
        """Bytes of one message, to those that came before; elvinto §1: over-long is skipped up to the next `;`."""
        if self._skipping:
            return
        self._buffer += text
        if len(self._buffer) > self._dialect.max_message_bytes:
            self._fault("too_long", f"over {self._dialect.max_message_bytes} bytes without ';'")
            self._skipping = True
            self._header = None
            self._buffer = b""

    def next_item(self) -> Message | ProtocolFault | None:
        """The oldest message or fault that was not taken yet."""
        return self._items.popleft() if self._items else None

    def _fault(self, kind: str, detail: str) -> None:
        self._items.append(ProtocolFault(kind, detail[:CONSOLE_TEXT_LIMIT]))  # type: ignore[arg-type]

    def _message(self, raw: bytes) -> None:
        header, self._header = self._header, None
        try:
            message = parse_message(raw, self._dialect.encoding)
        except MalformedError as error:
            self._fault("malformed", f"{error}: {printable(raw)}")
            return
        if message.name in HEADER_NAMES:
            self._header = message.params  # of two headers in a row the second counts
        elif header is None:
            if self._dialect.require_header:
                self._fault("no_header", f"without a check header: {printable(raw)}")
            else:
                self._items.append(message)
        elif self._verified(header, raw):
            self._items.append(message)
        else:
            self._fault("checksum", f"checksum or MD5 is wrong: {printable(raw)}")

    def _verified(self, header: Mapping[str, str], raw: bytes) -> bool:
        # Blanks between header and message are not the message's own (§1), but a machine may count them in.
        for covered in (raw.lstrip(_BLANKS), raw):
            md5 = hashlib.md5(covered, usedforsecurity=False).hexdigest()
            if header.get("MD5", "").lower() == md5 and self._value(header) == checksum(covered):
                return True
        return False

    def _value(self, header: Mapping[str, str]) -> int | None:
        try:
            return int(header.get("VALUE", ""), self._dialect.crc_radix)
        except ValueError:
            return None


def printable(raw: bytes) -> str:
    """Wire bytes for people: bounded, everything outside ASCII escaped."""
    return raw[:CONSOLE_TEXT_LIMIT].decode("latin-1").encode("unicode_escape").decode("ascii")
