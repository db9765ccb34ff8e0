"""What the local network is told of the daemon: names, port, addresses, TXT (RFC 6763). Pure.

Not the telling (mdns.py). The one rule: a daemon that listens on a loopback address alone is announced to nobody.
"""

import ipaddress
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from server.access.auth import is_loopback

SERVICES = ("_millstream._tcp.local.", "_http._tcp.local.")
WILDCARDS = frozenset({"0.0.0.0", "::"})  # noqa: S104 - compared, not bound
MOST_TXT_BYTES = 255
"""Of one string, `machines=` included (RFC 6763 §6.1). Machines that do not fit are left out."""
MOST_LABEL_BYTES = 63
"""RFC 1035 §2.3.4."""


@dataclass(frozen=True, slots=True)
class Announcement:
    """One service. `addresses` are those under which it is reached."""

    type: str
    name: str
    server: str
    port: int
    addresses: tuple[str, ...]
    properties: Mapping[str, str]


def reachable(host: str, own: Iterable[str]) -> tuple[str, ...]:
    """The addresses that others reach it at, sorted. `host` is where it listens, `own` are those of this computer."""
    if is_loopback(host):
        return ()
    bare = host.strip("[]")
    candidates = {one for one in own if bare == "::" or ":" not in one} if bare in WILDCARDS else {bare}
    return tuple(sorted(one for one in candidates if _is_for_others(one)))


def announcements(
    *, name: str, hostname: str, port: int, addresses: Sequence[str], version: str, machines: Sequence[str]
) -> list[Announcement]:
    """What is announced; `name` may be empty. Nothing where nobody reaches it."""
    label = hostname.partition(".")[0] or "millstream"
    instance = (name or label).encode()[:MOST_LABEL_BYTES].decode(errors="ignore")
    properties = {"version": version, "path": "/", "machines": _fitting(machines)}
    return [
        Announcement(service, f"{instance}.{service}", f"{label}.local.", port, tuple(addresses), properties)
        for service in SERVICES
        if addresses
    ]


def _fitting(machines: Sequence[str]) -> str:
    """As many of the names as one string of TXT holds."""
    text = ""
    for name in machines:
        longer = f"{text},{name}" if text else name
        if len(f"machines={longer}".encode()) > MOST_TXT_BYTES:
            break
        text = longer
    return text


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(text.partition("%")[0])
    except ValueError:
        return None


def _is_for_others(text: str) -> bool:
    """Link-local ones of IPv6 are left out: they mean nothing without the name of an interface."""
    address = _address(text)
    if address is None or address.is_loopback or address.is_unspecified or address.is_multicast:
        return False
    return not (address.version == 6 and address.is_link_local)
