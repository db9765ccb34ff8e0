"""A block and a virtual changer with a network between them: every message arrives, in order, some time later."""

from collections import deque
from random import Random

from protocol.iocontrol.control import IoControl
from protocol.iocontrol.events import Event, OperatorMessage, PinChanged, Snapshot, ToolPrepared
from protocol.iocontrol.pins import PINS, Pin
from sim.changer.changer import VirtualChanger

Levels = dict[str, bool | int]


class Pair:
    """`latency_s`: the longest way of a message, one way. Time goes on by `run` alone."""

    def __init__(self, io: IoControl, changer: VirtualChanger, *, seed: int = 0, latency_s: float = 0.0) -> None:
        self.io = io
        self.changer = changer
        self.now = 0.0
        self.events: list[Event] = []
        self._random = Random(seed)
        self._latency_s = latency_s
        self._to_changer: deque[tuple[float, Levels]] = deque()
        self._to_io: deque[tuple[float, Levels]] = deque()
        self._cut = False
        io.connect(changer.connect(), self.now)
        self.pump()

    @property
    def messages(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, OperatorMessage)]

    def of(self, *kinds: type[Event]) -> list[Event]:
        return [event for event in self.events if isinstance(event, kinds)]

    def pump(self) -> None:
        """Take what both have to say; a step of pins is one message."""
        steps: dict[int, Levels] = {}
        while (event := self.io.next_event()) is not None:
            self.events.append(event)
            if isinstance(event, Snapshot):
                self._send(self._to_changer, dict(event.pins))
            elif isinstance(event, PinChanged) and PINS[Pin(event.pin)].direction == "out":
                steps.setdefault(event.step, {})[event.pin] = event.value
        for levels in steps.values():
            self._send(self._to_changer, levels)
        if changed := self.changer.changes():
            self._send(self._to_io, changed)

    def cut(self) -> None:
        """The connection breaks: what is on its way is lost, and so is everything until `mend`."""
        self._cut = True
        self._to_changer.clear()
        self._to_io.clear()
        self.io.disconnect(self.now)
        self.pump()

    def mend(self) -> None:
        self._cut = False
        self.io.connect(self.changer.connect(), self.now)
        self.pump()

    def run(self, seconds: float) -> None:
        """Let this time pass."""
        end = self.now + seconds
        while (at := self._next()) is not None and at <= end:
            self.now = max(self.now, at)
            if self._to_changer and self._to_changer[0][0] <= self.now:
                self.changer.see(self._to_changer.popleft()[1], self.now)
            elif self._to_io and self._to_io[0][0] <= self.now:
                self.io.set_inputs(self._to_io.popleft()[1], self.now)
            else:
                self.changer.handle_timer(self.now)
                self.io.handle_timer(self.now)
            self.pump()
        self.now = end

    def prepare(self, tool: int) -> None:
        self.io.prepare(tool, self.now)
        self.pump()

    def change(self) -> None:
        self.io.start_change(self.now)
        self.pump()
        self.run(2.0)
        if self.io.change_moves_allowed:
            self.io.change(self.now)
            self.pump()

    def prepared(self) -> bool:
        return bool(self.of(ToolPrepared))

    def _send(self, way: deque[tuple[float, Levels]], levels: Levels) -> None:
        if self._cut:
            return
        at = self.now + self._random.uniform(0.0, self._latency_s)
        way.append((max(at, way[-1][0] if way else at), levels))

    def _next(self) -> float | None:
        times = [at for at in (self.io.next_timer(), self.changer.next_timer()) if at is not None]
        times += [way[0][0] for way in (self._to_changer, self._to_io) if way]
        return min(times, default=None)
