"""The NC frame engine and the virtual lathe joined by two wires, in simulated time, with the smallest job there can be.

Around the engine stand a list of batches, a journal and what a daemon does when the link breaks. What the engine says
is executed is held against what the lathe has executed at that very moment. The one rule: a run is decided by its seed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, Literal

from protocol.commands import CycleStart, SendBatch
from protocol.engine import OpenWork
from protocol.events import (
    BatchDone,
    BatchFailed,
    Event,
    FateInDoubt,
    FateSettled,
    LinkLost,
    LinkReady,
    MachineRestarted,
    MessageSeen,
    StateReported,
)
from protocol.ncframe.codec import ACK, NAK
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.engine import NcFrameEngine
from sim.faults import FaultRates, HostileWire
from sim.ncframe.machine import EVERY_BYTE, VirtualLathe
from sim.ncframe.settings import SimSettings

TIME_LIMIT_S = 3600.0
RECONNECT_S = 0.5
HELD_MOST_S = 20.0
"""After so long somebody presses cycle start: a byte of noise may have been XOFF."""


@dataclass(frozen=True)
class Mishap:
    """Something that befalls the pair at `at` seconds; `ack`, `nak`: a byte reaches the host that nobody said."""

    at: float
    kind: Literal["unplug", "restart", "hold", "panic", "ack", "nak"]
    lasts_s: float = 0.0


@dataclass
class NcPair:
    """One run. `outcome` is None while it goes on."""

    program: Sequence[tuple[str, ...]] = ()
    settings: SimSettings = field(default_factory=SimSettings)
    seed: int = 0
    rates: FaultRates = field(default_factory=FaultRates)
    mishaps: Sequence[Mishap] = ()
    dialect: Dialect = field(default_factory=Dialect)
    baud: int = 115200
    resume_within_s: float = 1e9
    up: FaultRates | None = None  # from the lathe to the host; None: as `rates`
    expected_s: float = 5.0

    def __post_init__(self) -> None:
        self.now = 0.0
        self.lathe = VirtualLathe(self.settings)
        self.to_machine = HostileWire(self.seed * 2 + 1, self.rates, baud=self.baud, framing=EVERY_BYTE)
        back = self.rates if self.up is None else self.up
        self.to_host = HostileWire(self.seed * 2 + 2, back, baud=self.baud, framing=EVERY_BYTE)
        self.engine: NcFrameEngine | None = None
        self.events: list[tuple[float, Event]] = []
        self.done: list[int] = []  # batches, by their place in the program
        self.journal: dict[int, int] = {}  # ID -> place in the program
        self.open: list[SendBatch] = []
        self.failed: BatchFailed | None = None
        self.doubt: tuple[int, ...] = ()
        self.outcome: str | None = None
        self.started = False
        self.epochs = 0
        self.life_at = 0.0
        self.sent_frames: set[str] = set()
        self._connect_at: float | None = 0.0
        self._unplugged_until = 0.0
        self._mishaps = sorted(self.mishaps, key=lambda mishap: mishap.at)
        self._release_at: float | None = None
        self._held_since: float | None = None

    # --- the loop -----------------------------------------------------------------------------------------------

    def run(self, seconds: float = TIME_LIMIT_S, *, until: Callable[["NcPair"], bool] | None = None) -> "NcPair":
        end = self.now + seconds
        self._turn()
        while self.outcome is None and not (until is not None and until(self)):
            if self.now >= end:
                if seconds == TIME_LIMIT_S:
                    raise TimeoutError(f"seed {self.seed}: no end after {seconds} s of simulated time")
                return self
            self._advance(end)
            self._turn()
        return self

    def _advance(self, end: float) -> None:
        timers = [self.lathe.next_timer(), self.to_machine.next_timer(), self.to_host.next_timer(), self._release_at]
        if self.engine is not None:
            timers.append(self.engine.next_timer())
        if self._connect_at is not None:
            timers.append(max(self._connect_at, self._unplugged_until))
        if self._mishaps:
            timers.append(self._mishaps[0].at)
        if self._held_since is not None:
            timers.append(self._held_since + HELD_MOST_S)
        due = [timer for timer in timers if timer is not None]
        if not due:
            raise RuntimeError(f"seed {self.seed}: nothing is scheduled at {self.now:.3f} s, the pair hangs")
        self.now = max(self.now, min(end, *due))

    def _turn(self) -> None:
        now = self.now
        self._mishap()
        if self._release_at is not None and now >= self._release_at:
            self._release_at = None
            self.lathe.release(now)
        if self._held_since is not None and now >= self._held_since + HELD_MOST_S and self.engine is not None:
            self._held_since = None
            self.engine.realtime(CycleStart(99), now)
        if self._connect_at is not None and now >= max(self._connect_at, self._unplugged_until):
            self._connect()
        self.lathe.handle_timer(now)
        self.lathe.receive_data(self.to_machine.receive(now), now)
        self.to_host.send(self.lathe.data_to_send(now), now)
        data = self.to_host.receive(now)
        if self.engine is None:
            return
        self.engine.receive_data(data, now)
        self.engine.handle_timer(now)
        self.drain()
        if self.engine is not None:
            self.to_machine.send(self.engine.data_to_send(now), now)
            self.drain()

    # --- what a daemon does -------------------------------------------------------------------------------------

    def _connect(self) -> None:
        self._connect_at = None
        self.epochs += 1
        work = None
        if self.started:
            work = OpenWork(tuple(self.open), {}, self.life_at + self.resume_within_s)
        first = 1000 * self.epochs
        self.engine = NcFrameEngine(self.dialect, first_id=first, baud=self.baud, now=self.now, open_work=work)

    def _disconnect(self, wait_s: float) -> None:
        self.engine = None
        self._held_since = None
        self._connect_at = self.now + wait_s
        for wire in (self.to_machine, self.to_host):
            wire.cut()
            wire.mend()

    def _mishap(self) -> None:
        while self._mishaps and self._mishaps[0].at <= self.now:
            mishap = self._mishaps.pop(0)
            match mishap.kind:
                case "restart":
                    self.lathe.restart(self.now)
                case "panic":
                    self.lathe.panic(self.now)
                case "hold":
                    self.lathe.hold(self.now)
                    self._release_at = self.now + mishap.lasts_s
                case "ack" | "nak" if self.engine is not None:
                    self.engine.receive_data(bytes([ACK if mishap.kind == "ack" else NAK]), self.now)
                case "unplug":
                    self._unplugged_until = self.now + mishap.lasts_s
                    self._disconnect(mishap.lasts_s)

    def drain(self) -> None:
        while self.engine is not None and (event := self.engine.next_event()) is not None:
            self.events.append((self.now, event))
            if not isinstance(event, MessageSeen):
                self._handle(event)
        free = self.engine is not None and self.outcome is None and self.engine.free()
        if free and not self.open and self.program and self.started:
            self._send_next()

    def _handle(self, event: Event) -> None:
        match event:
            case LinkReady():
                self.started = True
            case LinkLost():
                self._disconnect(RECONNECT_S)
            case BatchDone(id=id):
                self.life_at = self.now
                self._finished((id,))
            case FateSettled(done=done):
                self._finished(done)
                self.open.clear()
            case BatchFailed(id=id):
                self.failed = event
                self._interrupt((id,))
            case FateInDoubt(done=done, doubtful=doubtful):
                self._finished(done)
                self._interrupt(doubtful)
            case MachineRestarted() if self.started and not self.open:
                self._interrupt(())
            case StateReported(status="alarm"):
                self._interrupt(())
            case StateReported(status=status):
                self._held_since = (self._held_since or self.now) if status == "hold" else None
            case _:
                pass

    def _finished(self, ids: Sequence[int]) -> None:
        for id in ids:
            place = self.journal[id]
            self.done.append(place)
            self.open = [batch for batch in self.open if batch.id != id]
            for frame in () if self.misread else self.program[place]:
                ran = [each for each in self.lathe.executed if each.text == frame]
                assert ran, f"seed {self.seed}, {self.now:.3f} s: {frame} is called done and never ran"
                assert ran[-1].finished, f"seed {self.seed}, {self.now:.3f} s: {frame} is called done and still runs"
        if len(self.done) == len(self.program):
            self.outcome = "completed"

    def _interrupt(self, ids: Sequence[int]) -> None:
        self.doubt = tuple(sorted({*self.doubt, *(self.journal[id] for id in ids)}))
        self.outcome = "interrupted"

    def _send_next(self) -> None:
        assert self.engine is not None
        place = len(self.done)
        batch = SendBatch(self.engine.next_id, self.program[place], self.expected_s)
        self.journal[batch.id] = place
        self.open.append(batch)
        self.engine.submit(batch, self.now)

    # --- for tests ----------------------------------------------------------------------------------------------

    def of(self, kind: str) -> list[Any]:
        return [event for _, event in self.events if type(event).__name__ == kind]

    def console(self) -> list[str]:
        return [f"{at:8.3f} {e.direction} {e.text}" for at, e in self.events if isinstance(e, MessageSeen)]

    @property
    def executed(self) -> list[str]:
        """Frames that the lathe began, in order."""
        return [each.text for each in self.lathe.executed]

    @property
    def misread(self) -> list[str]:
        """Frames that it executed and nobody sent: damage that the check byte did not show."""
        ours = {frame for batch in self.program for frame in batch}
        return [text for text in self.executed if text not in ours]

    def verify(self) -> None:
        """Exactly once and in order; or interrupted, with what is certain and what is in doubt named rightly."""
        what = f"seed {self.seed}"
        executed = self.executed
        assert len(set(executed)) == len(executed), f"{what}: a frame was executed twice"
        assert self.done == list(range(len(self.done))), what
        frames = [frame for batch in self.program for frame in batch]
        assert executed == frames[: len(executed)], f"{what}: lost or out of order"
        if self.outcome == "completed":
            assert executed == frames, what
            return
        certain = sum(len(self.program[place]) for place in self.done)
        doubtful = sum(len(self.program[place]) for place in self.doubt)
        assert certain <= len(executed) <= certain + doubtful, f"{what}: {len(executed)} frames ran"
        if self.failed is not None and self.failed.lines_done is not None and self.failed.lines_touched is not None:
            least, most = certain + self.failed.lines_done, certain + self.failed.lines_touched
            assert least <= len(executed) <= most, f"{what}: {self.failed}, and {len(executed) - certain} ran"
            unfinished = [each.text for each in self.lathe.executed[:least] if not each.finished]
            assert not unfinished, f"{what}: {self.failed}, and {unfinished} did not end"


def walk(seed: int, batches: int, *, most: int = 12) -> list[tuple[str, ...]]:
    """Short moves, lines and arcs, modal words left out here and there; no frame twice, for each says its number."""
    random = Random(seed)
    program: list[tuple[str, ...]] = []
    number = 0
    for _ in range(batches):
        frames = []
        for _ in range(random.randint(1, most)):
            number += 1
            words = {"X": random.randint(-300, 300), "Z": number * (-1) ** number, "R": None, "G": None}
            if number == 1 or random.random() < 0.3:
                words["G"] = random.choice((0, 1))
            if number == 1 or random.random() < 0.2:
                words["F"] = random.randint(100, 255)
            if random.random() < 0.05:
                words["M"] = random.choice((3, 5, 8, 9))
            if random.random() < 0.3:
                words["S"] = random.choice((5, 6, 24))
            frames.append(" ".join(f"{each}{words[each]}" for each in "GMXZRFST" if words.get(each) is not None))
        program.append(tuple(frames))
    return program
