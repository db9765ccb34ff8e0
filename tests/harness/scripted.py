"""A machine played by hand: says what a test tells it to say, and shows what the engine sent.

Its frames are written out here and not taken from the codec under test.
"""

import hashlib
import re

from protocol.commands import SendBatch
from protocol.elvinto.dialect import Dialect
from protocol.elvinto.engine import ElvintoEngine
from protocol.engine import OpenWork
from protocol.events import Event, MessageSeen

SENT = re.compile(rb"CRC16,VALUE<#\d+,MD5<#[0-9a-f]{32},ID<#(\d+);([^;]*);")
QUIET = Dialect(poll_interval_s=0)


def framed(message: str) -> bytes:
    """A message of the machine with its check header."""
    raw = message.encode() + b";"
    total = 0
    for byte in raw:
        f = byte << 1
        f ^= (f & 0xFF00) >> 8
        total = (total + (f & 0xFFFF)) & 0xFFFF
    return f"CRC16,VALUE<#{total},MD5<#{hashlib.md5(raw).hexdigest()};".encode() + raw


def state(kind: str = "idle", x: float = 0, y: float = 0, z: float = 0, more: str = "") -> str:
    return f"STATE,TYPE<#{kind},MX<#{x},MY<#{y},MZ<#{z},MA<#0,MB<#0,MC<#0,FEED<#0,SPEED<#0{more},ISABS<#Y"


class Scripted:
    """An engine and the hand that plays its machine. Time moves only by `wait`."""

    def __init__(self, dialect: Dialect = QUIET, *, first_id: int = 1000, open_work: OpenWork | None = None) -> None:
        self.now = 0.0
        self.engine = ElvintoEngine(dialect, first_id=first_id, baud=0, now=0.0, open_work=open_work)
        self.events: list[Event] = []

    def sent(self) -> list[tuple[int, str]]:
        """(ID, message) of everything sent since the last call; fails on anything but whole frames."""
        data = self.engine.data_to_send(self.now)
        found = SENT.findall(data)
        assert SENT.sub(b"", data) == b"", data
        self._drain()
        return [(int(id), message.decode()) for id, message in found]

    def say(self, *messages: str) -> None:
        for message in messages:
            self.engine.receive_data(framed(message), self.now)
        self._drain()

    def wait(self, seconds: float) -> list[tuple[int, str]]:
        """Let so much time pass, timers included; what was sent meanwhile."""
        until, sent = self.now + seconds, self.sent()
        while (due := self.engine.next_timer()) is not None and due <= until:
            self.now = max(self.now, due)
            self.engine.handle_timer(self.now)
            sent += self.sent()
        self.now = until
        self._drain()
        return sent

    def _drain(self) -> None:
        while (event := self.engine.next_event()) is not None:
            if not isinstance(event, MessageSeen):
                self.events.append(event)

    def take(self, *kinds: type) -> list[Event]:
        """Events so far (of these kinds), and forget all."""
        self._drain()
        events, self.events = self.events, []
        return [e for e in events if not kinds or isinstance(e, kinds)]

    def shake_hands(self, x: float = 0, y: float = 0, z: float = 0) -> None:
        """INIT, READY, W90, W95: the engine is ready afterwards and its log empty."""
        for _ in range(4):
            ((id, message),) = self.sent()
            if message == "READY":
                self.say("READY")
            elif message.endswith("W95"):
                self.say(f"RECEIVED,ID<#{id}", state("idle", x, y, z), f"OK,ID<#{id}")
            else:
                self.say(f"RECEIVED,ID<#{id}", f"OK,ID<#{id}")
        assert self.sent() == []
        assert self.engine.free() == 1
        self.take()

    def answer_position(self, x: float = 0, y: float = 0, z: float = 0) -> None:
        """The engine has asked W95 once: execute it."""
        ((id, message),) = self.sent()
        assert message == "GCODE,DATA<#W95"
        self.say(f"RECEIVED,ID<#{id}", state("idle", x, y, z), f"OK,ID<#{id}")

    def batch(self, *blocks: str, end: dict[str, float] | None = None, **more: object) -> SendBatch:
        """Submit a batch under the next ID; it is taken off the wire."""
        batch = SendBatch(self.engine.next_id, blocks, 0.5, end or {}, **more)  # type: ignore[arg-type]
        self.engine.submit(batch, self.now)
        ((id, message),) = self.sent()
        assert id == batch.id
        assert message == "GCODE,DATA<#" + "|".join(blocks)
        return batch
