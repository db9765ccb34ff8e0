"""The virtual lathe: bytes in, bytes out, in simulated time. Not the wire's faults (`sim.faults`), no I/O, no clock.

It takes one frame at a time, executes it, says ACK. While a frame runs it notices CAN alone; all else waits in its
buffer, ENQ too: it answers when it stands. The one rule: every frame that it begins is in `executed`, with its number.
"""

from collections import deque
from collections.abc import Callable

from sim.faults import Framing
from sim.ncframe import codec
from sim.ncframe.carriage import Carriage, Impossible
from sim.ncframe.events import Aborted, BytesLost, BytesRefused, Executed, SimEvent
from sim.ncframe.settings import SimSettings

EVERY_BYTE = Framing(b"", bytes(range(256)))
"""Nothing in the bytes tells where a message ends."""
MODULUS = 1 << 32
EVENTS_KEPT = 10_000


class VirtualLathe:
    """See `sim.shell.Machine`. `now`: it has been running for a while. `on_block` is called with every frame as it
    begins."""

    def __init__(
        self, settings: SimSettings, now: float = 0.0, on_block: Callable[[Executed], None] | None = None
    ) -> None:
        self.settings = settings
        self.executed: list[Executed] = []
        self.events: deque[SimEvent] = deque(maxlen=EVENTS_KEPT)
        self.count = settings.start_count
        self.carriage = Carriage(settings)
        self.holding = False
        self._on_block = on_block
        self._out = bytearray()
        self._burst = bytearray()
        self._bad: str | None = None
        self._last_byte_at = now
        self._waiting: deque[tuple[float, int]] = deque()  # when and what came while a frame ran
        self._run: Executed | None = None
        self._takes_s = self._left_s = 0.0
        self._ends_at: float | None = None
        self._boots_at: float | None = None

    @property
    def framing(self) -> Framing:
        return EVERY_BYTE

    @property
    def position(self) -> tuple[int, int]:
        """X and Z in counts from the place at power-on."""
        return self.carriage.x, self.carriage.z

    # --- the verbs of every machine -------------------------------------------------------------------------------

    def receive_data(self, data: bytes, now: float) -> None:
        """Bytes from the host."""
        self.handle_timer(now)
        for byte in data:
            if self._boots_at is not None:
                self.events.append(BytesLost(1, "off", now))
            elif self._run is not None:
                self._set_aside(byte, now)
            else:
                self._take(byte, now)

    def data_to_send(self, now: float) -> bytes:  # noqa: ARG002
        """Bytes to the host."""
        data = bytes(self._out)
        self._out.clear()
        return data

    def next_timer(self) -> float | None:
        """When something happens by itself."""
        timers = [self._boots_at, self._ends_at]
        if self._burst:
            timers.append(self._last_byte_at + self.settings.gap_s)
        return min((timer for timer in timers if timer is not None), default=None)

    def handle_timer(self, now: float) -> None:
        """Calling early does nothing."""
        if self._boots_at is not None and now >= self._boots_at:
            self._boots_at = None
        if self._burst and now >= self._last_byte_at + self.settings.gap_s:
            self._on_gap(now)
        if self._ends_at is not None and now >= self._ends_at:
            self._finish(self._ends_at, now)

    # --- what is done to it from outside ----------------------------------------------------------------------------

    def restart(self, now: float) -> None:
        """The power goes and comes back: what ran is broken off where it is, count and modes are gone."""
        self._break_off(now)
        self._out.clear()
        self.holding = False
        self._boots_at = now + self.settings.boot_s

    def hold(self, now: float) -> None:
        """The hold key at the panel: the carriage stops where it is."""
        if self.holding or self._boots_at is not None:
            return
        self.holding = True
        self._out += codec.XOFF
        if self._ends_at is not None:
            self._left_s, self._ends_at = self._ends_at - now, None

    def release(self, now: float) -> None:
        """The hold key again."""
        if not self.holding:
            return
        self.holding = False
        self._out += codec.XON
        if self._run is not None:
            self._ends_at = now + self._left_s

    def panic(self, now: float) -> None:
        """The stop button at the panel."""
        if self._boots_at is None:
            self._abort("panel", now)

    # --- bytes ------------------------------------------------------------------------------------------------------

    def _set_aside(self, byte: int, now: float) -> None:
        """It is busy. A byte that is CAN stops it wherever it stands: it may be part of a frame, and is none then."""
        if byte == codec.CAN[0]:
            self._abort("host", now)
        elif len(self._waiting) < self.settings.rx_bytes:
            self._waiting.append((now, byte))
        else:
            self.events.append(BytesLost(1, "busy", now))

    def _take(self, byte: int, now: float) -> None:
        """It stands and listens."""
        self._last_byte_at = now
        self._burst.append(byte)
        if self.settings.framing == "gap" or self._bad is not None:
            return
        head = self._burst[0]
        if len(self._burst) == 1 and head in (codec.ENQ[0], codec.CAN[0]):
            self._burst.clear()
            self._control(head, now)
        elif head == 0:
            self._bad = "empty"
        elif len(self._burst) == codec.length(head) + (self.settings.check != "none"):
            self._judge(now)

    def _on_gap(self, now: float) -> None:
        """Silence: what is not whole by now is not going to be."""
        if self.settings.framing == "gap" and bytes(self._burst) in (codec.ENQ, codec.CAN):
            head = self._burst[0]
            self._burst.clear()
            self._control(head, now)
            return
        if self.settings.framing == "gap":
            self._judge(now)
        if self._burst:
            self.events.append(BytesRefused(bytes(self._burst), self._bad or "gap", now))
            self._burst.clear()
            self._bad = None
            self._out += codec.NAK

    def _judge(self, now: float) -> None:
        try:
            block = codec.decode(bytes(self._burst), self.settings.check)
        except codec.Refused as refused:
            self._bad = str(refused)  # NAK comes behind the silence, once for all that follows
        else:
            self._burst.clear()
            self._begin(block, now)

    def _control(self, byte: int, now: float) -> None:
        if byte == codec.CAN[0]:
            self._abort("host", now)
            return
        self._out += codec.ACK
        if self.settings.counter:
            self._out += self.count.to_bytes(4, "big")

    # --- frames -----------------------------------------------------------------------------------------------------

    def _begin(self, block: codec.Block, now: float) -> None:
        try:
            x, z, seconds = self.carriage.take(block)
        except Impossible:
            self._abort("arc", now)
            return
        self._run = Executed(block.text, (self.count + 1) % MODULUS, now, x, z)
        limit = self.settings.executed_limit
        if limit and len(self.executed) >= 2 * limit:
            del self.executed[:limit]
        self.executed.append(self._run)
        if self._on_block is not None:
            self._on_block(self._run)
        if not self.carriage.within(x, z):
            self._abort("limit", now)
            return
        pace = 0.0 if self.settings.instant else 1.0 / self.settings.speed_factor
        self._takes_s = self._left_s = (self.settings.frame_s + seconds) * pace
        if self.holding:
            return
        self._ends_at = now + self._left_s
        if self._ends_at <= now:
            self._finish(now, now)

    def _finish(self, ended_at: float, now: float) -> None:
        run = self._run
        assert run is not None
        self._run = self._ends_at = None
        run.ended_at = ended_at
        self.carriage.x, self.carriage.z = run.x, run.z
        self.count = run.id
        self._out += codec.ACK
        self._go_on(now)

    def _go_on(self, now: float) -> None:
        """What came meanwhile is read now, with the silences that were in it, as far as nothing new runs."""
        while self._waiting and self._run is None:
            at, byte = self._waiting[0]
            if self._burst and at >= self._last_byte_at + self.settings.gap_s:
                self._on_gap(now)
                continue
            self._waiting.popleft()
            self._take(byte, now)
            self._last_byte_at = at

    def _abort(self, why: str, now: float) -> None:
        """CAN: everything stops and nothing of it goes on; position, modes and count are not what they were."""
        assert why in ("host", "panel", "limit", "arc")
        self._break_off(now)
        self.events.append(Aborted(why, now))  # type: ignore[arg-type]
        self._out += codec.CAN

    def _break_off(self, now: float) -> None:
        x, z = self.position
        if (run := self._run) is not None:  # somewhere on its way
            left_s = self._left_s if self._ends_at is None else self._ends_at - now
            part = 1.0 - left_s / self._takes_s if self._takes_s else 0.0
            x, z = x + int((run.x - x) * part), z + int((run.z - z) * part)
        self._run = self._ends_at = None
        self._burst.clear()
        self._waiting.clear()
        self._bad = None
        self.count = 0
        self.carriage = Carriage(self.settings, x, z)
