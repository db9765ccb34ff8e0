"""A sender that does nothing but count characters: `python -m bench.grblbare PORT FILE` prints its processor time.

The yardstick of what asyncio and the serial port cost by themselves on this computer at this moment: no journal, no
reports, no state, no API. The one rule: the same port, the same bytes and the same window as the daemon's.
"""

import asyncio
import json
import sys
import time
from collections import deque
from pathlib import Path

from server.machine.serialport import PortOpener

BAUD = 115200
WINDOW_BYTES = 128
QUIET_S = 0.5
"""After the port was opened the banner comes; nothing is sent before."""


class Bare:
    """`done` when every line has its ok."""

    def __init__(self, lines: list[bytes]) -> None:
        self._lines = deque(lines)
        self._sizes: deque[int] = deque()
        self._used_bytes = 0
        self._rest = b""
        self.begun = False
        self.done: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def heard(self, data: bytes) -> bytes:
        """What comes in; what is to go out then."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            if line.strip() == b"ok" and self._sizes:
                self._used_bytes -= self._sizes.popleft()
        if not self._lines and not self._sizes and not self.done.done():
            self.done.set_result(None)
        return self.ready()

    def ready(self) -> bytes:
        """As many lines as there is room for."""
        out = b""
        while self.begun and self._lines and self._used_bytes + len(self._lines[0]) <= WINDOW_BYTES:
            line = self._lines.popleft()
            self._sizes.append(len(line))
            self._used_bytes += len(line)
            out += line
        return out


async def send(path: str, lines: list[bytes]) -> float:
    """Send them all; processor seconds."""
    bare = Bare(lines)

    def heard(data: bytes) -> None:
        if out := bare.heard(data):
            port.write(out)

    port = await PortOpener("grbl")(path, BAUD, heard, lambda _reason: None)
    await asyncio.sleep(QUIET_S)
    began_s = time.process_time()
    bare.begun = True
    port.write(bare.ready())
    await bare.done
    port.close()
    return time.process_time() - began_s


if __name__ == "__main__":
    program = [line.replace(b" ", b"") + b"\n" for line in Path(sys.argv[2]).read_bytes().split(b"\n") if line.strip()]
    print(json.dumps({"cpu_s": asyncio.run(send(sys.argv[1], program))}))
