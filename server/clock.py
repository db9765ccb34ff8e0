"""The clock for people: what stands in time stamps. Not the engine's clock, which is `loop.time()`.

The one rule: nobody asks the operating system for the time but through the clock that app.py passes in, so that a
test can run a day in a second.
"""

from datetime import UTC, datetime
from functools import lru_cache
from typing import Protocol


def utc_now() -> datetime:
    """The wall clock, for time stamps that people and scripts read."""
    return datetime.now(UTC)


def rfc3339(at: datetime) -> str:
    """A time as api.md writes it: UTC with milliseconds and `Z`."""
    utc = at if at.tzinfo is UTC else at.astimezone(UTC)
    second = _to_the_second(utc.year, utc.month, utc.day, utc.hour, utc.minute, utc.second)
    return f"{second}.{utc.microsecond // 1000:03d}Z"


@lru_cache(maxsize=16)
def _to_the_second(year: int, month: int, day: int, hour: int, minute: int, second: int) -> str:
    """Kept for the next stamp: mostly it is of the same second, and a machine at work asks for a hundred in one."""
    return f"{year:04d}-{month:02d}-{day:02d}T{hour:02d}:{minute:02d}:{second:02d}"


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
