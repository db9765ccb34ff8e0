"""The pump between a transport and an engine, for one connection epoch. Understands neither bytes nor events.

The one rule: after every input, write what the engine has to send, hand over what happened, offer what it can take,
re-arm the one timer. Mostly nothing follows from an input but the next bytes (a line was acknowledged, the next one
goes out), and the engine says so (`news`); then it ends with the write.
"""

import asyncio
from collections.abc import Callable
from typing import Protocol

from protocol.commands import RealtimeCommand
from protocol.engine import Engine, OpenWork
from protocol.events import Event

EARLY_S = 0.001
"""A loop that counts in milliseconds (uvloop) rings up to one too early, and would do so again and again until then."""


class EngineFactory(Protocol):
    """Makes the engine of an epoch."""

    def __call__(self, *, first_id: int, now: float, open_work: OpenWork | None) -> Engine: ...


class Link:
    """One epoch. `write` takes bytes and never waits. `on_event` says whether anything may follow from the event.
    `on_quiet` is called when everything was handed over, for an engine can become free without an event; it says
    whether it submitted something."""

    def __init__(
        self,
        engine: Engine,
        write: Callable[[bytes], None],
        on_event: Callable[[Event], bool],
        on_quiet: Callable[[], bool],
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self.engine = engine
        self._write = write
        self._on_event = on_event
        self._on_quiet = on_quiet
        self._loop = loop
        self._timer: asyncio.TimerHandle | None = None
        self._rings_at = 0.0
        self._takes: tuple[int, int] | None = None
        self._pumping = False
        self._asked = False
        self._closed = False

    def receive(self, data: bytes) -> None:
        """Bytes that came in."""
        if self._closed:
            return  # what the old port still had in its buffers
        now = self._loop.time()
        self.engine.receive_data(data, now)
        if out := self.engine.data_to_send(now):
            self._write(out)
        if self.engine.news and not self._pumping:
            self._run()

    def realtime(self, command: RealtimeCommand) -> None:
        """Hand a realtime command to the engine; its bytes go out before this returns."""
        self.engine.realtime(command, self._loop.time())
        self.flush()
        self.pump()

    def pump(self) -> None:
        """Move everything that can be moved. Harmless at any time; from inside a callback it is taken up outside."""
        self._asked = True
        if not self._pumping:
            self.flush()
            self._run()

    def _run(self) -> None:
        """Hand over, and offer where it was asked for or something has changed, until nothing moves any more."""
        self._pumping = True
        try:
            while (self._hand_over() or self._asked) and not self._closed:
                self._asked = self._on_quiet()
                self.flush()
        finally:
            self._pumping = False
        self._arm()

    def flush(self) -> None:
        """Write what the engine has to send. Harmless at any time, from inside a callback too."""
        if not self._closed and (data := self.engine.data_to_send(self._loop.time())):
            self._write(data)

    def close(self) -> None:
        """The epoch is over: nothing comes in or goes out any more. What has happened before is told."""
        if self._closed:
            return
        self._closed = True
        self._arm()
        while not self._pumping and (event := self.engine.next_event()) is not None:
            self._on_event(event)

    def _hand_over(self) -> bool:
        """Tell what happened; whether something may follow from it."""
        engine, follows = self.engine, False
        while not self._closed and (event := engine.next_event()) is not None:
            follows = self._on_event(event) or follows
        takes = (engine.free(), engine.next_id)
        if follows or takes != self._takes:
            self._takes, follows = takes, True
            self.flush()
        return follows

    def _arm(self) -> None:
        """The timer rings at the engine's deadline or before it: most deadlines are put off long before they come, and
        one that rings too early is cheaper than a new one for each."""
        due_at = None if self._closed else self.engine.next_timer()
        if self._timer is not None:
            if due_at is not None and self._rings_at <= due_at:
                return
            self._timer.cancel()
            self._timer = None
        if due_at is not None:
            self._timer, self._rings_at = self._loop.call_at(due_at, self._tick), due_at

    def _tick(self) -> None:
        self._timer = None
        now, due_at = self._loop.time(), self.engine.next_timer()
        if due_at is None or now < due_at - EARLY_S:
            self._arm()
            return
        self.engine.handle_timer(max(now, due_at))
        self.flush()
        if self.engine.news:
            self.pump()
        else:
            self._arm()  # a question went out, nothing else
