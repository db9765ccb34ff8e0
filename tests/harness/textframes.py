"""The server's text frames of a WebSocket, read back (RFC 6455 §5.2): a second reading, not the library's.

Not masked, not fragmented, no extension: anything else fails the test.
"""

import json
from collections.abc import Iterator
from typing import Any

WHOLE_TEXT = 0x81
"""FIN and the opcode of a text."""


def texts(data: bytes) -> Iterator[str]:
    """The texts of whole frames."""
    at = 0
    while at < len(data):
        assert data[at] == WHOLE_TEXT, f"byte {at} begins no whole text: {data[at : at + 4]!r}"
        length, at = data[at + 1], at + 2
        assert length < 0x80, "a server does not mask"
        for short, size in ((126, 2), (127, 8)):
            if length == short:
                length, at = int.from_bytes(data[at : at + size], "big"), at + size
                break
        assert len(data) >= at + length, "a frame breaks off"
        yield data[at : at + length].decode()
        at += length


def messages(data: bytes) -> list[Any]:
    """The JSON of whole frames."""
    return [json.loads(text) for text in texts(data)]


class Ear:
    """The outlet of one reader (`server.live.fanout.Outlet`): what it hears, and it can stop reading."""

    def __init__(self) -> None:
        self.takes = True
        self.pieces: list[bytes] = []

    def write(self, data: bytes) -> None:
        """The fan-out has sent this."""
        assert self.takes, "a reader that does not read is given nothing"
        assert data, "nothing is not sent"
        self.pieces.append(data)

    @property
    def heard(self) -> list[Any]:
        """All messages so far."""
        return [message for piece in self.pieces for message in messages(piece)]
