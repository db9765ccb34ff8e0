"""Who may move a machine by hand: one client at a time, as long as it does so.

Not who may do what (auth.py), and nothing about jobs: the queue says whose turn that is. The one rule: it stands
between two people and never between one and the machine. Whoever moves a machine that nobody has gets it by that;
pause, stop and e-stop ask nobody; and who wants it from another one takes it, openly.
"""

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from server.problems import ProblemError

log = logging.getLogger(__name__)

LEASE_S = 30.0
"""So long after the last use it is free again: a look at the work and back, not a coffee."""


@dataclass(frozen=True, slots=True)
class Client:
    """One who moves machines. `key` tells one from another; `name` and `place` (what it calls itself, or its address)
    are for people."""

    key: tuple[str, str]
    name: str
    place: str


@dataclass(slots=True)
class Lease:
    """Of one machine."""

    client: Client
    since: str
    uses: int = 0
    """Requests under way: while a block is being executed nobody has fallen silent."""
    ends_at: float = 0.0
    timer: asyncio.TimerHandle | None = field(default=None, repr=False)

    def view(self) -> dict[str, Any]:
        """As everybody may see it."""
        return {"name": self.client.name, "client": self.client.place, "since": self.since}


Show = Callable[[str, dict[str, Any] | None], None]
"""Told of each change: the machine, and its holder."""


class Leases:
    """Those of all machines. On the loop's thread; nothing here waits."""

    def __init__(self, show: Show, stamp: Callable[[], str]) -> None:
        self._show = show
        self._stamp = stamp
        self._leases: dict[str, Lease] = {}
        self._sockets: Counter[tuple[str, str]] = Counter()

    def holder(self, machine: str) -> Lease | None:
        """Who has the machine; None: nobody."""
        return self._leases.get(machine)

    def has(self, machine: str, client: Client) -> bool:
        """Whether it is this client's."""
        lease = self._leases.get(machine)
        return lease is not None and lease.client.key == client.key

    def take(self, machine: str, client: Client, *, takeover: bool = False) -> Client | None:
        """Have the machine, or go on having it; from whom it was taken. Raises ProblemError when another one has it."""
        lease = self._leases.get(machine)
        if lease is not None and lease.client.key == client.key:
            self._renew(machine, lease)
            return None
        if lease is not None and not takeover:
            raise held(machine, lease)
        before = None if lease is None else lease.client
        if lease is not None:
            self._forget(machine, lease)
            log.warning("%s: %s takes the control from %s", machine, client.name, lease.client.name)
        lease = self._leases[machine] = Lease(client, self._stamp())
        self._renew(machine, lease)
        self._show(machine, lease.view())
        return before

    def release(self, machine: str, client: Client) -> None:
        """Give it back; harmless without it. Raises ProblemError when another one has it."""
        lease = self._leases.get(machine)
        if lease is None:
            return
        if lease.client.key != client.key:
            raise held(machine, lease)
        self._end(machine, lease)

    @contextmanager
    def use(self, machine: str, client: Client) -> Iterator[None]:
        """Move the machine inside of this. What was refused by the machine has not taken it from anybody."""
        was_free = machine not in self._leases
        self.take(machine, client)
        lease = self._leases[machine]
        lease.uses += 1
        try:
            yield
        except BaseException:
            lease.uses -= 1
            if was_free and lease.uses == 0 and self._leases.get(machine) is lease:
                self._end(machine, lease)
            raise
        lease.uses -= 1
        if self._leases.get(machine) is lease:
            self._renew(machine, lease)

    def socket_opened(self, client: Client) -> None:
        """A WebSocket of this client."""
        self._sockets[client.key] += 1

    def socket_closed(self, client: Client) -> None:
        """With its last socket a client has gone, and what it had is free."""
        self._sockets[client.key] -= 1
        if self._sockets[client.key] > 0:
            return
        del self._sockets[client.key]
        for machine, lease in list(self._leases.items()):
            if lease.client.key == client.key and lease.uses == 0:
                self._end(machine, lease)

    def _renew(self, machine: str, lease: Lease) -> None:
        """One timer, moved on when it has come: a held jog renews ten times a second."""
        loop = asyncio.get_running_loop()
        lease.ends_at = loop.time() + LEASE_S
        if lease.timer is None:
            lease.timer = loop.call_at(lease.ends_at, self._look, machine, lease)

    def _look(self, machine: str, lease: Lease) -> None:
        loop = asyncio.get_running_loop()
        lease.timer = None
        if self._leases.get(machine) is not lease:
            return
        if lease.uses or loop.time() < lease.ends_at:
            lease.timer = loop.call_at(max(lease.ends_at, loop.time() + 1.0), self._look, machine, lease)
        else:
            self._end(machine, lease)

    def _end(self, machine: str, lease: Lease) -> None:
        self._forget(machine, lease)
        self._show(machine, None)

    def _forget(self, machine: str, lease: Lease) -> None:
        del self._leases[machine]
        if lease.timer is not None:
            lease.timer.cancel()
            lease.timer = None


def held(machine: str, lease: Lease) -> ProblemError:
    """The refusal: who has it, and how to take it over."""
    return ProblemError(
        "control_held",
        f"{lease.client.name} ({lease.client.place}) moves {machine} by hand since {lease.since}. It is free "
        f"{LEASE_S:g} seconds after the last move; to have it now: POST /api/v1/machines/{machine}/control "
        '{"takeover": true}. Pause, stop and e-stop need no control.',
        holder=lease.view(),
    )
