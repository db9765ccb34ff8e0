"""Clients that do not read, do not end and say too much, beside a job: the stream does not notice, and they are cut.

A real daemon and real sockets, for the buffers of the operating system are a part of the story.
"""

import base64
import os
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.harness.process import MACHINE, Daemon, daemon, sim_process, until

pytestmark = pytest.mark.real

SMALL_BYTES = 4096
"""Of a receive buffer: little of what the daemon sends disappears in the system."""
DEAF_READERS = 8
AT_ONCE_S = 10.0
"""On any computer, whatever else it does; who waits for a reader that does not read waits for ever."""


def program() -> str:
    moves = [f"G1 X{i % 2 * 40 + i % 7} Y{i % 5} F6000" for i in range(1, 60)]
    return "\n".join(["G90", *moves])


@contextmanager
def deaf_reader(one: Daemon) -> Iterator[socket.socket]:
    """A WebSocket that is open, and nobody reads."""
    parts = urlsplit(one.url)
    key = base64.b64encode(os.urandom(16)).decode()
    with socket.socket() as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SMALL_BYTES)
        deaf.settimeout(10)
        deaf.connect((parts.hostname, parts.port))
        deaf.sendall(
            f"GET /api/v1/events HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        assert deaf.recv(12) == b"HTTP/1.1 101"
        yield deaf


def frame(text: bytes) -> bytes:
    """A short text message of a client, under the mask 0."""
    assert len(text) < 126
    return bytes((0x81, 0x80 | len(text), 0, 0, 0, 0)) + text


@contextmanager
def endless_upload(one: Daemon) -> Iterator[socket.socket]:
    """An upload that has begun and never goes on."""
    parts = urlsplit(one.url)
    with socket.create_connection((parts.hostname, parts.port)) as upload:
        upload.sendall(
            f"POST /api/v1/programs?name=big.nc HTTP/1.1\r\nHost: {parts.netloc}\r\n"
            f"Content-Length: 1000000000\r\n\r\nG1 X1 F100\n".encode()
        )
        yield upload


def metric(one: Daemon, name: str) -> float:
    lines = one.http.get("/metrics").text.splitlines()
    return sum(float(line.rpartition(" ")[2]) for line in lines if line.startswith(name))


def timed(one: Daemon) -> float:
    """Run the program; seconds by the daemon's own clock, from its row."""
    job = one.job(program())
    view = one.status(job, "completed", "failed", "interrupted")
    assert view["status"] == "completed", view
    return float(view["progress"]["seconds_elapsed"])


def test_readers_that_do_not_read_delay_nothing_and_are_cut(tmp_path: Path) -> None:
    with (
        sim_process(tmp_path, "--speed", "10") as (port, recording),
        daemon(tmp_path, port) as one,
        ExitStack() as readers,
    ):
        one.connected()
        alone_s = timed(one)
        deaf = [readers.enter_context(deaf_reader(one)) for _ in range(DEAF_READERS)]
        readers.enter_context(endless_upload(one))
        among_deaf_s = timed(one)
        assert among_deaf_s < 3 * alone_s + AT_ONCE_S, (alone_s, among_deaf_s)
        executed = recording.blocks()
        assert executed[: len(executed) // 2] == executed[len(executed) // 2 :], "twice the same program"
        # What says much and reads nothing is given up as soon as its answers do not fit any more.
        before = metric(one, "millstream_websocket_clients_dropped_total")
        chatter = frame(b'{"type": "nonsense", "id": 1}') * 400

        def cut() -> bool:
            with suppress(OSError):  # it may be cut already
                deaf[0].sendall(chatter)
            return metric(one, "millstream_websocket_clients_dropped_total") > before

        until(cut, why=one.log)


def test_an_emergency_stop_waits_for_nobody(tmp_path: Path) -> None:
    with (
        sim_process(tmp_path, "--speed", "1") as (port, recording),
        daemon(tmp_path, port) as one,
        ExitStack() as readers,
    ):
        job = one.connected().job(program())
        for _ in range(DEAF_READERS):
            readers.enter_context(deaf_reader(one))
            readers.enter_context(endless_upload(one))
        recording.reached(5)
        asked_at = time.monotonic()
        assert one.http.post(f"/api/v1/machines/{MACHINE}/estop").status_code == 202
        assert time.monotonic() - asked_at < AT_ONCE_S
        view = one.status(job, "failed")
        assert view["error"]["code"] == "estop"
        assert view["error"]["line_from"] - 1 <= len(recording.blocks()) <= view["error"]["line_to"]
        state = one.get(f"/machines/{MACHINE}/state")
        assert (state["status"], state["alarm"]["code"]) == ("alarm", 100)
        stood = recording.blocks()
        refused = one.http.post(f"/api/v1/machines/{MACHINE}/commands", json={"blocks": ["G0 X0"]})
        assert (refused.status_code, refused.json()["code"]) == (409, "alarm_active")
        assert recording.blocks() == stood
