"""The same workshop (workshop.py) with a virtual lathe behind NC frames at the other end of the cable."""

from dataclasses import dataclass, field
from typing import Any

from server.app import Workshop
from sim.ncframe.machine import VirtualLathe
from sim.ncframe.settings import SimSettings
from tests.harness.simloop import until
from tests.harness.workshop import MACHINE, Bench, Cable

HERE = "G92 X0 Z0"
"""By hand: the lathe stands at the host's zero."""


@dataclass
class NcBench(Bench):
    """`ncframe`: keys of `[machine.ncframe]`; check and counter are those of the lathe. A network port, for its bytes
    take no time."""

    settings: Any = field(default_factory=lambda: SimSettings(start_count=100))
    ncframe: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.machine: Any = VirtualLathe(self.settings)
        self.cable = Cable(self.machine)
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

    def begun(self) -> list[str]:
        """The frames that the lathe began with, executed to their end or not."""
        return [frame.text for frame in self.machine.executed]

    async def moving(self, frames: int, *, within_s: float = 120.0) -> None:
        """Wait until the lathe executes its frame number `frames` of this bench."""
        await until(lambda: len(self.machine.executed) >= frames, within_s=within_s)
