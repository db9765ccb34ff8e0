"""The virtual ElVinto controller: IDs, acknowledgements, alarms, the SD card, power (standard §2, §4 to §7).

An object without I/O and without a clock: bytes and `now` in; bytes, events and the next deadline out. It is the
second, independent reading of the standard. The one rule: strict; what the standard does not promise to accept is
dropped without a word and counted in `dropped`.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable
from typing import Literal

from sim.elvinto.admission import Situation, judge_command, judge_question
from sim.elvinto.codec import Message
from sim.elvinto.commands import Command
from sim.elvinto.events import (
    MAX_EVENTS,
    AlarmCleared,
    AlarmRaised,
    BlockFinished,
    BlockStarted,
    Booted,
    CommandAccepted,
    CommandEnded,
    CommandRepeated,
    Executed,
    MessageDropped,
    PowerLost,
    SimEvent,
    ToolWanted,
)
from sim.elvinto.executor import Asked, Executor, ProgramEnded
from sim.elvinto.gate import Gate, Passed
from sim.elvinto.gcode import ERR_PARAMETER, ERR_UNKNOWN_COMMAND, BlockError, split_batch
from sim.elvinto.mill import ALARM_EMERGENCY, ALARM_END_SWITCH, ALARM_START_SWITCH, ALARM_START_SWITCH_FAULTY, Mill
from sim.elvinto.reports import Reports
from sim.elvinto.settings import SimSettings
from sim.elvinto.voice import Voice
from sim.motion import AXES, Point

Status = Literal["off", "boot", "idle", "run", "cnscalarm", "axisalarm"]


class VirtualElvinto:
    """`on_block` is called with every block as its execution begins, before anything about it is on the wire's way out.

    The machine is built running and idle: it was switched on before anybody connected. READY comes unasked after
    `restart` and `power_on` only.
    """

    def __init__(
        self, settings: SimSettings, *, now: float = 0.0, on_block: Callable[[Executed], None] | None = None
    ) -> None:
        self.settings = settings
        self.mill = Mill(settings)
        self.executed: list[Executed] = []
        """Every block that was begun, in order (see `SimSettings.executed_limit`)."""
        self.executed_count = 0
        self.dropped: Counter[str] = Counter()
        self.last_id = 0
        self.alarm: tuple[int, int | None] | None = None
        """(ALARMNUM, AXISNUM), the axis only for an alarm of one axis."""
        self._on_block = on_block
        self._now = now
        self._power: Literal["off", "boot", "on"] = "on"
        self._boot_at: float | None = None
        self._voice = Voice(settings)
        self._executor = Executor(settings, self.mill)
        self._gate = Gate(settings)
        self._reports = Reports(settings)
        self._last_error: int | None = None
        self._tool_wanted: int | None = None
        self._events: deque[SimEvent] = deque(maxlen=MAX_EVENTS)

    # The five verbs.

    def receive_data(self, data: bytes, now: float) -> None:
        """Bytes from the host. Never raises, whatever they are; without power or while booting nothing is heard."""
        self.handle_timer(now)
        if self._power != "on":
            return
        for verdict in self._gate.feed(data):
            if isinstance(verdict, Passed):
                self._obey(verdict.message, verdict.id, verdict.raw)
            else:
                self._drop(verdict.reason, verdict.raw)

    def data_to_send(self, now: float) -> bytes:
        self.handle_timer(now)
        return self._voice.take()

    def next_event(self) -> SimEvent | None:
        return self._events.popleft() if self._events else None

    def next_timer(self) -> float | None:
        at = self._boot_at
        for other in (self._executor.ends_at, self._reports.due_at):
            if other is not None and (at is None or other < at):
                at = other
        return at

    def handle_timer(self, now: float) -> None:
        """Does everything that was due until `now`, each thing at its own time."""
        while (at := self.next_timer()) is not None and at <= now:
            self._now = max(self._now, at)
            if at == self._boot_at:
                self._boot()
            elif at == self._executor.ends_at:
                self._work(self._executor.advance(at))
            else:
                self._report(at)
        self._now = max(self._now, now)

    # What can be seen.

    @property
    def status(self) -> Status:
        if self._power != "on":
            return self._power
        if self.alarm is not None:
            return "cnscalarm" if self.alarm[1] is None else "axisalarm"
        return "run" if self._executor.command is not None else "idle"

    @property
    def position(self) -> dict[str, float]:
        """Coordinates as STATE says them, per axis letter, at the latest `now` the machine was told."""
        return dict(zip(AXES, self._shown(), strict=True))

    @property
    def true_position(self) -> dict[str, float]:
        """Where the carriage really stood at the last end of a block, counted from the limit switches."""
        return dict(zip(AXES, self.mill.true, strict=True))

    # What can happen to a machine.

    def power_off(self, now: float) -> None:
        """Forgets everything but where the carriage stands."""
        self.handle_timer(now)
        self._executor.abort(now)
        self.mill.forget()
        self._power, self._boot_at = "off", None
        self.last_id, self._last_error = 0, None
        self.alarm = self._tool_wanted = None
        self._gate.clear()
        self._reports.cancel()
        self._voice.clear()
        self._events.append(PowerLost())

    def power_on(self, now: float) -> None:
        """Boots; READY follows after `boot_s`. Nothing happens when there is power already."""
        self.handle_timer(now)
        if self._power == "off":
            self._power, self._boot_at = "boot", now + self.settings.boot_s

    def restart(self, now: float) -> None:
        """A reset in the middle of whatever it does."""
        self.power_off(now)
        self.power_on(now)

    def press_emergency(self, now: float) -> None:
        """The button on the machine: everything stops where it is."""
        self.handle_timer(now)
        if self._power == "on":
            self._executor.abort(now)
            self._alarm(ALARM_EMERGENCY, None)

    def trip_limit(self, axis: str, end: Literal["start", "end"], now: float, *, faulty: bool = False) -> bool:
        """A limit switch closes, or (`faulty`) gives an intermediate level. True when that raised an alarm.

        Switches are watched while homing only (§7): at another time a closed one does nothing, a faulty one is
        noticed by the next homing.
        """
        self.handle_timer(now)
        first = ALARM_START_SWITCH_FAULTY if faulty else ALARM_START_SWITCH
        alarm = (first + (ALARM_END_SWITCH - ALARM_START_SWITCH) * (end == "end"), AXES.index(axis.upper()) + 1)
        if self._executor.homing:
            self._executor.abort(now)
            self._alarm(*alarm)
            return True
        if faulty:
            self.mill.faulty_switch = alarm
        return False

    def confirm_tool(self, now: float) -> None:
        """The operator has changed the tool and pressed the button on the machine (`tool_change = "wait"`)."""
        self.handle_timer(now)
        self._tool_wanted = None
        if self._executor.command is not None and self._executor.ends_at is None:
            self._work(self._executor.advance(now))

    # Messages in.

    def _obey(self, found: Message, wire_id: int | None, raw: bytes) -> None:
        blocks = self._blocks(found) if found.name == "GCODE" else []
        if found.name == "INIT":
            return self._init(wire_id, raw)
        if found.name in ("READY", "READDIR", "CHECKCHANGETOOL"):
            return self._answer(found.name, raw)
        if wire_id is None:
            return self._drop("no_id", raw)
        if not self._admits(found.name, blocks, wire_id, raw):
            return None
        self._reports.cancel()
        self.last_id, self._last_error = wire_id, None
        self._events.append(CommandAccepted(wire_id, found.name))
        self._voice.received(wire_id)
        match found.name:
            case "GCODE" if "DATA" in found.params:
                self._start(Command.batch(wire_id, blocks))
            case "RUN" if "NAME" in found.params:
                self._run(wire_id, found.params["NAME"])
            case "RESETALERT":
                self._reset_alert(wire_id)
            case "GCODE" | "RUN":
                self._end(CommandEnded(wire_id, ERR_PARAMETER))
            case _:
                self._end(CommandEnded(wire_id, ERR_UNKNOWN_COMMAND))
        return None

    def _blocks(self, found: Message) -> list[str]:
        return split_batch(found.params.get("DATA", b"").decode(self.settings.encoding, errors="replace"))

    def _situation(self) -> Situation:
        return Situation(self._executor.command, self.alarm is not None, self.last_id)

    def _admits(self, name: str, blocks: list[str], wire_id: int, raw: bytes) -> bool:
        """May this command be executed? If not, answers what the standard lets a machine answer."""
        match judge_command(self.settings, self._situation(), name, wire_id, blocks):
            case "execute":
                return True
            case "interrupt":
                self._executor.abort(self._now)
                return True
            case "acknowledged" | "answered" as before:
                self._repeat(wire_id, ended=before == "answered")
            case refusal:
                self._drop(refusal, raw)
        return False

    def _repeat(self, wire_id: int, *, ended: bool) -> None:
        """An ID ≤ the last one is never executed again (§6); acknowledging it again is the machine's habit."""
        answered = self.settings.repeat == "reack"
        self._events.append(CommandRepeated(wire_id, answered))
        if not answered:
            self.dropped["repeated"] += 1
            return
        self._voice.received(wire_id)
        if ended:
            self._voice.ended(wire_id, self._last_error if wire_id == self.last_id else None)

    def _init(self, wire_id: int | None, raw: bytes) -> None:
        """Accepted with any ID; resets the memory of IDs (§4)."""
        if not self._listens(raw):
            return
        if self.settings.init_acknowledged:
            if wire_id is None:
                self._drop("no_id", raw)
                return
            self._voice.received(wire_id)
            self._voice.ended(wire_id, None)
        self._events.append(CommandAccepted(wire_id or 0, "INIT"))
        self.last_id, self._last_error = 0, None

    def _answer(self, name: str, raw: bytes) -> None:
        """Messages that are answered by data, not by RECEIVED and OK; they do not touch the memory of IDs."""
        waits = self._executor.command is not None and self._executor.ends_at is None
        if not (name == "CHECKCHANGETOOL" and waits) and not self._listens(raw):
            return
        match name:
            case "READY":
                self._voice.say("READY")
            case "READDIR":
                self._voice.card()
            case _ if self._tool_wanted is not None:
                self._voice.say("TOOL", ("NUM", str(self._tool_wanted)))

    def _listens(self, raw: bytes) -> bool:
        refusal = judge_question(self.settings, self._situation())
        if refusal is not None:
            self._drop(refusal, raw)
        return refusal is None

    # The SD card.

    def _run(self, wire_id: int, name: bytes) -> None:
        try:
            self._start(Command.file(wire_id, name, self.settings))
        except BlockError as error:
            self._end(CommandEnded(wire_id, error.num))

    # Execution.

    def _start(self, command: Command) -> None:
        if not command.quiet:
            self._tool_wanted = None
        self._work(self._executor.start(command, self._now))

    def _work(self, happenings: Iterable[SimEvent | Asked | ProgramEnded]) -> None:
        command = self._executor.command
        from_card = command is not None and command.from_card
        reports, append = not self.settings.instant, self._events.append
        for happening in happenings:
            match happening:
                case BlockFinished():
                    pass
                case BlockStarted():
                    self._note(happening.block)
                    if reports and self._reports_moves(from_card) and self._executor.moving:
                        self._reports.moving(self._now)
                case Asked(code):
                    self._tell(code)
                    continue
                case ProgramEnded():
                    self.last_id = 0
                    continue
                case ToolWanted(num):
                    self._tool_wanted = num
                    self._voice.say("TOOL", ("NUM", str(num)))
                case AlarmRaised(num, axis):
                    self._alarm(num, axis)
                    continue
                case CommandEnded():
                    if from_card and happening.error is None:
                        self._voice.say("PROGRAM_END")
                    self._end(happening)
                    if self._reports_moves(from_card) and self._executor.has_moved:
                        self._reports.came_to_rest(self._now)
                    continue
            append(happening)

    def _reports_moves(self, from_card: bool) -> bool:
        return self.mill.reports_moves or from_card

    def _note(self, block: Executed) -> None:
        self.executed.append(block)
        self.executed_count += 1
        limit = self.settings.executed_limit
        if limit and len(self.executed) > 2 * limit:
            del self.executed[:-limit]
        if self._on_block is not None:
            self._on_block(block)

    def _end(self, ended: CommandEnded) -> None:
        self._reports.cancel()
        self._last_error = ended.error
        self._events.append(ended)
        self._voice.ended(ended.id, ended.error)

    def _alarm(self, num: int, axis: int | None) -> None:
        """No OK for what was executing: it has not been executed completely."""
        self.alarm = (num, axis)
        self._events.append(AlarmRaised(num, axis))
        self._say_state()
        self._reports.alarm(self._now)

    def _reset_alert(self, wire_id: int) -> None:
        self.alarm = None
        self._events.append(AlarmCleared())
        self._end(CommandEnded(wire_id, None))
        self._say_state()

    def _boot(self) -> None:
        self._power, self._boot_at = "on", None
        self._events.append(Booted())
        self._voice.say("READY")

    def _report(self, at: float) -> None:
        self._say_state()
        self._reports.repeat(at, alarm=self.alarm is not None, running=self._executor.command is not None)

    # Messages out.

    def _tell(self, code: str) -> None:
        match code:
            case "W95":
                self._say_state()
            case "W96":
                self._voice.switches(axis for axis, place in zip("XYZ", self.mill.true, strict=False) if place == 0.0)
            case _:
                self._voice.about()

    def _shown(self) -> Point:
        return self._executor.shown(self._now)

    def _say_state(self) -> None:
        self._reports.said(self._now)
        command = self._executor.command
        quiet = self.alarm is None and command is not None and command.quiet
        self._voice.state(
            "idle" if quiet else self.status,
            self._shown(),
            feed=self.mill.feed_mm_min,
            speed=self.mill.spindle_rpm if self.mill.spindle_on else 0.0,
            alarm=self.alarm,
            absolute=self.mill.absolute,
        )

    def _drop(self, reason: str, raw: bytes) -> None:
        self.dropped[reason] += 1
        self._events.append(MessageDropped(reason, raw[:200]))
