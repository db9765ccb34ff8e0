"""Ready frames on uvicorn's connection, with a transport of the test's: where they go out, and where no more."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, cast

import pytest
import uvicorn
from uvicorn.server import ServerState

from server.api.wswire import Wire, WireProtocol, wire_of
from server.live.textframe import text_frame
from tests.harness.simloop import run_simulated as run
from tests.harness.textframes import texts

HANDSHAKE = (
    b"GET /api/v1/events HTTP/1.1\r\nHost: mill\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
CLOSE = bytes.fromhex("88 82 00 00 00 00 03 e8")
"""A masked close of the client, 1000, under the mask 0."""
PING, PONG = bytes.fromhex("89 82 00 00 00 00 68 69"), bytes.fromhex("8a 02 68 69")

App = Callable[[Any, Any, Any], Awaitable[None]]


class FakeTransport(asyncio.Transport):
    """Keeps what is written."""

    def __init__(self) -> None:
        super().__init__({"peername": ("127.0.0.1", 4000), "sockname": ("127.0.0.1", 8420)})
        self.written: list[bytes] = []
        self.closing = False

    def write(self, data: Any) -> None:
        assert not self.closing
        self.written.append(bytes(data))

    def is_closing(self) -> bool:
        return self.closing

    def close(self) -> None:
        self.closing = True

    def pause_reading(self) -> None: ...
    def resume_reading(self) -> None: ...


class Connection:
    """A connection to an application that accepts and hands its wire out."""

    def __init__(self) -> None:
        self.send: Any = None
        self.wire: Wire | None = None
        config = uvicorn.Config(
            cast(Any, self._app), interface="asgi3", ws=WireProtocol, ws_per_message_deflate=False, log_config=None
        )
        config.load()
        self.transport = FakeTransport()
        self.protocol = WireProtocol(config, ServerState(), {}, asyncio.get_running_loop())
        self.protocol.connection_made(self.transport)

    async def _app(self, scope: Any, receive: Any, send: Any) -> None:
        self.wire, self.send = wire_of(scope), send
        assert "websocket.http.response" in scope["extensions"], "what the server offers stays"
        assert not self.wire.has_room, "before the handshake nothing may be sent"
        self.wire.write_frames(b"dropped")
        await receive()
        await send({"type": "websocket.accept"})
        while (await receive())["type"] != "websocket.disconnect":
            pass

    async def opened(self) -> Wire:
        self.protocol.data_received(HANDSHAKE)
        await asyncio.sleep(0.1)
        assert self.transport.written[0].startswith(b"HTTP/1.1 101")
        assert len(self.transport.written) == 1
        assert self.wire is not None
        return self.wire


def test_frames_go_out_as_they_are_between_the_servers_own() -> None:
    async def main() -> None:
        connection = Connection()
        wire = await connection.opened()
        assert wire.has_room
        wire.write_frames(text_frame("one") + text_frame("two"))
        await connection.send({"type": "websocket.send", "text": "three"})
        wire.write_frames(text_frame("four"))
        assert [*texts(b"".join(connection.transport.written[1:]))] == ["one", "two", "three", "four"]

    run(main())


def test_a_peer_that_does_not_read_is_told_of() -> None:
    async def main() -> None:
        connection, calls = Connection(), []
        wire = await connection.opened()
        connection.protocol.pause_writing()
        assert not wire.has_room
        connection.protocol.resume_writing()
        wire.on_room = lambda: calls.append(wire.has_room)
        connection.protocol.pause_writing()
        connection.protocol.resume_writing()
        assert calls == [True]

    run(main())


def test_pings_of_a_peer_that_does_not_read_fill_nothing() -> None:
    async def main() -> None:
        connection = Connection()
        await connection.opened()
        connection.protocol.pause_writing()
        for _ in range(1000):
            connection.protocol.data_received(PING)
        assert len(connection.transport.written) == 1
        connection.protocol.resume_writing()
        connection.protocol.data_received(PING)
        assert connection.transport.written[1:] == [PONG]

    run(main())


@pytest.mark.parametrize("by", ["us", "the peer", "the transport", "a lost line"])
def test_behind_a_close_nothing_goes_out(by: str) -> None:
    async def main() -> None:
        connection = Connection()
        wire = await connection.opened()
        match by:
            case "us":
                await connection.send({"type": "websocket.close", "code": 1013})
            case "the peer":
                connection.protocol.data_received(CLOSE)
            case "the transport":
                connection.transport.close()
            case _:
                connection.protocol.connection_lost(ConnectionResetError())
        before = len(connection.transport.written)
        assert not wire.has_room
        wire.write_frames(text_frame("late"))
        assert len(connection.transport.written) == before

    run(main())


def test_another_server_is_refused() -> None:
    with pytest.raises(KeyError):
        wire_of({"extensions": {}})
