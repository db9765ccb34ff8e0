"""The load of many at once, in a tiny setting; what a crowd gets is counted right, and what is late shows."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

import pytest

from bench import load
from bench.load import Came, Crowd
from bench.loadclients import ADDRESSES, CONNECTIONS, LINE, Load, _asking, _uploading, program
from bench.report import Report
from bench.tap import DeadTime

WHO = Crowd(readers=2, topics="state", requests_s=50.0, upload_bytes=1)


@pytest.mark.parametrize("size", [1, 33, 1_000_000, 5_000_001])
def test_an_upload_has_the_size_that_it_says_and_is_a_program(size: int) -> None:
    data = b"".join(program(size))
    assert len(data) == size
    assert data.startswith(LINE.encode()[:size])


def dead(seconds: float) -> DeadTime:
    return DeadTime(11, 20, 10.0 + seconds, 10.0, 0.1, 0.1, 0.0, seconds - 0.1, 0.0, 0.0)


@pytest.mark.parametrize(("found", "met"), [(0.2, True), (0.209, True), (0.3, False)])
def test_dead_time_is_held_against_the_quiet_run(found: float, met: bool) -> None:
    came = Came(19.5, Load(requests=500, uploaded_bytes=2 * 10**9, seconds=10.0, answers_s=[0.001, 0.002]))
    report = Report.of("", [("it", load._elvinto(dead(found), dead(0.2), came, WHO))])
    ratio = report.groups[0][1][0]
    assert ratio.value == pytest.approx(found / 0.2)
    assert ratio.met is met
    assert report.value("it", "messages a second to each reader") == 19.5
    assert report.value("it", "requests a second") == 50
    assert report.value("it", "uploaded meanwhile") == 2.0


class Server:
    """Answers every request, and keeps what it was sent."""

    def __init__(self) -> None:
        self.requests: list[str] = []
        self.bodies: list[int] = []
        self.connections = 0

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        try:
            while True:
                head = (await reader.readuntil(b"\r\n\r\n")).decode()
                self.requests.append(head.partition(" HTTP")[0])
                if head.startswith("POST"):
                    size = int(head.partition("Content-Length: ")[2].partition("\r\n")[0])
                    self.bodies.append(len(await reader.readexactly(size)))
                    writer.write(b"HTTP/1.1 201 Created\r\ncontent-length: 2\r\n\r\n{}")
                elif "state" in head:
                    writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 2\r\n\r\n{}")
                else:
                    writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n[]")
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()


async def beside(work: Callable[[str, int, Load], Any], until: Callable[[Load], bool]) -> tuple[Server, Load]:
    server, found = Server(), Load()
    listening = await asyncio.start_server(server.talk, "127.0.0.1", 0)
    async with listening, asyncio.timeout(10):
        task = asyncio.ensure_future(work("127.0.0.1", listening.sockets[0].getsockname()[1], found))
        while not until(found):
            await asyncio.sleep(0.005)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    return server, found


@pytest.mark.real
def test_requests_go_over_kept_connections_and_refusals_are_counted() -> None:
    server, found = asyncio.run(
        beside(lambda host, port, load: _asking(host, port, 500.0, load), lambda load: load.requests >= 40)
    )
    assert 1 <= server.connections <= CONNECTIONS
    assert {request.partition("?")[0] for request in server.requests} == {
        f"GET /api/v1{address.partition('?')[0]}" for address in ADDRESSES
    }
    assert found.requests == len(found.answers_s)
    assert 0 < found.refused < found.requests / 2, "a fifth of the addresses is refused"


@pytest.mark.real
def test_a_program_is_uploaded_again_and_again() -> None:
    server, found = asyncio.run(
        beside(lambda host, port, load: _uploading(host, port, 3_000_000, load), lambda load: load.uploads >= 3)
    )
    assert set(server.bodies) == {3_000_000}
    assert found.uploaded_bytes >= 9_000_000
    assert found.refused == 0


@pytest.mark.real
def test_everything_at_once_beside_a_job() -> None:
    found, came = asyncio.run(load.on_elvinto(30, Crowd(3, load.EVERYTHING, 20.0, 2_000_000)))
    assert found.batches > 1
    assert found.dead_s > 0
    assert came.messages_s > 0
    assert came.load is not None
    assert came.load.refused == 0
    assert came.load.requests > 0
    assert came.load.uploaded_bytes > 0


@pytest.mark.real
def test_a_pause_with_nobody_there() -> None:
    held, came = asyncio.run(load.paused(1, load.QUIET))
    assert len(held) == 1
    assert held[0] > 0
    assert came == Came()


def test_what_a_client_prints_is_read_back() -> None:
    assert load.loaded(json.loads('{"requests": 3, "answers_s": [0.1, 0.2]}')) == Load(requests=3, answers_s=[0.1, 0.2])
