"""The host's side of the ElVinto standard for one connection epoch: stop-and-wait, exactly once. No I/O, no clock.

`phases.py` is the table of what is exchanged; the layers below (`settling`, `flights`, `exchange`) move between the
phases; here stand the five verbs, what each message means in each phase, and the emergency stop.
The one rule: a block that moves the machine goes out only while the machine's ID memory is *proven* to be the ID
before it (`ids.py`). Then no copy, delay or flipped digit of a header can make it run twice.
"""

from collections.abc import Callable, Mapping
from typing import ClassVar

from protocol.commands import (
    AskToolChange,
    ClearAlarm,
    Command,
    EmergencyStop,
    GrblCommand,
    ListFiles,
    Locate,
    RealtimeCommand,
    RunBlock,
    RunFile,
    SendBatch,
    SetPosition,
)
from protocol.elvinto.codec import Message, encode_gcode, encode_message
from protocol.elvinto.dialect import Dialect
from protocol.elvinto.ids import LAST_PROBE_ID
from protocol.elvinto.phases import EMERGENCY, EMERGENCY_TRIES, HANDSHAKE, STEPS, Phase, Turn
from protocol.elvinto.reports import ALARM_EMERGENCY, ALARMS, FileListing, integer, read_state
from protocol.elvinto.settle import Case
from protocol.elvinto.settling import Settling
from protocol.engine import Frame, OpenWork
from protocol.errors import LocalError
from protocol.events import (
    Alarm,
    CommandDone,
    CommandFailed,
    Event,
    MessageSeen,
    ProtocolFault,
    StateReported,
    ToolRequested,
)


class ElvintoEngine(Settling):
    """See protocol.engine.Engine. `baud` 0: bytes take no time. `now`: the shell's clock at the connection."""

    def __init__(
        self, dialect: Dialect, *, first_id: int, baud: int, now: float, open_work: OpenWork | None = None
    ) -> None:
        super().__init__(dialect, first_id, baud)
        self._timers: Mapping[Phase, Callable[[float], None]] = {
            **dict.fromkeys(STEPS, self._try_again),
            Phase.IDLE: self._poll,
            Phase.SENT: self._on_flight_unheard,
            Phase.RUNNING: self._on_flight_quiet,
            Phase.PROBE: self._on_probe_unanswered,
            Phase.ASK: self._on_ask_unanswered,
            Phase.TOOLCHECK: self._on_toolcheck_unanswered,
            Phase.FILE: self._on_file_quiet,
        }
        if open_work is None:
            self._enter(Phase.INIT, now)
        else:
            self._initialised = True  # by the epoch before; the restart probe tells if that still holds
            self._standing = open_work.start
            self._open_case(Case(open_work.batches, open_work.start, open_work.move_until), now)

    # --- the five verbs -----------------------------------------------------------------------------------------

    def receive_data(self, data: bytes, now: float) -> None:
        """Any bytes, in any pieces; never raises."""
        for item in self._wire.receive_data(data, now):
            if self._phase is Phase.CLOSED:
                return
            if isinstance(item, ProtocolFault):
                self._garbled(item, now)
                continue
            self._heard_at = now
            self._emit(MessageSeen("<", item.text))
            handler = self._HANDLERS.get(item.name)
            if handler is not None:
                handler(self, item, now)

    def _garbled(self, fault: ProtocolFault, now: float) -> None:
        """Noise proves nothing, but it may make one careful: what looks like READY may be a restart's only word."""
        self._noise_at = now
        self._emit(fault)
        if self._listing is not None:
            self._listing.damaged = True
        if fault.kind in ("checksum", "no_header") and "READY" in fault.detail and self._greetings == 0:
            self._suspect_restart(now)

    def data_to_send(self, now: float) -> bytes:
        """What is to go out now, whole frames, the realtime lane first."""
        return self._wire.data_to_send(now)

    def next_event(self) -> Event | None:
        """What happened, oldest first."""
        return self._events.popleft() if self._events else None

    def next_timer(self) -> float | None:
        """The earliest deadline."""
        return self._deadline

    def handle_timer(self, now: float) -> None:
        """The deadline has come; calling early does nothing."""
        if self._deadline is None or now < self._deadline:
            return
        self._deadline = None
        if self._emergency is not None:
            self._press_emergency(now)
        elif self._turn is not None and self._turn.located:
            self._locate(self._turn, now)
        else:
            self._timers[self._phase](now)

    # --- the domain's verbs -------------------------------------------------------------------------------------

    @property
    def next_id(self) -> int:
        """The ID that the next SendBatch must carry."""
        return self._ids.next

    def free(self) -> int:
        """1 while a command can be taken, else 0. In alarm only ClearAlarm makes sense."""
        idle = self._phase is Phase.IDLE and self._emergency is None
        return int(idle and (self._alarmed or self._ids.proven))

    def recent_frames(self) -> tuple[Frame, ...]:
        """What the recorder holds, oldest first."""
        return self._wire.recent_frames()

    def submit(self, command: Command, now: float) -> None:
        """Take a command. Raises LocalError when not free or a batch's ID is not `next_id`, and MessageTooLongError."""
        if not self.free():
            raise LocalError(f"the engine takes no command now: it {self._phase.value}")
        match command:
            case SendBatch():
                self._submit_batch(command, now)
            case RunBlock(token, blocks, expected_s):
                message = encode_gcode(blocks)
                self._submit_message(message, now, token=token, kind="gcode", blocks=blocks, expected_s=expected_s)
            case ClearAlarm(token):
                self._submit_message(encode_message("RESETALERT"), now, token=token, kind="alarm")
            case RunFile(token, name):
                message = encode_message("RUN", {"NAME": name}, encoding=self._dialect.encoding)
                self._submit_message(message, now, token=token, kind="file")
            case Locate(token):
                self._query_token = token
                self._enter(Phase.SYNC, now)
            case ListFiles(token):
                self._query_token = token
                self._listing = FileListing(token)
                self._enter(Phase.LIST, now)
            case AskToolChange(token):
                self._query_token = token
                self._enter(Phase.TOOLCHECK, now)
            case _:
                assert isinstance(command, GrblCommand | SetPosition), "a command of the realtime lane"
                self._emit(CommandFailed(command.token, None, "an ElVinto machine does not know this command"))

    def realtime(self, command: RealtimeCommand, now: float) -> None:
        """The emergency stop (W98): goes out before everything else; what was under way is failed at once."""
        if not isinstance(command, EmergencyStop):
            self._emit(CommandFailed(command.token, None, "an ElVinto machine knows no real-time command but the stop"))
            return
        if self._phase is Phase.CLOSED:
            self._emit(CommandFailed(command.token, None, "the link is down: use the machine's own emergency button"))
            return
        self._wire.drop_unsent()
        if self._phase in HANDSHAKE:
            self._initialised = False
        self._break_off("estop", ALARM_EMERGENCY, "the emergency stop was pressed")
        self._enter_idle()
        self._ids.doubt()
        self._emergency_tokens.append(command.token)
        self._emergency = self._emergency or Turn(STEPS[Phase.ASK], now)
        self._press_emergency(now)

    def _press_emergency(self, now: float) -> None:
        """Under a new ID each time: the machine may remember a higher one than it should, and twice does no harm."""
        assert self._emergency is not None
        tries = self._emergency.ids
        if len(tries) >= EMERGENCY_TRIES:
            self._close("the machine does not answer the emergency stop")
            return
        id = self._ids.take(len(tries))
        tries.append(id)
        self._deadline = now + self._send(EMERGENCY, id, urgent=True) + self._dialect.retry_interval_s

    def _emergency_heard(self, now: float, *, reported: bool) -> None:
        self._emergency = None
        self._alarmed = True
        if not reported:
            alarm = Alarm(ALARM_EMERGENCY, None, ALARMS[ALARM_EMERGENCY], emergency=True)
            self._emit(StateReported(status="alarm", position={}, alarm=alarm))
        for token in self._emergency_tokens:
            self._emit(CommandDone(token))
        self._emergency_tokens.clear()
        self._go_idle(now)

    # --- what the machine says ----------------------------------------------------------------------------------

    def _on_received(self, message: Message, now: float) -> None:
        id = integer(message.params.get("ID"))
        if id is None:
            self._emit(ProtocolFault("malformed", f"an acknowledgement without an ID: {message.text}"))
        elif self._emergency is not None and id in self._emergency.ids:
            self._emergency_heard(now, reported=False)
        elif self._flight is not None and id == self._flight.id and self._phase is Phase.SENT:
            self._flight_received(now)
        elif self._flight is not None and id == self._flight.id and self._case is not None:
            self._case.accepted = True
        elif self._turn is not None and id in self._turn.ids:
            self._turn.received = self._turn.received or id == self._turn.ids[-1]
        else:
            self._stray_acknowledgement(id, now)

    def _on_ok(self, message: Message, now: float) -> None:
        id = integer(message.params.get("ID"))
        if self._flight is not None and id == self._flight.id and self._phase in (Phase.SENT, Phase.RUNNING):
            if self._flight.kind == "file":
                self._file_accepted(self._flight, now)
            else:
                self._flight_done(now)
        elif id is not None and self._case is not None and self._case.holds(id):
            self._case.finished(id)
            if not self._case.remaining:
                self._settled(now)
        elif self._turn is not None and self._turn.step.awaits == "ack" and id in self._turn.ids:
            self._enter_next(now)
        elif self._turn is not None and id == self._turn.ids[-1]:
            self._turn.received = self._turn.ended = True
            self._answered(now)
        else:
            self._on_received(message, now)

    def _on_error(self, message: Message, now: float) -> None:
        id = integer(message.params.get("ID"))
        code = integer(message.params.get("NUM"))
        text = f"the machine answered ERROR {'without a number' if code is None else code}"
        if id is not None and self._case is not None and self._case.holds(id):
            self._in_doubt(text, now)
        elif id is not None and self._flight is not None and id == self._flight.id:
            repeated = self._flight.attempts > 1
            self._flight_failed("error", code, text)
            if repeated:
                self._ids.doubt()
            else:
                self._ids.prove(id)
            self._go_idle(now)
        elif self._phase is Phase.FILE and self._file is not None and id == self._file.id:
            self._file_refused(code, text, now)
        elif self._phase is Phase.REPORT and self._turn is not None and id in self._turn.ids:
            self._enter_next(now)  # a machine without W90 reports less, and works
        else:
            self._on_received(message, now)

    def _stray_acknowledgement(self, id: int, now: float) -> None:
        """Of an ID that is not in flight: counted and ignored (elvinto §5.2), but for what it says of the memory."""
        if id <= LAST_PROBE_ID or id == self._ids.memory:
            return
        self._emit(ProtocolFault("unknown_id", f"an acknowledgement of ID {id}, which is not in flight"))
        if not self._ids.given(id):
            self._never_given(id, now)

    def _on_state(self, message: Message, now: float) -> None:
        report = read_state(message)
        if report is None:
            self._emit(ProtocolFault("malformed", f"a STATE of unknown type: {message.text}"))
            return
        self._emit(report)
        match report.status:
            case "alarm":
                self._on_alarm(report, now)
            case "run":
                self._report_file_begun()
                if self._flight is not None:
                    self._flight_runs(now)
                if self._case is not None:
                    self._machine_runs(now)
            case _:
                self._on_idle_report(report, now)

    def _on_idle_report(self, report: StateReported, now: float) -> None:
        if self._phase in (Phase.SENT, Phase.RUNNING):
            self._flight_idle(report, now)
            return
        self._standing = report.position
        if self._phase is Phase.PROBE and self._case is not None:
            self._case.probe.heard_state()
        elif self._phase is Phase.FILE:
            self._file_idle(now)
        elif self._turn is not None:
            self._turn.state = report
            self._answered(now)

    def _answered(self, now: float) -> None:
        """The question for the position has ended and is answered (a lost OK of it is waited for until the timer)."""
        if self._turn is not None and self._turn.located and self._turn.ended:
            self._locate(self._turn, now)

    def _locate(self, turn: Turn, now: float) -> None:
        assert turn.state is not None
        self._ids.prove(turn.ids[-1])
        self._greetings = 0  # the machine answers in order: every READY asked for has come or is lost
        if self._case is not None:
            self._located(turn.state, now)
            return
        self._initialised = True
        self._report_unproven(turn.state.position)
        if self._query_token is not None:
            token, self._query_token = self._query_token, None
            self._emit(CommandDone(token))
        self._go_idle(now)

    def _on_alarm(self, report: StateReported, now: float) -> None:
        """An alarm ends what is under way; nothing is sent until it is cleared (elvinto §5.8).

        In the handshake too: a machine in alarm may answer nothing else. Clearing it begins the handshake anew.
        """
        assert report.alarm is not None
        if self._emergency is not None:
            self._emergency_heard(now, reported=True)
            return
        self._alarmed = True
        if self._flight is not None and self._flight.kind == "alarm":
            return  # it may have been under way before the alarm was cleared
        self._break_off("alarm", report.alarm.code, f"alarm: {report.alarm.message}")
        self._ids.doubt()
        self._go_idle(now)

    def _on_ready(self, _message: Message, now: float) -> None:
        """The answer to READY, or, unasked for, a machine that has restarted (elvinto §4)."""
        solicited = self._greetings > 0
        self._greetings = max(0, self._greetings - 1)
        if self._emergency is not None:
            self._initialised = self._initialised and solicited
        elif self._phase is Phase.GREET:
            self._enter_next(now)
        elif self._phase is Phase.CHECK:
            self._report_doubt("the machine executes nothing: it is in alarm")
            self._lock(now)
        elif not solicited and self._phase is not Phase.INIT:
            self._restarted("READY came unasked", now)

    def _on_tool(self, message: Message, now: float) -> None:
        number = integer(message.params.get("NUM"))
        if number is None:
            self._emit(ProtocolFault("malformed", f"a TOOL without a number: {message.text}"))
            return
        self._emit(ToolRequested(number))
        if self._phase is Phase.TOOLCHECK:
            self._finish_toolcheck(now)

    def _finish_toolcheck(self, now: float) -> None:
        assert self._query_token is not None
        token, self._query_token = self._query_token, None
        self._emit(CommandDone(token))
        self._ids.doubt()
        self._go_idle(now)

    def _on_toolcheck_unanswered(self, now: float) -> None:
        """Nothing is said when no change is pending; so silence after a repetition is an answer."""
        assert self._turn is not None
        if len(self._turn.ids) < (self._turn.step.tries or 1):
            self._try(now)
        else:
            self._finish_toolcheck(now)

    def _on_files(self, message: Message, now: float) -> None:
        if self._phase is not Phase.LIST or self._listing is None:
            return
        listed = self._listing.take(message)
        if listed is not None:
            self._listing = self._query_token = None
            self._emit(listed)
            self._emit(CommandDone(listed.token))
            self._ids.doubt()
            self._go_idle(now)

    def _on_program_end(self, _message: Message, now: float) -> None:
        if self._phase is Phase.FILE:
            self._file_ended(now)

    _HANDLERS: ClassVar[Mapping[str, Callable[["ElvintoEngine", Message, float], None]]] = {
        "RECEIVED": _on_received,
        "RECEIVE": _on_received,  # so once in the standard's prose (§6)
        "OK": _on_ok,
        "ERROR": _on_error,
        "STATE": _on_state,
        "READY": _on_ready,
        "TOOL": _on_tool,
        "PROGRAM_END": _on_program_end,
        **dict.fromkeys(("SDD_NO", "SDD_OK", "DIR_BEGIN", "FILE", "DIR_END", "END_BEGIN"), _on_files),
    }
