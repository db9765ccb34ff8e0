"""Announces the daemon by mDNS (extra `mdns`: zeroconf): anew when the addresses change, withdrawn at the end.

Not what is announced (announcement.py). The one rule: zeroconf lives in threads of its own, so that the traffic of a
network is never work for the loop of the machines.
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

import ifaddr
from zeroconf import Error, ServiceInfo, Zeroconf

from server.outbound.announcement import Announcement
from server.waysout import WayOut

log = logging.getLogger(__name__)

LOOK_EVERY_S = 15.0
"""So often the addresses of this computer are looked at: a lease that changes, a cable that comes later."""


class Registration(Protocol):
    """What stands in the network, until it is closed."""

    def close(self) -> None: ...


Register = Callable[[Sequence[Announcement]], Registration]
"""Raises OSError."""


class Announcer:
    """See the head of this file. `wanted` is asked for what is to be announced, in a thread, and so is `register`."""

    def __init__(self, wanted: Callable[[], Sequence[Announcement]], register: Register, counted: WayOut) -> None:
        self._wanted = wanted
        self._register = register
        self._counted = counted
        self._standing: Registration | None = None
        self._told: Sequence[Announcement] = ()
        self._complaint = ""

    async def run(self) -> None:
        """Until it is cancelled; then nothing stands any more."""
        try:
            while True:
                await self._look()
                await asyncio.sleep(LOOK_EVERY_S)
        finally:
            await self._withdraw()

    async def _look(self) -> None:
        try:
            wanted = await asyncio.to_thread(self._wanted)
            if list(wanted) == list(self._told):
                return
            await self._withdraw()
            if wanted:
                self._standing = await asyncio.to_thread(self._register, wanted)
                self._counted.connected = 1
                self._counted.sent += len(wanted)
                where = ", ".join(wanted[0].addresses)
                log.info("mDNS: announced as %s at %s, port %d", wanted[0].name, where, wanted[0].port)
            elif not self._told:
                log.info("mDNS: nobody on the network reaches this daemon: nothing is announced")
            self._told = wanted
            self._complaint = ""
        except OSError as error:
            self._counted.failures += 1
            if str(error) != self._complaint:
                self._complaint = str(error)
                log.warning("mDNS: the daemon cannot be announced: %s. Trying again.", error)

    async def _withdraw(self) -> None:
        standing, self._standing, self._told = self._standing, None, ()
        self._counted.connected = 0
        if standing is not None:
            await asyncio.to_thread(standing.close)


# --- zeroconf -------------------------------------------------------------------------------------------------


def own_addresses() -> list[str]:
    """The addresses of this computer."""
    found = []
    for adapter in ifaddr.get_adapters():
        found += [ip.ip if isinstance(ip.ip, str) else ip.ip[0] for ip in adapter.ips]
    return found


class _Zeroconf:
    """Everything that was announced; closing it takes all of it back."""

    def __init__(self, wanted: Sequence[Announcement]) -> None:
        # By address, so that it also speaks at networks without a default route.
        self._zeroconf = Zeroconf(interfaces=list(wanted[0].addresses))
        try:
            for one in wanted:
                self._zeroconf.register_service(info_of(one), allow_name_change=True)
        except BaseException:
            self._zeroconf.close()
            raise

    def close(self) -> None:
        self._zeroconf.unregister_all_services()
        self._zeroconf.close()


def register(wanted: Sequence[Announcement]) -> Registration:
    """Announce; call it in a thread. Raises OSError."""
    try:
        return _Zeroconf(wanted)
    except (Error, ValueError, RuntimeError) as error:
        raise OSError(str(error) or type(error).__name__) from error


def info_of(one: Announcement) -> ServiceInfo:
    """As zeroconf wants it."""
    return ServiceInfo(
        one.type,
        one.name,
        port=one.port,
        properties=dict(one.properties),
        server=one.server,
        parsed_addresses=list(one.addresses),
    )


def announcer(wanted: Callable[[Sequence[str]], Sequence[Announcement]], counted: WayOut) -> Announcer:
    """The real one. `wanted` makes what is announced of this computer's addresses."""
    return Announcer(partial(_of_own, wanted), register, counted)


def _of_own(wanted: Callable[[Sequence[str]], Sequence[Announcement]]) -> Sequence[Announcement]:
    return wanted(own_addresses())
