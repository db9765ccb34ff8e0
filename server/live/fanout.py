"""Who of the readers is served when: a few sends in a turn of the loop, and the serial ports and requests in between.

Not what a reader gets (`server/live/subscription.py`) and not a socket. One timer for all readers that wait for their
time. The one rule: a turn has at most SENDS_A_TURN sends, however many readers there are, so a stop never waits for a
crowd.
"""

import asyncio
from collections import deque
from math import ceil
from typing import Protocol

SENDS_A_TURN = 5
"""A send is mostly the work of the system, 20 to 50 us on a small computer: a quarter of a millisecond in a turn."""
TICK_S = 0.005
"""Those who wait for their time are looked through in this grid: a hundred readers of 20 Hz would be 2,000 timers a
second. So a message that had to wait comes up to this late."""


class Outlet(Protocol):
    """Where the messages of one reader go."""

    @property
    def takes(self) -> bool:
        """Whether it has room. When it has again it wakes its reader."""

    def write(self, data: bytes) -> None:
        """Hand over whole frames; never waits."""


class Served(Protocol):
    """A reader, as it is seen here. `listed` is the fan-out's own mark: it stands in the row already."""

    listed: bool

    @property
    def outlet(self) -> Outlet | None: ...
    @property
    def due_at(self) -> float | None: ...
    def take(self, now: float) -> bytes: ...


class Fanout:
    """See the head of this file. `loop` is None until a reader with an outlet is there: nobody is served before."""

    def __init__(self) -> None:
        self._row: deque[Served] = deque()
        self._resting: dict[Served, float] = {}
        self._turn_due = False
        self._timer: asyncio.TimerHandle | None = None
        self.loop: asyncio.AbstractEventLoop | None = None

    def wake(self, reader: Served) -> None:
        """Something waits for this reader, or it takes messages again. Harmless at any time."""
        if reader.listed or reader.outlet is None or (due_at := reader.due_at) is None:
            return
        assert self.loop is not None
        if not due_at or due_at <= self.loop.time():
            self._line_up(reader)
        elif due_at < self._resting.get(reader, float("inf")):
            self._resting[reader] = due_at
            self._set_timer(due_at)

    def forget(self, reader: Served) -> None:
        """It has gone."""
        self._resting.pop(reader, None)

    def _line_up(self, reader: Served) -> None:
        reader.listed = True
        self._resting.pop(reader, None)
        self._row.append(reader)
        self._ask_for_turn()

    def _ask_for_turn(self) -> None:
        if not self._turn_due and self.loop is not None:
            self._turn_due = True
            self.loop.call_soon(self._turn)

    def _turn(self) -> None:
        assert self.loop is not None
        now = self.loop.time()
        self._turn_due = False
        try:
            for _ in range(min(SENDS_A_TURN, len(self._row))):
                reader = self._row.popleft()
                reader.listed = False
                outlet = reader.outlet
                if outlet is not None and outlet.takes:
                    if data := reader.take(now):
                        outlet.write(data)
                    self.wake(reader)
        finally:
            if self._row:
                self._ask_for_turn()

    def _set_timer(self, due_at: float) -> None:
        assert self.loop is not None
        tick_at = ceil(due_at / TICK_S) * TICK_S
        if self._timer is not None:
            if self._timer.when() <= tick_at:
                return
            self._timer.cancel()
        self._timer = self.loop.call_at(tick_at, self._tick)

    def _tick(self) -> None:
        assert self.loop is not None
        self._timer = None
        now = self.loop.time()
        for reader in [reader for reader, due_at in self._resting.items() if due_at <= now]:
            self._line_up(reader)
        if self._resting:
            self._set_timer(min(self._resting.values()))
