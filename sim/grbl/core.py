"""All that the parts of the virtual controller share: its state, its flags, its memory, what it has to say.

Interrupts (bytes, switches, the stepper) only set flags here; the main loop (`mainloop.py`, `service.py`) acts on them
when it comes round. The one rule: the state of the machine is changed here and nowhere stored twice.
"""

from collections import deque
from collections.abc import Callable, Generator
from enum import Enum, IntFlag, auto
from typing import Final, TypeAlias, TypeVar

from sim.grbl.card import OpenFile
from sim.grbl.events import AlarmRaised, Executed, SimEvent
from sim.grbl.lines import LineReader
from sim.grbl.modal import Modal
from sim.grbl.nonvolatile import Nonvolatile
from sim.grbl.planner import Planner
from sim.grbl.ring import RxRing
from sim.grbl.simsettings import ORIGIN, Point, SimSettings
from sim.grbl.stepper import Stepper

MAX_EVENTS: Final = 10_000

T = TypeVar("T")
Task: TypeAlias = Generator[float | None, None, T]
"""A part of the main loop. It gives way with the time at which it wants to be woken, or None: when anything happens."""


class State(Enum):
    """The names of the status report."""

    IDLE = "Idle"
    ALARM = "Alarm"
    CHECK = "Check"
    HOMING = "Home"
    RUN = "Run"
    HOLD = "Hold"
    JOG = "Jog"
    DOOR = "Door"
    SLEEP = "Sleep"
    TOOL = "Tool"


class Flag(IntFlag):
    """What interrupts ask of the main loop."""

    STATUS = auto()
    FULL_STATUS = auto()
    PARSER_STATE = auto()
    CYCLE_START = auto()
    CYCLE_STOP = auto()
    FEED_HOLD = auto()
    RESET = auto()
    DOOR = auto()
    MOTION_CANCEL = auto()
    SLEEP = auto()
    TOOL_ACK = auto()


class Suspend(IntFlag):
    """Why the main loop is parked. Nothing set: it is not."""

    HELD = auto()
    """Motion has come to rest."""
    RETRACTED = auto()
    RESTORING = auto()
    RESTORED = auto()
    DOOR_AJAR = auto()
    MOTION_CANCEL = auto()
    JOG_CANCEL = auto()
    TOOL = auto()


NO_FLAG: Final = Flag(0)
NOT_SUSPENDED: Final = Suspend(0)
BUSY: Final = frozenset({State.HOMING, State.RUN, State.HOLD, State.JOG, State.DOOR})
"""Reports repeat WCO and Ov less often in these."""


class Core:
    """See the head of this file."""

    def __init__(self, kind: SimSettings, *, now: float) -> None:
        self.kind = kind
        self.now = now
        self.memory = Nonvolatile(kind)
        self.ring = RxRing(kind.ring_bytes)
        self.reader = LineReader(kind.line_limit)
        self.modal = Modal()
        self.planner = Planner(self.memory, kind.usable_blocks)
        self.stepper = Stepper(self.planner, speed_factor=kind.speed_factor, instant=kind.instant)
        self.out = bytearray()
        self.events: deque[SimEvent] = deque(maxlen=MAX_EVENTS)
        self.executed: list[Executed] = []
        self.executed_count = 0
        self.on_line: Callable[[Executed], None] | None = None
        self.current: Executed | None = None
        """The line that is being executed: its motion is written down there."""
        self.state = State.IDLE
        self.deaf_until = 0.0
        """Interrupts are off: bytes are lost, realtime ones too."""
        self.true_shift: Point = kind.start_position
        """True position minus the one that the controller believes in."""
        self.pressed: set[str] = set()
        """Inputs held by hand, letters of Pn."""
        self.probe_position: Point = ORIGIN
        self.probe_found = False
        self.probe_connected = True
        self.mpg = False
        self.homed = False
        self.file: OpenFile | None = None
        """What is read from the SD card (grblHAL)."""
        self.last_alarm = 0
        """The alarm that was said last; grblHAL shows it as long as the state is Alarm."""
        self._first_stream: tuple[RxRing, LineReader] | None = None
        self.clear()

    def clear(self) -> None:
        """What a reset forgets: everything but position, state, EEPROM and what has been written down."""
        position = self.position()
        self.flags = NO_FLAG
        self.file = None
        self.suspend = NOT_SUSPENDED
        self.alarm = 0
        """An alarm that is still to be said."""
        self.asked: list[object] = []
        """Overrides asked for by realtime bytes, in order."""
        self.abort = False
        self.soft_limit = False
        self.spindle_override = 100
        self.spindle_stop = ""
        """"", "stop", "stopped", "restore", "resume": the stages of 0x9E."""
        self.probing = False
        self.probe_away = False
        self.wco_in = 0
        """Reports until the next one with WCO."""
        self.overrides_in = 0
        self.spindle = "M5"
        """What the output does; `modal.spindle` is what the program wants."""
        self.spindle_rpm = 0.0
        self.flood = self.mist = False
        self.end_second_stream()
        self.ring.clear()
        self.reader.clear()
        self.modal = Modal(position=position, system_offset=self.memory.coords["G54"])
        self.stepper.kill(self.now)
        self.planner.reset(position)
        self.planner.feed_override = self.planner.rapid_override = 100

    # Seen.

    def position(self) -> Point:
        """Machine coordinates as the controller believes, to the step."""
        steps = self.memory.axes(100)
        x, y, z = (round(p * s) / s for p, s in zip(self.stepper.position(self.now), steps, strict=True))
        return x, y, z

    def true_position(self) -> Point:
        x, y, z = (p + s for p, s in zip(self.stepper.position(self.now), self.true_shift, strict=True))
        return x, y, z

    @property
    def attention(self) -> bool:
        """The main loop has something to do besides lines."""
        return bool(self.flags or self.alarm or self.asked)

    @property
    def resting_state(self) -> State:
        """Where motion ends: in the middle of a tool change it is not Idle (grblHAL)."""
        return State.TOOL if self._first_stream is not None else State.IDLE

    def aborted(self) -> bool:
        return self.abort

    def is_in(self, *states: State) -> bool:
        return self.state in states

    @property
    def resting(self) -> bool:
        return self.state is self.resting_state

    @property
    def door_open(self) -> bool:
        return self.kind.door_pin and "D" in self.pressed

    # Said.

    def say(self, text: str) -> None:
        self.out += text.encode("ascii", errors="replace") + b"\r\n"

    def message(self, text: str) -> None:
        self.say(f"[MSG:{text}]")

    # Done.

    def flag(self, flag: Flag) -> None:
        self.flags |= flag

    def unflag(self, flag: Flag) -> None:
        self.flags &= ~flag

    def reset(self) -> None:
        """0x18, the reset button, a limit: outputs off and motors dead at once; the main loop does the rest."""
        if self.flags & Flag.RESET:
            return
        self.flag(Flag.RESET)
        self.stop_outputs()
        moving = self.state in (State.RUN, State.JOG, State.HOMING) or self.stepper.running
        if moving or self.suspend & Suspend.RESTORING:
            if not self.alarm:
                self.alarm = 6 if self.state is State.HOMING else 3
            self.stepper.kill(self.now)

    def stop_outputs(self) -> None:
        self.set_spindle("M5", 0.0)
        self.set_coolant(flood=False, mist=False)

    def set_spindle(self, code: str, rpm: float) -> None:
        """The output; a change of it is told by the next report (II.5)."""
        self.spindle = code
        self.overrides_in = 0
        if code == "M5" or rpm <= 0:
            self.spindle_rpm = 0.0
            return
        rpm *= self.spindle_override / 100
        self.spindle_rpm = min(max(rpm, self.memory[31]), self.memory[30])

    def set_coolant(self, *, flood: bool, mist: bool) -> None:
        self.flood, self.mist = flood, mist
        self.overrides_in = 0

    def write_eeprom(self, byte_count: int) -> None:
        """Nothing is heard while the EEPROM is written (II.4)."""
        if byte_count and not self.kind.hal:
            self.deaf_until = max(self.deaf_until, self.now) + byte_count * self.kind.eeprom_byte_s

    def note(self, record: Executed) -> None:
        """A line was taken."""
        self.executed.append(record)
        self.executed_count += 1
        limit = self.kind.executed_limit
        if limit and len(self.executed) > 2 * limit:
            del self.executed[:-limit]
        if self.on_line is not None:
            self.on_line(record)

    def note_alarm(self, num: int) -> None:
        self.last_alarm = num
        self.events.append(AlarmRaised(num))

    def begin_second_stream(self) -> None:
        """A tool change was acknowledged: lines that came before wait, new ones are obeyed (grblHAL, 0xA3)."""
        if self._first_stream is None:
            self._first_stream = self.ring, self.reader
            self.ring, self.reader = RxRing(self.kind.ring_bytes), LineReader(self.kind.line_limit)

    def end_second_stream(self) -> None:
        if self._first_stream is not None:
            second = self.ring
            self.ring, self.reader = self._first_stream
            self.ring.dropped_bytes += second.dropped_bytes
            self.ring.overflows += second.overflows
            self._first_stream = None

    def forget_motion(self) -> None:
        """Empty the queue; parser and planner take over where the machine stands."""
        self.stepper.kill(self.now)
        self.planner.reset(self.position())
        self.modal.position = self.planner.position


def pause(core: Core, seconds: float) -> Task[None]:
    """The processor stands still: nothing is looked at, bytes still come in."""
    until = core.now + seconds
    while core.now < until:
        yield until


def eeprom(core: Core, byte_count: int) -> Task[None]:
    core.write_eeprom(byte_count)
    yield from pause(core, core.deaf_until - core.now)
