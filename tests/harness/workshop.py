"""A whole daemon without its HTTP: Workshop, engine, virtual machine and an in-memory link, in simulated time.

`Bench` outlives its daemons: the machine, the disk and the time line stay when a daemon dies. The one rule: what the
machine executed is read from the machine, never from the job.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from server.app import Parts, Workshop
from server.background.dbthread import Connect, InlineDb, plainly
from server.background.worker import InlineWorker
from server.config.model import Config
from sim.elvinto.machine import VirtualElvinto
from sim.elvinto.settings import SimSettings
from sim.shell import MemoryLink, open_memory
from tests.harness.simloop import LoopClock, until

MACHINE = "router"
OURS = ("W90", "W95", "W98")
"""Blocks that the engine sends of its own accord; they move nothing."""


class Cable:
    """Opens links to one virtual machine, as often as a daemon likes, unless it is pulled out."""

    def __init__(self, machine: VirtualElvinto) -> None:
        self.machine = machine
        self.plugged = True
        self.opened = 0
        self._link: MemoryLink | None = None
        self._on_lost: Callable[[str], None] | None = None

    async def __call__(
        self, url: str, baud: int, on_data: Callable[[bytes], None], on_lost: Callable[[str], None]
    ) -> MemoryLink:
        if not self.plugged:
            raise OSError("no such device")
        self.opened += 1
        self._link = await open_memory(self.machine, on_data)
        self._on_lost = on_lost
        return self._link

    def pull(self) -> None:
        """The cable is out; the daemon notices at once, the machine never."""
        self.plugged = False
        self.drop()
        if self._on_lost is not None:
            self._on_lost("unplugged")

    def drop(self) -> None:
        """The daemon died: nobody closed anything, nobody hears anything."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def touch(self) -> None:
        """Something was done to the machine by hand: let it speak."""
        if self._link is not None:
            self._link.turn()

    async def live_alone(self, seconds: float) -> None:
        """Time passes for a machine that nobody is connected to."""
        link = await open_memory(self.machine, lambda _data: None)
        await asyncio.sleep(seconds)
        link.close()


@dataclass
class Bench:
    """The world around the daemons of one test."""

    folder: Path
    settings: SimSettings = field(default_factory=SimSettings)
    options: dict[str, Any] = field(default_factory=dict)
    latency_s: float = 0.001
    connect: Connect = plainly
    set_back_s: float = 0.0
    """What the clock for people is wrong by when the next daemon starts."""
    monotonic: Callable[[], float] = time.monotonic
    """The clock of what people have signed in with."""

    def __post_init__(self) -> None:
        self.machine = VirtualElvinto(self.settings)
        self.cable = Cable(self.machine)
        self.databases: list[InlineDb] = []
        self.shop: Workshop | None = None

    def config(self) -> Config:
        return Config.model_validate(
            {
                "server": {"data_dir": str(self.folder)},
                "machine": [{"name": MACHINE, "port": "/dev/cable", **self.options}],
            }
        )

    async def start(self) -> Workshop:
        """A daemon on this bench."""
        loop = asyncio.get_running_loop()

        def open_db(path: Path) -> InlineDb:
            self.databases.append(InlineDb(path, loop, latency_s=self.latency_s, connect=self.connect))
            # A crash here is one of the simulated process, never of this computer.
            self.databases[-1].db.execute("pragma synchronous = off")
            return self.databases[-1]

        parts = Parts(
            clock=LoopClock(loop, set_back_s=self.set_back_s),
            open_db=open_db,
            worker=lambda _name: InlineWorker(),
            opener=lambda _config: self.cable,
            monotonic=self.monotonic,
        )
        self.shop = Workshop(self.config(), parts)
        await self.shop.start()
        return self.shop

    async def connected(self, *, within_s: float = 60.0) -> Workshop:
        """A daemon on this bench whose machine takes commands."""
        shop = self.shop or await self.start()
        await until(lambda: shop.machines[MACHINE].link_status == "connected", within_s=within_s)
        return shop

    def crash(self) -> None:
        """kill -9: what is not durable is gone, nothing is closed in good order."""
        assert self.shop is not None
        self.databases[-1].crash()
        self.cable.drop()
        for controller in self.shop.machines.values():
            kill(controller)
        for task in self.shop.jobs._background._tasks:
            task.cancel()
        self.shop = None

    def executed(self) -> list[str]:
        """The blocks of programs that the machine has executed, in order."""
        return [block.text for block in self.machine.executed if block.text not in OURS]

    async def job(self, program: str, **options: Any) -> dict[str, Any]:
        """Upload a program and queue it."""
        assert self.shop is not None
        stored, _ = await self.shop.programs.store(one_chunk(program.encode()), "part.nc")
        return await self.shop.jobs.create(stored["id"], MACHINE, force=True, **options)

    async def status(self, job: int, *wanted: str, within_s: float = 600.0) -> dict[str, Any]:
        """Wait until the job is in one of these states; its view."""
        shop = self.shop
        assert shop is not None
        deadline = asyncio.get_running_loop().time() + within_s
        while True:
            view = await shop.jobs.get(job)
            if view["status"] in wanted:
                return view
            if asyncio.get_running_loop().time() > deadline:
                raise AssertionError(f"job {job} is {view['status']} and not {wanted}: {view}")
            await asyncio.sleep(0.05)


def kill(controller: Any) -> None:
    """Stop everything of a controller that still has a timer, without any good order."""
    controller._reconnect._cancel()
    if controller._link is not None:
        controller._link.close()
    controller._link = None
    controller.tools._closed = True
    if controller.tools._timer is not None:
        controller.tools._timer.cancel()
    controller.stream._engine = None
    controller.stream.runner = None
    controller.stream._todo.clear()
    controller.stream._arm()


async def one_chunk(data: bytes) -> AsyncIterator[bytes]:
    yield data
