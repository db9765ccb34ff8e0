"""The clock for people: what stands in time stamps. Not the engine's clock, which is `loop.time()`.

The one rule: nobody asks the operating system for the time but through the clock that app.py passes in, so that a
test can run a day in a second.
"""

from datetime import datetime
from typing import Protocol

from server.hub import rfc3339, utc_now


class Clock(Protocol):
    """Says what time it is for people."""

    def now(self) -> datetime:
        """UTC."""


class WallClock:
    """The computer's clock."""

    def now(self) -> datetime:
        return utc_now()


def stamp(clock: Clock) -> str:
    """RFC 3339 UTC with `Z`."""
    return rfc3339(clock.now())


def seconds_since(clock: Clock, at: str | None) -> float | None:
    """Seconds from `at` until now; None when it is unknown or lies in the future (a clock that was set back)."""
    if at is None:
        return None
    passed_s = (clock.now() - datetime.fromisoformat(at)).total_seconds()
    return passed_s if passed_s >= 0 else None
