"""The Grbl engine and the virtual Grbl joined by two wires, in simulated time, with the smallest job there can be.

Around the engine stands a list of batches and nothing else. What the engine claims is held against what the virtual
machine has really done at that very moment. The one rule: a run is decided by its seed alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

from protocol.commands import OnError, SendBatch
from protocol.engine import OpenWork
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    Event,
    FateInDoubt,
    LinkLost,
    LinkReady,
    MessagesSeen,
)
from protocol.grbl.dialect import Dialect
from protocol.grbl.engine import GrblEngine
from sim.faults import FaultRates, HostileWire
from sim.grbl.events import BytesLost, SimEvent
from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings
from tests.harness.reach import Reaches

TIME_LIMIT_S = 3600.0


@dataclass
class GrblPair:
    """One run. `at` holds things to do at a time, by the seconds; each gets the pair."""

    program: Sequence[tuple[str, ...]] = ()
    settings: SimSettings = field(default_factory=SimSettings)
    seed: int = 0
    rates: FaultRates = field(default_factory=FaultRates)
    dialect: Dialect = field(default_factory=lambda: Dialect(resets_on_open=False))
    baud: int = 115200
    on_error: OnError = "hold"
    at: Sequence[tuple[float, Callable[["GrblPair"], None]]] = ()
    open_work: OpenWork | None = None

    def __post_init__(self) -> None:
        self.now = 0.0
        self.machine = VirtualGrbl(self.settings)
        # Grbl has no checksum: nobody can notice a digit that flips on the way to it. Its answers may be hurt.
        self.to_machine = HostileWire(self.seed * 2 + 1, FaultRates(), baud=self.baud)
        self.to_host = HostileWire(self.seed * 2 + 2, self.rates, baud=self.baud)
        self.machine.line_opened(0.0)
        self.engine = GrblEngine(self.dialect, first_id=1, now=0.0, open_work=self.open_work)
        self.events: list[tuple[float, Event]] = []
        self.sim_events: list[SimEvent] = []
        self.done: list[int] = []
        self.failed: dict[int, BatchFailed] = {}
        self.submitted = 0
        self.over = False
        self._todo = sorted(self.at, key=lambda item: item[0])
        self._token = 0
        self._reaches = Reaches()

    # --- the loop -----------------------------------------------------------------------------------------------

    def run(self, seconds: float = TIME_LIMIT_S, *, until: Callable[["GrblPair"], bool] | None = None) -> "GrblPair":
        end = self.now + seconds
        self._pump()
        while not (until(self) if until else self.finished):
            if self.now >= end:
                if until is None and seconds == TIME_LIMIT_S:
                    raise TimeoutError(f"seed {self.seed}: no end after {seconds} s of simulated time")
                return self
            self._advance(end)
            self._pump()
        return self

    @property
    def finished(self) -> bool:
        """Every batch has ended one way or the other."""
        ended = len(self.done) + len(self.failed)
        return self.over or ended == len(self.program) or (bool(self.failed) and ended == self.submitted)

    def _advance(self, end: float) -> None:
        timers = [
            self.machine.next_timer(),
            self.to_machine.next_timer(),
            self.to_host.next_timer(),
            self.engine.next_timer(),
            self._todo[0][0] if self._todo else None,
            end,
        ]
        self.now = max(self.now, min(timer for timer in timers if timer is not None))

    def _pump(self) -> None:
        now = self.now
        while self._todo and self._todo[0][0] <= now:
            self._todo.pop(0)[1](self)
        self.machine.handle_timer(now)
        self.machine.receive_data(self.to_machine.receive(now), now)
        self.to_host.send(self.machine.data_to_send(now), now)
        if data := self.to_host.receive(now):
            self.engine.receive_data(data, now)
        self.engine.handle_timer(now)
        self._drain()
        self.to_machine.send(self.engine.data_to_send(now), now)
        self._drain()
        while (event := self.machine.next_event()) is not None:
            self.sim_events.append(event)

    # --- the job ------------------------------------------------------------------------------------------------

    def _drain(self) -> None:
        while (event := self.engine.next_event()) is not None:
            self._handle(event)
        while self.submitted < len(self.program) and self.engine.free() and not self.failed and not self.over:
            blocks = self.program[self.submitted]
            self.submitted += 1
            reach_mm = self._reaches.of(blocks)
            batch = SendBatch(self.engine.next_id, blocks, 1.0, on_error=self.on_error, reach_mm=reach_mm)
            self.engine.submit(batch, self.now)

    def _handle(self, event: Event) -> None:
        self.events.append((self.now, event))
        match event:
            case BatchDone(id=id):
                self.done.append(id)
                self._certain(self.program[id - 1], f"batch {id} is done")
            case BatchFailed(id=id):
                self.failed[id] = event
                assert event.lines_done is not None
                self._certain(self.program[id - 1][: event.lines_done], f"batch {id} failed")
            case LinkLost():
                self.over = True
            case _:
                pass

    def _certain(self, blocks: Sequence[str], why: str) -> None:
        """What the engine calls executed is executed at this moment, to the last step."""
        refused = {(e.id, e.index) for e in self.of("LineRefused")}
        for block in blocks:
            ran = [line for line in self.machine.executed if line.text == block]
            if not ran:
                assert refused, f"seed {self.seed}, {self.now:.3f} s: {why}, but {block} was never executed"
                continue
            assert ran[-1].finished, f"seed {self.seed}, {self.now:.3f} s: {why}, but {block} still moves"

    # --- for tests ----------------------------------------------------------------------------------------------

    def token(self) -> int:
        self._token += 1
        return self._token

    def submit(self, make: Callable[[int], Any]) -> int:
        token = self.token()
        self.engine.submit(make(token), self.now)
        return token

    def press(self, make: Callable[[int], Any]) -> int:
        token = self.token()
        self.engine.realtime(make(token), self.now)
        return token

    def of(self, kind: str) -> list[Any]:
        return [event for _, event in self.events if type(event).__name__ == kind]

    def ready(self) -> "GrblPair":
        return self.run(30.0, until=lambda pair: bool(pair.of("LinkReady")))

    def console(self) -> list[str]:
        seen = [message for _, e in self.events if isinstance(e, MessagesSeen) for message in e.messages]
        return [f"{at:8.3f} {direction} {text}" for at, direction, text in seen]

    @property
    def lost_bytes(self) -> list[BytesLost]:
        return [event for event in self.sim_events if isinstance(event, BytesLost)]

    @property
    def program_lines(self) -> list[str]:
        return [block for batch in self.program for block in batch]

    @property
    def executed(self) -> list[str]:
        """Lines of the program that the machine took, in order."""
        ours = set(self.program_lines)
        return [line.text for line in self.machine.executed if line.text in ours]

    def verify(self) -> None:
        """Exactly once and in order; or failed, with what is certain, what is not, and what lies between."""
        assert self.done == sorted(self.done)
        # While the EEPROM is written a real-time byte may be lost (it is sent again); of a line never a byte.
        overrun = [lost for lost in self.lost_bytes if lost.why == "ring" or (lost.why == "eeprom" and lost.count > 1)]
        assert overrun == [], f"seed {self.seed}: {overrun}"
        executed = self.executed
        assert len(set(executed)) == len(executed), f"seed {self.seed}: a line was executed twice"
        lines = self.program_lines
        assert executed == [line for line in lines if line in set(executed)], f"seed {self.seed}: out of order"
        if not self.failed and not self.over:
            assert executed == lines or self.of("LineRefused"), f"seed {self.seed}"
        for id, failed in self.failed.items():
            untouched = self.program[id - 1][failed.lines_touched :]
            assert not set(untouched) & set(executed), f"seed {self.seed}: {failed} but {untouched} ran in part"


def walk(seed: int, batches: int, *, most_mm: float = 3.0) -> list[tuple[str, ...]]:
    """Short moves, no line twice: each ends where none ended before; modal lines between."""
    random = Random(seed)
    program: list[tuple[str, ...]] = [("G21G90G94", "G1F3000")]
    x = 0.0
    for number in range(batches):
        lines = []
        for nth in range(random.randint(1, 12)):
            x = round(x + random.uniform(0.02, most_mm), 3)
            lines.append(f"G{random.choice((0, 1))}X{x % 150:.3f}Y{number}.{nth:02}")
        if random.random() < 0.1:
            lines.append(f"G4P0.0{number:03}")
        program.append(tuple(lines))
    return program


__all__ = ["BatchReceived", "FateInDoubt", "GrblPair", "LinkReady", "walk"]
