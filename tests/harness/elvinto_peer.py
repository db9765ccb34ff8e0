"""The smallest host there can be for a virtual ElVinto machine: frames in, checked messages out.

Written from the standard without the codecs of either side. The one rule: it accepts no message without a valid header.
"""

import hashlib
import re

from sim.elvinto.machine import VirtualElvinto

HEADER = re.compile(r"(CRC(?:16)?),VALUE<#([0-9a-f]+),MD5<#([0-9a-f]{32});")


def getcrc16(data: bytes) -> int:
    """The listing of the standard, word for word."""
    crc_short = 0
    for byte in data:
        f = byte << 1
        f = f ^ ((f & 0xFF00) >> 8)
        crc_short += f & 0xFFFF
        crc_short &= 0xFFFF
    return crc_short


def frame(message: str, wire_id: int | None = None, *, name: str = "CRC16", radix: int = 10) -> bytes:
    """Header and message."""
    data = message.encode()
    value = format(getcrc16(data), "x" if radix == 16 else "d")
    tail = "" if wire_id is None else f",ID<#{wire_id}"
    return f"{name},VALUE<#{value},MD5<#{hashlib.md5(data).hexdigest()}{tail};".encode() + data


def unframe(data: bytes, *, name: str = "CRC16", radix: int = 10) -> list[str]:
    """The messages of the machine; an AssertionError for one whose header does not fit."""
    messages: list[str] = []
    rest = data.decode()
    while rest:
        header = HEADER.match(rest)
        assert header is not None, f"no header before {rest[:60]!r}"
        assert header[1] == name
        end = rest.index(";", header.end()) + 1
        body = rest[header.end() : end]
        assert int(header[2], radix) == getcrc16(body.encode())
        assert header[3] == hashlib.md5(body.encode()).hexdigest()
        messages.append(body)
        rest = rest[end:]
    return messages


class Peer:
    """Talks to a machine at a time of its own."""

    def __init__(self, machine: VirtualElvinto, now: float = 0.0) -> None:
        self.machine = machine
        self.now = now

    def tell(self, message: str, wire_id: int | None = None) -> list[str]:
        """Sends a message now; what the machine says to it at once."""
        self.machine.receive_data(frame(message, wire_id), self.now)
        return self.heard()

    def batch(self, wire_id: int, *blocks: str) -> list[str]:
        return self.tell(f"GCODE,DATA<#{'|'.join(blocks)};", wire_id)

    def heard(self) -> list[str]:
        settings = self.machine.settings
        return unframe(self.machine.data_to_send(self.now), name=settings.header_name, radix=settings.crc_radix)

    def wait(self, seconds: float) -> list[str]:
        """Lets time pass in one step."""
        self.now += seconds
        self.machine.handle_timer(self.now)
        return self.heard()

    def settle(self, limit_s: float = 3600.0) -> list[str]:
        """Follows the machine's deadlines until it has none, or until `limit_s` later."""
        end = self.now + limit_s
        said: list[str] = []
        while (at := self.machine.next_timer()) is not None and at <= end:
            self.now = at
            self.machine.handle_timer(at)
            said += self.heard()
        if at is not None:
            self.now = end
        return said

    @property
    def blocks(self) -> list[str]:
        return [block.text for block in self.machine.executed]


def fields(message: str) -> dict[str, str]:
    """The parameters of a plain message."""
    return dict(part.strip().split("<#") for part in message.rstrip(";").split(",")[1:])


def names(messages: list[str]) -> list[str]:
    return [re.split("[,;]", message)[0] for message in messages]
