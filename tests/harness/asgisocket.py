"""A WebSocket client that speaks ASGI to an application directly: no network, no server, and it can stop reading.

It offers the daemon's own extension as well (`server/api/wswire.py`), and reads its frames with a decoder of its own.
"""

import asyncio
import json
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import urlencode

from starlette.types import ASGIApp, Message

from tests.harness.textframes import texts


class Reading(asyncio.Event):
    """Set while the client reads. Whoever writes frames is told when it reads again."""

    def __init__(self) -> None:
        super().__init__()
        self.on_room: Callable[[], None] | None = None
        super().set()

    def set(self) -> None:
        super().set()
        if self.on_room is not None:
            self.on_room()


class _Wire:
    """The frames' way out (`server/api/wswire.py`)."""

    def __init__(self, reading: Reading, heard: asyncio.Queue[Message]) -> None:
        self._reading = reading
        self._heard = heard

    @property
    def on_room(self) -> Callable[[], None] | None:
        return self._reading.on_room

    @on_room.setter
    def on_room(self, call: Callable[[], None] | None) -> None:
        self._reading.on_room = call

    @property
    def has_room(self) -> bool:
        return self._reading.is_set()

    def write_frames(self, frames: bytes) -> None:
        assert self.has_room, "a reader that does not read is given nothing"
        for text in texts(frames):
            self._heard.put_nowait({"type": "websocket.send", "text": text})


class AsgiSocket:
    """One connection. Use as `async with`; `status` is set when the handshake was refused."""

    def __init__(
        self,
        app: ASGIApp,
        path: str = "/api/v1/events",
        *,
        query: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        sent = {"host": "127.0.0.1:8420"} | {name.lower(): value for name, value in (headers or {}).items()}
        self._app = app
        self._scope: dict[str, Any] = {
            "type": "websocket",
            "asgi": {"version": "3.0", "spec_version": "2.4"},
            "http_version": "1.1",
            "scheme": "ws",
            "path": path,
            "raw_path": path.encode(),
            "root_path": "",
            "query_string": urlencode(query or {}).encode(),
            "headers": [(name.encode(), value.encode()) for name, value in sent.items() if value],
            "client": ("127.0.0.1", 40000),
            "server": ("127.0.0.1", 8420),
            "subprotocols": [],
            "state": {},
        }
        self._to_app: asyncio.Queue[Message] = asyncio.Queue()
        self._from_app: asyncio.Queue[Message] = asyncio.Queue()
        self.reading = Reading()
        wire = _Wire(self.reading, self._from_app)
        self._scope["extensions"] = {"websocket.http.response": {}, "millstream.frames": {"wire": wire}}
        self.status: int | None = None
        self.response_headers: dict[str, str] = {}
        self.problem: Any = None
        self.closed: tuple[int, str] | None = None
        self._task: asyncio.Task[None] | None = None

    async def __aenter__(self) -> "AsgiSocket":
        await self._to_app.put({"type": "websocket.connect"})
        self._task = asyncio.ensure_future(self._app(self._scope, self._to_app.get, self._send))
        message = await self._next()
        if message["type"] == "websocket.http.response.start":
            self.status = message["status"]
            self.response_headers = {name.decode(): value.decode() for name, value in message["headers"]}
            self.problem = json.loads((await self._next())["body"])
        else:
            assert message["type"] == "websocket.accept", message
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.disconnect()

    async def disconnect(self) -> None:
        """Go away, and see that the application ends."""
        assert self._task is not None
        self.reading.set()
        await self._to_app.put({"type": "websocket.disconnect", "code": 1001})
        await asyncio.wait_for(self._task, 5)

    @property
    def ended(self) -> bool:
        """Whether the application has finished with this connection."""
        return self._task is not None and self._task.done()

    async def say(self, message: Any) -> None:
        """Send a JSON message, or a text as it is."""
        text = message if isinstance(message, str) else json.dumps(message)
        await self._to_app.put({"type": "websocket.receive", "text": text})

    async def hear(self, within_s: float = 5.0) -> Any:
        """The next message; None when the connection was closed instead."""
        async with asyncio.timeout(within_s):
            message = await self._next()
        if message["type"] == "websocket.close":
            self.closed = (message["code"], message.get("reason") or "")
            return None
        return json.loads(message["text"])

    async def hear_type(self, type_: str, within_s: float = 5.0) -> Any:
        """The next message of this type; others are skipped."""
        while (message := await self.hear(within_s)) is not None:
            if message["type"] == type_:
                return message
        raise AssertionError(f"closed while waiting for {type_}")

    async def ask(self, message: dict[str, Any]) -> Any:
        """Send a message and return its result."""
        await self.say(message)
        return await self.hear_type("result")

    def unheard(self) -> int:
        """How many messages have arrived and were not read by the test."""
        return self._from_app.qsize()

    async def _next(self) -> Message:
        assert self._task is not None
        getting = asyncio.ensure_future(self._from_app.get())
        try:
            await asyncio.wait([getting, self._task], return_when=asyncio.FIRST_COMPLETED)
            if getting.done():
                return getting.result()
        finally:
            getting.cancel()
        self._task.result()
        raise AssertionError("the application ended without a word")

    async def _send(self, message: Message) -> None:
        await self.reading.wait()
        self._from_app.put_nowait(message)
