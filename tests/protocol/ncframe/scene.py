"""A lathe played by hand: what it says, byte by byte; what the engine sends and reports."""

from collections.abc import Sequence
from typing import Any, TypeVar

from protocol.commands import Command, RealtimeCommand, RunBlock, SendBatch
from protocol.engine import OpenWork
from protocol.events import Event, MessageSeen, StateReported
from protocol.ncframe.codec import ACK, CAN, ENQ, NAK, XOFF, XON
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.engine import NcFrameEngine

T = TypeVar("T")

WORDS = {"ACK": ACK, "NAK": NAK, "CAN": CAN, "XON": XON, "XOFF": XOFF}
ASKED = bytes([ENQ])
STOP = bytes([CAN])


def said(words: str) -> bytes:
    """`ACK 7` is an answer with a count, `ACK` alone a byte; anything else is hexadecimal."""
    out = bytearray()
    before = ""
    for word in words.split():
        if word in WORDS:
            out.append(WORDS[word])
        elif before == "ACK":
            out += int(word).to_bytes(4, "big")
        else:
            out += bytes.fromhex(word)
        before = word
    return bytes(out)


class Scene:
    """`now` in seconds; `log` holds every event that was not taken, without the console's."""

    def __init__(self, dialect: Dialect | None = None, work: OpenWork | None = None, *, baud: int = 0) -> None:
        self.now = 0.0
        self.dialect = dialect or Dialect(check="none", poll_interval_s=0)
        self.engine = NcFrameEngine(self.dialect, first_id=1000, baud=baud, now=0.0, open_work=work)
        self.log: list[Event] = []
        self.console: list[str] = []
        self._token = 0

    def say(self, words: str) -> bytes:
        """Bytes of the lathe and a short silence; answers what the engine sends then."""
        self.engine.receive_data(said(words), self.now)
        return self.sent()

    def hush(self) -> bytes:
        """A silence that ends what was said."""
        return self.wait(self.dialect.gap_s)

    def sent(self) -> bytes:
        data = self.engine.data_to_send(self.now)
        while (event := self.engine.next_event()) is not None:
            if isinstance(event, MessageSeen):
                self.console.append(f"{event.direction} {event.text}")
            else:
                self.log.append(event)
        return data

    def wait(self, seconds: float) -> bytes:
        """Let timers ring; answers all that was sent."""
        end, out = self.now + seconds, self.sent()
        while (due := self.engine.next_timer()) is not None and due <= end:
            self.now = max(self.now, due)
            self.engine.handle_timer(self.now)
            out += self.sent()
        self.now = end
        return out + self.sent()

    def take(self, kind: type[T]) -> list[T]:
        found = [event for event in self.log if isinstance(event, kind)]
        self.log = [event for event in self.log if not isinstance(event, kind)]
        return found

    def news(self) -> list[Event]:
        """What was reported, without states."""
        found = [event for event in self.log if not isinstance(event, StateReported)]
        self.log.clear()
        return found

    def statuses(self) -> list[str]:
        return [event.status for event in self.take(StateReported)]

    def batch(self, *blocks: str, expected_s: float = 1.0, **more: Any) -> bytes:
        self.engine.submit(SendBatch(self.engine.next_id, blocks, expected_s, **more), self.now)
        return self.sent()

    def by_hand(self, *blocks: str) -> bytes:
        return self.submit(RunBlock(self.token(), blocks))

    def submit(self, command: Command) -> bytes:
        self.engine.submit(command, self.now)
        return self.sent()

    def press(self, command: RealtimeCommand) -> bytes:
        self.engine.realtime(command, self.now)
        return self.sent()

    def token(self) -> int:
        self._token += 1
        return self._token

    def greet(self, count: int = 7) -> "Scene":
        """The first contact: ENQ is answered twice."""
        for _ in range(2 if self.dialect.counter else 1):
            assert self.sent() in (ASKED, b"")
            self.say(f"ACK {count}" if self.dialect.counter else "ACK")
            self.hush()
        return self

    def executes(self, count: int) -> bytes:
        """The lathe has executed the frame and says so twice."""
        assert self.say("ACK") == ASKED
        return self.say(f"ACK {count}")


def ready(count: int = 7, *, dialect: Dialect | None = None, baud: int = 0) -> Scene:
    scene = Scene(dialect, baud=baud).greet(count)
    assert scene.engine.free() == 1
    scene.log.clear()
    return scene


def ready_without_counter(**more: Any) -> Scene:
    return ready(dialect=Dialect(check="none", poll_interval_s=0, counter=False), **more)


def batch(id: int, *blocks: str, **more: Any) -> SendBatch:
    return SendBatch(id, blocks, 1.0, **more)


def work(batches: Sequence[SendBatch], **more: Any) -> OpenWork:
    return OpenWork(tuple(batches), **more)
