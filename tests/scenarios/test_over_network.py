"""The API behind a real server on a real port: what ASGI in the same process cannot show."""

import asyncio
import contextlib
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import httpx
import pytest
import uvicorn
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from server.api.wswire import WireProtocol
from server.live.subscription import QUEUE_LIMIT
from tests.harness.fakeworkshop import FakeWorkshop, bearer

pytestmark = pytest.mark.real

BIG = "x" * 8000
WITHIN_S = 30.0


class Daemon:
    """A workshop of fakes behind uvicorn."""

    def __init__(self, workshop: FakeWorkshop, port: int) -> None:
        self.workshop = workshop
        self.http = f"http://127.0.0.1:{port}"
        self.events = f"ws://127.0.0.1:{port}/api/v1/events"


Story = Callable[[Daemon], Awaitable[None]]


@contextlib.asynccontextmanager
async def serving() -> AsyncIterator[Daemon]:
    listener = socket.create_server(("127.0.0.1", 0))
    async with FakeWorkshop() as workshop:
        server = uvicorn.Server(uvicorn.Config(workshop.app(), log_level="warning", lifespan="off", ws=WireProtocol))
        task = asyncio.create_task(server.serve(sockets=[listener]))
        while not server.started:
            await asyncio.sleep(0.01)
        try:
            yield Daemon(workshop, listener.getsockname()[1])
        finally:
            server.should_exit = True
            await task
            listener.close()


def told(story: Story) -> None:
    async def main() -> None:
        async with asyncio.timeout(WITHIN_S), serving() as daemon:
            await story(daemon)

    asyncio.run(main())


def plain(daemon: Daemon) -> connect:
    """Without compression, which would shrink a backlog to nothing."""
    return connect(daemon.events, proxy=None, compression=None)


async def hear(socket: ClientConnection) -> Any:
    return json.loads(await socket.recv())


def test_the_websocket_of_a_real_client() -> None:
    async def story(daemon: Daemon) -> None:
        async with connect(daemon.events, origin=daemon.http, proxy=None) as socket:
            assert (await hear(socket))["type"] == "hello"
            daemon.workshop.hub.publish("alarm", "router", {"alarm": None})
            assert (await hear(socket))["type"] == "alarm"
            await socket.send('{"type": "estop", "id": 1}')
            assert await hear(socket) == {"type": "result", "id": 1, "ok": True}
            assert daemon.workshop.router.names() == ["estop"]

    told(story)


def test_a_refused_handshake_says_why() -> None:
    async def story(daemon: Daemon) -> None:
        secret = await daemon.workshop.token("viewer")
        for headers, origin, status, code in (
            ({}, None, 401, "unauthorized"),
            (bearer(secret), "http://evil.example", 403, "bad_origin"),
        ):
            with pytest.raises(InvalidStatus) as caught:
                await connect(daemon.events, additional_headers=headers, origin=origin, proxy=None)
            assert caught.value.response.status_code == status
            assert json.loads(caught.value.response.body or b"")["code"] == code
        async with connect(daemon.events, additional_headers=bearer(secret), proxy=None) as socket:
            assert (await hear(socket))["data"]["role"] == "viewer"

    told(story)


def test_a_reader_that_does_not_read_its_socket_is_cut_while_others_hear_everything() -> None:
    async def story(daemon: Daemon) -> None:
        hub = daemon.workshop.hub
        async with plain(daemon) as good, plain(daemon) as stuck:
            await hear(good)
            await hear(stuck)
            stuck.transport.pause_reading()
            loop = asyncio.get_running_loop()
            published, longest_s = 0, 0.0
            while hub.cut_readers == 0:
                assert published < QUEUE_LIMIT * 10, "the socket's own buffers cannot hold so much"
                before = loop.time()
                hub.publish("job", "router", {"n": published, "text": BIG})
                longest_s = max(longest_s, loop.time() - before)
                assert (await hear(good))["data"]["n"] == published
                published += 1
            assert longest_s < 1.0, "publishing waits for nobody"
            assert hub.readers == 1
            hub.publish("job", "router", {"n": published})
            assert (await hear(good))["data"]["n"] == published
            stuck.transport.resume_reading()
            with contextlib.suppress(ConnectionClosed):
                for _ in range(published + 2):
                    await stuck.recv()
                raise AssertionError("the connection is still there")

    told(story)


def test_a_held_jog_ends_when_the_network_goes() -> None:
    async def story(daemon: Daemon) -> None:
        async with connect(daemon.events, proxy=None) as socket:
            await hear(socket)
            await socket.send('{"type": "jog", "machine": "router", "x": 1, "feed": 600, "hold": true}')
            assert (await hear(socket))["ok"]
            socket.transport.abort()
            while "cancel_jog" not in daemon.workshop.router.names():
                await asyncio.sleep(0.01)

    told(story)


def test_an_upload_is_read_no_faster_than_it_is_kept() -> None:
    """Back pressure reaches the sender: it is stopped by TCP, not by our memory."""

    async def story(daemon: Daemon) -> None:
        piece = b"G1 X1 F100\n" * 6000
        sent = 0
        gate = asyncio.Event()
        programs = daemon.workshop.programs
        keeping = programs.store

        async def slow_disk(chunks: AsyncIterator[bytes], name: str) -> tuple[dict[str, Any], bool]:
            await gate.wait()
            return await keeping(chunks, name)

        programs.store = slow_disk  # type: ignore[method-assign]

        async def body() -> AsyncIterator[bytes]:
            nonlocal sent
            for _ in range(400):
                sent += len(piece)
                yield piece

        async with httpx.AsyncClient(timeout=WITHIN_S, trust_env=False) as client:
            uploading = asyncio.create_task(client.post(f"{daemon.http}/api/v1/programs?name=a.nc", content=body()))
            last = -1
            while sent != last or sent == 0:
                last = sent
                await asyncio.sleep(0.2)
            assert sent < 400 * len(piece), "the sender waits"
            gate.set()
            answer = await uploading
            assert (answer.status_code, answer.json()["bytes"]) == (201, 400 * len(piece))

    told(story)


def test_a_client_that_goes_away_in_its_upload_leaves_nothing() -> None:
    async def story(daemon: Daemon) -> None:
        port = int(daemon.http.rpartition(":")[2])
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(
            b"POST /api/v1/programs?name=a.nc HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1000000\r\n\r\n"
            + b"G0 X1\n" * 50_000  # more than is gathered before it goes to the disk
        )
        await writer.drain()
        while daemon.workshop.programs.taken_bytes == 0:
            await asyncio.sleep(0.01)
        writer.transport.abort()
        async with httpx.AsyncClient(trust_env=False) as client:
            assert (await client.get(f"{daemon.http}/healthz")).status_code == 200
        while not daemon.workshop.programs.broken_off:
            await asyncio.sleep(0.01)
        assert daemon.workshop.programs.kept == {}

    told(story)
