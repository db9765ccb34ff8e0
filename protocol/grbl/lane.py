"""The real-time lane: single bytes that go out before every line (grbl I, II.2).

The one rule: nothing waits here for anything; what is asked for goes out with the next write, once.
"""

from dataclasses import dataclass, field
from typing import Final

from protocol.grbl.realtime import SOFT_RESET, STATUS

MAX_WAITING: Final = 64
"""Bytes kept between two writes; a shell writes after every input, so more are a caller's loop gone mad."""


@dataclass(slots=True)
class Lane:
    """Bytes to go, with the tokens of those who want to know that they went."""

    idle: bool = True
    """Nothing waits to go out, and nobody to be told."""
    _bytes: bytearray = field(default_factory=bytearray)
    _tokens: list[int] = field(default_factory=list)

    def put(self, byte: bytes, token: int | None = None) -> None:
        """Queue a byte. `?` waits once at most; a soft reset drops what stands before it."""
        self.idle = False
        if byte == SOFT_RESET:
            self._bytes.clear()
        if not (byte == STATUS and STATUS in self._bytes) and len(self._bytes) < MAX_WAITING:
            self._bytes += byte
        if token is not None:
            self._tokens.append(token)

    def take(self) -> tuple[bytes, list[int]]:
        """All of it."""
        data, tokens = bytes(self._bytes), self._tokens
        self._bytes.clear()
        self._tokens = []
        self.idle = True
        return data, tokens
