"""The MTConnect adapter: agents connect, are told everything, and then what changes. Read only.

Not what is told (shdr.py). The one rule: an agent that does not read is dropped; nothing that it sends but `* PING` has
any meaning, and its lines are short or it goes.
"""

import asyncio
import logging
import socket
from collections.abc import Callable, Iterable, Mapping

from server.outbound.feed import Feed, Notice
from server.outbound.shdr import HEARTBEAT_MS, PING, PONG, Device, Value, lines
from server.waysout import WayOut

log = logging.getLogger(__name__)

MAX_LINE_BYTES = 256
"""Of an agent's: `* PING` has 6."""
MAX_UNSENT_BYTES = 256 * 1024
"""Some minutes of a machine at work. An agent that lets so much lie is dropped; it comes again and is told anew."""
SILENT_S = 3 * HEARTBEAT_MS / 1000
"""An agent that has asked once asks every HEARTBEAT_MS; one that stopped is gone."""
BACKLOG = 16


class Adapter:
    """See the head of this file. `emergency` says of a machine whether an emergency stop is pressed or demanded."""

    def __init__(
        self,
        devices: Mapping[str, Device],
        *,
        counted: WayOut,
        emergency: Callable[[str], bool],
        now: Callable[[], str],
        max_clients: int,
    ) -> None:
        self.counted = counted
        self.max_clients = max_clients
        self._devices = dict(devices)
        self._emergency = emergency
        self._now = now
        self._told: dict[str, Mapping[str, Value]] = {name: self._items(name) for name in devices}
        self.agents: set[Agent] = set()

    async def run(self, listener: socket.socket, feed: Feed) -> None:
        """Serve until it is cancelled."""
        server = await asyncio.get_running_loop().create_server(lambda: Agent(self), sock=listener, backlog=BACKLOG)
        try:
            async for notice in feed:
                self.hear(notice)
        finally:
            server.close()
            for agent in tuple(self.agents):
                agent.close()

    def hear(self, notice: Notice) -> None:
        """Something happened: tell the agents what it changes."""
        name = notice.machine
        if name not in self._devices:
            return
        self._devices[name] = self._devices[name].told(notice)
        before, after = self._told[name], self._items(name)
        self._told[name] = after
        if changed := self._lines(name, notice.at, before, after):
            for agent in tuple(self.agents):
                agent.tell(changed)

    def all_lines(self) -> bytes:
        """How things stand."""
        at = self._now()
        return b"".join(self._lines(name, at, {}, told) for name, told in self._told.items())

    def _items(self, name: str) -> Mapping[str, Value]:
        return self._devices[name].items(emergency=self._emergency(name))

    def _lines(self, name: str, at: str, before: Mapping[str, Value], after: Mapping[str, Value]) -> bytes:
        prefix = f"{name}:" if len(self._devices) > 1 else ""
        return "".join(lines(prefix, at, before, after)).encode()


class Agent(asyncio.Protocol):
    """One connection."""

    def __init__(self, adapter: Adapter) -> None:
        self._adapter = adapter
        self._transport: asyncio.Transport | None = None
        self._peer = "?"
        self._pending = b""
        self._silent: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._peer = str((transport.get_extra_info("peername") or "?")[0])
        if len(self._adapter.agents) >= self._adapter.max_clients:
            log.warning("MTConnect: %s is refused, %d agents are connected", self._peer, self._adapter.max_clients)
            self._adapter.counted.failures += 1
            transport.abort()
            return
        self._transport = transport
        self._adapter.agents.add(self)
        self._adapter.counted.connected = len(self._adapter.agents)
        log.info("MTConnect: %s has connected", self._peer)
        self.tell(self._adapter.all_lines())

    def connection_lost(self, exc: Exception | None) -> None:
        if self._transport is not None:
            log.info("MTConnect: %s has gone%s", self._peer, "" if exc is None else f": {exc}")
        self._forget()

    def tell(self, data: bytes) -> None:
        """Whole lines; never waits."""
        transport = self._transport
        if transport is None:
            return
        if transport.get_write_buffer_size() > MAX_UNSENT_BYTES:
            self._drop("it does not read")
            return
        transport.write(data)
        self._adapter.counted.sent += data.count(b"\n")

    def data_received(self, data: bytes) -> None:
        *whole, self._pending = (self._pending + data).split(b"\n")
        if len(self._pending) > MAX_LINE_BYTES or any(len(line) > MAX_LINE_BYTES for line in whole):
            self._drop("it sends what no agent does")
            return
        if any(line.strip() == PING for line in whole):
            self._pong()

    def eof_received(self) -> bool:
        """It says nothing more; so it is gone."""
        return False

    def close(self) -> None:
        """The adapter ends."""
        if self._transport is not None:
            self._transport.close()
        self._forget()

    def _pong(self) -> None:
        """One for however many: an agent that floods us with questions gets no flood of answers."""
        if self._transport is None:
            return
        self._quiet()
        self._silent = asyncio.get_running_loop().call_later(SILENT_S, self._drop, "its heartbeat has stopped")
        if self._transport.get_write_buffer_size() <= MAX_UNSENT_BYTES:
            self._transport.write(PONG)

    def _drop(self, why: str) -> None:
        if self._transport is not None:
            log.warning("MTConnect: %s is dropped: %s", self._peer, why)
            self._adapter.counted.dropped += 1
            self._transport.abort()
        self._forget()

    def _forget(self) -> None:
        self._quiet()
        self._pending = b""
        self._transport = None
        self._adapter.agents.discard(self)
        self._adapter.counted.connected = len(self._adapter.agents)

    def _quiet(self) -> None:
        if self._silent is not None:
            self._silent.cancel()
            self._silent = None


def fresh_devices(axes: Iterable[tuple[str, str]]) -> dict[str, Device]:
    """Devices of which nothing is known yet, by name and axes."""
    return {name: Device(axes=letters) for name, letters in axes}
