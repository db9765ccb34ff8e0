"""One machine: its link, its state, its job. What happens to it; what people ask of it is in controller.py.

Not the wire (protocol), not the job's logic (jobs/runner.py), not HTTP. The one rule: what a machine is doing is in
`state`, what a job is doing in the runner; nothing of either is kept here a second time.
"""

import asyncio
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from gcode.profile import load_profile
from gcode.toolcodes import coolant_codes
from jobs.toolstore import KeptTools
from protocol.commands import EmergencyStop
from protocol.engine import Engine, OpenWork
from protocol.events import (
    Announced,
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    Event,
    FirmwareRead,
    LinkLost,
    LinkReady,
    MachineRestarted,
    MessageSeen,
    MessagesSeen,
    ProbeReported,
    ProgramEnded,
    ProtocolFault,
    StartupBlockRun,
    StateReported,
    ToolRequested,
)
from protocol.iocontrol.config import AbortReason
from protocol.machine import MachineState, reduce, tool_is
from server.background.dbthread import Db
from server.background.worker import Worker
from server.changer.toolchanger import ToolChanger
from server.clock import Clock, stamp
from server.config.grbl import GrblConfig
from server.config.model import MachineConfig
from server.live.hub import Hub
from server.machine.framehand import hand_of
from server.machine.jobstream import JobStream
from server.machine.link import EngineFactory, Link
from server.machine.manual import Manual
from server.machine.reconnect import Reconnect
from server.machine.recorder import Recorder, dump
from server.machine.serialport import Opener, Port
from server.machine.timing import AckTimer
from server.machine.verbs import VERBS, extras_of
from server.machine.views import alarm_view, said, state_view
from server.metrics import MachineMetrics

log = logging.getLogger(__name__)

FIRST_ID = 1000
ID_STEP = 1000
"""A new epoch begins at the next full thousand but one above every ID ever journaled: room for IDs that were used
for probes and commands by hand and are in no journal (elvinto §5.1: IDs never go back)."""
LOG_EVERY_S = 1.0
"""Of each kind of protocol fault; noise on a wire must not push what matters out of the hub. All are counted."""


class Machine:
    """See the head of this file. Made on the loop; `highest_id` is the highest wire ID in the journal."""

    def __init__(
        self,
        config: MachineConfig,
        *,
        db: Db,
        hub: Hub,
        clock: Clock,
        opener: Opener,
        engine: EngineFactory,
        highest_id: int = 0,
        kept: KeptTools = KeptTools(),  # noqa: B008 - frozen
        reader: Worker,
    ) -> None:
        self.config = config
        self.verbs = VERBS[config.protocol]
        self.hand = hand_of(config)
        self.name = config.name
        self.state = MachineState()
        self.metrics = MachineMetrics()
        self.queue_length: Callable[[], int] = lambda: 0
        self.on_ready: Callable[[], None] = lambda: None
        self.control: dict[str, Any] | None = None
        self._hub = hub
        self._clock = clock
        self._loop = loop = asyncio.get_running_loop()
        self._opener = opener
        self._make_engine = engine
        self._highest_id = highest_id
        self._link: Link | None = None
        self._port: Port | None = None
        self._engine: Engine | None = None
        self.own_program: str | None = None
        """What it runs from its SD card; STATE `run` alone may be the old news of a job that has just ended."""
        self.unheard_stop: EmergencyStop | None = None
        """An emergency stop that the machine has not confirmed: if the link breaks it is the first word of the next."""
        self.checking_for: int | None = None
        """The job for which the controller was put into check mode (jobmodes.py)."""
        self._jogged_at = -float("inf")
        self._ready = False
        self._extras: tuple[str, ...] = ()
        self._last_life_at = -float("inf")
        self._state_seq = 0
        self._state_at: str | None = None
        self._logged_at: dict[str, float] = {}
        self._recorder = Recorder(clock.now, self._loop.time)
        self._acks = AckTimer(self.metrics)
        self._reconnect = Reconnect(self._open_epoch, self._refused)
        self.manual = Manual(self.name, self._loop)
        self.stream = JobStream(
            self.name, db=db, hub=hub, clock=clock, loop=loop, metrics=self.metrics, frames=self._frames, reader=reader
        )
        self.tools = ToolChanger(
            self.name, config.toolchanger, kept=kept, job=self.stream, db=db, hub=hub, clock=clock, loop=self._loop
        )
        self._join_tools()

    def _join_tools(self) -> None:
        """What the tool changer, the job and the machine ask and tell each other."""
        self.tools.coolant_codes = coolant_codes(load_profile(self.config.profile))
        self.tools.on_tool = self._tool_is
        self.tools.emergency = lambda: self.state.emergency
        self.tools.on_estop = self.chain_opened
        self.stream.ask_changer = self.tools.ask
        self.stream.on_end = self.tools.job_ended

    # --- views ------------------------------------------------------------------------------------------------

    @property
    def link_status(self) -> str:
        """`disconnected`, `connecting` or `connected`."""
        if self._ready:
            return "connected"
        return "connecting" if self._reconnect.wanted else "disconnected"

    def view(self) -> dict[str, Any]:
        """The machine (api.md)."""
        return {
            "name": self.name,
            "protocol": self.config.protocol,
            "port": self.config.port,
            "link": self.link_status,
            "capabilities": list(self.capabilities),
            "travel": {axis: list(reach) for axis, reach in self.config.motion.travel.known().items()},
            "state": self.state_view(),
            "active_job": self.stream.active_job,
            "queue_length": self.queue_length(),
            "link_stats": {
                "epoch": self._reconnect.epoch,
                "retries": self.metrics.retries,
                "errors": dict(self.metrics.link_errors),
            },
        }

    @property
    def capabilities(self) -> tuple[str, ...]:
        """What its protocol has, and what this controller has said that it has besides."""
        return (*self.verbs.capabilities, *self._extras)

    @property
    def program_position(self) -> Mapping[str, float]:
        """Where it stands in the coordinates of programs, as far as it has said."""
        return self.state.work_position

    def state_view(self) -> dict[str, Any]:
        """The machine's state (api.md)."""
        return {**state_view(self.state, seq=self._state_seq, at=self._state_at), "control": self.control}

    def show_control(self, holder: dict[str, Any] | None) -> None:
        """Who moves it by hand (lease.py)."""
        self.control = holder
        self._publish_state()

    def console(self, limit: int) -> Iterator[dict[str, Any]]:
        """The last messages both ways, oldest first."""
        return self._recorder.each(limit)

    # --- the link ---------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the port and leave it closed; the job, if there is one, is not asked."""
        self._reconnect.unwant()
        self._end_epoch("the port was closed", wanted=False)

    async def _open_epoch(self, epoch: int) -> None:
        self._publish_state()
        port = await self._opener(
            self.config.port,
            self.config.baud,
            partial(self._received, epoch),
            lambda reason: self._port_lost(epoch, reason),
        )
        if self._reconnect.lost_already:  # no engine is begun on a port that nobody will ever report as lost again
            port.close()
            raise OSError("it was lost while it was being opened")
        self._port = port
        log.info("%s: %s is open", self.name, self.config.port)
        self._start_engine(port, self.stream.inherit())

    def _start_engine(self, port: Port, open_work: OpenWork | None) -> None:
        now = self._loop.time()
        first_id = max(FIRST_ID, -(-self._highest_id // ID_STEP) * ID_STEP + ID_STEP)
        engine = self._make_engine(first_id=first_id, now=now, open_work=open_work)
        self._engine = engine
        self._link = Link(engine, port.write, self._handle, self._offer, self._loop)
        self.stream.link_up(engine, self.pump, self._link.flush)
        if self.unheard_stop is not None:
            # Once: a machine that is in alarm already may answer none, and must not be shut out for ever.
            stop, self.unheard_stop = self.unheard_stop, None
            self._link.realtime(stop)
        self.pump()

    def _end_engine(self, reason: str) -> None:
        link, self._link = self._link, None
        if link is None:
            return
        link.close()
        self._ready = False
        self.own_program = None
        self._highest_id = max(self._highest_id, link.engine.next_id)
        self._reduce(LinkLost(reason))
        self._acks.break_off()
        self.stream.link_down(last_life_at=self._last_life_at)
        self.manual.epoch_ended()

    def _end_epoch(self, reason: str, *, wanted: bool = True) -> None:
        self._end_engine(reason)
        port, self._port = self._port, None
        if port is not None:
            port.close()
            self.metrics.link_errors["lost"] += wanted
            log.info("%s: the link is down: %s", self.name, reason)
            self._hub.publish("log", self.name, {"level": "warning" if wanted else "info", "message": reason})
        self._publish_state()
        self._reconnect.lost(self._reconnect.epoch)

    def _port_lost(self, epoch: int, reason: str) -> None:
        if epoch == self._reconnect.epoch:
            self._end_epoch(reason)

    def _refused(self, reason: str) -> None:
        if reason != self._reconnect.refusal:  # once for each: a machine may be off for a night
            log.info("%s: cannot open %s: %s", self.name, self.config.port, reason)
        if self._reconnect.attempts == 0:
            message = f"{self.config.port} cannot be opened: {reason}"
            self._hub.publish("log", self.name, {"level": "warning", "message": message})

    def _received(self, epoch: int, data: bytes) -> None:
        if epoch == self._reconnect.epoch and self._link is not None:
            self._link.receive(data)

    def pump(self) -> None:
        """There may be something new to hand to the engine, or from it."""
        if self._link is not None:
            self._link.pump()

    # --- events -----------------------------------------------------------------------------------------------

    def _offer(self) -> bool:
        """The engine may have become free: the job first, then what is asked by hand."""
        if self._link is None:
            return False
        if self.stream.offer():
            return True
        return self.manual.waiting and self.manual.offer(self._link.engine, self._loop.time())

    def _handle(self, event: Event) -> bool:
        """An event of the engine; whether anything may follow from it (link.py)."""
        if isinstance(event, MessagesSeen):
            self._seen(event.messages)
        elif isinstance(event, MessageSeen):
            self._seen(((self._loop.time(), event.direction, event.text),))
        else:
            self._happened(event)
            return True
        return False

    def _happened(self, event: Event) -> None:
        match event:
            case BatchSent() | BatchReceived() | BatchDone():
                self._acks.handle(event, self._loop.time())
                if isinstance(event, BatchReceived):  # the others say nothing about the machine
                    self._reduce(event)
                self.stream.handle(event)
                return
            case ProtocolFault():
                self._fault(event)
                return
            case LinkReady():
                self._ready = True
                self.metrics.connects += 1
                self._reconnect.proved()
            case CommandDone(token=token) if self.unheard_stop is not None and token == self.unheard_stop.token:
                self.unheard_stop = None
            case MachineRestarted() | ProgramEnded() | StateReported(status="alarm"):
                self.own_program = None
            case BatchFailed():
                self._acks.handle(event, self._loop.time())
            case _:
                pass
        self._reduce(event)
        self.stream.handle(event)
        self.manual.handle(event)
        self._follow(event)

    def _follow(self, event: Event) -> None:
        """What else follows, once state, job and commands by hand have heard of it."""
        match event:
            case LinkLost(reason=reason):
                self._end_epoch(reason)
            case LinkReady():
                self._publish_state()
                self.on_ready()
            case ToolRequested(number=number) if not self.stream.moving:
                if self.verbs.hold is not None or not self.tools.open(number):
                    self._hub.publish("tool", self.name, {"tool": number, "job": None})
            case FirmwareRead() | Announced() | StartupBlockRun() | ProbeReported():
                self._tell(event)
            case _:
                pass

    def _tell(self, event: FirmwareRead | Announced | StartupBlockRun | ProbeReported) -> None:
        """What changes nothing here, but people want to know."""
        if isinstance(event, FirmwareRead):
            dialect = self.config.dialect
            self._extras = extras_of(event)
            if isinstance(dialect, GrblConfig) and (message := dialect.contradicted_by(event.flavour)) is not None:
                self._hub.publish("log", self.name, {"level": "warning", "kind": "firmware", "message": message})
            return
        self._hub.publish("log", self.name, said(event))
        if isinstance(event, ProbeReported):
            self.stream.note("probe", position=dict(event.position), succeeded=event.succeeded)

    def _reduce(self, event: Event) -> None:
        before, self.state = self.state, reduce(self.state, event)
        if self.state is before:
            return
        self._publish_state()
        self.stream.conditions(self.state)
        if self.state.emergency and not before.emergency:
            self._tell_changer_of_emergency()
        if self.state.alarm != before.alarm:
            self._hub.publish("alarm", self.name, {"alarm": alarm_view(self.state.alarm)})

    def _tell_changer_of_emergency(self) -> None:
        """The end of a job says it to the changer; without a job nothing else does. What was demanded here is known."""
        if not self.stream.moving and not self.tools.stopped and self.unheard_stop is None:
            self.tools.abort(AbortReason.AUX_ESTOP, "the emergency stop was pressed at the machine")

    def chain_opened(self) -> None:
        """The tool changer's e-stop chain is open: what is done about it is in controller.py."""

    def _tool_is(self, number: int | None) -> None:
        """What the tool changer says of the spindle."""
        self.state = tool_is(self.state, number)
        self._publish_state()

    def _publish_state(self) -> None:
        self._state_seq += 1
        self._state_at = stamp(self._clock)
        self._hub.publish(
            "state", self.name, lambda: {**self.state_view(), "link": self.link_status, **self._acks.view()}
        )

    def _seen(self, messages: Sequence[tuple[float, str, str]]) -> None:
        recorder = self._recorder
        if self._hub.unwanted(self.name, len(messages)):
            recorder.record(messages)
        else:
            for message in messages:
                recorder.record((message,))
                self._hub.publish("console", self.name, recorder.newest)
        heard_at = next((at for at, direction, _ in reversed(messages) if direction == "<"), None)
        if heard_at is not None:
            self._last_life_at = heard_at
            self.stream.heard(heard_at)

    def _fault(self, fault: ProtocolFault) -> None:
        self.metrics.link_errors[fault.kind] += 1
        now = self._loop.time()
        if now - self._logged_at.get(fault.kind, -LOG_EVERY_S) >= LOG_EVERY_S:
            self._logged_at[fault.kind] = now
            data = {"level": "warning", "kind": fault.kind, "message": fault.detail}
            self._hub.publish("log", self.name, data)

    def _frames(self) -> dict[str, Any]:
        return dump(() if self._engine is None else self._engine.recent_frames(), now=self._loop.time())
