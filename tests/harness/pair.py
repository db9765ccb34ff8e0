"""Two state machines joined by two wires and nothing else: the engine and the virtual machine, in simulated time.

Around the engine stands the smallest job there can be: a list of batches, a journal, and what a daemon does after a
crash. The one rule: a run is decided by its seed alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Literal

from protocol.commands import Position, SendBatch
from protocol.elvinto.dialect import Dialect
from protocol.elvinto.engine import ElvintoEngine
from protocol.engine import OpenWork
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    Event,
    FateInDoubt,
    FateSettled,
    LinkLost,
    LinkReady,
    MachineRestarted,
    MessageSeen,
)
from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings
from sim.faults import FaultRates, HostileWire

TIME_LIMIT_S = 3600.0
RECONNECT_S = 0.5
OURS = ("W90", "W95", "W98")
"""Blocks that the engine sends of its own: they move nothing and are no part of a program."""


@dataclass(frozen=True)
class Part:
    """A batch of the test's program, before it has an ID."""

    blocks: tuple[str, ...]
    end: Position
    ends_program: bool = False


@dataclass(frozen=True)
class Mishap:
    """Something that befalls the pair at `at` seconds."""

    at: float
    kind: Literal["crash", "unplug", "restart"]
    lasts_s: float = 0.0


@dataclass
class Pair:
    """One run. `outcome` is None while it goes on."""

    program: Sequence[Part]
    settings: SimSettings
    seed: int = 0
    rates: FaultRates = field(default_factory=FaultRates)
    mishaps: Sequence[Mishap] = ()
    dialect: Dialect = field(default_factory=Dialect)
    durable_lag: int = 1  # how many of the last OKs a crash makes the journal forget
    resume_within_s: float = 1e9
    baud: int = 115200

    def __post_init__(self) -> None:
        self.now = 0.0
        self.machine = VirtualElvinto(self.settings)
        self.to_machine = HostileWire(self.seed * 2 + 1, self.rates, baud=self.baud)
        self.to_host = HostileWire(self.seed * 2 + 2, self.rates, baud=self.baud)
        self.outcome: str | None = None
        self.done: list[int] = []  # indices of parts, as the job knows them
        self.doubt: tuple[int, ...] = ()
        self.journal: dict[int, int] = {}  # wire ID -> index of the part
        self.open: list[SendBatch] = []
        self.events: list[Event] = []
        self.epochs = 0
        self.highest_id = 1000
        self.engine: ElvintoEngine | None = None
        self.connect_at: float | None = 0.0
        self.unplugged_until = 0.0
        self.life_at = 0.0
        self.started = False
        self._mishaps = sorted(self.mishaps, key=lambda mishap: mishap.at)
        self._durable: list[int] = []

    # --- the loop -----------------------------------------------------------------------------------------------

    def run(self, until: Callable[[], bool] = lambda: False) -> "Pair":
        while self.outcome is None and not until():
            if self.now > TIME_LIMIT_S:
                raise TimeoutError(f"seed {self.seed}: no end after {TIME_LIMIT_S} s of simulated time")
            self._advance()
            self._mishap()
            if self.connect_at is not None and self.now >= max(self.connect_at, self.unplugged_until):
                self._connect()
            self._pump()
        return self

    def _advance(self) -> None:
        timers = [self.machine.next_timer(), self.to_machine.next_timer(), self.to_host.next_timer()]
        if self.engine is not None:
            timers.append(self.engine.next_timer())
        if self.connect_at is not None:
            timers.append(max(self.connect_at, self.unplugged_until))
        if self._mishaps:
            timers.append(self._mishaps[0].at)
        due = [timer for timer in timers if timer is not None]
        if not due:
            raise RuntimeError(f"seed {self.seed}: nothing is scheduled at {self.now:.3f} s, the pair hangs")
        self.now = max(self.now, min(due))

    def _pump(self) -> None:
        now = self.now
        self.machine.handle_timer(now)
        self.machine.receive_data(self.to_machine.receive(now), now)
        self.to_host.send(self.machine.data_to_send(now), now)
        data = self.to_host.receive(now)
        if self.engine is None:
            return  # nobody listens: what the machine says is lost
        if data:
            self.engine.receive_data(data, now)
        self.engine.handle_timer(now)
        self._drain()
        if self.engine is not None:
            self.to_machine.send(self.engine.data_to_send(now), now)

    # --- what a daemon does -------------------------------------------------------------------------------------

    def _connect(self) -> None:
        self.connect_at = None
        self.epochs += 1
        for wire in (self.to_machine, self.to_host):
            wire.cut()
            wire.mend()
        work = None
        if self.started:
            start = self.program[self.done[-1]].end if self.done else {"x": 0.0, "y": 0.0, "z": 0.0}
            work = OpenWork(tuple(self.open), start, self.life_at + self.resume_within_s)
        first = (self.highest_id // 1000 + 1) * 1000
        self.engine = ElvintoEngine(self.dialect, first_id=first, baud=self.baud, now=self.now, open_work=work)

    def _disconnect(self, wait_s: float) -> None:
        if self.engine is not None:
            self.highest_id = max(self.highest_id, self.engine.next_id)
        self.engine = None
        self.connect_at = self.now + wait_s

    def _mishap(self) -> None:
        while self._mishaps and self._mishaps[0].at <= self.now:
            mishap = self._mishaps.pop(0)
            if mishap.kind == "restart":
                self.machine.restart(self.now)
                continue
            for wire in (self.to_machine, self.to_host):
                wire.cut()
                wire.mend()
            if mishap.kind == "crash":
                self._forget()
            else:
                self.unplugged_until = self.now + mishap.lasts_s
            self._disconnect(mishap.lasts_s)

    def _forget(self) -> None:
        """A crash: the last OK may not have been durable yet. What was journaled is known, sent or not."""
        if self.durable_lag and self.done and len(self.open) <= 1:
            index = self.done[-1]
            id = max(id for id, part in self.journal.items() if part == index)
            part = self.program[index]
            if not part.ends_program and not any(batch.ends_program for batch in self.open):
                self.done.pop()
                self.open.insert(0, SendBatch(id, part.blocks, 1.0, part.end, ends_program=part.ends_program))

    def _drain(self) -> None:
        while self.engine is not None and (event := self.engine.next_event()) is not None:
            if isinstance(event, MessageSeen):
                continue
            self.events.append(event)
            self._handle(event)
        if self.engine is not None and self.outcome is None and self.engine.free() and not self.open:
            self._send_next()

    def _handle(self, event: Event) -> None:
        match event:
            case LinkReady():
                self.started = True
            case LinkLost():
                self._disconnect(RECONNECT_S)
            case BatchReceived():
                self.life_at = self.now
            case BatchDone(id=id):
                self.life_at = self.now
                self._finished((id,))
            case FateSettled(done=done):
                self._finished(done)
                self.open.clear()  # what was not done goes out under fresh IDs
                if len(self.done) == len(self.program):
                    self.outcome = "completed"
            case FateInDoubt(done=done, doubtful=doubtful):
                self._finished(done)
                self._interrupt(doubtful)
            case BatchFailed(id=id):
                self._interrupt((id,))
            case MachineRestarted() if self.started and self.outcome is None:
                if not self.open:
                    self._interrupt(())
            case _:
                pass

    def _finished(self, ids: Sequence[int]) -> None:
        for id in ids:
            self.done.append(self.journal[id])
            self.open = [batch for batch in self.open if batch.id != id]
        if len(self.done) == len(self.program):
            self.outcome = "completed"

    def _interrupt(self, doubtful: Sequence[int]) -> None:
        self.doubt = tuple(self.journal[id] for id in doubtful)
        self.outcome = "interrupted"

    def _send_next(self) -> None:
        assert self.engine is not None
        index = len(self.done)
        part = self.program[index]
        batch = SendBatch(self.engine.next_id, part.blocks, 1.0, part.end, ends_program=part.ends_program)
        self.journal[batch.id] = index
        self.highest_id = max(self.highest_id, batch.id)
        self.open.append(batch)
        self.engine.submit(batch, self.now)
        self.engine_sent_at = self.now

    # --- what came of it ----------------------------------------------------------------------------------------

    @property
    def executed(self) -> list[str]:
        """The blocks of the program that the machine began, in order; an end of program run twice counts once."""
        blocks: list[str] = []
        for block in self.machine.executed:
            if block.text in OURS or (block.text == "M30" and blocks and blocks[-1] == "M30"):
                continue
            blocks.append(block.text)
        return blocks

    def blocks(self, indices: Sequence[int]) -> list[str]:
        return [block for index in indices for block in self.program[index].blocks]

    @property
    def flipped(self) -> bool:
        """The machine acknowledged an ID that nobody gave, while a batch was being repeated."""
        return any(isinstance(event, FateInDoubt) and "executed twice" in event.reason for event in self.events)

    def verify(self) -> None:
        """Exactly once, in order; or interrupted, with the certain and the doubtful named rightly."""
        assert self.done == list(range(len(self.done))), self.seed
        certain = self.blocks(self.done)
        executed = self.executed
        if self.outcome == "completed":
            assert executed == self.blocks(range(len(self.program))), f"seed {self.seed}"
            return
        assert executed[: len(certain)] == certain, f"seed {self.seed}: a certain block was not executed"
        rest = executed[len(certain) :]
        doubtful = self.blocks(self.doubt)
        if self.flipped and rest[: len(doubtful)] == doubtful:
            rest = rest[len(doubtful) :]
        # A machine that restarts between two copies of a batch begins it anew: only lines in doubt, from the first.
        while rest and any(mishap.kind == "restart" for mishap in self.mishaps) and rest[0] in doubtful[:1]:
            again = rest.index(rest[0], 1) if rest[0] in rest[1:] else len(rest)
            assert rest[:again] == doubtful[:again], f"seed {self.seed}: {rest} is not of {doubtful}"
            rest = rest[again:]
        assert rest == doubtful[: len(rest)], f"seed {self.seed}: executed {rest}, in doubt only {doubtful}"


def walk(seed: int, parts: int, *, end: bool = True) -> list[Part]:
    """A program of short moves; no two batches end at the same place."""
    random = Random(seed)
    x, y = 0.0, 0.0
    program: list[Part] = []
    for number in range(parts):
        blocks = []
        for _ in range(random.randint(1, 4)):
            x, y = round(x + random.uniform(0.1, 2), 3), round(random.uniform(0, 50), 3)
            blocks.append(f"G1X{x}Y{y}F6000")
        program.append(Part((*blocks, f"G1Z{number * 0.1:.1f}"), {"x": x, "y": y, "z": round(number * 0.1, 1)}))
    if end:
        program.append(Part(("M30",), program[-1].end, ends_program=True))
    return program
