"""A broker small enough to be read: MQTT 3.1.1 as far as the daemon speaks it, over a real socket.

Not a broker: no sessions, no wildcards, one client at a time. The one rule: it reads the standard by itself, byte by
byte, and it can misbehave: refuse, fall silent, cut the line.
"""

import asyncio
from dataclasses import dataclass, field

CONNECT, PUBLISH, PUBACK, SUBSCRIBE, PINGREQ, DISCONNECT = 1, 3, 4, 8, 12, 14
CONNACK, SUBACK, PINGRESP = 0x20, 0x90, 0xD0


@dataclass
class Broker:
    """`published` in order; `retained` as a broker would keep it. `refuse`: the return code of CONNACK."""

    refuse: int = 0
    silent: bool = False
    """It takes everything and acknowledges nothing."""
    published: list[tuple[str, str]] = field(default_factory=list)
    retained: dict[str, str] = field(default_factory=dict)
    subscribed: list[str] = field(default_factory=list)
    connects: int = 0
    will: tuple[str, str] | None = None
    user: str | None = None
    password: str | None = None
    port: int = 0

    async def __aenter__(self) -> "Broker":
        self._news = asyncio.Event()
        self._writers: list[asyncio.StreamWriter] = []
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        self.cut()
        await self._server.wait_closed()

    def cut(self) -> None:
        """The line breaks; nobody says good-bye, so the last will is said."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    def send(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """A message to the client."""
        body = _text(topic.encode()) + payload
        for writer in self._writers:
            writer.write(_packet(PUBLISH << 4 | retain, body))

    async def until(self, condition: object, within_s: float = 5.0) -> None:
        """Wait for something to be true of what was received."""
        assert callable(condition)
        async with asyncio.timeout(within_s):
            while not condition():
                self._news.clear()
                await self._news.wait()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        polite = False
        try:
            while not polite:
                head = (await reader.readexactly(1))[0]
                body = await reader.readexactly(await _length(reader))
                polite = head >> 4 == DISCONNECT
                self._packet(head, body, writer)
                self._news.set()
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            if self.will is not None and not polite:
                self.retained[self.will[0]] = self.will[1]
            writer.close()
            self._news.set()

    def _packet(self, head: int, body: bytes, writer: asyncio.StreamWriter) -> None:
        match head >> 4:
            case kind if kind == CONNECT:
                self._connect(body)
                self._writers.append(writer)
                writer.write(_packet(CONNACK, bytes((0, self.refuse))))
            case kind if kind == PUBLISH:
                topic, rest = _take(body)
                quality = head >> 1 & 3
                payload = rest[2:] if quality else rest
                self.published.append((topic.decode(), payload.decode()))
                if head & 1:
                    self.retained[topic.decode()] = payload.decode()
                if quality and not self.silent:
                    writer.write(_packet(PUBACK << 4, rest[:2]))
            case kind if kind == SUBSCRIBE:
                topic, _ = _take(body[2:])
                self.subscribed.append(topic.decode())
                writer.write(_packet(SUBACK, body[:2] + b"\x01"))
            case kind if kind == PINGREQ and not self.silent:
                writer.write(_packet(PINGRESP, b""))
            case _:
                pass

    def _connect(self, body: bytes) -> None:
        name, rest = _take(body)
        assert (name, rest[0]) == (b"MQTT", 4)
        flags, rest = rest[1], rest[4:]
        self.connects += 1
        _, rest = _take(rest)
        if flags & 0x04:
            topic, rest = _take(rest)
            message, rest = _take(rest)
            self.will = topic.decode(), message.decode()
        if flags & 0x80:
            user, rest = _take(rest)
            self.user = user.decode()
        if flags & 0x40:
            word, rest = _take(rest)
            self.password = word.decode()


def _text(data: bytes) -> bytes:
    return len(data).to_bytes(2) + data


def _take(data: bytes) -> tuple[bytes, bytes]:
    size = int.from_bytes(data[:2])
    return data[2 : 2 + size], data[2 + size :]


def _packet(head: int, body: bytes) -> bytes:
    size, length = len(body), b""
    while True:
        size, seven = divmod(size, 128)
        length += bytes((seven | (128 if size else 0),))
        if not size:
            return bytes((head,)) + length + body


async def _length(reader: asyncio.StreamReader) -> int:
    total = shift = 0
    while True:
        byte = (await reader.readexactly(1))[0]
        total |= (byte & 127) << shift
        if not byte & 128:
            return total
        shift += 7
