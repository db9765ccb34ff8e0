"""A controller played by hand: what is said to the engine, what it sends, what it reports."""

from typing import Any, TypeVar

from protocol.commands import SendBatch
from protocol.engine import OpenWork
from protocol.events import Event
from protocol.grbl.dialect import Dialect
from protocol.grbl.engine import GrblEngine
from tests.harness.reach import Reaches

BANNER = "Grbl 1.1h ['$' for help]"
T = TypeVar("T")


class Scene:
    """`now` in seconds; `log` holds every event that was not taken."""

    def __init__(self, dialect: Dialect | None = None, open_work: OpenWork | None = None) -> None:
        self.now = 0.0
        self.engine = GrblEngine(dialect or Dialect(resets_on_open=False), first_id=1, now=0.0, open_work=open_work)
        self.log: list[Event] = []
        self.reaches = Reaches()

    def say(self, *lines: str) -> bytes:
        """Lines of the controller; answers what the engine sends then."""
        for line in lines:
            self.engine.receive_data(line.encode() + b"\r\n", self.now)
        return self.sent()

    def sent(self) -> bytes:
        data = self.engine.data_to_send(self.now)
        while (event := self.engine.next_event()) is not None:
            self.log.append(event)
        return data

    def wait(self, seconds: float) -> bytes:
        """Let timers ring; answers all that was sent."""
        end, out = self.now + seconds, b""
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

    def poll(self, report: str) -> bytes:
        """Wait for a question and answer it."""
        for _ in range(40):
            if b"?" in self.wait(0.05):
                break
        else:
            raise AssertionError("no question came")
        return self.say(report)

    def batch(self, *blocks: str, **more: Any) -> int:
        id = self.engine.next_id
        self.engine.submit(SendBatch(id, blocks, 1.0, reach_mm=self.reaches.of(blocks), **more), self.now)
        return id

    def shake_hands(self, *, opt: str = "[OPT:V,15,128]", idle: str = "<Idle|MPos:0.000,0.000,0.000|FS:0,0>") -> None:
        if self.engine.next_timer() == 0.0:
            self.wait(0.0)
            self.say(idle)
        self.say("[VER:1.1h.20190830:]", opt, "ok")
        self.say("[HLP:$$]", "ok")
        self.say("[GC:G1 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]", "ok")
        self.say("[G54:0.000,0.000,0.000]", "[PRB:0.000,0.000,0.000:0]", "ok")
        self.say("$13=0", "$100=100.000", "$101=100.000", "$102=100.000", "ok")
        self.sent()


def ready(dialect: Dialect | None = None, **more: Any) -> Scene:
    scene = Scene(dialect)
    scene.shake_hands(**more)
    assert scene.engine.free() > 0
    return scene
