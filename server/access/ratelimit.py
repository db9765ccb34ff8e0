"""How often a token may be guessed: a bucket of attempts for each address, and one for all of them.

Pure: no clock and no request. A secret has 256 random bits, so guessing is hopeless anyway; what is bounded here is the
noise of it (log, database, audit). The one rule: who comes with a right token from an address that did not guess is
never kept out by those who do, and nobody who is at work is kept out by a forgotten script on the same computer.
"""

import ipaddress
import math
from collections import OrderedDict
from dataclasses import dataclass

from server.access.auth import digest

BURST = 10
"""Wrong tokens in a row from one address: a person who pastes the wrong line a few times."""
RESERVE = 5
"""Of these, for tokens that are not the last wrong one: a script that has an old token and asks all day uses up the
others, and whoever signs in on the same computer still can."""
REFILL_S = 10.0
"""Each of them is forgiven after that."""
OVERALL_BURST = 100
OVERALL_REFILL_S = 1.0
"""The same for all addresses together: a whole network that guesses."""
MAX_ADDRESSES = 1024
MAX_TRUSTED = 1024
"""Memory is constant: the addresses and the right tokens of longest ago are forgotten first."""
FORGIVEN_S = BURST * REFILL_S
"""After that an address that guesses no more is as one that never did: it is forgotten."""
TRUSTED_S = 30 * 24 * 3600.0
"""A right token was at work from there in this time, or it is a stranger there again; a browser's session lasts as
long."""
IPV6_PREFIX = 64
"""One computer has all addresses of such a network."""


@dataclass(slots=True)
class _Bucket:
    """Attempts that are left; they come back with time."""

    burst: int
    refill_s: float
    left: float
    at: float
    last: str = ""
    """The hash of the last wrong token, which came at `guessed_at`."""
    guessed_at: float = 0.0

    def fill(self, now: float) -> None:
        self.left = min(self.burst, self.left + max(0.0, now - self.at) / self.refill_s)
        self.at = now

    def wait_s(self, now: float, reserve: int = 0) -> float:
        """How long until there is one beside the reserve; 0 when there is."""
        self.fill(now)
        return max(0.0, (1 + reserve - self.left) * self.refill_s)

    def take(self, now: float) -> None:
        self.fill(now)
        self.left = max(0.0, self.left - 1)


class Attempts:
    """Wrong tokens, by the address that they came from. Times are seconds of any steady clock."""

    def __init__(self) -> None:
        self._all = _Bucket(OVERALL_BURST, OVERALL_REFILL_S, OVERALL_BURST, 0.0)
        self._by_address: OrderedDict[str, _Bucket] = OrderedDict()
        self._trusted: OrderedDict[tuple[str, str], float] = OrderedDict()
        """When it was right last; the oldest first, as in `_by_address`."""
        self.refused = 0
        """How many were turned away without a look at what they had."""
        self.guessed = 0
        """How many were looked at, and wrong."""

    def wait_s(self, address: str, secret: str, *, now: float) -> int:
        """For how many whole seconds no token from this address is looked at; 0: it is looked at.

        A token that was right from there before is looked at always: it is no guess.
        """
        network = network_of(address)
        bucket = self._by_address.get(network)
        # An address that never guessed is heard even while everybody else does.
        hashed = digest(secret)
        if bucket is None or now - self._trusted.get((network, hashed), -math.inf) < TRUSTED_S:
            return 0
        wait_s = max(bucket.wait_s(now, RESERVE if hashed == bucket.last else 0), self._all.wait_s(now))
        if wait_s > 0:
            self.refused += 1
        return math.ceil(wait_s)

    def wrong(self, address: str, secret: str, *, now: float) -> None:
        """This token from there was wrong."""
        self.guessed += 1
        network = network_of(address)
        bucket = self._by_address.get(network)
        if bucket is None:
            bucket = self._by_address[network] = _Bucket(BURST, REFILL_S, BURST, now)
        self._by_address.move_to_end(network)
        bucket.last = digest(secret)
        bucket.take(now)
        bucket.guessed_at = now
        self._all.take(now)
        while len(self._by_address) > MAX_ADDRESSES or now - self._oldest_guess_at() >= FORGIVEN_S:
            self._by_address.popitem(last=False)

    def right(self, address: str, secret: str, *, now: float) -> None:
        """A token from there was right."""
        key = network_of(address), digest(secret)
        self._trusted[key] = now
        self._trusted.move_to_end(key)
        while len(self._trusted) > MAX_TRUSTED or now - next(iter(self._trusted.values())) >= TRUSTED_S:
            self._trusted.popitem(last=False)

    def _oldest_guess_at(self) -> float:
        return next(iter(self._by_address.values())).guessed_at


def network_of(address: str) -> str:
    """The address as it counts: an IPv4 address, also where it is written as IPv6, or the network of an IPv6 one."""
    try:
        ip = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(ip, ipaddress.IPv6Address):
        if ip.ipv4_mapped is not None:
            return str(ip.ipv4_mapped)
        return str(ipaddress.ip_network((ip, IPV6_PREFIX), strict=False))
    return str(ip)
