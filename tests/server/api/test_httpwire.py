"""The server's HTTP connection with peers that say nothing, little, or all at once; in simulated time."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState

from server.api import httpwire
from server.api.httpwire import BODY_SILENCE_S, HEAD_S, LOOK_EVERY_S, HttpProtocol
from tests.harness.simloop import run_simulated

KEEP_ALIVE_S = 30
MOST, MAKE_WAY_AT, MAKE_WAY_BY = 64, 60, 4
"""A small server: simulated time looks through all timers at each step."""
HEAD = b"POST /estop HTTP/1.1\r\nHost: mill\r\n"
WITH_BODY = HEAD + b"Content-Length: 10\r\n\r\n"


class Wire(asyncio.Transport):
    """The server's end of a connection."""

    def __init__(self) -> None:
        super().__init__()
        self.sent = b""
        self.gone = False
        self.protocol: HttpProtocol | None = None

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return ("10.0.0.1", 5000) if name in ("peername", "sockname") else default

    def is_closing(self) -> bool:
        return self.gone

    def write(self, data: Any) -> None:
        self.sent += bytes(data)

    def close(self) -> None:
        if not self.gone and self.protocol is not None:
            asyncio.get_running_loop().call_soon(self.protocol.connection_lost, None)
        self.gone = True

    abort = close

    def pause_reading(self) -> None: ...
    def resume_reading(self) -> None: ...


class Server:
    """uvicorn's connections around an application that reads its body, then answers when it is allowed to."""

    def __init__(self) -> None:
        self.may_answer = asyncio.Event()
        self.may_answer.set()
        self.may_read = asyncio.Event()
        self.may_read.set()
        self._state = ServerState()
        self._config = uvicorn.Config(
            self._app,
            http=HttpProtocol,
            interface="asgi3",
            lifespan="off",
            log_config=None,
            access_log=False,
            limit_concurrency=MOST,
            timeout_keep_alive=KEEP_ALIVE_S,
        )
        self._config.load()

    def connect(self, *said: bytes) -> Wire:
        wire = Wire()
        wire.protocol = HttpProtocol(config=self._config, server_state=self._state, app_state={})
        wire.protocol.connection_made(wire)
        for data in said:
            wire.protocol.data_received(data)
        return wire

    async def _app(self, _scope: Any, receive: Callable[[], Awaitable[Any]], send: Callable[[Any], Any]) -> None:
        await self.may_read.wait()
        while (await receive()).get("more_body"):
            pass
        await self.may_answer.wait()
        await send({"type": "http.response.start", "status": 202, "headers": [(b"content-length", b"2")]})
        await send({"type": "http.response.body", "body": b"ok"})


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(httpwire, "MAKE_WAY_AT", MAKE_WAY_AT)
    monkeypatch.setattr(httpwire, "MAKE_WAY_BY", MAKE_WAY_BY)


def say(wire: Wire, data: bytes) -> None:
    assert wire.protocol is not None
    wire.protocol.data_received(data)


def told(story: Callable[[Server], Awaitable[None]]) -> None:
    async def main() -> None:
        await story(Server())

    run_simulated(main())


def is_obeyed(wire: Wire) -> bool:
    return wire.sent.startswith(b"HTTP/1.1 202")


@pytest.mark.parametrize("said", [b"", HEAD])
def test_who_never_ends_a_head_is_closed(said: bytes) -> None:
    async def story(server: Server) -> None:
        wire = server.connect(said) if said else server.connect()
        await asyncio.sleep(HEAD_S - 1)
        assert not wire.gone
        if said:
            say(wire, b"X-More: 1\r\n")  # a byte now and then does not help
        await asyncio.sleep(1 + LOOK_EVERY_S)
        assert wire.gone

    told(story)


def test_nor_does_it_help_behind_a_whole_request() -> None:
    async def story(server: Server) -> None:
        wire = server.connect(HEAD + b"\r\n")
        await asyncio.sleep(KEEP_ALIVE_S - 1)
        assert is_obeyed(wire)
        assert not wire.gone, "a browser keeps its connections for a while"
        say(wire, HEAD)
        await asyncio.sleep(HEAD_S - 1)
        assert not wire.gone
        await asyncio.sleep(1 + LOOK_EVERY_S)
        assert wire.gone

    told(story)


def test_a_body_may_come_slowly_but_not_never() -> None:
    async def story(server: Server) -> None:
        wire = server.connect(WITH_BODY)
        for _ in range(5):
            await asyncio.sleep(BODY_SILENCE_S - 1)
            say(wire, b"x")
        assert not wire.gone
        await asyncio.sleep(BODY_SILENCE_S + LOOK_EVERY_S)
        assert wire.gone

    told(story)


def test_who_waits_for_us_is_not_closed() -> None:
    async def story(server: Server) -> None:
        server.may_answer.clear()
        wire = server.connect(HEAD + b"\r\n")  # blocks by hand: an hour, if they take one
        await asyncio.sleep(3600)
        assert not wire.gone
        server.may_answer.set()
        await asyncio.sleep(0.1)
        assert is_obeyed(wire)

    told(story)


def test_a_body_that_we_do_not_read_is_no_silence_of_the_peer() -> None:
    async def story(server: Server) -> None:
        server.may_read.clear()  # a slow disk
        wire = server.connect(HEAD + b"Content-Length: 200000\r\n\r\n", b"x" * 150_000)
        await asyncio.sleep(10 * BODY_SILENCE_S)
        assert not wire.gone

    told(story)


@pytest.mark.parametrize("said", [b"", HEAD, WITH_BODY, HEAD + b"\r\n"], ids=["nothing", "head", "body", "answered"])
def test_any_number_of_those_who_wait_keeps_no_request_out(said: bytes) -> None:
    async def story(server: Server) -> None:
        others = []
        for _ in range(2 * MOST):
            others.append(server.connect(said) if said else server.connect())
            await asyncio.sleep(0.0001)
        stop = server.connect(HEAD + b"\r\n")
        await asyncio.sleep(0.01)
        assert is_obeyed(stop)
        open_ = [wire for wire in others if not wire.gone]
        assert MAKE_WAY_AT - MAKE_WAY_BY <= len(open_) <= MAKE_WAY_AT
        assert open_ == others[-len(open_) :], "those that have waited longest went"

    told(story)


def test_what_is_being_obeyed_makes_way_for_nobody() -> None:
    async def story(server: Server) -> None:
        server.may_answer.clear()
        obeyed = [server.connect(HEAD + b"\r\n") for _ in range(20)]
        await asyncio.sleep(0.01)
        for _ in range(2 * MOST):
            server.connect()
        server.may_answer.set()
        await asyncio.sleep(0.01)
        assert all(is_obeyed(wire) for wire in obeyed)

    told(story)
