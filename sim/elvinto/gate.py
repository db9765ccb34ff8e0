"""What of the bytes that come in is a message the machine may look at (standard §2 and CRC16 in §4).

It knows no command and no ID rule. The one rule: a check header is good for the message right behind it and no other.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from sim.elvinto.codec import CheckHeader, MalformedError, Message, Reader, parse
from sim.elvinto.settings import SimSettings


@dataclass(frozen=True, slots=True)
class Passed:
    """A message whose header vouches for it. `id` is None when the header carries none."""

    message: Message
    id: int | None
    raw: bytes


@dataclass(frozen=True, slots=True)
class Refused:
    """`reason`: overlong, malformed, no_header or checksum."""

    reason: str
    raw: bytes


class Gate:
    """Bytes in any pieces → what passed and what was refused, in order. Never raises."""

    def __init__(self, settings: SimSettings) -> None:
        self._settings = settings
        self._reader = Reader(min(settings.max_message_bytes, settings.receive_buffer_bytes))
        self._header: CheckHeader | None = None

    def clear(self) -> None:
        self._reader.clear()
        self._header = None

    def feed(self, data: bytes) -> Iterator[Passed | Refused]:
        for raw in self._reader.feed(data):
            verdict = self._judge(raw)
            if verdict is not None:
                yield verdict

    def _judge(self, raw: bytes) -> Passed | Refused | None:
        header, self._header = self._header, None
        if not raw:
            return Refused("overlong", raw)
        try:
            found = parse(raw)
            if found.name == self._settings.header_name:
                self._header = CheckHeader.of(found, self._settings.crc_radix)
                return None
        except MalformedError:
            return Refused("malformed", raw)
        if header is None:
            return Refused("no_header", raw)
        if not header.covers(self._covered(found, raw)):
            return Refused("checksum", raw)
        return Passed(found, header.id, raw)

    def _covered(self, found: Message, raw: bytes) -> bytes:
        if self._settings.checksum_scope == "gcode" and found.name == "GCODE":
            return found.params.get("DATA", b"") + b";"
        return raw
