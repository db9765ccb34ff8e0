"""A crowd in a process of its own: who reads over WebSockets, who asks, who uploads. `python -m bench.loadclients`.

Each line on its standard input is a `Crowd` as JSON, which comes and is answered with `{}` when all of it is there, or
an empty line: then it goes and what it got is printed (`Load`). The upload stops there and goes on the next time. The
one rule: it takes only the time that the daemon and the machines leave over, for a crowd is on other computers.
"""

import asyncio
import base64
import itertools
import json
import os
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from statistics import quantiles
from typing import Any

POLITE = 19
"""The lowest priority of Linux."""
ADDRESSES = ("/machines", "/machines/mill/state", "/jobs?limit=20", "/programs", "/machines/mill/console")
CONNECTIONS = 10
NO_ANSWER = 0
"""In the place of a status, where the connection broke."""
BLOCK_LINES = 8192
LINE = "G1 X12.345 Y67.890 Z-1.234 F1200\n"
UPLOAD_BYTES_S = 50_000_000
"""As quick as a line of half a gigabit."""
PING, PONG, FIN, MASKED = 0x9, 0xA, 0x80, 0x80
SIZE_IN_2, SIZE_IN_8 = 126, 127
"""Payload lengths that stand for a longer field (RFC 6455 §5.2)."""


@dataclass(frozen=True, slots=True)
class Crowd:
    """Who comes, and where to."""

    host: str
    port: int
    readers: int = 0
    topics: str = ""
    rate_hz: float = 20.0
    requests_s: float = 0.0
    upload_bytes: int = 0
    """Of each program; one after the other."""


@dataclass(slots=True)
class Load:
    """What they got, in bytes and seconds. `refusals`: answers that were none of 2xx, by address and status.

    `pieces` are the messages that came together; they and `read_bytes` are of all readers.
    """

    requests: int = 0
    refusals: dict[str, int] = field(default_factory=dict)
    answer_bytes: int = 0
    uploaded_bytes: int = 0
    uploads: int = 0
    seconds: float = 0.0
    answers_s: list[float] = field(default_factory=list)
    messages: int = 0
    pieces: int = 0
    read_bytes: int = 0

    def __add__(self, other: "Load") -> "Load":
        total = Load(**asdict(self))
        for name, value in asdict(other).items():
            if name != "refusals":
                setattr(total, name, getattr(total, name) + value)
        for refusal, times in other.refusals.items():
            total.refusals[refusal] = total.refusals.get(refusal, 0) + times
        return total

    @property
    def refused(self) -> int:
        return sum(self.refusals.values())

    def answered(self, address: str, status: int) -> None:
        """One answer."""
        if not 200 <= status < 300:
            self.refusals[f"{address}: {status}"] = self.refusals.get(f"{address}: {status}", 0) + 1

    @property
    def p99_s(self) -> float:
        return quantiles(self.answers_s, n=100, method="inclusive")[98] if len(self.answers_s) > 1 else 0.0


def polite() -> None:
    """Only what the others leave over, from now on."""
    os.nice(POLITE)


# --- who reads --------------------------------------------------------------------------------------------------------


class Reader(asyncio.Protocol):
    """One dashboard. It counts messages and looks into none: what a browser does with them costs another computer."""

    def __init__(self, crowd: Crowd, found: Load) -> None:
        self._crowd = crowd
        self._found = found
        self._rest = bytearray()
        self._transport: asyncio.Transport | None = None
        self.accepted: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        asked = f"/api/v1/events?topics={self._crowd.topics}&rate={self._crowd.rate_hz:g}"
        transport.write(
            f"GET {asked} HTTP/1.1\r\nHost: {self._crowd.host}:{self._crowd.port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n".encode()
        )

    def data_received(self, data: bytes) -> None:
        self._rest += data
        if not self.accepted.done():
            head, end, rest = self._rest.partition(b"\r\n\r\n")
            if not end:
                return
            self._rest = rest
            if b" 101 " in head.partition(b"\r\n")[0]:
                self.accepted.set_result(None)
            else:
                self.accepted.set_exception(ConnectionError(head.decode("latin-1")[:300]))
        self._found.pieces += 1
        self._found.read_bytes += len(data)
        self._count()

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - however it was lost
        if not self.accepted.done():
            self.accepted.set_exception(ConnectionError("a reader was refused"))
        elif self._transport is not None:
            self._found.answered("a reader was cut off", NO_ANSWER)

    def leave(self) -> None:
        """No farewell: a window that is closed."""
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.abort()

    def _count(self) -> None:
        at, data = 0, self._rest
        while len(data) - at >= 2:
            size, begins = data[at + 1], at + 2
            if size in (SIZE_IN_2, SIZE_IN_8):
                begins += 2 if size == SIZE_IN_2 else 8
                size = int.from_bytes(data[at + 2 : begins])
            if len(data) < begins + size:
                break
            if data[at] & 0xF == PING and self._transport is not None:
                # A mask of zeros changes nothing.
                self._transport.write(bytes((FIN | PONG, MASKED | size, 0, 0, 0, 0)) + data[begins : begins + size])
            at = begins + size
            self._found.messages += 1
        del data[:at]


async def _reading(crowd: Crowd, found: Load) -> list[Reader]:
    """All of them, accepted. Raises ConnectionError."""
    loop = asyncio.get_running_loop()
    readers: list[Reader] = []
    for _ in range(crowd.readers):
        _, reader = await loop.create_connection(lambda: Reader(crowd, found), crowd.host, crowd.port)
        readers.append(reader)
    for reader in readers:
        await reader.accepted
    return readers


# --- who asks and uploads ---------------------------------------------------------------------------------------------


class _Link:
    """One connection that is kept."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self.lock = asyncio.Lock()

    async def ask(self, head: str, body: AsyncIterator[bytes] | None = None) -> tuple[int, bytes]:
        """Status and body of the answer."""
        if self._streams is None:
            self._streams = await asyncio.open_connection(*self._address)
        reader, writer = self._streams
        writer.write(f"{head}\r\nHost: {self._address[0]}:{self._address[1]}\r\n\r\n".encode())
        if body is not None:
            async for block in body:
                writer.write(block)
                await writer.drain()
        answer = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower()
        length = int(answer.partition("content-length:")[2].partition("\r\n")[0])
        return int(answer.split()[1]), await reader.readexactly(length)

    def close(self) -> None:
        if self._streams is not None:
            self._streams[1].close()


def program(size: int) -> Iterator[bytes]:
    """A program of exactly so many bytes."""
    block = (LINE * BLOCK_LINES).encode()
    for at in range(0, size, len(block)):
        yield block[: size - at]


async def _asking(crowd: Crowd, found: Load) -> None:
    """Requests begin at their times, whether the ones before are answered or not."""
    links = [_Link(crowd.host, crowd.port) for _ in range(CONNECTIONS)]
    under_way: set[asyncio.Task[None]] = set()

    async def one(link: _Link, address: str) -> None:
        async with link.lock:
            began_s = time.monotonic()
            body = b""
            try:
                status, body = await link.ask(f"GET /api/v1{address} HTTP/1.1")
            except (OSError, asyncio.IncompleteReadError):
                status = NO_ANSWER
            found.answers_s.append(time.monotonic() - began_s)
            found.requests += 1
            found.answer_bytes += len(body)
            found.answered(address, status)

    try:
        began_s = time.monotonic()
        for number, link, address in zip(itertools.count(), itertools.cycle(links), itertools.cycle(ADDRESSES)):
            await asyncio.sleep(began_s + number / crowd.requests_s - time.monotonic())
            task = asyncio.ensure_future(one(link, address))
            under_way.add(task)
            task.add_done_callback(under_way.discard)
    finally:
        for task in under_way:
            task.cancel()
        for link in links:
            link.close()


class Uploading:
    """Programs to one address, one after the other, while `found` is there to count them; else it waits where it is."""

    def __init__(self, crowd: Crowd) -> None:
        self._link = _Link(crowd.host, crowd.port)
        self._size = crowd.upload_bytes
        self._going = asyncio.Event()
        self._found = Load()
        self._paid_at = 0.0
        self._task = asyncio.ensure_future(self._run())

    def go_on(self, found: Load) -> None:
        """Count into `found` from now on."""
        self._found, self._paid_at = found, time.monotonic()
        self._going.set()

    def rest(self) -> None:
        """Until `go_on`. Raises what ended it, if something did."""
        self._going.clear()
        if self._task.done():
            self._task.result()

    async def end(self) -> None:
        """For good."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        self._link.close()

    async def _run(self) -> None:
        head = f"POST /api/v1/programs?name=load.nc HTTP/1.1\r\nContent-Length: {self._size}"
        while True:
            status, _ = await self._link.ask(head, self._body())
            self._found.uploads += 1
            self._found.answered("upload", status)

    async def _body(self) -> AsyncIterator[bytes]:
        for block in program(self._size):
            await self._going.wait()
            await asyncio.sleep(self._paid_at - time.monotonic())
            self._paid_at = max(self._paid_at, time.monotonic() - 1.0) + len(block) / UPLOAD_BYTES_S
            yield block
            self._found.uploaded_bytes += len(block)


# --- the process ------------------------------------------------------------------------------------------------------


class Visit:
    """A crowd that is there."""

    def __init__(self, crowd: Crowd, uploading: Uploading | None) -> None:
        self._crowd = crowd
        self._uploading = uploading
        self._found = Load()
        self._readers: list[Reader] = []
        self._asking: asyncio.Task[None] | None = None
        self._began_s = 0.0

    async def begin(self) -> None:
        """All of them have come. Raises ConnectionError."""
        self._readers = await _reading(self._crowd, self._found)
        self._began_s = time.monotonic()
        if self._crowd.requests_s:
            self._asking = asyncio.ensure_future(_asking(self._crowd, self._found))
        if self._uploading is not None:
            self._uploading.go_on(self._found)

    async def end(self) -> Load:
        """They go; what they got. Raises what went wrong with them."""
        self._found.seconds = time.monotonic() - self._began_s
        if self._uploading is not None:
            self._uploading.rest()
        for reader in self._readers:
            reader.leave()
        if self._asking is not None:
            self._asking.cancel()
            with suppress(asyncio.CancelledError):
                await self._asking
        return self._found


async def obey(lines: AsyncIterator[bytes], say: Callable[[Any], None]) -> None:
    """Until there are no more lines."""
    visit: Visit | None = None
    uploads: dict[int, Uploading] = {}
    async for line in lines:
        if line.strip():
            crowd = Crowd(**json.loads(line))
            if crowd.upload_bytes and crowd.port not in uploads:
                uploads[crowd.port] = Uploading(crowd)
            visit = Visit(crowd, uploads.get(crowd.port) if crowd.upload_bytes else None)
            await visit.begin()
            say({})
        elif visit is not None:
            say(asdict(await visit.end()))
            visit = None
    for upload in uploads.values():
        await upload.end()


async def _main() -> None:
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    await obey(reader, lambda what: print(json.dumps(what), flush=True))


if __name__ == "__main__":
    polite()
    asyncio.run(_main())
