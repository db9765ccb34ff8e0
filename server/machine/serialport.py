"""Opening what a machine hangs on: a serial device, a pty, `tcp://host:port`, or the built-in `sim:`.

Not the pump (link.py) and not the trying again (reconnect.py). The one rule: opening happens off the loop's thread
and exclusively, `write` never waits, and the loss of the port is told exactly once.
"""

import asyncio
import os
import re
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol
from urllib.parse import urlsplit

import serial

READ_BYTES = 65_536
"""Most that is taken from a socket in one go."""
OPEN_TIMEOUT_S = 5.0
"""A TCP host that does not answer must not keep the machine in `connecting` for minutes."""

_NUMBER = re.compile(r"\[Errno \d+\] |\(\d+, '(?=[^']*'\)$)|(?<=\w)'\)$")
"""The system's number of an error, in the two ways in which pyserial says it."""

OnData = Callable[[bytes], None]
OnLost = Callable[[str], None]


class Port(Protocol):
    """An open port."""

    def write(self, data: bytes) -> Any:
        """Hand bytes to the wire; never waits. What is outstanding is bounded: the protocol is stop-and-wait."""

    def close(self) -> Any:
        """Close it; `on_lost` is not called for that."""


class Opener(Protocol):
    """Opens a port. Raises OSError when that cannot be done."""

    async def __call__(self, url: str, baud: int, on_data: OnData, on_lost: OnLost) -> Port: ...


class _TcpStream(asyncio.BufferedProtocol):
    """A socket as a Port, read into a buffer of its own: asyncio would make one of 256 KiB for every few bytes."""

    def __init__(self, on_data: OnData, on_lost: OnLost) -> None:
        self._on_data = on_data
        self._on_lost: OnLost | None = on_lost
        self._transport: asyncio.Transport | None = None
        self._buffer = bytearray(READ_BYTES)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport  # type: ignore[assignment]

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - what it is called with
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._on_data(bytes(memoryview(self._buffer)[:nbytes]))

    def connection_lost(self, exc: Exception | None) -> None:
        lost, self._on_lost = self._on_lost, None
        if lost is not None:
            lost(f"the port was closed: {exc}" if exc else "the port was closed by the other side")

    def write(self, data: bytes) -> None:
        if self._transport is not None:
            self._transport.write(data)

    def close(self) -> None:
        self._on_lost = None
        if self._transport is not None:
            # Not close(): what still waits in its buffer belongs to an epoch that is over and must not go out.
            self._transport.abort()


class _Device:
    """An open serial device as a Port. The loop says when it can be read; what is written goes to it at once, and only
    what it does not take waits. No transport of asyncio: a Grbl answers every line, and each answer comes this way."""

    def __init__(self, device: serial.Serial, on_data: OnData, on_lost: OnLost) -> None:
        self._device = device
        self._file = device.fileno()
        self._on_data = on_data
        self._on_lost: OnLost | None = on_lost
        self._waiting = bytearray()
        self._closing: asyncio.Future[None] | None = None
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._file, self._readable)

    def write(self, data: bytes) -> None:
        if self._on_lost is None:
            return
        if not self._waiting:
            taken = self._push(data)
            if taken == len(data):
                return
            data = data[taken:]
            self._loop.add_writer(self._file, self._writable)
        self._waiting += data

    def close(self) -> None:
        if self._on_lost is None:
            return
        self._on_lost = None
        self._loop.remove_reader(self._file)
        self._loop.remove_writer(self._file)
        self._waiting.clear()  # it belongs to an epoch that is over and must not go out
        # A driver that still has bytes for the wire waits for them when it is closed.
        self._closing = self._loop.run_in_executor(None, self._device.close)

    async def closed(self) -> None:
        """It is ours no more; or that takes so long that whoever opens it anew had better be refused."""
        if self._closing is not None:
            await asyncio.wait([self._closing], timeout=OPEN_TIMEOUT_S)

    def _readable(self) -> None:
        try:
            data = os.read(self._file, READ_BYTES)
        except OSError:
            data = b""
        if data or (data := self._asked()):
            self._on_data(data)

    def _asked(self) -> bytes:
        """A read that gave nothing: pyserial finds out whether something is wrong, and says it."""
        try:
            return bytes(self._device.read(READ_BYTES))
        except (OSError, ValueError) as error:  # ValueError: it asks by select(), which knows a thousand files
            self._lose(error)
            return b""

    def _writable(self) -> None:
        del self._waiting[: self._push(self._waiting)]
        if not self._waiting:
            self._loop.remove_writer(self._file)

    def _push(self, data: bytes | bytearray) -> int:
        """How many bytes the device takes now."""
        try:
            return os.write(self._file, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._loop.call_soon(self._lose, error)  # whoever writes is in the middle of something
            return len(data)

    def _lose(self, error: Exception) -> None:
        lost = self._on_lost
        self.close()
        if lost is not None:
            lost(f"the port was closed: {error}")


class PortOpener:
    """Opens whatever a URL names. One for each machine, of its protocol: a built-in virtual machine outlives its
    connections."""

    def __init__(self, protocol: str, *, dtr: bool = True) -> None:
        self._protocol = protocol
        self._dtr = dtr
        self._simulated: dict[str, Any] = {}
        self._device: _Device | None = None
        """The last one: while it is being closed it would lock us out."""

    async def __call__(self, url: str, baud: int, on_data: OnData, on_lost: OnLost) -> Port:
        """Raises OSError (serial's errors are OSErrors)."""
        if url.startswith("sim:"):
            return await self._open_simulated(url.removeprefix("sim:").removeprefix("?"), on_data)
        if url.startswith("tcp://"):
            return await _open_tcp(url, on_data, on_lost)
        if self._device is not None:
            await self._device.closed()
        self._device = await _open_device(url, baud, on_data, on_lost, dtr=self._dtr)
        return self._device

    async def _open_simulated(self, query: str, on_data: OnData) -> Port:
        from sim.kinds import build
        from sim.options import READERS
        from sim.shell import open_memory

        options = READERS[self._protocol](query)
        machine = self._simulated.get(query)
        if machine is None:
            now = asyncio.get_running_loop().time()
            machine = self._simulated[query] = build(options.settings, now=now)
        return await open_memory(machine, on_data, faults=options.faults, seed=options.seed, baud=options.baud)


async def _open_tcp(url: str, on_data: OnData, on_lost: OnLost) -> Port:
    parts = urlsplit(url)
    if parts.hostname is None or parts.port is None:
        raise OSError(f"{url} is not tcp://host:port")
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            transport, stream = await loop.create_connection(
                lambda: _TcpStream(on_data, on_lost), parts.hostname, parts.port
            )
    except TimeoutError as error:
        raise OSError(f"{url} does not answer within {OPEN_TIMEOUT_S:g} s") from error
    # An acknowledgement of a few bytes must not wait for a full segment.
    transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return stream


async def _open_device(path: str, baud: int, on_data: OnData, on_lost: OnLost, *, dtr: bool) -> _Device:
    def open_blocking() -> serial.Serial:
        # Two opens of one port are allowed unless exclusive is asked for, and each would get half of the answers.
        device = serial.Serial(None, baudrate=baud, exclusive=True, timeout=0, write_timeout=0)
        device.port, device.dtr = path, dtr
        device.open()
        with suppress(ValueError, OSError, AttributeError):
            # FTDI chips keep what they have heard for 16 ms otherwise. A pty and most other chips know no such mode.
            device.set_low_latency_mode(True)
        return device

    try:
        device = await asyncio.to_thread(open_blocking)
    except ValueError as error:
        raise OSError(f"{path}: {error}") from error
    except serial.SerialException as error:
        raise OSError(_plain(error, path)) from error
    return _Device(device, on_data, on_lost)


def _plain(error: serial.SerialException, path: str) -> str:
    """What pyserial says with the system's words, its number and the name of the port in it twice, said once. Whoever
    asked to open it names the port."""
    text = _NUMBER.sub("", str(error.args[-1]))
    return text.removeprefix(f"could not open port {path}: ").removesuffix(f": {path!r}")


def list_ports() -> list[dict[str, Any]]:
    """The serial devices of this computer."""
    from serial.tools.list_ports import comports

    return [
        {"device": port.device, "description": port.description, "hardware_id": port.hwid}
        for port in sorted(comports())
    ]
