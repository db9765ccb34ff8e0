"""The lowest layer of the engine: ENQ and its answers, idle, what is told of the state, the end of the link.

Above it stand `flights.py` (frames), `settling.py` (what a new epoch inherits) and `engine.py` (the five verbs and the
commands); all of them are one object. The one rule of this layer: exactly one deadline, and while ENQ is open bytes are
read only after a silence.
"""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from typing import Final, Literal

from protocol.commands import Position
from protocol.events import (
    Alarm,
    CommandDone,
    CommandFailed,
    Event,
    LinkLost,
    LinkReady,
    MessageSeen,
    ProtocolFault,
    StateReported,
    Status,
)
from protocol.ncframe.answers import BURST_BYTES_MOST, Reading, console, read
from protocol.ncframe.codec import ACK, COUNT_BYTES, COUNT_MODULUS, ENQ
from protocol.ncframe.dialect import Dialect
from protocol.ncframe.pace import Pace
from protocol.ncframe.phases import STEPS, Flight, Inquiry, Phase
from protocol.ncframe.wire import Wire

IDLE_AFTER_S: Final = 0.2
"""The end of a batch is told as idle when nothing has followed for so long."""
REPORT_S: Final = 0.2
"""Positions between two frames are told no more often."""
LONGEST_WAIT: Final = 4
"""Unanswered ENQs wait longer and longer, up to so many times `enq_timeout_s`."""

Verdict = Callable[[Inquiry, int | None, float], None]


class Exchange(ABC):
    """State of the whole engine, and the means to ask and to be idle."""

    def __init__(self, dialect: Dialect, first_id: int, baud: int) -> None:
        self._dialect = dialect
        self._wire = Wire(baud)
        self._pace = Pace(dialect)
        self._events: deque[Event] = deque()
        self._phase = Phase.GREET
        self._deadline: float | None = None
        self._inquiry: Inquiry | None = None
        self._verdicts: Mapping[Phase, Verdict] = {}
        self._flight: Flight | None = None
        self._counted: int | None = None  # frames executed since the machine's start, as proven; None: not known
        self._proven_at = -math.inf
        self._next = first_id  # of batches, where the machine counts nothing
        self._standing: Position = {}
        self._status: Status = "idle"  # as last told
        self._told_at = -math.inf
        self._alarm: Alarm | None = None
        self._ready = False  # LinkReady was reported
        self._xoff = False  # the machine holds
        self._hold = False  # people hold
        self._hold_tokens: list[int] = []
        self._stop_tokens: list[int] = []
        self._abort_tokens: list[int] = []
        self._locate_token: int | None = None
        self._clear_token: int | None = None

    def _emit(self, event: Event) -> None:
        self._events.append(event)

    # --- asking -------------------------------------------------------------------------------------------------

    def _enquire(
        self,
        phase: Phase,
        now: float,
        *,
        expected: int | None = None,
        until: float = -math.inf,
        settle: bool = False,
        once: bool = False,
    ) -> None:
        """Begin the exchange of `phase`. `settle`: wait for a silence first, in which the machine drops a bad frame."""
        self._phase = phase
        self._inquiry = Inquiry(now, until, expected, once)
        if settle:
            self._deadline = now + self._dialect.gap_s
        else:
            self._ask(now)

    def _ask(self, now: float) -> None:
        inquiry = self._inquiry
        assert inquiry is not None
        inquiry.tries += 1
        inquiry.asked_at = now
        self._emit(MessageSeen(">", "ENQ"))
        self._deadline = now + self._wire.send(bytes([ENQ])) + self._patience_s(inquiry)

    def _patience_s(self, inquiry: Inquiry) -> float:
        wait_s = self._dialect.enq_timeout_s * min(inquiry.tries, LONGEST_WAIT)
        return max(wait_s, inquiry.until - inquiry.asked_at) if inquiry.once else wait_s

    def _collect(self, data: bytes, now: float) -> None:
        """Bytes while ENQ is open. The usual answer, and nothing else, needs no silence behind it."""
        inquiry = self._inquiry
        assert inquiry is not None
        burst = inquiry.burst
        burst += data[: BURST_BYTES_MOST + 1 - len(burst)]
        usual = len(burst) == 1 + COUNT_BYTES and burst[0] == ACK and inquiry.tries == 1 and not inquiry.answers
        if usual and self._dialect.counter and int.from_bytes(burst[1:], "big") == inquiry.expected:
            self._read_burst(now)
        else:
            self._deadline = now + self._dialect.gap_s

    def _on_inquiry_timer(self, now: float) -> None:
        inquiry = self._inquiry
        assert inquiry is not None
        if inquiry.burst:
            self._read_burst(now)
        elif inquiry.stragglers:
            self._conclude(now)
        elif inquiry.tries < (1 if inquiry.once else self._dialect.enq_tries) or now < inquiry.until:
            self._ask(now)
        else:
            self._on_no_answer(now)

    def _read_burst(self, now: float) -> None:
        """A silence behind bytes: they are complete."""
        inquiry = self._inquiry
        assert inquiry is not None
        burst = bytes(inquiry.burst)
        inquiry.burst.clear()
        counter = self._dialect.counter
        self._emit(MessageSeen("<", console(burst, counter=counter)))
        plausible = frozenset() if self._counted is None else {self._counted, (self._counted + 1) % COUNT_MODULUS}
        reading = read(burst, counter=counter, plausible=frozenset(plausible))
        if reading is None:
            self._emit(ProtocolFault("malformed", f"no answer to ENQ: {burst[:20].hex(' ')}"))
            reading = Reading()
        if reading.held is not None:
            self._flow(reading.held, now)
        if reading.cancelled:
            self._cancelled(now)
            return
        inquiry.acks += reading.acks
        inquiry.naks += reading.naks
        self._weigh(inquiry, reading, now)

    def _weigh(self, inquiry: Inquiry, reading: Reading, now: float) -> None:
        """Is it an answer, and is it believed?"""
        answered = reading.count is not None if self._dialect.counter else bool(reading.acks and inquiry.tries)
        if not answered:
            self._deadline = max(now, inquiry.asked_at + self._patience_s(inquiry)) if inquiry.tries else now
            return
        inquiry.answers.append(reading.count)
        needed = 1
        if self._dialect.counter and reading.count != inquiry.expected:
            needed = STEPS[self._phase].agree
        if len(inquiry.answers) < needed or len(set(inquiry.answers[-needed:])) > 1:
            inquiry.stragglers = False
            self._ask(now)
        elif len(inquiry.answers) < inquiry.tries:
            inquiry.stragglers = True
            self._deadline = now + self._dialect.enq_timeout_s
        else:
            self._conclude(now)

    def _conclude(self, now: float) -> None:
        """The answer is believed, and nothing more is to come."""
        inquiry, self._inquiry = self._inquiry, None
        assert inquiry is not None
        self._deadline = None
        self._proven_at = now
        self._verdicts[self._phase](inquiry, inquiry.answers[-1], now)

    def _on_no_answer(self, now: float) -> None:  # noqa: ARG002
        """What the table says of silence."""
        self._close("the machine does not answer")

    # --- what others do -----------------------------------------------------------------------------------------

    @abstractmethod
    def _flow(self, held: bool, now: float) -> None:
        """XOFF or XON."""

    @abstractmethod
    def _cancelled(self, now: float) -> None:
        """CAN from the machine."""

    @abstractmethod
    def _go_on(self, now: float) -> None:
        """An errand in between is over: the next frame, or idle."""

    # --- idle, state, end -----------------------------------------------------------------------------------------

    def _go_idle(self, now: float) -> None:
        """Nothing is on the wire."""
        self._phase, self._inquiry = Phase.IDLE, None
        if not self._ready:
            self._ready = True
            self._emit(LinkReady())
            self._tell(self._resting_status, now)
        self._arm_rest(now)

    def _arm_rest(self, now: float) -> None:
        """While nothing is on the wire: idle is told a little later, and now and then the machine is asked for."""
        self._deadline = None
        if self._phase is Phase.IDLE and self._status == "run":
            self._deadline = self._proven_at + IDLE_AFTER_S
        elif self._dialect.poll_interval_s > 0:
            self._deadline = now + self._dialect.poll_interval_s

    def _on_rest(self, now: float) -> None:
        if self._phase is Phase.IDLE and self._status == "run":
            self._tell(self._resting_status, now)
            self._arm_rest(now)
        else:
            self._poll(now)

    def _poll(self, now: float) -> None:
        self._enquire(Phase.POLL, now, expected=None if self._alarm is not None else self._counted)

    @property
    def _resting_status(self) -> Literal["alarm", "hold", "idle"]:
        """While nothing is on the wire."""
        if self._alarm is not None:
            return "alarm"
        return "hold" if self._xoff or self._hold else "idle"

    def _tell(self, status: Status, now: float) -> None:
        """The state, and the position as far as it is known."""
        self._status, self._told_at = status, now
        at = self._standing if self._flight is None else self._flight.position
        self._emit(StateReported(status, dict(at), alarm=self._alarm, complete=True))

    def _fail_queries(self, why: str) -> None:
        for token in (self._locate_token, self._clear_token):
            if token is not None:
                self._emit(CommandFailed(token, None, why))
        self._locate_token = self._clear_token = None

    def _answer_stops(self) -> None:
        """The machine stands: whoever asked for that is answered."""
        for token in (*self._hold_tokens, *self._stop_tokens):
            self._emit(CommandDone(token))
        self._hold_tokens.clear()
        self._stop_tokens.clear()

    def _close(self, reason: str) -> None:
        """Give the link up. A batch that was open stays open: the next epoch settles it."""
        self._fail_queries("the link was lost")
        flight, self._flight = self._flight, None
        if flight is not None and flight.token is not None:
            doubt = "; whether it was executed is not known" if flight.sent > flight.done else ""
            self._emit(CommandFailed(flight.token, None, f"the link was lost{doubt}"))
        for token in (*self._hold_tokens, *self._stop_tokens, *self._abort_tokens):
            self._emit(CommandFailed(token, None, "the machine does not answer: use its own emergency button"))
        for tokens in (self._hold_tokens, self._stop_tokens, self._abort_tokens):
            tokens.clear()
        self._phase, self._inquiry, self._deadline = Phase.CLOSED, None, None
        self._emit(LinkLost(reason))
