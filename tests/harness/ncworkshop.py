"""The same workshop (workshop.py) with a virtual lathe behind NC frames at the other end of the cable.

The one rule of it holds here as well, and more: not which frames came, but where each led is compared, count by count.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from server.app import Workshop
from server.machine.controller import Controller
from sim.faults import FaultRates
from sim.ncframe.machine import VirtualLathe
from sim.ncframe.settings import SimSettings
from sim.shell import MemoryLink, open_memory
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench, Cable

HERE = "G92 X0 Z0"
"""By hand: the lathe stands at the host's zero."""

Place = tuple[int, int]


class NcCable(Cable):
    """A cable that may spoil bytes."""

    faults: FaultRates | None = None
    seed = 0

    async def __call__(
        self, url: str, baud: int, on_data: Callable[[bytes], None], on_lost: Callable[[str], None]
    ) -> MemoryLink:
        if not self.plugged:
            raise OSError("no such device")
        self.opened += 1
        self._link = await open_memory(self.machine, on_data, faults=self.faults, seed=self.seed + 2 * self.opened)
        self._on_lost = on_lost
        return self._link


@dataclass
class NcBench(Bench):
    """`ncframe`: keys of `[machine.ncframe]`; check and counter are those of the lathe. A network port, for its bytes
    take no time."""

    settings: Any = field(default_factory=lambda: SimSettings(start_count=100))
    ncframe: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.machine: Any = VirtualLathe(self.settings)
        self.cable: Any = NcCable(self.machine)
        self.databases = []
        self.shop = None
        dialect = {"check": self.settings.check, "counter": self.settings.counter, **self.ncframe}
        self.options = {"protocol": "ncframe", "port": "tcp://lathe:4000", "ncframe": dialect, **self.options}

    async def located(self) -> Workshop:
        """Connected, and somebody has said where the lathe stands."""
        shop = await self.connected()
        results = await shop.machines[MACHINE].run_blocks([HERE])
        assert results[0]["ok"], results
        return shop

    def executed(self) -> list[str]:
        """The frames that were executed wholly."""
        return [frame.text for frame in self.machine.executed if frame.finished]

    def path(self) -> list[Place]:
        """Where each frame led that moved something, in counts: executed wholly, in order."""
        return [
            (frame.x, frame.z)
            for frame in self.machine.executed
            if frame.finished and {"X", "Z"} & {word[0] for word in frame.text.split()} and "G4" not in frame.text
        ]

    async def moving(self, frames: int, *, within_s: float = 300.0) -> None:
        """Wait until the lathe executes its frame number `frames` of this bench."""
        await until(lambda: len(self.machine.executed) >= frames, within_s=within_s)


def simulated(folder: Path, story: Callable[[NcBench, Workshop, Controller], Awaitable[None]], **options: Any) -> None:
    """Tell a story on a connected lathe that stands at zero, and stop the daemon."""

    async def main() -> None:
        bench = NcBench(folder, **options)
        shop = await bench.located()
        await story(bench, shop, shop.machines[MACHINE])
        if bench.shop is not None:
            await bench.shop.stop()

    run_simulated(main())


async def stands(bench: NcBench, seconds: float = 20.0) -> None:
    """Nothing moves by itself."""
    before = len(bench.machine.executed)
    await asyncio.sleep(seconds)
    assert len(bench.machine.executed) == before
