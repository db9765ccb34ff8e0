"""A daemon that does nothing: takes uploads, answers requests, talks to readers, each with bytes that are ready.

`python -m bench.standin ANSWER_BYTES PIECE_BYTES PIECES_S` prints its port and ends with its standard input. A job
beside a crowd that is with it shows what this computer itself takes away. The one rule: it has nothing of ours in it.
"""

import asyncio
import base64
import hashlib
import json
import re
import sys
from dataclasses import dataclass

HOST = "127.0.0.1"
ACCEPT = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
"""RFC 6455 §4.2.2."""
TEXT = 0x81
SIZE_IN_2, LONGEST_IN_2 = 126, 65_535


@dataclass(frozen=True, slots=True)
class Manner:
    """How much it says. Each of `PIECES_S` is one write to one reader."""

    answer_bytes: int
    piece_bytes: int
    pieces_s: float


class StandIn:
    """See the head of this file."""

    def __init__(self, manner: Manner) -> None:
        body = b" " * manner.answer_bytes
        self._answer = b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n" % len(body) + body
        size = min(max(manner.piece_bytes - 4, SIZE_IN_2), LONGEST_IN_2)
        self._piece = bytes((TEXT, SIZE_IN_2)) + size.to_bytes(2) + b" " * size
        self._every_s = 1 / manner.pieces_s if manner.pieces_s else None

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection, until its client goes."""
        try:
            while True:
                head = await reader.readuntil(b"\r\n\r\n")
                if found := re.search(rb"Sec-WebSocket-Key: (\S+)", head):
                    await self._tell(found[1], writer)
                if found := re.search(rb"Content-Length: (\d+)", head):
                    left = int(found[1])
                    while left:
                        left -= len(await reader.readexactly(min(left, 1 << 16)))
                writer.write(self._answer)
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            writer.close()

    async def _tell(self, key: bytes, writer: asyncio.StreamWriter) -> None:
        accept = base64.b64encode(hashlib.sha1(key + ACCEPT).digest())
        writer.write(
            b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Accept: %b\r\n\r\n" % accept
        )
        while not writer.is_closing():
            if self._every_s is not None:
                writer.write(self._piece)
            await asyncio.sleep(self._every_s or 1.0)
        raise ConnectionResetError


async def _main(manner: Manner) -> None:
    server = await asyncio.start_server(StandIn(manner).talk, HOST, 0)
    print(json.dumps({"port": server.sockets[0].getsockname()[1]}), flush=True)
    await asyncio.to_thread(sys.stdin.read)
    server.close()


if __name__ == "__main__":
    asyncio.run(_main(Manner(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))))
