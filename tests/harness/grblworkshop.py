"""The same workshop (workshop.py) with a virtual Grbl at the other end of the cable."""

from dataclasses import dataclass, field
from typing import Any

from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings
from tests.harness.workshop import Bench, Cable


@dataclass
class GrblBench(Bench):
    """`grbl`: keys of `[machine.grbl]`. The board does not reset when its port is opened unless the settings say so."""

    settings: Any = field(default_factory=SimSettings)
    grbl: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.machine: Any = VirtualGrbl(self.settings)
        self.cable = Cable(self.machine)
        self.databases = []
        self.shop = None
        dialect = {"resets_on_open": self.settings.reset_on_open, **self.grbl}
        self.options = {"protocol": "grbl", "grbl": dialect, **self.options}

    def executed(self) -> list[str]:
        """Every line that the parser took without an error, but for what the engine asks."""
        return [line.text for line in self.machine.executed if not line.text.startswith("$")]
