"""Opening what a machine hangs on: a serial device, a pty, `tcp://host:port`, or the built-in `sim:`.

Not the pump (link.py) and not the trying again (reconnect.py). The one rule: opening happens off the loop's thread
and exclusively, `write` never waits, and the loss of the port is told exactly once.
"""

import asyncio
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol
from urllib.parse import urlsplit

import serial
import serial_asyncio_fast

READ_BYTES = 65_536
"""Most that is taken from a socket in one go."""
OPEN_TIMEOUT_S = 5.0
"""A TCP host that does not answer must not keep the machine in `connecting` for minutes."""

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


class _Stream(asyncio.Protocol):
    """A transport of asyncio as a Port."""

    def __init__(self, on_data: OnData, on_lost: OnLost) -> None:
        self._on_data = on_data
        self._on_lost: OnLost | None = on_lost
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport  # type: ignore[assignment]

    def data_received(self, data: bytes) -> None:
        self._on_data(data)

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


class _TcpStream(_Stream, asyncio.BufferedProtocol):
    """The same for a socket, into a buffer of its own: asyncio would make one of 256 KiB for every few bytes."""

    def __init__(self, on_data: OnData, on_lost: OnLost) -> None:
        super().__init__(on_data, on_lost)
        self._buffer = bytearray(READ_BYTES)

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - what it is called with
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self.data_received(bytes(memoryview(self._buffer)[:nbytes]))


class _Device(serial.Serial):
    """A serial port of which the loop knows already that it can be read or written: pyserial asks the system again each
    time, and where the device takes nothing more it would try for ever instead of leaving the rest to the loop."""

    def read(self, size: int = 1) -> bytes:
        """What has come; never waits. What is wrong, pyserial finds out and says."""
        if os.name == "posix" and self.is_open:
            with suppress(OSError):
                if data := os.read(self.fileno(), size):
                    return data
        return bytes(super().read(size))

    def write(self, data: Any, /) -> int | None:
        """How many bytes the device has taken. Raises BlockingIOError when it takes none at the moment."""
        if os.name == "posix" and self.is_open:
            try:
                return os.write(self.fileno(), data)
            except BlockingIOError:
                raise
            except OSError:
                pass  # pyserial finds out what is wrong, and says it
        return super().write(data)


class PortOpener:
    """Opens whatever a URL names. One for each machine, of its protocol: a built-in virtual machine outlives its
    connections."""

    def __init__(self, protocol: str, *, dtr: bool = True) -> None:
        self._protocol = protocol
        self._dtr = dtr
        self._simulated: dict[str, Any] = {}

    async def __call__(self, url: str, baud: int, on_data: OnData, on_lost: OnLost) -> Port:
        """Raises OSError (serial's errors are OSErrors)."""
        if url.startswith("sim:"):
            return await self._open_simulated(url.removeprefix("sim:").removeprefix("?"), on_data)
        if url.startswith("tcp://"):
            return await _open_tcp(url, on_data, on_lost)
        return await _open_device(url, baud, on_data, on_lost, dtr=self._dtr)

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


async def _open_device(path: str, baud: int, on_data: OnData, on_lost: OnLost, *, dtr: bool) -> Port:
    def open_blocking() -> serial.Serial:
        # Two opens of one port are allowed unless exclusive is asked for, and each would get half of the answers.
        device = _Device(None, baudrate=baud, exclusive=True, timeout=0, write_timeout=0)
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
    stream = _Stream(on_data, on_lost)
    serial_asyncio_fast.SerialTransport(asyncio.get_running_loop(), stream, device)
    await asyncio.sleep(0)  # the transport announces itself in the next round of the loop
    return stream


def list_ports() -> list[dict[str, Any]]:
    """The serial devices of this computer."""
    from serial.tools.list_ports import comports

    return [
        {"device": port.device, "description": port.description, "hardware_id": port.hwid}
        for port in sorted(comports())
    ]
