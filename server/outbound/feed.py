"""What happens in the workshop, for a part of the daemon that tells others: a reader of the hub like any browser.

Not the hub (server/live/hub.py) and nothing of what is told, or to whom. The one rule: a part that is slow loses
states, and then its place: it is cut like any reader, begins anew with how things stand (`Notice.fresh`), and nobody
waits for it.
"""

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol

from server.live.hub import Hub
from server.live.subscription import STATE, Filter, Subscription

Json = Mapping[str, Any]

HELD_BYTES = 64 * 1024
"""More is not taken from the hub until it was read here; the subscription holds the rest, and has its own limit."""
_SHORT, _MEDIUM = 126, 127
"""RFC 6455 §5.2: up to 125 the length itself, else what says how many bytes of it follow."""


@dataclass(frozen=True, slots=True)
class Notice:
    """A message of the hub (api.md). `fresh`: nothing happened, it is how things stand."""

    type: str
    machine: str
    at: str
    data: Json = field(default_factory=dict)
    fresh: bool = False


class Shown(Protocol):
    """What is read of a machine (`server.machine.controller.Controller`)."""

    def view(self) -> dict[str, Any]: ...
    @property
    def stream(self) -> Any: ...


def standing(machines: Mapping[str, Shown], at: Callable[[], str]) -> Iterable[Notice]:
    """How things stand: of each machine its state, and its job if it has one."""
    for name, machine in machines.items():
        view = machine.view()
        yield Notice("state", name, at(), {**view["state"], "link": view["link"]}, fresh=True)
        if (job := machine.stream.view()) is not None:
            yield Notice("job", name, at(), job, fresh=True)


def texts(frames: bytes) -> Iterable[bytes]:
    """The texts of whole frames, as `server.textframe` makes them."""
    at = 0
    while at < len(frames):
        length, at = frames[at + 1], at + 2
        if length >= _SHORT:
            size = 2 if length == _SHORT else 8
            length, at = int.from_bytes(frames[at : at + size]), at + size
        yield frames[at : at + length]
        at += length


class Feed:
    """See the head of this file. One reader: iterate it once. `rate_hz`: most states a second, of all machines."""

    def __init__(self, hub: Hub, *, rate_hz: float, now_stands: Callable[[], Iterable[Notice]]) -> None:
        self._hub = hub
        self._wanted = Filter(frozenset({STATE, "job", "alarm"}), rate_hz=rate_hz)
        self._now_stands = now_stands
        self._held: deque[bytes] = deque()
        self._held_bytes = 0
        self._arrived = asyncio.Event()
        self._subscription: Subscription | None = None
        self.restarts = 0
        """How often it was cut because it did not read."""

    @property
    def takes(self) -> bool:
        """Whether there is room (`server.live.fanout.Outlet`)."""
        return self._held_bytes < HELD_BYTES

    def write(self, data: bytes) -> None:
        """What the hub hands over (`server.live.fanout.Outlet`)."""
        self._held.extend(texts(data))
        self._held_bytes += len(data)
        self._arrived.set()

    async def __aiter__(self) -> AsyncIterator[Notice]:
        """First how things stand, then what happens, for ever."""
        while True:
            self._subscription = subscription = self._hub.subscribe(self._wanted)
            cut = asyncio.create_task(self._when_cut(subscription))
            try:
                subscription.begin(self)
                for notice in self._now_stands():
                    yield notice
                while not subscription.is_cut:
                    while self._held:
                        yield _notice(self._next(subscription))
                    self._arrived.clear()
                    if not subscription.is_cut:
                        await self._arrived.wait()
            finally:
                cut.cancel()
                self._hub.unsubscribe(subscription)
            self._held.clear()
            self._held_bytes = 0
            self.restarts += 1

    async def _when_cut(self, subscription: Subscription) -> None:
        with suppress(asyncio.CancelledError):
            await subscription.until_cut()
            self._arrived.set()

    def _next(self, subscription: Subscription) -> bytes:
        text = self._held.popleft()
        if not self._held:
            self._held_bytes = 0
            subscription.wake()
        return text


def _notice(text: bytes) -> Notice:
    message = json.loads(text)
    return Notice(message["type"], message["machine"] or "", message["at"], message["data"])
