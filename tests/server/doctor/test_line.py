"""Lines for a few questions: on a pty and on TCP, exclusive, with a time limit to everything."""

import os
import socket
import threading
import tty
from collections.abc import Iterator

import pytest

from server.doctor import line as doctorline
from server.doctor.line import open_line


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorline, "QUIET_S", 0.03)


@pytest.fixture
def pty() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_pty_is_spoken_to_and_heard(pty: tuple[int, str]) -> None:
    master, port = pty
    with open_line(port, 115200, dtr=True) as line:
        line.say(b"?")
        assert os.read(master, 10) == b"?"
        os.write(master, b"<Idle>\r\n")
        assert line.hear(5.0) == b"<Idle>\r\n"
        assert line.hear(0.01) == b""


def test_a_port_is_opened_by_one_alone(pty: tuple[int, str]) -> None:
    _, port = pty
    with open_line(port, 115200, dtr=True), pytest.raises(OSError, match="lock"), open_line(port, 115200, dtr=True):
        pass


def test_a_port_that_is_none_is_an_os_error() -> None:
    with pytest.raises(OSError, match="ttyNOTHERE"), open_line("/dev/ttyNOTHERE", 115200, dtr=True):
        pass


def test_tcp_is_spoken_to_and_heard_until_it_closes() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"tcp://127.0.0.1:{server.getsockname()[1]}"

        def controller() -> None:
            with server.accept()[0] as client:
                client.sendall(client.recv(10).upper())

        thread = threading.Thread(target=controller)
        thread.start()
        with open_line(url, 0, dtr=True) as line:
            line.say(b"ready;")
            assert line.read_once(5.0) == b"READY;"
            with pytest.raises(OSError, match="closed"):
                line.read_once(5.0)
        thread.join()
    with pytest.raises(OSError, match="refused"), open_line(url, 0, dtr=True):
        pass


def test_tcp_that_says_nothing() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with open_line(url, 0, dtr=True) as line:
            assert line.hear(0.02) == b""
