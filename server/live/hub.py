"""Fan-out of events to the readers of the WebSocket: sequence numbers, replay, who gets what.

Not a socket (that is `server/api/ws.py`), not what waits for one reader (`server/live/subscription.py`) and not a
store: the history is in the database. It lives on the loop's thread. The one rule: `publish` never waits and never
grows.
"""

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Iterable
from datetime import datetime, timedelta
from typing import Any

from server.clock import rfc3339, utc_now
from server.jsontext import dumps
from server.live.fanout import Fanout
from server.live.subscription import CONSOLE, STATE, Filter, Message, Subscription
from server.live.textframe import text_frame

REPLAY_LIMIT = 4096
"""Messages kept for `since=`; a reader that was away for longer gets `resync` and a snapshot."""
REPLAY_LIMIT_BYTES = 16 * 1024 * 1024
"""The same in bytes: a message about a queue of a thousand jobs has 100 KB."""
REPLAY_FOR = timedelta(days=1)
"""The same in time: a tablet that slept over night is told what it missed, one of last week gets the snapshot. So a
quiet workshop does not fill the limit for months."""
CONSOLE_READERS = 4
"""So many readers get every console line. A Grbl at work says and hears 700 lines a second: for a hundred readers that
would be 10 MB a second, and some percent of a core for the loop."""
CONSOLE_LINES = 1000
CONSOLE_GATHER_S = 0.05
"""Console lines wait so long for others to go with: each reader is offered one piece then, and not each line in the
moment in which the machine waits for the next."""
CONSOLE_PIECE_LINES = 64
"""More do not wait."""
CONSOLE_SLICE = timedelta(seconds=0.1)
"""With more readers so many lines in that time, counted for each, go to all of them; the others are left out."""


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
        self._fanout = Fanout()
        self._subscriptions: set[Subscription] = set()
        self._takers: dict[tuple[str, str | None], tuple[Subscription, ...]] = {}
        """Who wants what, as far as it was asked for since a reader came, went or changed its mind: a console says
        hundreds of lines a second that nobody of a hundred readers may want."""
        self._console_since = clock()
        self._console_lines = 0
        self.published: Counter[str] = Counter()
        self.cut_readers = 0
        self._left_out = 0
        self._gathered: dict[str | None, list[bytes]] = {}
        """Console lines of each machine that nobody has been offered yet."""
        self._alarm: asyncio.TimerHandle | None = None

    @property
    def seq(self) -> int:
        """The number of the last message."""
        return self._seq

    @property
    def readers(self) -> int:
        """How many readers are connected."""
        return len(self._subscriptions)

    @property
    def console_left_out(self) -> int:
        """Console lines that readers did not get, counted for each: they were slow, or there were so many of them."""
        return self._left_out + sum(reader.left_out for reader in self._subscriptions)

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
        readers = self._readers_of(type, machine)
        if not kept and not readers:
            return self._seq
        if type == CONSOLE and len(readers) > CONSOLE_READERS and not self._affords(len(readers)):
            self._left_out += len(readers)
            return self._seq
        content = data() if callable(data) else data
        frame = text_frame(self.envelope(type, content, machine=machine, seq=self._seq))
        if type == CONSOLE:
            self._gather(machine, frame)
            return self._seq
        message = Message(self._seq, type, machine, frame, self._clock())
        if kept:
            self.hand_out_lines()  # they were said before
            self._keep(message)
        for reader in readers:
            reader.offer(message)
        return self._seq

    def unwanted(self, machine: str | None, lines: int) -> bool:
        """Whether nobody reads the console of this machine: so many lines of it are announced with that, then."""
        if self._subscriptions and self._readers_of(CONSOLE, machine):
            return False
        self._seq += lines
        self.published[CONSOLE] += lines
        return True

    def _gather(self, machine: str | None, line: bytes) -> None:
        lines = self._gathered.setdefault(machine, [])
        lines.append(line)
        if len(lines) >= CONSOLE_PIECE_LINES:
            self.hand_out_lines()
        elif self._alarm is None and (loop := self._fanout.loop) is not None:
            self._alarm = loop.call_later(CONSOLE_GATHER_S, self.hand_out_lines)

    def hand_out_lines(self) -> None:
        """Offer the console lines that were gathered."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        if not self._gathered:
            return
        gathered, self._gathered = self._gathered, {}
        for machine, lines in gathered.items():
            piece = b"".join(lines)
            for reader in self._readers_of(CONSOLE, machine):
                reader.offer_lines(piece, len(lines))

    def _readers_of(self, type: str, machine: str | None) -> tuple[Subscription, ...]:  # noqa: A002
        readers = self._takers.get((type, machine))
        if readers is None:
            readers = tuple(reader for reader in self._subscriptions if reader.wants(type, machine))
            self._takers[type, machine] = readers
        return readers

    def _affords(self, lines: int) -> bool:
        """Whether a console line for so many readers is still within the bound."""
        now = self._clock()
        if not timedelta(0) <= now - self._console_since < CONSOLE_SLICE:  # also where the clock was set back
            self._console_since, self._console_lines = now, 0
        self._console_lines += lines
        return self._console_lines <= max(CONSOLE_LINES, lines)

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
        """A new reader; it gets what is published from now on, once it begins. Pair with `unsubscribe`."""
        self.hand_out_lines()
        subscription = Subscription(wanted, self._fanout, self._takers.clear)
        self._subscriptions.add(subscription)
        self._takers.clear()
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """The reader has gone, or was cut."""
        if subscription in self._subscriptions:
            self._left_out += subscription.left_out
        self._subscriptions.discard(subscription)
        self._takers.clear()
        subscription.end()
        self.cut_readers += subscription.is_cut

    def missed(self, since: int, wanted: Filter) -> Iterable[bytes] | None:
        """The frames of what was published after `since` and never dropped; None when that is no longer known."""
        if not self._forgotten_seq <= since <= self._seq:
            return None
        return [kept.frame for kept in self._kept if kept.seq > since and wanted.takes(kept.type, kept.machine)]

    def _keep(self, message: Message) -> None:
        self._kept.append(message)
        self._kept_bytes += len(message.frame)
        while (
            len(self._kept) > REPLAY_LIMIT
            or self._kept_bytes > REPLAY_LIMIT_BYTES
            or message.at - self._kept[0].at > REPLAY_FOR
        ):
            forgotten = self._kept.popleft()
            self._kept_bytes -= len(forgotten.frame)
            self._forgotten_seq = forgotten.seq
