"""What waits for one reader of the WebSocket: events and console lines in order, of states the newest.

Not the socket and not the turn of the loop in which it is sent (`server/live/fanout.py`). The one rule: nothing here
waits and nothing grows: a reader that does not read loses states first, console lines next, and then its connection.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime

from server.live.fanout import TICK_S, Fanout, Outlet

STATE = "state"
CONSOLE = "console"
TOPICS = (STATE, "job", "queue", CONSOLE, "alarm", "tool", "io", "program", "log")
"""What can be subscribed to; `hello` and `result` come by themselves."""

QUEUE_LIMIT = 1024
"""Messages, and pieces of console lines, waiting for one reader; at the next one its connection is cut. It can come
back with `since=`."""
QUEUE_LIMIT_BYTES = 4 * 1024 * 1024
"""The same bound in bytes, because a queue of a thousand jobs has 100 KB."""
CONSOLE_LIMIT = QUEUE_LIMIT // 2
"""From this many waiting messages on, console lines for this reader are left out (and counted)."""
PIECE_BYTES = 64 * 1024
"""As much as a socket is given at once: asyncio's own mark for asking a writer to pause."""
DEFAULT_RATE_HZ = 20.0


@dataclass(frozen=True, slots=True)
class Message:
    """One event, published `at`. `frame` is what goes to every reader, made once."""

    seq: int
    type: str
    machine: str | None
    frame: bytes
    at: datetime


@dataclass(frozen=True, slots=True)
class Filter:
    """What a reader wants. Empty `machines` means all; `rate_hz` bounds its state messages a second in all."""

    topics: frozenset[str] = frozenset(TOPICS)
    machines: frozenset[str] = frozenset()
    rate_hz: float = DEFAULT_RATE_HZ

    def takes(self, type: str, machine: str | None) -> bool:  # noqa: A002 - the word of api.md
        """Whether this reader is to get such a message. What concerns no machine concerns everybody."""
        if type not in self.topics:
            return False
        return not self.machines or machine is None or machine in self.machines


class Subscription:
    """See the head of this file. Until it begins everything waits."""

    def __init__(self, wanted: Filter, fanout: Fanout, on_change: Callable[[], None]) -> None:
        """`on_change` is called when it wants something else from now on, or nothing more."""
        self.wanted = wanted
        self.left_out = 0
        self.listed = False
        self.is_cut = False
        """Whether the hub has given this reader up."""
        self.outlet: Outlet | None = None
        self.cut_reason = ""
        self._fanout = fanout
        self._on_change = on_change
        self._owed: deque[bytes] = deque()
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._states: dict[str | None, bytes] = {}
        self._state_due_at = 0.0
        self._cut = asyncio.Event()

    def begin(self, outlet: Outlet, owed: Iterable[bytes] = ()) -> None:
        """Send to `outlet` from now on: first the frames that are owed, then what waits."""
        self.outlet = outlet
        self._fanout.loop = asyncio.get_running_loop()
        self._owed.extend(owed)
        self.wake()

    def end(self) -> None:
        """Nothing is sent any more."""
        self.outlet = None
        self._fanout.forget(self)

    def wake(self) -> None:
        """The outlet has room, or there is something for it."""
        self._fanout.wake(self)

    def wants(self, type: str, machine: str | None) -> bool:  # noqa: A002
        """Whether a message of this kind would be taken."""
        return not self.is_cut and self.wanted.takes(type, machine)

    def offer(self, message: Message) -> None:
        """Take a published message that this reader wants; never waits."""
        if self.is_cut:
            return
        if message.type == STATE:
            # The newest state takes the place of the one that still waits: never a backlog.
            self._states[message.machine] = message.frame
            self.wake()
        else:
            self.push(message.frame)

    def offer_lines(self, frames: bytes, lines: int) -> None:
        """Take so many console lines in one piece, unless too much waits already."""
        if len(self._waiting) >= CONSOLE_LIMIT:
            self.left_out += lines
        else:
            self.push(frames)

    def push(self, frame: bytes) -> None:
        """Queue a frame for this reader (or an answer to its own command), after what already waits."""
        if len(self._waiting) >= QUEUE_LIMIT or self._waiting_bytes + len(frame) > QUEUE_LIMIT_BYTES:
            self.cut("it does not read fast enough")
        elif not self.is_cut:
            self._waiting.append(frame)
            self._waiting_bytes += len(frame)
            self.wake()

    def cut(self, reason: str) -> None:
        """Give the reader up and free what waits for it."""
        if self.is_cut:
            return
        self.is_cut = True
        self.cut_reason = reason
        self._owed.clear()
        self._waiting.clear()
        self._states.clear()
        self._cut.set()
        self._on_change()

    def narrow(self, wanted: Filter) -> None:
        """Change what this reader gets from now on."""
        self.wanted = wanted
        self._states = {machine: held for machine, held in self._states.items() if wanted.takes(STATE, machine)}
        self._on_change()

    @property
    def due_at(self) -> float | None:
        """When something may be sent; None while nothing waits."""
        if self._owed or self._waiting:
            return 0.0
        return self._state_due_at if self._states else None

    def take(self, now: float) -> bytes:
        """The frames that may go now, in order, PIECE_BYTES and the rest of one frame at most."""
        pieces: list[bytes] = []
        size = 0
        while size < PIECE_BYTES and (frame := self._next(now)) is not None:
            pieces.append(frame)
            size += len(frame)
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)

    def _next(self, now: float) -> bytes | None:
        if self._owed:
            return self._owed.popleft()
        if self._waiting:
            frame = self._waiting.popleft()
            self._waiting_bytes -= len(frame)
            return frame
        if not self._states or now < self._state_due_at:
            return None
        # One that is late by a tick or two of the fan-out keeps the beat; after a rest a new one begins.
        kept = now - self._state_due_at < 2 * TICK_S
        self._state_due_at = (self._state_due_at if kept else now) + 1.0 / self.wanted.rate_hz
        return self._states.pop(next(iter(self._states)))

    async def until_cut(self) -> None:
        """Returns when the hub gives this reader up; `cut_reason` says why."""
        await self._cut.wait()
