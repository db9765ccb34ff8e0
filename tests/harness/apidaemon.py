"""A daemon of each kind of virtual machine behind its whole HTTP, for tools that only know `requests`.

With a connected machine, a program, and a job on hold or, with a tool changer, one that waits for a tool: most routes
then have something to work on. Not the tests (tests/server/api/test_schemathesis.py). The one rule: what is asked goes
the whole way, through the application to the machine and back.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import requests

from sim.elvinto.settings import SimSettings
from tests.harness.asgihttp import AsgiAdapter
from tests.harness.changerbench import desk
from tests.harness.grblworkshop import GrblBench
from tests.harness.ncworkshop import HERE, NcBench
from tests.harness.simloop import SimLoop, until
from tests.harness.workshop import MACHINE, Bench

BASE_URL = "http://127.0.0.1:8420"
PROGRAM = "G21 G90\nG0 X1\nG1 X2 Y3 F600\nM30\n"
TURNED = "G21 G90\nG0 X1\nG1 X2 Z3 F60\nM30\n"
CHANGED = "G21 G90\nG1 X1 F600\nT1 M6\nG1 X2\nM30\n"
PINS_AT_REST = {"emc-enable-in": True}


@dataclass(frozen=True, slots=True)
class Kind:
    """Which machine. `waits`: the job has begun and waits for a tool; else it is on hold in the queue."""

    bench: Callable[[Path], Bench]
    program: str = PROGRAM
    waits: bool = False


def _with_changer(folder: Path) -> Bench:
    changer = {"kind": "external", "start_in_estop": False}
    return Bench(folder, settings=SimSettings(), options={"toolchanger": changer})


KINDS = {
    "elvinto": Kind(Bench),
    "grbl": Kind(GrblBench),
    "ncframe": Kind(NcBench, TURNED),
    "changer": Kind(_with_changer, CHANGED, waits=True),
}


@dataclass
class Daemon:
    """One daemon; its tokens close it."""

    folder: Path
    kind: Kind
    loop: SimLoop = field(default_factory=SimLoop)

    def __post_init__(self) -> None:
        self.bench = self.kind.bench(self.folder)
        self.loop.run_until_complete(self._begin())
        self.session = requests.Session()
        self.session.trust_env = False
        self.session.mount("http://", AsgiAdapter(desk()[1], self.loop, self.secret))
        self.signed = {"Authorization": f"Bearer {self.secret}"}

    async def _begin(self) -> None:
        self.shop = await self.bench.connected()
        self.router = self.shop.machines[MACHINE]
        self.secret = (await self.shop.tokens.create("tool", "admin"))["token"]
        await until(lambda: self.router.state.status == "idle", within_s=60)
        if isinstance(self.bench, NcBench):
            await self.router.run_blocks([HERE])
        if self.kind.waits:
            self.router.tools.drive(PINS_AT_REST)
            for level in (True, False):
                self.router.tools.drive({"emc-abort-ack": level})
            await until(lambda: self.router.tools.io.start_refusal is None, within_s=60)
        self.job = await self.bench.job(self.kind.program, hold=not self.kind.waits)
        if self.kind.waits:
            await self.bench.status(self.job["id"], "waiting")
        self.places = {"/machines/{m}": MACHINE, "/programs/{id}": self.job["program"], "/jobs/{id}": self.job["id"]}

    def attend(self) -> None:
        """This daemon is the one that the application asks."""
        desk()[0].shop = self.shop

    def is_fit(self) -> bool:
        """Connected, without an alarm, with its program, and its job as it was."""
        if self.router.link_status != "connected" or self.router.state.alarm is not None:
            return False
        if self.kind.waits:
            return str(self.router.stream.status) == "waiting" and self.router.tools.io.connected
        programs = self.loop.run_until_complete(self.shop.programs.list())
        idle = self.router.state_view()["status"] == "idle"
        return idle and any(program["id"] == self.job["program"] for program in programs)

    def passes(self, seconds: float) -> None:
        """Time, in which the machine does what it does."""
        self.loop.run_until_complete(asyncio.sleep(seconds))

    def close(self) -> None:
        self.loop.run_until_complete(self.shop.stop())
        self.session.close()
        self.loop.close()


class Daemons:
    """The daemon of each kind that is there, or another one where an operation has spoilt it."""

    def __init__(self, make_folder: Callable[[], Path]) -> None:
        self._make_folder = make_folder
        self._there: dict[str, Daemon] = {}
        self.made = 0

    def fit(self, kind: str) -> Daemon:
        there = self._there.get(kind)
        if there is not None:
            there.attend()
            if not there.is_fit():
                there.close()
                there = None
        self._there[kind] = there = there or self.fresh(kind)
        return there

    def fresh(self, kind: str) -> Daemon:
        """Another one that only the caller has."""
        self.made += 1
        daemon = Daemon(self._make_folder(), KINDS[kind])
        daemon.attend()
        return daemon

    def close(self) -> None:
        for daemon in self._there.values():
            daemon.attend()
            daemon.close()
        self._there.clear()
