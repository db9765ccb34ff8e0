"""Puts a virtual machine behind a TCP port, a pseudo-terminal or a pair of callbacks. The only impure file of `sim`.

It knows nothing of what the machine speaks: any object with the verbs will do. The one rule: the machine lives on when
nobody is connected, as a real one does; what it says then is lost, as on a real line.
"""

import asyncio
import os
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, runtime_checkable

from sim.faults import MESSAGES, FaultRates, Framing, HostileWire
from sim.kinds import Recorded, Settings, build

READ_BYTES = 65_536
NEVER = (None, None, None)
"""No timer of machine or wires is running."""


class Machine(Protocol):
    """The verbs a shell needs."""

    def receive_data(self, data: bytes, now: float) -> None: ...
    def data_to_send(self, now: float) -> bytes: ...
    def next_timer(self) -> float | None: ...
    def handle_timer(self, now: float) -> None: ...


@runtime_checkable
class Framed(Protocol):
    """A machine whose messages do not end with `;`."""

    @property
    def framing(self) -> Framing: ...


@runtime_checkable
class NoticesOpening(Protocol):
    """A machine to which it matters that the port was opened: DTR resets an Arduino."""

    def line_opened(self, now: float) -> None: ...


class Pump:
    """Moves bytes between a machine and a way out, through two wires; one timer. `say` takes what the machine says."""

    def __init__(self, machine: Machine, *, faults: FaultRates | None = None, seed: int = 0, baud: int = 0) -> None:
        self.machine = machine
        self.say: Callable[[bytes], None] | None = None
        self._loop = asyncio.get_running_loop()
        framing = machine.framing if isinstance(machine, Framed) else MESSAGES
        self._down = HostileWire(seed, faults, baud=baud, framing=framing)
        self._up = HostileWire(seed + 1, faults, baud=baud, framing=framing)
        self._timer: asyncio.TimerHandle | None = None

    def hear(self, data: bytes) -> None:
        self._down.send(data, self._loop.time())
        self.turn()

    def opened(self) -> None:
        """Somebody has opened the port."""
        if isinstance(self.machine, NoticesOpening):
            self.machine.line_opened(self._loop.time())

    def turn(self) -> None:
        """To be called after anything was done to the machine from outside, too."""
        now = self._loop.time()
        machine = self.machine
        machine.handle_timer(now)
        if data := self._down.receive(now):
            machine.receive_data(data, now)
        if data := machine.data_to_send(now):
            self._up.send(data, now)
        data = self._up.receive(now)
        if data and self.say is not None:
            self.say(data)
        self._arm()

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _arm(self) -> None:
        self.stop()
        timers = (self.machine.next_timer(), self._down.next_timer(), self._up.next_timer())
        if timers != NEVER:
            self._timer = self._loop.call_at(min(at for at in timers if at is not None), self.turn)


class MemoryLink:
    """A machine in this process. What it says comes by a callback of the loop, never from inside `write`."""

    def __init__(self, pump: Pump, on_data: Callable[[bytes], None]) -> None:
        self._pump = pump
        self._on_data = on_data
        self._loop = asyncio.get_running_loop()
        self._open = True
        pump.opened()
        pump.turn()
        pump.say = self._say

    def write(self, data: bytes) -> None:
        if self._open:
            self._loop.call_soon(self._hear, data)

    def close(self) -> None:
        """Nothing is heard or said any more; the machine keeps its state for the next `open_memory`."""
        self._open = False
        self._pump.say = None
        self._pump.stop()

    def turn(self) -> None:
        """To be called after anything was done to the machine from outside."""
        if self._open:
            self._pump.turn()

    def _hear(self, data: bytes) -> None:
        if self._open:
            self._pump.hear(data)

    def _say(self, data: bytes) -> None:
        self._loop.call_soon(self._pass_on, data)

    def _pass_on(self, data: bytes) -> None:
        if self._open:
            self._on_data(data)


async def open_memory(
    machine: Machine,
    on_data: Callable[[bytes], None],
    *,
    faults: FaultRates | None = None,
    seed: int = 0,
    baud: int = 0,
) -> MemoryLink:
    """A link to a machine in this process. `now` is the loop's time, real or simulated."""
    return MemoryLink(Pump(machine, faults=faults, seed=seed, baud=baud), on_data)


class _Client(asyncio.BufferedProtocol):
    """Somebody at the port. The buffer is its own: asyncio would make one of 256 KiB for every few bytes."""

    transport: asyncio.Transport

    def __init__(self, shell: "TcpShell") -> None:
        self._shell = shell
        self._buffer = bytearray(READ_BYTES)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self._shell.joined(self)

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - what it is called with
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self._shell.heard(self, bytes(memoryview(self._buffer)[:nbytes]))

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - however it was lost
        self._shell.left(self)


class TcpShell:
    """One client at a time; a new one takes the place of the old one, as a re-plugged cable does."""

    def __init__(self, pump: Pump) -> None:
        self.pump = pump
        self._server: asyncio.Server | None = None
        self._client: _Client | None = None
        self._host = ""
        self.port = 0

    async def open(self, host: str, port: int) -> None:
        self._host = host
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: _Client(self), host, port, reuse_address=True)
        self.port = self._server.sockets[0].getsockname()[1]
        self.pump.say = self._say
        self.pump.turn()

    async def unplug(self) -> None:
        """The client loses its connection and finds nobody; the machine goes on."""
        if self._server is not None:
            self._server.close()
            self._server = None
        self._cut()
        await asyncio.sleep(0)

    async def replug(self) -> None:
        await self.open(self._host, self.port)

    async def close(self) -> None:
        await self.unplug()
        self.pump.stop()

    def joined(self, client: _Client) -> None:
        """Somebody has connected."""
        self._cut()
        self._client = client
        self.pump.opened()
        self.pump.turn()

    def heard(self, client: _Client, data: bytes) -> None:
        """Bytes from the port; nobody is heard any more who was replaced."""
        if client is self._client:
            self.pump.hear(data)

    def left(self, client: _Client) -> None:
        """The connection has ended, by whichever side."""
        if client is self._client:
            self._client = None

    def _say(self, data: bytes) -> None:
        client = self._client
        # A client that does not read loses bytes, as a UART's buffer does: the machine's memory is bounded.
        if client is not None and client.transport.get_write_buffer_size() < READ_BYTES:
            client.transport.write(data)

    def _cut(self) -> None:
        if self._client is not None:
            self._client.transport.abort()
            self._client = None


async def serve_tcp(
    machine: Machine, host: str, port: int, *, faults: FaultRates | None = None, seed: int = 0, baud: int = 0
) -> TcpShell:
    """A machine behind a TCP port (0: any free one, see `.port`). Raises OSError when it cannot be had."""
    shell = TcpShell(Pump(machine, faults=faults, seed=seed, baud=baud))
    await shell.open(host, port)
    return shell


class PtyShell:
    """A machine behind a pseudo-terminal, with a link at a path of our choice.

    That somebody opens it cannot be seen from here: a machine that a DTR pulse would reset is not reset.
    We keep the slave open ourselves: without that the master reads nothing but EIO between two daemons.
    """

    def __init__(self, pump: Pump, link: Path | None) -> None:
        self.pump = pump
        self._link = link
        self._loop = asyncio.get_running_loop()
        self._master = -1
        self._slave = -1
        self.path = link or Path()

    def open(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        slave_path = Path(os.ttyname(self._slave))
        self.path = self._link or slave_path
        if self._link is not None:
            self._place_link(self._link, slave_path)
        self._loop.add_reader(self._master, self._read)
        self.pump.say = self._say
        self.pump.turn()

    def unplug(self) -> None:
        """Whoever has the port open gets a hang-up; the path is gone; the machine goes on."""
        if self._master < 0:
            return
        self.pump.say = None
        self._loop.remove_reader(self._master)
        if self._link is not None and self._link.is_symlink() and self._link.readlink() == self._slave_path():
            self._link.unlink()
        os.close(self._slave)
        os.close(self._master)
        self._master = self._slave = -1

    def replug(self) -> None:
        """The same path, another device behind it, as after a USB adapter was plugged in again."""
        self.open()

    def close(self) -> None:
        self.unplug()
        self.pump.stop()

    def _slave_path(self) -> Path:
        return Path(os.ttyname(self._slave))

    def _place_link(self, link: Path, target: Path) -> None:
        if link.exists() and not link.is_symlink():
            self._loop.remove_reader(self._master)
            os.close(self._slave)
            os.close(self._master)
            self._master = self._slave = -1
            raise FileExistsError(f"{link} exists and is no symbolic link; give another path for the virtual port")
        fresh = link.with_name(f".{link.name}.{os.getpid()}")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(target)
        fresh.replace(link)

    def _read(self) -> None:
        try:
            data = os.read(self._master, READ_BYTES)
        except BlockingIOError:
            return
        self.pump.hear(data)

    def _say(self, data: bytes) -> None:
        """What does not fit into the terminal's buffer is lost: nobody has read there for a long time."""
        try:
            os.write(self._master, data)
        except BlockingIOError:
            return


async def serve_pty(
    machine: Machine, link_path: Path | None, *, faults: FaultRates | None = None, seed: int = 0, baud: int = 0
) -> PtyShell:
    """A machine behind a pseudo-terminal. Raises FileExistsError when something else is at `link_path`."""
    shell = PtyShell(Pump(machine, faults=faults, seed=seed, baud=baud), link_path)
    shell.open()
    return shell


@contextmanager
def recording(path: Path | None) -> Iterator[Callable[[Recorded], None] | None]:
    """A line `id TAB block` for every block as it begins, written before the machine says anything about it."""
    if path is None:
        yield None
        return
    with path.open("a", encoding="utf-8", newline="\n") as file:

        def record(block: Recorded) -> None:
            file.write(f"{block.id}\t{' '.join(block.text.split())}\n")
            file.flush()

        yield record


async def run(
    settings: Settings,
    *,
    pty: Path | None,
    tcp: str | None,
    record: Path | None,
    faults: FaultRates | None,
    seed: int,
    ready: Callable[[str], None],
    baud: int = 0,
) -> None:
    """`millstream sim`: serves until cancelled. `ready` gets the address. Raises OSError, ValueError."""
    with recording(record) as on_block:
        machine = build(settings, now=asyncio.get_running_loop().time(), on_block=on_block)
        if tcp is not None:
            host, port = split_address(tcp)
            shell = await serve_tcp(machine, host, port, faults=faults, seed=seed, baud=baud)
            ready(f"tcp://{host}:{shell.port}")
            try:
                await asyncio.Event().wait()
            finally:
                await shell.close()
        else:
            port_shell = await serve_pty(machine, pty, faults=faults, seed=seed, baud=baud)
            ready(str(port_shell.path))
            try:
                await asyncio.Event().wait()
            finally:
                port_shell.close()


def split_address(text: str) -> tuple[str, int]:
    """`host:port` with or without `tcp://`. Raises ValueError."""
    host, colon, port = text.removeprefix("tcp://").rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65_535:
        raise ValueError(f"{text!r} is no address: HOST:PORT is wanted, as in 127.0.0.1:8421")
    return host.strip("[]"), int(port)
