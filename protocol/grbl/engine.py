"""The host's side of Grbl 1.1 and grblHAL for one connection epoch: character counting, real-time lane, status polls.

No I/O, no clock. `phases.py` is the table; the layers below (`watching`, `resets`, `traffic`) move between the phases;
here stand the five verbs, what each line of the controller is handed to, and what people may ask.
The one rule: done is not acknowledged (`errands.py`), and nothing real-time waits behind a line (`lane.py`).
"""

from collections.abc import Callable
from operator import itemgetter
from typing import Any, Final, assert_never

from protocol.commands import (
    AskToolChange,
    CheckMode,
    Command,
    CoolantToggle,
    CycleStart,
    EmergencyStop,
    FeedHold,
    JogCancel,
    ListFiles,
    Locate,
    Override,
    RealtimeCommand,
    RunBlock,
    RunFile,
    SafetyDoor,
    SendBatch,
    SetPosition,
    SoftReset,
    SpindleStopToggle,
    Stop,
    ToggleOption,
    ToolAck,
)
from protocol.engine import Frame, OpenWork
from protocol.errors import LocalError, MessageTooLongError
from protocol.events import (
    Announced,
    BatchFailed,
    CommandDone,
    CommandFailed,
    Event,
    MessagesSeen,
    ProbeReported,
    ProtocolFault,
    StartupBlockRun,
)
from protocol.grbl import asking, realtime
from protocol.grbl.asking import named
from protocol.grbl.codec import OK, OK_LINE, Decoder
from protocol.grbl.dialect import Dialect
from protocol.grbl.errands import Errand
from protocol.grbl.messages import (
    AlarmRaised,
    AxisNames,
    Banner,
    Fact,
    Message,
    Options,
    ProbeResult,
    Refusal,
    Said,
    SettingValue,
    StartupAnswer,
)
from protocol.grbl.phases import CLOSED, READING, READY, STEPS, Phase
from protocol.grbl.reports import StatusReport, number
from protocol.grbl.settings import STEPS_PER_MM
from protocol.grbl.traffic import CHECK_MODE, MAX_BATCHES, MAX_BY_HAND
from protocol.grbl.watching import Watching
from protocol.grbl.window import Window

TELL_WITHIN_S: Final = 0.1
"""So long lines and answers from which nothing follows wait to be told, and what they prove of lines before them: each
alone would cost as much again."""


class GrblEngine(Watching):
    """See protocol.engine.Engine. `now`: the shell's clock at the connection."""

    def __init__(self, dialect: Dialect, *, first_id: int, now: float, open_work: OpenWork | None = None) -> None:
        super().__init__(dialect, first_id, now, open_work)
        self._decoder = Decoder()
        self._silences: dict[Phase, Callable[[float], None]] = {
            Phase.OPENING: self._ask,
            Phase.ASKING: self._on_nobody,
            Phase.READING: self._on_reading_silence,
            Phase.STOPPING: lambda now: self._stopped(now, parked=False),
            Phase.RESETTING: self._on_no_banner,
            Phase.RESTARTING: self._on_no_restart,
        }
        self._handlers: dict[type, Callable[[Any, float], None]] = {
            Refusal: self._on_refusal,
            AlarmRaised: self._on_alarm,
            Banner: self._on_banner,
            StatusReport: self._on_report,
            Options: self._on_options,
            AxisNames: self._on_axes,
            Fact: self._on_fact,
            SettingValue: self._on_setting,
            Said: lambda said, _: self._emit(Announced(said.text)),
            ProbeResult: self._on_probe,
            StartupAnswer: lambda said, _: self._emit(StartupBlockRun(said.block, said.code)),
        }

    # --- the five verbs -----------------------------------------------------------------------------------------

    def receive_data(self, data: bytes, now: float) -> None:
        """Any bytes, in any pieces; never raises."""
        self._quiet = False
        if data == OK_LINE and self._decoder.between_lines and self._plain_ok(now):  # nearly all that is ever said
            self.news = now - self._seen[0][0] >= TELL_WITHIN_S
            if self.news:
                self._settle(self._executed.behind(self._planner_blocks))
            return
        self.news = True
        self._settle(self._executed.behind(self._planner_blocks))  # by what was known up to here
        for heard in self._decoder.receive_data(data):
            if self._phase is Phase.CLOSED:
                return
            if heard is OK:
                if not self._plain_ok(now):
                    self._on_ok(now)
                continue
            message = heard.message
            if isinstance(message, ProtocolFault):
                self._recorded.append((now, "<", heard.text))
                self._emit(message)
                continue
            self._poll.heard(now)
            self._seen.append((now, "<", heard.text))
            self._handle(message, now)

    def _on_ok(self, now: float) -> None:
        if self._phase is CLOSED:
            return
        self._poll.quiet_since = now
        self._seen.append((now, "<", "ok"))
        self._answered(None, "", now, refused=False)
        if self._phase is READING:
            self._read_on(now)

    def _handle(self, message: Message, now: float) -> None:
        head = self._active.head
        if head is not None and head[0].request is not None and STEPS[self._phase].counts:
            head[0].request.hear(message)
        handler = self._handlers.get(type(message))
        if handler is not None:
            handler(message, now)

    def next_event(self) -> Event | None:
        """What happened, oldest first; what was said before what follows from it."""
        if self._seen:
            seen, self._seen = self._seen, []
            self._recorded.extend(seen)
            return MessagesSeen(seen)
        return self._events.popleft() if self._events else None

    def next_timer(self) -> float | None:
        """The earliest deadline."""
        if self._phase is READY and not self._due:
            return self._poll.next_at
        due = list(self._due.values())
        if STEPS[self._phase].polls:
            due.append(self._poll.next_at)
        return min(due, default=None)

    def handle_timer(self, now: float) -> None:
        """A deadline has come; calling early does nothing."""
        self._quiet, self.news = False, bool(self._events)
        if STEPS[self._phase].polls and now >= self._poll.next_at:
            self._watch_silence(now)
            self._lane.put(realtime.STATUS)
        if now >= self._due.get("phase", now + 1):
            self.news = True
            del self._due["phase"]
            self._silences[self._phase](now)

    # --- the domain's verbs -------------------------------------------------------------------------------------

    @property
    def next_id(self) -> int:
        """The ID that the next SendBatch must carry."""
        return self._next_id

    def free(self) -> int:
        """How many commands it can take. In alarm only what clears it makes sense; a batch fails then."""
        if self._phase is not READY or self._cancels or len(self._hand) >= MAX_BY_HAND:
            return 0
        return MAX_BATCHES - len(self._batches)

    def recent_frames(self) -> tuple[Frame, ...]:
        """What the recorder holds, oldest first."""
        recorded = sorted([*self._recorded, *self._seen], key=itemgetter(0))
        return tuple(Frame(at, direction, text.encode("ascii", "replace")) for at, direction, text in recorded)

    def submit(self, command: Command, now: float) -> None:
        """Take a command. Raises LocalError when not free, for a wrong ID or an impossible line of a batch, and
        MessageTooLongError. What people typed wrong is a CommandFailed."""
        self._quiet = False
        if not self.free():
            raise LocalError(f"the engine takes no command now: it {self._phase.value}")
        match command:
            case SendBatch():
                self._submit_batch(command)
            case RunBlock(token=token, blocks=blocks):
                self._submit_blocks(token, blocks)
            case Locate(token=token):
                self._locates.append((token, self._poll.asked))
                self._poll.next_at = min(self._poll.next_at, now)
            case AskToolChange(token=token) | SetPosition(token=token):
                self._emit(CommandFailed(token, None, "a Grbl has no such question"))
            case ListFiles(token=token) | RunFile(token=token) if self._flavour != "grblhal":
                self._emit(CommandFailed(token, None, "a Grbl 1.1 has no SD card"))
            case _:
                assert isinstance(command, asking.Asked), "a command of the realtime lane"
                self._submit_asked(command)

    def _submit_batch(self, batch: SendBatch) -> None:
        if batch.id != self._next_id:
            raise LocalError(f"batch {batch.id} is out of turn: the next ID is {self._next_id}")
        if not batch.blocks:
            raise LocalError("a batch without a line is never done")
        errand = Errand(self._lines(batch.blocks), batch=batch, reach_mm=batch.reach_mm)
        self._next_id += 1
        # Whoever submits may not have read the news yet: it is no fault of theirs, and nothing is sent.
        if self._status == "alarm":
            alarm = self._alarm
            code, message = (None, "the machine is in alarm") if alarm is None else (alarm.code, alarm.message)
            self._emit(BatchFailed(batch.id, "alarm", code, message, 0, 0))
        elif batch.check != (self._status == "check"):
            self._emit(BatchFailed(batch.id, "link", None, CHECK_MODE[batch.check], 0, 0))
        else:
            if not self._batches:
                self._executed.displaced()
            self._batches.append(errand)

    def _submit_blocks(self, token: int, blocks: tuple[str, ...]) -> None:
        problem = self._problem(in_alarm=False, needs_idle=True)
        try:
            lines = self._lines(blocks)
        except MessageTooLongError:
            raise
        except LocalError as error:
            problem = str(error)
        if problem is not None or not blocks:
            self._emit(CommandFailed(token, None, problem or "there is nothing to execute"))
        else:
            self._hand.append(Errand(lines, token=token))

    def _submit_asked(self, command: asking.Asked) -> None:
        if isinstance(command, CheckMode) and command.on == (self._status == "check"):
            self._emit(CommandDone(command.token))
            return
        try:
            asked = asking.request(command)
            if isinstance(command, CheckMode) and self._switching:
                raise LocalError("the check mode is being switched already")
            problem = self._problem(in_alarm=asked.in_alarm, needs_idle=asked.needs_idle or asked.jog)
            if problem is None:
                self._submit_request(asked)
        except MessageTooLongError:
            raise
        except LocalError as error:
            problem = str(error)
        if problem is not None:
            self._emit(CommandFailed(command.token, None, problem))

    @property
    def _switching(self) -> bool:
        """`$C` is on its way: another one would undo it."""
        asked = (errand.request for errand in self._hand)
        return any(request is not None and isinstance(request.command, CheckMode) for request in asked)

    def _problem(self, *, in_alarm: bool, needs_idle: bool) -> str | None:
        """Why a command by hand cannot be taken now. A reader never makes a job wait."""
        if self._pendant:
            return "a pendant owns the machine (MPG)"
        if self._card.running:
            return "the controller runs a program from its SD card"
        if self._status == "alarm" and not in_alarm:
            return "the machine is in alarm"
        if self._status == "sleep":
            return "the controller sleeps; only a reset wakes it up"
        if needs_idle and self._batches and self._by_hand is None:
            return "a job is under way"
        return None

    def realtime(self, command: RealtimeCommand, now: float) -> None:
        """Take a command of the real-time lane: its byte goes out with the next write, before every line."""
        self._quiet = False
        token = command.token
        if self._phase is Phase.CLOSED:
            self._emit(CommandFailed(token, None, "the link is down: use the machine's own emergency button"))
            return
        match command:
            case EmergencyStop():
                self._reset_tokens.append(token)
                self._reset("estop", None, "the emergency stop was pressed", now)
            case SoftReset():
                self._reset_tokens.append(token)
                self._reset("stop", None, "reset by hand", now)
            case Stop():
                self._reset_tokens.append(token)
                self._stop("stop", None, "stopped by hand", now)
            case FeedHold():
                self._hold(token)
            case CycleStart():
                self._go_on(token)
            case JogCancel():
                self._cancel_jogs(token)
            case ToolAck():
                self._acknowledge_tool(token)
            case SafetyDoor() | Override() | CoolantToggle() | SpindleStopToggle() | ToggleOption():
                self._press(command)
            case _:
                assert_never(command)

    def _press(self, command: SafetyDoor | Override | CoolantToggle | SpindleStopToggle | ToggleOption) -> None:
        """A byte that changes nothing of the stream."""
        match command:
            case SafetyDoor():
                byte: bytes | None = realtime.SAFETY_DOOR
            case Override(what=what, step=step):
                byte = realtime.OVERRIDES.get((what, step))
            case CoolantToggle(what=coolant):
                byte = realtime.COOLANTS[coolant]
            case SpindleStopToggle():
                byte = realtime.SPINDLE_STOP
            case ToggleOption(what=option):
                byte = realtime.OPTIONS[option] if self._flavour == "grblhal" else None
        if byte is None:
            self._emit(CommandFailed(command.token, None, "this controller has no such key"))
        else:
            self._lane.put(byte, command.token)

    def _cancel_jogs(self, token: int) -> None:
        for errand in tuple(self._hand):
            if errand.request is not None and errand.request.jog and errand.waiting:
                self._drop(errand, "the jog was cancelled")
        self._lane.put(realtime.JOG_CANCEL)
        self._cancels.append(token)
        self._cancelled_at = self._poll.asked

    def _acknowledge_tool(self, token: int) -> None:
        """grblHAL, M6: from now on lines go into a second input buffer until `~`; the first one waits as it is."""
        self._lane.put(realtime.TOOL_ACK, token)
        if self._status == "tool" and self._by_hand is None:
            self._by_hand = Window(self._window.capacity, one_by_one=True)

    # --- what the controller says -------------------------------------------------------------------------------

    def _on_refusal(self, refusal: Refusal, now: float) -> None:
        if self._card.running and self._window.empty:
            self._emit(Announced(f"SD card: error {refusal.text or refusal.code}"))  # the next report shows the end
            return
        self._answered(refusal.code, refusal.text, now, refused=True)
        if self._phase is Phase.READING:
            self._read_on(now)

    def _on_options(self, options: Options, _: float) -> None:
        self._learn_rx(options.rx_bytes)
        self._planner_blocks = options.planner_blocks

    def _on_axes(self, axes: AxisNames, _: float) -> None:
        self._axes = axes.names

    def _on_fact(self, fact: Fact, _: float) -> None:
        if fact.key == "FIRMWARE" and fact.value.lower() == "grblhal":
            self._flavour = "grblhal"

    def _on_setting(self, setting: SettingValue, _: float) -> None:
        if self._phase is Phase.READING:
            self._settings_read = True
        if 0 <= setting.number - STEPS_PER_MM < 3:
            try:
                self._blocks.learn_steps(setting.number - STEPS_PER_MM, number(setting.value))
            except ValueError:
                return  # not a number: nothing can be counted on this axis

    def _on_probe(self, probe: ProbeResult, _: float) -> None:
        """`[PRB:]` is a row of `$#` too: there it is no news."""
        head = self._active.head
        if head is None or head[0].request is None:
            self._emit(ProbeReported(named(probe.position, self._axes), probe.succeeded))
