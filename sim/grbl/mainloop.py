"""The main program: banner, start-up, then line after line until a reset (grbl II.3, II.4).

A generator that stands for the processor: it gives way whenever it can go no further, and is resumed when something has
happened. The one rule: exactly one answer for each line end, in order.
"""

from sim.grbl import reports
from sim.grbl.core import Core, Flag, State, Task, pause
from sim.grbl.errors import Refused
from sim.grbl.events import BannerSaid, BytesLost, Executed, LineAnswered
from sim.grbl.execute import gcode
from sim.grbl.lines import Line
from sim.grbl.motion import auto_start
from sim.grbl.service import realtime
from sim.grbl.system import dollar, run_startup

READING = (State.IDLE, State.RUN, State.CHECK)
"""States in which a file of the SD card is read on."""


class Program:
    """One run from power-on; `answered` counts lines over all resets."""

    def __init__(self, core: Core) -> None:
        self.core = core
        self.answered = 0
        self.waiting_bytes = 0
        """Bytes of lines that came and were not answered yet: a sender's window as it arrived."""

    def main(self) -> Task[None]:
        """Never ends."""
        core = self.core
        if core.memory.on(22) and core.kind.homing_lock:
            core.state = State.ALARM
        while True:
            core.events.append(BannerSaid())
            core.say("")
            core.say(reports.banner(core))
            yield from self._begin()
            if not core.abort:
                yield from self._lines()
            yield from pause(core, core.kind.reset_s)
            if len(core.ring):
                core.events.append(BytesLost("reset", len(core.ring)))
            self.waiting_bytes = 0
            core.clear()

    def _begin(self) -> Task[None]:
        core = self.core
        if core.memory.on(21) and core.pressed & set("XYZ"):
            core.state = State.ALARM
            core.message("Check Limits")
        if core.state in (State.ALARM, State.SLEEP):
            core.message("'$H'|'$X' to unlock")
            core.state = State.ALARM
            return
        core.state = State.IDLE
        if core.door_open:
            core.flag(Flag.DOOR)
            yield from realtime(core)
        if not core.abort:
            yield from run_startup(core)

    def _lines(self) -> Task[None]:
        core = self.core
        while True:
            yield from self._read_card()
            while core.file is None and (byte := core.ring.read()) is not None:
                line = core.reader.feed(byte)
                if line is None:
                    continue
                yield from realtime(core)
                if core.abort:
                    return
                yield from self._obey(line)
            auto_start(core)
            yield from realtime(core)
            if core.abort:
                return
            if not core.attention and not (self._card_goes_on if core.file is not None else len(core.ring)):
                yield None

    @property
    def _card_goes_on(self) -> bool:
        """The next line of the file can be read, or its end seen."""
        core = self.core
        if core.file is None or core.state not in READING:
            return False
        return not core.file.exhausted or (core.state is not State.RUN and not core.planner.blocks)

    def _read_card(self) -> Task[None]:
        """grblHAL: what is on the card instead of what comes over the wire; an error ends it (II, SD)."""
        core = self.core
        while core.file is not None and self._card_goes_on:
            if core.file.exhausted:
                core.file = None
                core.message("Pgm End")
                return
            number, line = core.file.number + 1, core.file.next()
            yield from realtime(core)
            if core.abort:
                return
            record = Executed(line.text, 0, core.now)
            core.current = record
            try:
                yield from self._execute(line, record)
            except Refused as refused:
                core.file = None
                core.say(f"error:{refused.code} in SD file at line {number}")
                core.say(f"error:{refused.code}")
            core.current = None

    def _obey(self, line: Line) -> Task[None]:
        core = self.core
        if core.kind.echo:
            core.say(f"[echo:{line.text}]")
        yield from pause(core, core.kind.line_s)
        record = Executed(line.text, self.answered + 1, core.now)
        error = 0
        core.current = record
        try:
            yield from self._execute(line, record)
        except Refused as refused:
            error = refused.code
        core.current = None
        self.answered += 1
        self.waiting_bytes = max(0, self.waiting_bytes - line.raw_bytes)
        core.events.append(LineAnswered(record.id, line.text, error))
        core.say(f"error:{error}" if error else "ok")

    def _execute(self, line: Line, record: Executed) -> Task[None]:
        core = self.core
        if line.overflow:
            raise Refused(11)
        if not line.text:
            return
        if line.text.startswith("$"):
            yield from dollar(core, line.text)
        elif core.kind.hal and line.text == "%":
            return
        elif core.state in (State.ALARM, State.JOG):
            raise Refused(9)
        elif core.state is State.TOOL and not line.text.startswith("G38"):
            raise Refused(40)
        else:
            yield from gcode(core, line.text)
        if line.text[0] != "$" or line.text.startswith("$J"):
            core.note(record)
