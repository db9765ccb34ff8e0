"""Fan-out of events to the readers of the WebSocket: sequence numbers, coalescing, replay, cutting slow readers off.

Not a socket (that is `server/ws.py`) and not a store: the history is in the database. It lives on the loop's thread.
The one rule: `publish` never waits and never grows. A reader that does not read loses states first, console lines
next, and then its connection; it never slows the stream.
"""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from server.jsontext import dumps

STATE = "state"
CONSOLE = "console"
TOPICS = (STATE, "job", "queue", CONSOLE, "alarm", "tool", "io", "program", "log")
"""What can be subscribed to; `hello` and `result` come by themselves."""

REPLAY_LIMIT = 4096
"""Messages kept for `since=`; a reader that was away for longer gets `resync` and a snapshot."""
REPLAY_LIMIT_BYTES = 16 * 1024 * 1024
"""The same in bytes: a message about a queue of a thousand jobs has 100 KB."""
QUEUE_LIMIT = 1024
"""Messages waiting for one reader; at the next one its connection is cut. It can come back with `since=`."""
QUEUE_LIMIT_BYTES = 4 * 1024 * 1024
"""The same bound in bytes, because a console line may be 8 KiB long."""
CONSOLE_LIMIT = QUEUE_LIMIT // 2
"""From this many waiting messages on, console lines for this reader are left out (and counted)."""
CONSOLE_READERS = 4
"""So many readers get every console line. A Grbl at work says and hears 700 lines a second: each reader more would cost
the loop some percent of a core, and a pause would wait behind them."""
CONSOLE_SENDS = 200
CONSOLE_SLICE = timedelta(seconds=0.1)
"""With more readers so many lines in that time go to all of them together; the others are left out (and counted)."""
DEFAULT_RATE_HZ = 20.0


def utc_now() -> datetime:
    """The wall clock, for time stamps that people and scripts read."""
    return datetime.now(UTC)


def rfc3339(at: datetime) -> str:
    """A time as api.md writes it: UTC with milliseconds and `Z`."""
    utc = at if at.tzinfo is UTC else at.astimezone(UTC)
    return utc.isoformat(timespec="milliseconds").removesuffix("+00:00") + "Z"


@dataclass(frozen=True, slots=True)
class Message:
    """One event, with the text that goes to every reader (encoded once)."""

    seq: int
    type: str
    machine: str | None
    text: str


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


class CutError(Exception):
    """This reader was disconnected by the hub; `str()` says why."""


class Subscription:
    """The messages that wait for one reader."""

    def __init__(self, wanted: Filter) -> None:
        self.wanted = wanted
        self.left_out = 0
        self._waiting: deque[str] = deque()
        self._waiting_bytes = 0
        self._states: dict[str | None, Message] = {}
        self._state_due_at = 0.0
        self._wake = asyncio.Event()
        self._cut = asyncio.Event()
        self._cut_reason = ""

    @property
    def is_cut(self) -> bool:
        """Whether the hub has given this reader up."""
        return self._cut.is_set()

    def wants(self, type: str, machine: str | None) -> bool:  # noqa: A002
        """Whether a message of this kind would be taken."""
        return not self.is_cut and self.wanted.takes(type, machine)

    def offer(self, message: Message) -> None:
        """Take a published message, if this reader wants it; never waits."""
        if not self.wants(message.type, message.machine):
            return
        if message.type == STATE:
            # The newest state takes the place of the one that still waits: never a backlog.
            self._states[message.machine] = message
            self._wake.set()
        elif message.type == CONSOLE and len(self._waiting) >= CONSOLE_LIMIT:
            self.left_out += 1
        else:
            self.push(message.text)

    def push(self, text: str) -> None:
        """Queue a text for this reader alone (an answer to its own command), after what already waits."""
        if len(self._waiting) >= QUEUE_LIMIT or self._waiting_bytes + len(text) > QUEUE_LIMIT_BYTES:
            self.cut("it does not read fast enough")
            return
        self._waiting.append(text)
        self._waiting_bytes += len(text)
        self._wake.set()

    def cut(self, reason: str) -> None:
        """Give the reader up and free what waits for it."""
        if self.is_cut:
            return
        self._cut_reason = reason
        self._waiting.clear()
        self._states.clear()
        self._cut.set()
        self._wake.set()

    def narrow(self, wanted: Filter) -> None:
        """Change what this reader gets from now on."""
        self.wanted = wanted
        self._states = {key: held for key, held in self._states.items() if wanted.takes(held.type, held.machine)}

    async def next(self) -> str:
        """The next text to send. Raises CutError when the hub has given this reader up."""
        loop = asyncio.get_running_loop()
        while True:
            if self.is_cut:
                raise CutError(self._cut_reason)
            if self._waiting:
                text = self._waiting.popleft()
                self._waiting_bytes -= len(text)
                return text
            wait_s = None
            if self._states:
                wait_s = self._state_due_at - loop.time()
                if wait_s <= 0:
                    self._state_due_at = loop.time() + 1.0 / self.wanted.rate_hz
                    return self._states.pop(next(iter(self._states))).text
            self._wake.clear()
            try:
                async with asyncio.timeout(wait_s):
                    await self._wake.wait()
            except TimeoutError:
                continue

    async def until_cut(self) -> None:
        """Returns when the hub gives this reader up."""
        await self._cut.wait()


class Hub:
    """Where everything that happens is announced.

    `clock` gives the time stamps. Sequence numbers begin at the clock's milliseconds, so that they go on rising
    over a restart of the daemon and a `since=` from before it is recognised as too old.
    """

    def __init__(self, *, clock: Callable[[], datetime] = utc_now, first_seq: int | None = None) -> None:
        self._clock = clock
        self._seq = int(clock().timestamp() * 1000) if first_seq is None else first_seq
        self._forgotten_seq = self._seq
        self._kept: deque[Message] = deque()
        self._kept_bytes = 0
        self._subscriptions: set[Subscription] = set()
        self._console_since = clock()
        self._console_sends = 0
        self.published: Counter[str] = Counter()
        self.cut_readers = 0

    @property
    def seq(self) -> int:
        """The number of the last message."""
        return self._seq

    @property
    def readers(self) -> int:
        """How many readers are connected."""
        return len(self._subscriptions)

    def publish(
        self,
        type: str,  # noqa: A002 - the word of api.md
        machine: str | None,
        data: dict[str, Any] | Callable[[], dict[str, Any]],
    ) -> int:
        """Announce something; its sequence number. Never waits for a reader.

        `data` as a function is called now, or not at all where nobody wants it and nobody could ask for it later.
        """
        self._seq += 1
        self.published[type] += 1
        kept = type not in (STATE, CONSOLE)
        if not kept and not self._subscriptions:
            return self._seq
        readers = [reader for reader in self._subscriptions if reader.wants(type, machine)]
        if not kept and not readers:
            return self._seq
        if type == CONSOLE and len(readers) > CONSOLE_READERS and not self._affords(len(readers)):
            for reader in readers:
                reader.left_out += 1
            return self._seq
        content = data() if callable(data) else data
        message = Message(self._seq, type, machine, self.envelope(type, content, machine=machine, seq=self._seq))
        if kept:
            self._keep(message)
        for reader in readers:
            reader.offer(message)
        return self._seq

    def _affords(self, sends: int) -> bool:
        """Whether a console line for so many readers is still within the bound."""
        now = self._clock()
        if not timedelta(0) <= now - self._console_since < CONSOLE_SLICE:  # also where the clock was set back
            self._console_since, self._console_sends = now, 0
        self._console_sends += sends
        return self._console_sends <= max(CONSOLE_SENDS, sends)

    def envelope(
        self,
        type: str,  # noqa: A002
        data: dict[str, Any],
        *,
        machine: str | None = None,
        seq: int,
    ) -> str:
        """A message as it goes over the wire (api.md, WebSocket)."""
        at = rfc3339(self._clock())
        return dumps({"seq": seq, "type": type, "machine": machine, "at": at, "data": data})

    def subscribe(self, wanted: Filter) -> Subscription:
        """A new reader; it gets what is published from now on. Pair with `unsubscribe`."""
        subscription = Subscription(wanted)
        self._subscriptions.add(subscription)
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """The reader has gone, or was cut."""
        self._subscriptions.discard(subscription)
        self.cut_readers += subscription.is_cut

    def missed(self, since: int, wanted: Filter) -> Iterable[str] | None:
        """The texts of what was published after `since` and never dropped; None when that is no longer known."""
        if not self._forgotten_seq <= since <= self._seq:
            return None
        return [kept.text for kept in self._kept if kept.seq > since and wanted.takes(kept.type, kept.machine)]

    def _keep(self, message: Message) -> None:
        self._kept.append(message)
        self._kept_bytes += len(message.text)
        while len(self._kept) > REPLAY_LIMIT or self._kept_bytes > REPLAY_LIMIT_BYTES:
            forgotten = self._kept.popleft()
            self._kept_bytes -= len(forgotten.text)
            self._forgotten_seq = forgotten.seq
