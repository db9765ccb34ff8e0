"""What the ways out count, for /metrics. Not the metrics' text (server/metrics.py).

The one rule: plain numbers, written on the loop's thread by the one way that they belong to.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

WAYS = ("mtconnect", "mqtt", "webhook", "mdns")


@dataclass(slots=True)
class WayOut:
    """One way. `connected`: agents, 1 for a broker or an announcement that stands; `waiting`: messages not sent yet."""

    connected: int = 0
    waiting: int = 0
    sent: int = 0
    dropped: int = 0
    failures: int = 0


@dataclass(frozen=True, slots=True)
class Counters:
    """All of them, also those that are switched off."""

    mtconnect: WayOut = field(default_factory=WayOut)
    mqtt: WayOut = field(default_factory=WayOut)
    webhook: WayOut = field(default_factory=WayOut)
    mdns: WayOut = field(default_factory=WayOut)

    def each(self) -> Iterator[tuple[str, WayOut]]:
        """By name."""
        return ((name, getattr(self, name)) for name in WAYS)
