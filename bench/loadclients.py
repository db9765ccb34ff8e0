"""Clients that ask and upload, in a process of their own: `python -m bench.loadclients HOST PORT REQUESTS_S BYTES`.

Requests begin at their times, whether the ones before are answered or not; a program of so many bytes is uploaded again
and again (0: none). When its standard input ends it prints what there was as JSON. The one rule: it takes only the time
that the daemon and the machine leave over, for clients are other computers.
"""

import asyncio
import itertools
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from statistics import quantiles
from typing import Any

POLITE = 19
"""The lowest priority of Linux."""
ADDRESSES = ("/machines", "/machines/mill/state", "/jobs?limit=20", "/programs", "/machines/mill/console")
CONNECTIONS = 10
NO_ANSWER = 0
"""In the place of a status, where the connection broke."""
BLOCK_LINES = 32_768
LINE = "G1 X12.345 Y67.890 Z-1.234 F1200\n"


@dataclass(slots=True)
class Load:
    """What there was, in bytes and seconds. `refusals`: answers that were none of 2xx, by address and status."""

    requests: int = 0
    refusals: dict[str, int] = field(default_factory=dict)
    uploaded_bytes: int = 0
    uploads: int = 0
    seconds: float = 0.0
    answers_s: list[float] = field(default_factory=list)

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


class _Link:
    """One connection that is kept."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self.lock = asyncio.Lock()

    async def ask(self, head: str, body: Iterable[bytes] = ()) -> tuple[int, bytes]:
        """Status and body of the answer."""
        if self._streams is None:
            self._streams = await asyncio.open_connection(*self._address)
        reader, writer = self._streams
        writer.write(f"{head}\r\nHost: {self._address[0]}:{self._address[1]}\r\n\r\n".encode())
        for block in body:
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


async def _asking(host: str, port: int, rate_hz: float, found: Load) -> None:
    links = [_Link(host, port) for _ in range(CONNECTIONS)]
    under_way: set[asyncio.Task[None]] = set()

    async def one(link: _Link, address: str) -> None:
        async with link.lock:
            began_s = time.monotonic()
            try:
                status, _ = await link.ask(f"GET /api/v1{address} HTTP/1.1")
            except (OSError, asyncio.IncompleteReadError):
                status = NO_ANSWER
            found.answers_s.append(time.monotonic() - began_s)
            found.requests += 1
            found.answered(address, status)

    try:
        began_s = time.monotonic()
        for number, link, address in zip(itertools.count(), itertools.cycle(links), itertools.cycle(ADDRESSES)):
            await asyncio.sleep(began_s + number / rate_hz - time.monotonic())
            task = asyncio.ensure_future(one(link, address))
            under_way.add(task)
            task.add_done_callback(under_way.discard)
    finally:
        for task in under_way:
            task.cancel()
        for link in links:
            link.close()


async def _uploading(host: str, port: int, size: int, found: Load) -> None:
    link = _Link(host, port)

    def counted() -> Iterator[bytes]:
        for block in program(size):
            yield block
            found.uploaded_bytes += len(block)

    head = f"POST /api/v1/programs?name=load.nc HTTP/1.1\r\nContent-Length: {size}"
    try:
        while True:
            status, _ = await link.ask(head, counted())
            found.uploads += 1
            found.answered("upload", status)
    finally:
        link.close()


async def press(host: str, port: int, rate_hz: float, upload_bytes: int) -> Load:
    """Until standard input ends."""
    found, began_s = Load(), time.monotonic()
    tasks = [asyncio.ensure_future(_asking(host, port, rate_hz, found))]
    if upload_bytes:
        tasks.append(asyncio.ensure_future(_uploading(host, port, upload_bytes, found)))
    ended = asyncio.ensure_future(asyncio.to_thread(sys.stdin.read))
    print(json.dumps("ready"), flush=True)
    done, _ = await asyncio.wait([*tasks, ended], return_when=asyncio.FIRST_COMPLETED)
    found.seconds = time.monotonic() - began_s
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for task in done - {ended}:
        task.result()
    return found


def loaded(answer: dict[str, Any]) -> Load:
    """What such a process has printed."""
    return Load(**answer)


if __name__ == "__main__":
    polite()
    pressed = asyncio.run(press(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])))
    print(json.dumps(asdict(pressed)), flush=True)
