"""A crowd against a server of a few lines, and against the stand-in: what it asks, sends and counts."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from typing import Any

import pytest

from bench.loadclients import ADDRESSES, CONNECTIONS, LINE, Crowd, Load, Reader, Uploading, _asking, obey, program
from bench.standin import Manner, StandIn

CROWD = Crowd("127.0.0.1", 0, requests_s=500.0, upload_bytes=1_000_000)


@pytest.mark.parametrize("size", [1, 33, 1_000_000, 5_000_001])
def test_an_upload_has_the_size_that_it_says_and_is_a_program(size: int) -> None:
    data = b"".join(program(size))
    assert len(data) == size
    assert data.startswith(LINE.encode()[:size])


def test_what_several_processes_got_is_added_up() -> None:
    one = Load(requests=3, answers_s=[0.1], refusals={"a: 404": 1}, messages=5)
    other = Load(requests=4, answers_s=[0.2], refusals={"a: 404": 1, "b: 500": 1})
    total = one + other
    assert (total.requests, total.answers_s, total.messages, total.refused) == (7, [0.1, 0.2], 5, 3)
    assert one.refused == 1
    assert Load(answers_s=[0.001] * 98 + [1.0] * 2).p99_s == 1.0


class Server:
    """Answers every request, and keeps what it was sent."""

    def __init__(self) -> None:
        self.requests: list[str] = []
        self.body_bytes = 0
        self.bodies = 0
        self.connections = 0

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        try:
            while True:
                head = (await reader.readuntil(b"\r\n\r\n")).decode()
                self.requests.append(head.partition(" HTTP")[0])
                if head.startswith("POST"):
                    left = int(head.partition("Content-Length: ")[2].partition("\r\n")[0])
                    while left:
                        data = await reader.read(left)
                        left, self.body_bytes = left - len(data), self.body_bytes + len(data)
                    self.bodies += 1
                    writer.write(b"HTTP/1.1 201 Created\r\ncontent-length: 2\r\n\r\n{}")
                elif "state" in head:
                    writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 2\r\n\r\n{}")
                else:
                    writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n[]")
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()


async def until(met: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not met():
            await asyncio.sleep(0.005)


def against(talk: Any, work: Callable[[Crowd], Any]) -> None:
    """`work` with a crowd that knows where `talk` listens."""

    async def main() -> None:
        listening = await asyncio.start_server(talk, "127.0.0.1", 0)
        async with listening:
            await work(replace(CROWD, port=listening.sockets[0].getsockname()[1]))

    asyncio.run(main())


@pytest.mark.real
def test_requests_go_over_kept_connections_and_refusals_are_counted() -> None:
    server, found = Server(), Load()

    async def work(crowd: Crowd) -> None:
        task = asyncio.ensure_future(_asking(crowd, found))
        await until(lambda: found.requests >= 40)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    against(server.talk, work)
    assert 1 <= server.connections <= CONNECTIONS
    assert {request.partition("?")[0] for request in server.requests} == {
        f"GET /api/v1{address.partition('?')[0]}" for address in ADDRESSES
    }
    assert found.requests == len(found.answers_s)
    assert found.answer_bytes >= found.requests
    assert 0 < found.refused < found.requests / 2, "a fifth of the addresses is refused"


@pytest.mark.real
def test_an_upload_rests_where_it_is_and_goes_on_for_who_comes_next() -> None:
    server, first, second = Server(), Load(), Load()

    async def work(crowd: Crowd) -> None:
        upload = Uploading(replace(crowd, upload_bytes=3_000_000))
        await asyncio.sleep(0.02)
        assert server.body_bytes == 0
        upload.go_on(first)
        await until(lambda: first.uploaded_bytes > 500_000)
        upload.rest()
        await asyncio.sleep(0.03)
        resting = server.body_bytes
        await asyncio.sleep(0.05)
        assert server.body_bytes == resting
        upload.go_on(second)
        await until(lambda: second.uploads >= 2)
        upload.rest()
        await upload.end()

    against(server.talk, work)
    assert server.bodies >= 2
    assert first.uploaded_bytes + second.uploaded_bytes >= 6_000_000
    assert first.refused == second.refused == 0


class Wire(asyncio.Transport):
    """Keeps what is written."""

    def __init__(self) -> None:
        super().__init__()
        self.written = b""

    def write(self, data: Any) -> None:
        self.written += data

    def abort(self) -> None:
        pass


@pytest.mark.parametrize("piece_bytes", [1, 3, 1000])
def test_messages_are_counted_however_they_are_cut_and_a_ping_is_answered(piece_bytes: int) -> None:
    async def main() -> Load:
        found, wire = Load(), Wire()
        reader = Reader(replace(CROWD, topics="state"), found)
        reader.connection_made(wire)
        assert b"/events?topics=state&rate=20 HTTP/1.1" in wire.written
        wire.written = b""
        frames = b"\x81\x02{}" + b"\x81\x7e\x01\x00" + b"x" * 256 + b"\x89\x02hi" + b"\x81\x7f" + bytes(7) + b"\x01y"
        data = b"HTTP/1.1 101 Switching Protocols\r\n\r\n" + frames
        for at in range(0, len(data), piece_bytes):
            reader.data_received(data[at : at + piece_bytes])
        assert reader.accepted.done()
        assert wire.written == b"\x8a\x82\x00\x00\x00\x00hi"
        reader.leave()
        reader.connection_lost(None)
        return found

    found = asyncio.run(main())
    assert found.messages == 4
    assert found.refused == 0


def test_a_reader_that_is_refused_or_cut_off_shows() -> None:
    async def main() -> Load:
        found = Load()
        refused, cut = Reader(CROWD, found), Reader(CROWD, found)
        refused.connection_made(Wire())
        refused.data_received(b"HTTP/1.1 503 Service Unavailable\r\n\r\n")
        with pytest.raises(ConnectionError, match="503"):
            await refused.accepted
        cut.connection_made(Wire())
        cut.data_received(b"HTTP/1.1 101 Switching Protocols\r\n\r\n")
        cut.connection_lost(None)
        return found

    assert asyncio.run(main()).refused == 1


@pytest.mark.real
def test_a_crowd_comes_and_goes_and_the_stand_in_takes_it_as_the_daemon_would() -> None:
    said: list[Any] = []

    async def work(crowd: Crowd) -> None:
        visit = json.dumps(
            {"host": crowd.host, "port": crowd.port, "readers": 3, "requests_s": 200.0, "upload_bytes": 300_000}
        ).encode()

        async def lines() -> AsyncIterator[bytes]:
            for _ in range(2):
                yield visit
                await asyncio.sleep(0.15)
                yield b"\n"

        await obey(lines(), said.append)

    against(StandIn(Manner(answer_bytes=700, piece_bytes=1500, pieces_s=100.0)).talk, work)
    assert said[0] == said[2] == {}
    for got in (Load(**said[1]), Load(**said[3])):
        assert got.refused == 0
        assert got.answer_bytes == 700 * got.requests > 0
        assert got.messages > 3
        assert got.uploaded_bytes > 300_000
        assert got.seconds > 0.1
