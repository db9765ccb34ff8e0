"""Where everything is put together: the configuration in, a running workshop out. Nothing is decided here.

The one rule: this is the only place that knows which part is made of what; a test puts the same parts together with
other clocks, wires and databases (`Parts`).
"""

import asyncio
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from jobs import journal, toolstore
from jobs.program import ProgramStore
from protocol.elvinto.engine import ElvintoEngine
from protocol.grbl.engine import GrblEngine
from protocol.ncframe.engine import NcFrameEngine
from server.access.audit import Audit
from server.access.tokens import TokenStore
from server.background.childworker import BySize, ChildWorker
from server.background.dbthread import Db, DbThread
from server.background.worker import ThreadWorker, Worker
from server.changer.toolchanger import ToolChanger
from server.clock import Clock, WallClock
from server.config.elvinto import ElvintoConfig
from server.config.grbl import GrblConfig
from server.config.model import Config, MachineConfig
from server.config.ncframe import NcFrameConfig
from server.job.estimates import Estimates
from server.job.service import JobService
from server.job.starting import Background, Starter
from server.live.hub import Hub
from server.machine.controller import Controller
from server.machine.link import EngineFactory
from server.machine.panel import Panel
from server.machine.serialport import Opener, PortOpener
from server.programs.plans import Planning
from server.programs.room import Room
from server.programs.service import ProgramService
from server.programs.toolpaths import Toolpaths
from server.programs.workpiece import RATELESS, Workpiece
from server.waysout import Counters

HEAVY = frozenset({"checks", "drawings", "timelines"})
"""Workers that read whole programs and compute."""
DESCRIBER = "describer"
"""Makes the description of the API. In a thread it would hold up the loop for 10 ms at once."""


def engine_factory(config: MachineConfig) -> EngineFactory:
    """The engine of this machine's protocol."""
    match config.dialect:
        case ElvintoConfig() as elvinto:
            return partial(ElvintoEngine, elvinto.dialect(), baud=config.baud)
        case GrblConfig() as grbl:
            return partial(GrblEngine, grbl.dialect())
        case NcFrameConfig() as ncframe:
            baud = 0 if config.port.startswith(RATELESS) else config.baud
            return partial(NcFrameEngine, ncframe.dialect(config.motion.motion()), baud=baud)


@dataclass(frozen=True, slots=True)
class Parts:
    """What a workshop is made of that touches the world. `monotonic`: seconds, for what people have signed in with."""

    clock: Clock
    open_db: Callable[[Path], Db]
    worker: Callable[[str], Worker]
    opener: Callable[[MachineConfig], Opener]
    monotonic: Callable[[], float] = time.monotonic

    @classmethod
    def real(cls) -> "Parts":
        """A thread for the database, threads for files, the computer's clock and ports."""
        return cls(
            clock=WallClock(),
            open_db=lambda path: DbThread(path, asyncio.get_running_loop()),
            worker=_worker,
            opener=lambda config: PortOpener(config.protocol, dtr=config.dtr),
        )


def _worker(name: str) -> Worker:
    if name == DESCRIBER:
        return ChildWorker(name)
    return BySize(name) if name in HEAVY else ThreadWorker(name)


class Workshop:
    """Everything that the API needs. Between `start` and `stop` the machines are at work."""

    machines: Mapping[str, Controller]
    panels: Mapping[str, Panel]
    changers: Mapping[str, ToolChanger]
    jobs: JobService
    programs: ProgramService
    hub: Hub
    db: Db
    tokens: TokenStore
    audit: Audit
    describer: Worker

    def __init__(self, config: Config, parts: Parts) -> None:
        self.config = config
        self._parts = parts
        self.outbound = Counters()
        self._workers: list[Worker] = []

    async def start(self) -> None:
        """Open the database, take up what was under way, connect what is to be connected."""
        config, parts = self.config, self._parts
        folder = config.server.data_dir
        folder.mkdir(parents=True, exist_ok=True)
        self.hub = Hub(clock=parts.clock.now)
        self.db = parts.open_db(config.server.database_path)
        self.tokens = TokenStore(self.db, host=config.server.host, clock=parts.clock.now, monotonic=parts.monotonic)
        await self.tokens.load()
        self.audit = Audit(self.db, parts.clock)
        self.describer = self._worker(DESCRIBER)
        store = ProgramStore(config.server.programs_dir)
        pieces = {machine.name: Workpiece.of(machine) for machine in config.machine}
        planning = Planning(store)
        files = self._worker("files")
        self.programs = ProgramService(
            store,
            db=self.db,
            hub=self.hub,
            clock=parts.clock,
            files=files,
            checks=self._worker("checks"),
            toolpaths=Toolpaths(store, planning.motion_of, maker=self._worker("drawings"), files=files),
            pieces=pieces,
            tools=lambda name: self.changers[name].known_tools,
            max_upload_bytes=config.server.max_upload_bytes,
            room=Room(folder, config.limits),
        )
        await self.programs.put_aside()
        self.machines = {machine.name: await self._controller(machine) for machine in config.machine}
        self.panels = {name: Panel(one, db=self.db, clock=parts.clock) for name, one in self.machines.items()}
        self.changers = {name: one.tools for name, one in self.machines.items()}
        background = Background()
        starter = Starter(
            db=self.db,
            hub=self.hub,
            clock=parts.clock,
            planning=planning,
            pieces=pieces,
            worker=self._worker("plans"),
            background=background,
            estimates=Estimates(self.db, store, pieces, self._worker("timelines")),
        )
        self.jobs = JobService(
            self.machines,
            db=self.db,
            hub=self.hub,
            clock=parts.clock,
            programs=self.programs,
            starter=starter,
            background=background,
            queue_limit=config.server.queue_limit,
        )
        await self.jobs.adopt()
        for controller in self.machines.values():
            if controller.config.autoconnect:
                await controller.connect()

    def say_farewell(self) -> None:
        """The daemon is going to stop: what ends its connections now is the daemon itself."""
        for controller in self.machines.values():
            controller.tools.say_farewell()

    async def stop(self) -> None:
        """Close the ports, make everything durable. What is in flight is settled at the next start (elvinto §5.4)."""
        for controller in self.machines.values():
            controller.tools.close()
            controller.close()
        for worker in self._workers:
            worker.close()
        await self.jobs.close()
        await self.db.close()

    def _worker(self, name: str) -> Worker:
        worker = self._parts.worker(name)
        self._workers.append(worker)
        return worker

    async def _controller(self, config: MachineConfig) -> Controller:
        return Controller(
            config,
            db=self.db,
            hub=self.hub,
            clock=self._parts.clock,
            opener=self._parts.opener(config),
            engine=engine_factory(config),
            highest_id=await self.db.run(journal.highest_id, config.name),
            kept=await self.db.run(toolstore.load, config.name),
            reader=self._worker("reading"),
        )


def build(config: Config) -> Workshop:
    """The workshop of the real world; `start` it on the loop that it is to live on."""
    return Workshop(config, Parts.real())
