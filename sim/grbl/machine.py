"""The virtual Grbl controller, put together: bytes and `now` in; bytes, events and the next deadline out.

An object without I/O and without a clock, with the five verbs that `sim.shell` wants. It is the second, independent
reading of the documents. The one rule: interrupts come first (bytes, switches, steps), then the main program runs as
far as it can.
"""

from collections.abc import Callable
from typing import Literal

from sim.faults import LINES
from sim.grbl import reports
from sim.grbl.core import Core, Flag, State
from sim.grbl.events import BytesLost, Executed, PowerLost, SimEvent
from sim.grbl.mainloop import Program
from sim.grbl.overrides import ALL as OVERRIDES
from sim.grbl.planner import PlanBlock
from sim.grbl.probing import contact, touched
from sim.grbl.realtime import Realtime, meaning, pieces, swallowed
from sim.grbl.simsettings import AXES, ORIGIN, SimSettings
from sim.grbl.stepper import Contact

_FLAGS = {
    Realtime.STATUS: Flag.STATUS,
    Realtime.FULL_STATUS: Flag.FULL_STATUS,
    Realtime.PARSER_STATE: Flag.PARSER_STATE,
    Realtime.CYCLE_START: Flag.CYCLE_START,
    Realtime.FEED_HOLD: Flag.FEED_HOLD,
    Realtime.SAFETY_DOOR: Flag.DOOR,
    Realtime.TOOL_ACK: Flag.TOOL_ACK,
}


class VirtualGrbl:
    """`on_line` is called with every line of G-code or jog that was taken, before its ok is on the way out.

    The machine is built running: it was switched on before anybody connected, and its banner was said to nobody.
    """

    framing = LINES

    def __init__(
        self, settings: SimSettings, *, now: float = 0.0, on_line: Callable[[Executed], None] | None = None
    ) -> None:
        self.settings = settings
        self.core = Core(settings, now=now)
        self.core.on_line = on_line
        self.most_waiting_bytes = 0
        """Most bytes of unanswered lines at a time: the window of the sender, as it arrived."""
        self._power: Literal["off", "boot", "on"] = "on"
        self._boot_at: float | None = None
        self._busy_until = now
        self._wire_up()
        self._switch_on()
        self.core.out.clear()

    # The five verbs.

    def receive_data(self, data: bytes, now: float) -> None:
        """Bytes from the host. Never raises, whatever they are."""
        self.handle_timer(now)
        for piece in pieces(data, hal=self.settings.hal):
            self._hear(piece)

    def data_to_send(self, now: float) -> bytes:
        self.handle_timer(now)
        said = bytes(self.core.out)
        self.core.out.clear()
        return said

    def next_event(self) -> SimEvent | None:
        return self.core.events.popleft() if self.core.events else None

    def next_timer(self) -> float | None:
        if self._boot_at is not None:
            return self._boot_at
        if self._power != "on":
            return None
        due = [self.core.stepper.next_at(), self._wake_at]
        if self._busy_until > self.core.now:
            due = [self.core.stepper.next_at(), self._busy_until]
        return min((at for at in due if at is not None), default=None)

    def handle_timer(self, now: float) -> None:
        """Does everything that was due until `now`, each thing at its own time."""
        while (at := self.next_timer()) is not None and at <= now:
            self.core.now = max(self.core.now, at)
            if at == self._boot_at:
                self._boot_at, self._power = None, "on"
                self._switch_on()
                continue
            steps_at = self.core.stepper.next_at()
            if steps_at is not None and steps_at <= at:
                self.core.stepper.advance(self.core.now)
            self._run()
        self.core.now = max(self.core.now, now)

    # What can be seen.

    @property
    def executed(self) -> list[Executed]:
        """Every line that was taken, with its motion (see `SimSettings.executed_limit`)."""
        return self.core.executed

    @property
    def executed_count(self) -> int:
        return self.core.executed_count

    @property
    def state(self) -> State:
        return self.core.state

    @property
    def position(self) -> dict[str, float]:
        """Machine coordinates as the controller believes."""
        return dict(zip(AXES, self.core.position(), strict=True))

    @property
    def true_position(self) -> dict[str, float]:
        """Where the tool really is, in machine space of a homed machine."""
        return dict(zip(AXES, self.core.true_position(), strict=True))

    @property
    def dropped_bytes(self) -> int:
        """Bytes that did not fit into the receive ring: a sender's fault if there are any."""
        return self.core.ring.dropped_bytes

    @property
    def overflows(self) -> int:
        return self.core.ring.overflows

    @property
    def most_ring_bytes(self) -> int:
        return self.core.ring.most_bytes

    # What can happen to a machine.

    def power_off(self, now: float) -> None:
        """Forgets everything but the EEPROM, and where it stands."""
        self.handle_timer(now)
        core = self.core
        self._power, self._boot_at = "off", None
        core.stepper.kill(core.now)
        true = core.true_position()
        core.stepper.rest, core.true_shift = ORIGIN, true
        core.probe_position, core.probe_found, core.homed = ORIGIN, False, False
        core.last_alarm = 0
        core.clear()
        core.state = State.IDLE
        core.out.clear()
        core.deaf_until = core.now
        core.events.append(PowerLost())

    def power_on(self, now: float) -> None:
        """Boots; the banner follows after `boot_s`. Nothing happens when there is power already."""
        self.handle_timer(now)
        if self._power == "off":
            self._power, self._boot_at = "boot", self.core.now + self.settings.boot_s

    def restart(self, now: float) -> None:
        """The reset line of the board, in the middle of whatever it does."""
        self.power_off(now)
        self.power_on(now)

    def line_opened(self, now: float) -> None:
        """Somebody has opened the port: with `reset_on_open` DTR resets the board."""
        if self.settings.reset_on_open:
            self.restart(now)

    def press(self, letter: str, now: float) -> None:
        """An input closes: X, Y, Z limit switches, P probe, D door, H hold, S start, R reset (the letters of Pn)."""
        self.handle_timer(now)
        self.core.pressed.add(letter)
        if self._power == "on":
            self._pressed(letter)
            self._run()

    def release(self, letter: str, now: float) -> None:
        self.handle_timer(now)
        self.core.pressed.discard(letter)
        if self._power == "on":
            touched(self.core)
            self._run()

    def set_mpg(self, on: bool, now: float) -> None:
        """grblHAL: the pendant takes the stream, or gives it back (`|MPG:1`)."""
        self.handle_timer(now)
        self.core.mpg = on
        self.core.say(reports.status(self.core, full=True))

    # Within.

    def _wire_up(self) -> None:
        core = self.core
        core.stepper.watch = self._watch
        core.stepper.on_stop = self._stopped
        core.stepper.on_contact = self._met

    def _switch_on(self) -> None:
        self._program = Program(self.core)
        self._main = self._program.main()
        self._wake_at: float | None = None
        self._busy_until = self.core.now
        self._run()

    def _run(self) -> None:
        """The main program, as far as it can go; not while an interrupt holds the processor."""
        if self._power == "on" and self.core.now >= self._busy_until:
            self._wake_at = next(self._main)

    def _hear(self, piece: bytes) -> None:
        core = self.core
        if self._power != "on":
            core.events.append(BytesLost("off", len(piece)))
            return
        if core.now < core.deaf_until:
            core.events.append(BytesLost("eeprom", len(piece)))
            return
        command = meaning(piece, hal=self.settings.hal)
        if command is not None:
            self._interrupt(command)
            self._run()
            self._catch_up()
        elif not swallowed(piece):
            self._store(piece)

    def _store(self, data: bytes) -> None:
        """Into the ring; the main program takes out what it can, what then does not fit is lost."""
        core = self.core
        if core.file is not None:
            return
        while data:
            taken = core.ring.put(data)
            self._program.waiting_bytes += taken
            self.most_waiting_bytes = max(self.most_waiting_bytes, self._program.waiting_bytes)
            data = data[taken:]
            self._run()
            self._catch_up()
            if data and not core.ring.free:
                core.ring.drop(len(data))
                core.events.append(BytesLost("ring", len(data)))
                return
            if data and core.now < core.deaf_until:
                core.events.append(BytesLost("eeprom", len(data)))
                return

    def _catch_up(self) -> None:
        """What takes no time happens now."""
        self.handle_timer(self.core.now)

    def _interrupt(self, command: Realtime) -> None:
        core = self.core
        if command is Realtime.RESET:
            core.reset()
        elif command is Realtime.JOG_CANCEL:
            if core.state is State.JOG:
                core.flag(Flag.MOTION_CANCEL)
        elif command in _FLAGS:
            core.flag(_FLAGS[command])
        elif command in OVERRIDES:
            core.asked.append(command)
        elif command is Realtime.MPG:
            core.mpg = not core.mpg
            core.flag(Flag.FULL_STATUS)
        elif command is Realtime.PROBE_CONNECTED:
            core.probe_connected = not core.probe_connected

    def _pressed(self, letter: str) -> None:
        core = self.core
        if letter in ("X", "Y", "Z"):
            self._limit()
        elif letter == "P":
            touched(core)
        elif letter == "R":
            core.reset()
        elif letter == "S":
            core.flag(Flag.CYCLE_START)
        elif letter == "H" or (letter == "D" and not self.settings.door_pin):
            core.flag(Flag.FEED_HOLD)
        elif letter == "D":
            core.flag(Flag.DOOR)

    def _limit(self) -> None:
        """A limit switch closes: ALARM:1 when hard limits are on, except while homing and in alarm (II.3)."""
        core = self.core
        if core.memory.on(21) and core.state not in (State.ALARM, State.HOMING) and not core.alarm:
            core.reset()
            core.alarm = 1

    def _watch(self, block: PlanBlock) -> list[Contact]:
        """What a block will run into."""
        found = contact(self.core, block)
        if self.core.memory.on(21):
            found += self._limits_on(block)
        return found

    def _limits_on(self, block: PlanBlock) -> list[Contact]:
        found: list[Contact] = []
        for at, axis in enumerate(AXES):
            if not block.unit[at]:
                continue
            start = block.start[at] + self.core.true_shift[at]
            switch = 0.0 if block.unit[at] > 0 else -self.settings.travel[axis]
            done_mm = (switch - start) / block.unit[at]
            if 0 < done_mm <= block.length_mm:
                found.append(Contact("limit", done_mm))
        return found

    def _met(self, what: str, _: float) -> None:
        if what == "probe":
            touched(self.core)
        else:
            self._limit()

    def _stopped(self, at: float) -> None:
        """Motion has ended. The motors stay locked for $1 ms, and the processor waits with them, unless it is 255."""
        core = self.core
        core.flag(Flag.CYCLE_STOP)
        lock_ms = core.memory[1]
        if lock_ms != 255 and not self.settings.instant:
            self._busy_until = at + lock_ms / 1000
