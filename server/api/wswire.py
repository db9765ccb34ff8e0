"""The server's WebSocket connection, with a way for frames that are made already: uvicorn's, and one extension of ASGI.

Through ASGI each message would be framed for each reader again, by a dozen calls that may wait. Everything else (the
handshake, pings, what the reader says, closing) is uvicorn's. The one rule: frames go out between its own messages,
never inside one, and never once either side has begun to close.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, cast

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

EXTENSION = "millstream.frames"
"""In the scope's `extensions`; its `wire` is the Wire of this connection."""


class Wire(Protocol):
    """One accepted connection. `on_room` is called when it takes frames again."""

    on_room: Callable[[], None] | None

    @property
    def has_room(self) -> bool: ...
    def write_frames(self, frames: bytes) -> None: ...


def wire_of(scope: Mapping[str, Any]) -> Wire:
    """The wire of a connection. Raises KeyError under a server that is not ours."""
    return cast(Wire, scope["extensions"][EXTENSION]["wire"])


class WireProtocol(WebSocketsSansIOProtocol):
    """For `uvicorn.Config(ws=...)`."""

    on_room: Callable[[], None] | None = None

    async def run_asgi(self) -> None:
        """Offer the extension to the application."""
        extensions = self.scope["extensions"] or {}
        self.scope["extensions"] = {**extensions, EXTENSION: {"wire": self}}
        await super().run_asgi()

    @property
    def has_room(self) -> bool:
        """Whether the peer reads what it is sent; a connection that closes has none."""
        return self.writable.is_set() and self._open

    @property
    def _open(self) -> bool:
        return self.handshake_complete and not (self.close_sent or self.disconnected or self.transport.is_closing())

    def write_frames(self, frames: bytes) -> None:
        """Whole frames of the server; never waits. What a closing connection is given is dropped."""
        if self._open:
            self.transport.write(frames)

    def handle_ping(self) -> None:
        """A peer that does not read what it has already is not given pongs on top, as many as it likes: that of its
        last ping is enough (RFC 6455 §5.5.3)."""
        if self.has_room:
            super().handle_ping()
        else:
            self.conn.data_to_send()

    def resume_writing(self) -> None:
        """The peer has read on."""
        super().resume_writing()
        if self.on_room is not None:
            self.on_room()
