"""The shell around the I/O control block of one machine: its one timer, its events, what the job and the machine want.

Not the handshake (protocol/iocontrol), not the dialogue with a job (jobs/toolchange.py), not what people and the
changer say (toolchanger.py). The one rule: after every verb all events are taken before anything else happens, and
what is a fact of the tools is durable before the job hears of it.
"""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from jobs.effects import Effect, ToolAsk
from jobs.job import Status
from jobs.runner import Runner
from jobs.toolstore import KeptTools, save
from protocol.iocontrol import tooltable
from protocol.iocontrol.config import AbortReason
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.events import (
    AbortAcknowledged,
    AbortSignalled,
    AnswerIgnored,
    ChangeFailed,
    ChangeStarted,
    EStopCleared,
    EStopped,
    Event,
    FaultCleared,
    FaultLatched,
    OperatorMessage,
    PinChanged,
    PrepareFailed,
    RequestIgnored,
    SetToolFailed,
    Snapshot,
    TableChanged,
    ToolChanged,
    ToolPrepared,
    ToolSet,
    Transition,
    WaitingFor,
)
from server.background.dbthread import Db
from server.clock import Clock
from server.config.toolchanger import ToolchangerConfig
from server.live.hub import Hub

LEVELS = {"notice": "warning", "wanted": "info", "error": "error"}
"""Of a message to people, as the log has them."""
FOR_PEOPLE = frozenset({"operator", "tool-changed", "verdict"})
"""What is waited for while a tool is on its way: it is told as a wish for a tool."""


ABORTS: Mapping[str, AbortReason] = {
    **dict.fromkeys(
        ("alarm", "machine_error", "machine_restarted", "machine_reset", "lines_refused", "check_mode"),
        AbortReason.MOTION_OR_IO_ERROR,
    ),
    **dict.fromkeys(
        (
            "in_doubt",
            "link_lost",
            "break_too_long",
            "not_plannable",
            "program_missing",
            "no_tool_word",
            "tool_change_failed",
            "internal",
        ),
        AbortReason.TASK_EXEC_ERROR,
    ),
}
"""What a changer is told of a job that did not end by itself, by the code of its error."""


class Job(Protocol):
    """The job's side (`server.machine.jobstream.JobStream`)."""

    def hear_changer(self, tell: Callable[[Runner], list[Effect]]) -> None: ...
    def tool_free(self, *, motion_allowed: bool) -> None: ...
    def note(self, kind: str, *, job: int | None = None, **data: Any) -> None: ...
    @property
    def active_job(self) -> int | None: ...


class ChangerShell:
    """See the head of this file. `on_estop`: the external chain was opened, stop the machine. `on_tool`: the tool in
    the spindle is this one, None: nobody knows. `emergency`: the machine's own emergency stop is pressed.
    `coolant_codes`: what switches coolant here, of M7, M8 and M9."""

    def __init__(
        self,
        machine: str,
        config: ToolchangerConfig,
        *,
        kept: KeptTools,
        job: Job,
        db: Db,
        hub: Hub,
        clock: Clock,
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self.machine = machine
        self.config = config
        self.on_estop: Callable[[], None] = lambda: None
        self.on_tool: Callable[[int | None], None] = lambda _tool: None
        self.emergency: Callable[[], bool] = lambda: False
        self.coolant_codes: frozenset[int] = frozenset()
        self._job, self._db, self._hub, self._clock, self._loop = job, db, hub, clock, loop
        self._connection: object = None
        self._timer: asyncio.TimerHandle | None = None
        self._draining = False
        self._closed = self._ending = self._farewell = False
        self._pins: dict[str, bool | int] = {}
        self._step = 0
        self._again: tuple[int, int | None] | None = None
        """A change that a daemon before us did not see the end of, or that the machine wants by itself."""
        self._kept = kept
        self._motion_allowed = True
        self._aborted_by_itself = False
        self._by_person = False
        table = None if kept.table is None else tooltable.parse(kept.table, random=config.random)[0]
        if table is None and config.random:
            table = tooltable.ToolTable(random=True)
        self.io = IoControl(config.io(), table, loop.time(), tool=kept.tool, fault=kept.fault)
        self._drain()

    def close(self) -> None:
        """The daemon ends."""
        self._ending = True  # a job that waits for a tool waits again when the daemon is back
        if self.io.may_fail or self._job.active_job is not None:
            self.abort(AbortReason.STATE_OFF, "the daemon is being stopped")
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    # --- the job ----------------------------------------------------------------------------------------------

    def ask(self, effect: ToolAsk) -> None:
        """What the job wants of the changer; its answer may come before this returns."""
        number, line = effect.number, effect.line
        with self._verb() as now:
            match effect.what:
                case "prepare":
                    self.io.prepare(number or 0, now, line=line)
                case "start":
                    self._aborted_by_itself = False
                    self.io.start_change(now, line=line)
                case "change":
                    self.io.change(now, line=line)
                case "set":
                    self.io.set_tool(number or 0, now)
                case "again":
                    self._again = (number or 0, line)
                case "coolant":
                    self._coolant(number or 0, now)

    def _coolant(self, code: int, now: float) -> None:
        if abs(code) == 7:
            self.io.coolant(now, mist=code > 0)
        elif abs(code) == 8:
            self.io.coolant(now, flood=code > 0)
        else:
            self.io.coolant(now, mist=False, flood=False)

    def open(self, number: int) -> bool:
        """The machine asks for a tool by itself: a program on its card, or one that was pending when it came back.
        False: nobody can be asked now."""
        if self.config.kind == "none" or self.io.may_fail or self.io.start_refusal is not None:
            return False
        with self._verb():
            self._again = (number, None)
        return True

    def job_ended(self, status: Status, code: str) -> None:
        """A job has come to an end, or cannot go on by itself. An e-stop has its own way, and what the changer has
        aborted by itself is not aborted twice."""
        self._again = None
        reason = AbortReason.USER if status is Status.CANCELLED else ABORTS.get(code)
        if code == "alarm" and self.emergency():
            reason = AbortReason.AUX_ESTOP
        if reason is not None and not (code == "tool_change_failed" and self._aborted_by_itself):
            self.abort(reason, f"the job is {status}")
        self._aborted_by_itself = False

    def abort(self, reason: AbortReason, message: str) -> None:
        """Whatever is under way is given up."""
        self._again = None
        with self._verb() as now:
            self.io.abort(reason, now, message=message)

    def estop(self) -> None:
        """The emergency stop was demanded of the machine."""
        self._again = None
        with self._verb() as now:
            self.io.estop("user", now)

    def estop_reset(self) -> bool:
        """The alarm is being cleared; whether there was an e-stop."""
        stopped = self.stopped
        if stopped:
            with self._verb() as now:
                self.io.estop_reset(now)
        return stopped

    @property
    def stopped(self) -> bool:
        """It is in an e-stop."""
        return self.io.estop_state.name != "ENABLED"

    # --- inside -----------------------------------------------------------------------------------------------

    @contextmanager
    def _verb(self) -> Iterator[float]:
        """Around every verb of the block: what it leads to is worked off."""
        try:
            yield self._loop.time()
        finally:
            self._drain()

    def _timeout(self) -> None:
        self._timer = None
        self.io.handle_timer(max(self._loop.time(), self.io.next_timer() or 0.0))
        self._drain()

    def _drain(self) -> None:
        if self._draining or self._closed:
            return
        self._draining = True
        try:
            while (event := self.io.next_event()) is not None or self._take_up():
                if event is not None:
                    self._handle(event)
            self._tell_pins()
        finally:
            self._draining = False
        self._free()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if (at := self.io.next_timer()) is not None:
            self._timer = self._loop.call_at(at, self._timeout)

    def _take_up(self) -> bool:
        """Ask again for a tool as soon as the changer can be asked. True: it was."""
        if self._again is None or self._asked() or self.io.start_refusal is not None:
            return False
        (number, line), self._again = self._again, None
        now = self._loop.time()
        self.io.prepare(number, now, line=line)
        if self._asked() or self.io.prepared == number:  # else it was refused at once
            self.io.change(now, line=line)
        return True

    def _asked(self) -> bool:
        return self.io.may_fail

    def _free(self) -> None:
        allowed = self.io.motion_allowed
        if allowed != self._motion_allowed:
            self._motion_allowed = allowed
            self._job.tool_free(motion_allowed=allowed)

    def _handle(self, event: Event) -> None:
        match event:
            case PinChanged():
                self._pin(event)
            case Snapshot(pins=pins):
                self._tell_pins()
                self._hub.publish("io", self.machine, {"pins": dict(pins)})
            case OperatorMessage(text=text, level=level):
                self._hub.publish("log", self.machine, {"level": LEVELS[level], "kind": "tool", "message": text})
                self._job.note("tool_message", level=level, message=text)
            case WaitingFor():
                self._waiting(event)
            case EStopped(kind=kind):
                self._job.note("tool_estop", by=kind)
                if kind == "external":
                    self.on_estop()
            case TableChanged():
                self._keep()
            case _:
                self._record(event)
                self._end(event)

    def _record(self, event: Event) -> None:
        """What is only written down."""
        match event:
            case Transition():
                self._job.note("io", region=event.region, before=event.before, after=event.after, why=event.why)
            case FaultLatched(reason=reason):
                self._keep()
                self._job.note("tool_fault", reason=reason)
            case FaultCleared(by=by):
                self._keep()
                self._job.note("tool_fault_cleared", by=by)
            case AbortSignalled(reason=reason):
                self._job.note("tool_abort", reason=reason)
            case AbortAcknowledged(reason=reason):
                self._job.note("tool_abort_acknowledged", reason=reason)
            case EStopCleared():
                self._job.note("tool_estop_reset")
            case AnswerIgnored(pin=pin, why=why):
                self._job.note("tool_answer_ignored", pin=pin, why=why)
            case RequestIgnored(what=what, why=why):
                self._job.note("tool_request_ignored", what=what, why=why)
            case _:
                pass

    def _end(self, event: Event) -> None:
        """The ends of requests: kept first, then told to the job."""
        match event:
            case ToolPrepared(number=number, pocket=pocket, line=line):
                self._job.note("tool_prepared", tool=number, pocket=pocket, line=line)
            case ChangeStarted():
                self._job.hear_changer(lambda runner: runner.tool_started())
            case ToolChanged(number=number, line=line, skipped=skipped):
                self._keep()
                self._job.note("tool_changed", tool=number, line=line, skipped=skipped)
                self.on_tool(number)
                self._job.hear_changer(lambda runner: runner.tool_changed(by_person=self._by_person))
            case ToolSet(number=number):
                self._keep()
                self._job.note("tool_set", tool=number)
                self.on_tool(number)
            case PrepareFailed(number=number) | ChangeFailed(number=number):
                self._failed(event, number)
            case SetToolFailed(number=number, message=message):
                self._job.note("tool_change_failed", tool=number, cause=event.cause, message=message)
                self._fail_job(message, goes_on=False)
            case _:
                pass

    def _failed(self, event: PrepareFailed | ChangeFailed, number: int | None) -> None:
        self._keep()
        data: dict[str, Any] = {"tool": number, "cause": event.cause, "reason": event.reason, "goes_on": event.goes_on}
        self._job.note("tool_change_failed", line=event.line, message=event.message, **data)
        if event.cause == "superseded":
            return
        if isinstance(event, ChangeFailed) or self.io.tool is None:
            self.on_tool(self.io.tool)  # what the controller had asked for does not come
        self._aborted_by_itself = not event.goes_on
        self._fail_job(event.message, goes_on=event.goes_on)

    def _fail_job(self, message: str, *, goes_on: bool) -> None:
        if not self._ending:
            self._job.hear_changer(lambda runner: runner.tool_failed(message, goes_on=goes_on))

    def _waiting(self, event: WaitingFor) -> None:
        if event.overdue:
            self._job.hear_changer(lambda runner: runner.tool_late())
        if event.what in FOR_PEOPLE or event.overdue:
            data = {"tool": event.tool, "job": self._job.active_job, "waiting_for": event.what}
            self._hub.publish("tool", self.machine, {**data, "overdue": event.overdue})

    # --- pins -------------------------------------------------------------------------------------------------

    def _pin(self, event: PinChanged) -> None:
        """What changes in one step goes out together, in its order."""
        if event.step != self._step:
            self._tell_pins()
            self._step = event.step
        self._pins[event.pin] = event.value

    def _tell_pins(self) -> None:
        if self._pins:
            pins, self._pins = self._pins, {}
            self._job.note("io_pins", pins=[[pin, value] for pin, value in pins.items()])  # a list keeps its order
            self._hub.publish("io", self.machine, {"pins": pins})

    # --- what outlives the daemon -----------------------------------------------------------------------------

    def _keep(self) -> None:
        table = self.io.tool_table
        text = None if table is None else tooltable.render(table)
        fault = int(self.io.parameters[5601]) if self.io.faulted else None
        kept = KeptTools(self.io.tool, text, fault)
        if kept != self._kept:
            self._kept = kept
            self._db.post(save, self.machine, kept)
