"""A line to a controller for a command that waits: a serial device, a pty or `tcp://`, opened for a few questions.

Not the daemon's ports (serialport.py), which never wait. The one rule: opened exclusively and closed at once behind the
questions; a line that takes nothing more is an OSError, not a wait.
"""

import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import closing, contextmanager
from urllib.parse import urlsplit

import serial

OPEN_TIMEOUT_S = 5.0
WRITE_TIMEOUT_S = 2.0
READ_BYTES = 4096
QUIET_S = 0.25
"""Behind the last byte of an answer: nothing more of it comes."""


class _Timed(ABC):
    """Hears until nothing more comes or time is up; what it stands on reads once, with a time limit."""

    def hear(self, seconds: float) -> bytes:
        """What comes in within so many seconds; less, where an answer has come and it is quiet behind it."""
        ends_at, heard = time.monotonic() + seconds, b""
        while (left_s := ends_at - time.monotonic()) > 0 and len(heard) < READ_BYTES:
            came = self.read_once(min(left_s, QUIET_S) if heard else left_s)
            if heard and not came:
                break
            heard += came
        return heard

    @abstractmethod
    def read_once(self, timeout_s: float) -> bytes:
        """Whatever comes first, or nothing. Raises OSError."""


class SerialLine(_Timed):
    """A device or a pty."""

    def __init__(self, port: str, baud: int, *, dtr: bool) -> None:
        self._device = serial.Serial(None, baudrate=baud, exclusive=True, write_timeout=WRITE_TIMEOUT_S)
        self._device.port, self._device.dtr = port, dtr
        self._device.open()

    def say(self, data: bytes) -> None:
        """Raises OSError."""
        self._device.write(data)

    def read_once(self, timeout_s: float) -> bytes:
        self._device.timeout = timeout_s
        first: bytes = self._device.read(1)
        return first + self._device.read(self._device.in_waiting) if first else first

    def close(self) -> None:
        """Give the port back."""
        self._device.close()


class TcpLine(_Timed):
    """`tcp://host:port`."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._socket = socket.create_connection((parts.hostname or "", parts.port or 0), OPEN_TIMEOUT_S)

    def say(self, data: bytes) -> None:
        """Raises OSError."""
        self._socket.settimeout(WRITE_TIMEOUT_S)
        self._socket.sendall(data)

    def read_once(self, timeout_s: float) -> bytes:
        self._socket.settimeout(timeout_s)
        try:
            came = self._socket.recv(READ_BYTES)
        except TimeoutError:
            return b""
        if not came:
            raise OSError("the other side has closed the connection")
        return came

    def close(self) -> None:
        """Give the connection back."""
        self._socket.close()


@contextmanager
def open_line(port: str, baud: int, *, dtr: bool) -> Iterator[SerialLine | TcpLine]:
    """The line, while somebody asks. Raises OSError."""
    try:
        line: SerialLine | TcpLine = TcpLine(port) if port.startswith("tcp://") else SerialLine(port, baud, dtr=dtr)
    except ValueError as error:
        raise OSError(f"{port}: {error}") from error
    with closing(line):
        yield line
