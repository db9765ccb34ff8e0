"""From where a request comes and over what: the address of the peer, or what a proxy in front of the daemon says of it.

The one rule: a header that anybody can write is believed only where the peer itself is a proxy that the configuration
names (`server.trusted_proxies`).
"""

import ipaddress
from collections.abc import Iterable
from typing import Any

from starlette.datastructures import Headers

ADDRESS_KEY = "millstream.address"
TLS_KEY = "millstream.tls"
FORWARDED_FOR = "x-forwarded-for"
FORWARDED_PROTO = "x-forwarded-proto"
MAX_HOPS = 10
"""Proxies behind one another; a longer list is somebody's joke."""
UNKNOWN = ""

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class Proxies:
    """The proxies that are believed, by address or network."""

    def __init__(self, trusted: Iterable[str] = ()) -> None:
        self._networks: tuple[Network, ...] = tuple(ipaddress.ip_network(one, strict=False) for one in trusted)

    def is_tls(self, scope: Any) -> bool:
        """Whether whoever made the request spoke TLS, to us or to the proxy that is the first on the way."""
        if scope.get("scheme") in ("https", "wss"):
            return True
        if not self._trusts(_peer(scope)):
            return False
        said = ",".join(Headers(scope=scope).getlist(FORWARDED_PROTO)).split(",")
        return said[0].strip().lower() in ("https", "wss")

    def address_of(self, scope: Any) -> str:
        """The address of whoever made the request; empty where there is none (a Unix socket)."""
        address = _peer(scope)
        if not self._trusts(address):
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
        if not self._networks:
            return False
        try:
            ip = ipaddress.ip_address(address)
        except ValueError:
            return False
        if isinstance(ip, ipaddress.IPv6Address) and ip.ipv4_mapped is not None:
            ip = ip.ipv4_mapped
        return any(ip in network for network in self._networks)


def _peer(scope: Any) -> str:
    peer = scope.get("client")
    return str(peer[0]) if peer else UNKNOWN


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
