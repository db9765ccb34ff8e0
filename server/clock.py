"""The clock for people: what stands in time stamps. Not the engine's clock, which is `loop.time()`.

The one rule: nobody asks the operating system for the time but through the clock that app.py passes in, so that a
test can run a day in a second.
"""

from datetime import UTC, datetime
from typing import Protocol

MILLISECONDS = tuple(f".{number:03d}Z" for number in range(1000))


def utc_now() -> datetime:
    """The wall clock, for time stamps that people and scripts read."""
    return datetime.now(UTC)


def rfc3339(at: datetime) -> str:
    """A time as api.md writes it: UTC with milliseconds and `Z`."""
    utc = at if at.tzinfo is UTC else at.astimezone(UTC)
    return _SECOND.text(utc) + MILLISECONDS[utc.microsecond // 1000]


class _Second:
    """The text of a second, kept for the next stamp: mostly that is of the same one, and a machine at work asks for a
    hundred in it. Any thread may ask."""

    def __init__(self) -> None:
        self._kept = self._of(datetime.min.replace(tzinfo=UTC))

    def text(self, utc: datetime) -> str:
        first, last, text = self._kept
        if first <= utc <= last:
            return text
        kept = self._kept = self._of(utc)
        return kept[2]

    def _of(self, utc: datetime) -> tuple[datetime, datetime, str]:
        first = utc.replace(microsecond=0)
        return first, utc.replace(microsecond=999_999), first.isoformat()[: len("2026-03-01T09:00:00")]


_SECOND = _Second()


class Clock(Protocol):
    """Says what time it is for people."""

    def now(self) -> datetime:
        """UTC."""


class WallClock:
    """The computer's clock."""

    def now(self) -> datetime:
        return datetime.now(UTC)


def stamp(clock: Clock) -> str:
    """RFC 3339 UTC with `Z`."""
    return rfc3339(clock.now())


def seconds_since(clock: Clock, at: str | None) -> float | None:
    """Seconds from `at` until now; None when it is unknown or lies in the future (a clock that was set back)."""
    if at is None:
        return None
    passed_s = (clock.now() - datetime.fromisoformat(at)).total_seconds()
    return passed_s if passed_s >= 0 else None
