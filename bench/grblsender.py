"""The plainest sender of G-code: a line, its `ok`, the next line. The yardstick: what one has without a window.

`python -m bench.grblsender HOST PORT CHECK FILE`, as a process of its own so that its processor time is known.
The one rule: nothing clever; what it gains over nothing is what the protocol gives to everybody.
"""

import json
import socket
import sys
import time
from pathlib import Path

READ_BYTES = 4096
ANSWER_WITHIN_S = 30.0


def send(host: str, port: int, lines: list[bytes], *, check: bool) -> float:
    """Send them all; processor seconds it took."""
    with socket.create_connection((host, port), timeout=ANSWER_WITHIN_S) as link:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        began_s = time.process_time()
        for line in [b"$C", *lines] if check else lines:
            link.sendall(line + b"\n")
            _await_answer(link)
        return time.process_time() - began_s


def _await_answer(link: socket.socket) -> None:
    heard = b""
    while not any(line.strip() == b"ok" or line.startswith(b"error") for line in heard.splitlines()):
        heard += link.recv(READ_BYTES)


if __name__ == "__main__":
    _, host, port, check, path = sys.argv
    program = [line.strip() for line in Path(path).read_bytes().splitlines() if line.strip()]
    print(json.dumps({"cpu_s": send(host, int(port), program, check=check == "check")}))
