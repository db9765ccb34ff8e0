"""From where a request comes: the address of the peer, or what a proxy in front of the daemon says of it.

The one rule: a header that anybody can write is believed only where the peer itself is a proxy that the configuration
names (`server.trusted_proxies`).
"""

import ipaddress
from collections.abc import Iterable
from typing import Any

from starlette.datastructures import Headers

ADDRESS_KEY = "millstream.address"
FORWARDED_FOR = "x-forwarded-for"
MAX_HOPS = 10
"""Proxies behind one another; a longer list is somebody's joke."""
UNKNOWN = ""

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class Proxies:
    """The proxies that are believed, by address or network."""

    def __init__(self, trusted: Iterable[str] = ()) -> None:
        self._networks: tuple[Network, ...] = tuple(ipaddress.ip_network(one, strict=False) for one in trusted)

    def address_of(self, scope: Any) -> str:
        """The address of whoever made the request; empty where there is none (a Unix socket)."""
        peer = scope.get("client")
        address = str(peer[0]) if peer else UNKNOWN
        if not self._networks or not self._trusts(address):
            return address
        said = ",".join(Headers(scope=scope).getlist(FORWARDED_FOR)).split(",")
        # From the right: each proxy adds the one that it heard, and what stands before the first stranger is hearsay.
        for hop in reversed(said[-MAX_HOPS:]):
            if (ip := _address(hop)) is None:
                break
            address = ip
            if not self._trusts(ip):
                break
        return address

    def _trusts(self, address: str) -> bool:
        try:
            ip = ipaddress.ip_address(address)
        except ValueError:
            return False
        if isinstance(ip, ipaddress.IPv6Address) and ip.ipv4_mapped is not None:
            ip = ip.ipv4_mapped
        return any(ip in network for network in self._networks)


def _address(text: str) -> str | None:
    """One entry of the header, without a port; None for what is no address."""
    bare = text.strip()
    if bare.startswith("["):
        bare = bare[1:].partition("]")[0]
    elif bare.count(":") == 1:
        bare = bare.partition(":")[0]
    try:
        return str(ipaddress.ip_address(bare))
    except ValueError:
        return None
