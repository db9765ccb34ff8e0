"""The lowest layer of the engine: one exchange at a time, its tries, and the way back to idle.

Above it stand `flights.py` (commands), `settling.py` (lost fates) and `engine.py` (the five verbs and what messages
mean); each layer is one story, all of them one object. The one rule of this layer: exactly one deadline.
"""

import math
from collections import deque

from protocol.commands import Position
from protocol.elvinto.codec import printable
from protocol.elvinto.dialect import Dialect
from protocol.elvinto.ids import Ids
from protocol.elvinto.phases import STEPS, Flight, Phase, Turn, Unproven
from protocol.elvinto.reports import LOCKED, FileListing
from protocol.elvinto.settle import Case
from protocol.elvinto.wire import Wire
from protocol.events import BatchDone, CommandDone, CommandFailed, Event, LinkLost, LinkReady, MessageSeen

SLOWEST_ASK_S = 2.0
"""Queries under fresh IDs are spaced out up to this, so that answers slower than the interval find their question."""
MOST_ROUNDS = 5
"""Rounds of tries while something is heard, however garbled: noise is no silence."""


class Exchange:
    """State of the whole engine and the means to send, to try again, to be idle and to give up."""

    def __init__(self, dialect: Dialect, first_id: int, baud: int) -> None:
        self._dialect = dialect
        self._wire = Wire(dialect, baud)
        self._ids = Ids(first_id)
        self._events: deque[Event] = deque()
        self._phase = Phase.IDLE
        self._deadline: float | None = None
        self._heard_at = -math.inf
        self._noise_at = -math.inf  # something came that was no valid message
        self._standing: Position = {}  # where the machine stands while nothing runs, as far as known
        self._turn: Turn | None = None
        self._flight: Flight | None = None
        self._case: Case | None = None
        self._listing: FileListing | None = None
        self._query_token: int | None = None  # of a Locate, ListFiles or AskToolChange
        self._unproven: Unproven | None = None
        self._emergency: Turn | None = None
        self._emergency_tokens: list[int] = []
        self._greetings = 0  # READYs sent and not answered
        self._alarmed = False
        self._file: Flight | None = None  # RUN was RECEIVED; an ERROR may still refuse it
        self._file_idle_reports = 0
        self._ready = False  # LinkReady was reported
        self._initialised = False

    @property
    def news(self) -> bool:
        """Whether anybody has to be told: every message of a machine says something."""
        return True

    def _emit(self, event: Event) -> None:
        self._events.append(event)

    def _send(self, message: bytes, id: int, *, urgent: bool = False) -> float:
        """Queue a frame; answers the seconds that it takes on the line."""
        wire_s = self._wire.send(message, id, urgent=urgent)
        self._emit(MessageSeen(">", printable(message)))
        return wire_s

    def _enter(self, phase: Phase, now: float, *, rounds: int = 1) -> None:
        """Begin the exchange of a phase that stands in STEPS."""
        self._phase = phase
        self._turn = Turn(STEPS[phase], now, rounds)
        self._try(now)
        if phase is Phase.INIT and not self._dialect.init_acknowledged:
            self._enter(Phase.GREET, now)

    def _enter_next(self, now: float) -> None:
        """The exchange has had its answer: the phase that the table names."""
        assert self._turn is not None
        phase = self._turn.step.then
        if phase is Phase.REPORT and not self._dialect.report_moves:
            phase = STEPS[phase].then
        self._enter(phase, now)

    def _try(self, now: float) -> None:
        """Send the phase's message once (more)."""
        assert self._turn is not None
        turn, step = self._turn, self._turn.step
        # Noise is a garbled answer, so the question was executed; only silence and bare acknowledgements were in vain.
        turn.in_vain = turn.in_vain + 1 if turn.ids and self._noise_at < turn.asked_at else 0
        turn.asked_at = now
        id = self._ids.probe() if step.ids == "probe" else self._ids.take(turn.in_vain)
        if step.awaits == "ready":
            self._greetings += 1
        turn.ids.append(id)
        if step.ids == "fresh":  # the answer to this try counts, not to one before it
            turn.received, turn.ended, turn.state = False, False, None
        wait_s = self._dialect.retry_interval_s
        if step.ids == "fresh":
            wait_s = max(wait_s, min(wait_s * (1 + len(turn.ids)) / 2, SLOWEST_ASK_S))
        self._deadline = now + self._send(step.message, id) + wait_s

    def _try_again(self, now: float) -> None:
        """No answer in time: once more, or what the table says of silence."""
        assert self._turn is not None
        step = self._turn.step
        if step.awaits == "ack" and self._turn.received:
            self._enter_next(now)  # RECEIVED came, OK was lost
        elif len(self._turn.ids) < (self._dialect.max_retries if step.tries is None else step.tries):
            self._try(now)
        else:
            self._tries_are_over(now)

    def _tries_are_over(self, now: float) -> None:
        """What the table says of silence, if silence it was."""
        turn = self._turn
        assert turn is not None
        if max(self._heard_at, self._noise_at) > turn.began_at and turn.rounds < MOST_ROUNDS:
            self._enter(self._phase, now, rounds=turn.rounds + 1)
        elif turn.step.on_silence is Phase.CLOSED:
            self._close("the machine does not answer")
        elif turn.step.on_silence is Phase.IDLE:
            self._fail_query("the machine did not answer; try again")
            self._go_idle(now)
        else:
            self._enter(turn.step.on_silence, now)

    def _enter_idle(self) -> None:
        self._phase, self._turn, self._deadline = Phase.IDLE, None, None

    def _go_idle(self, now: float) -> None:
        """Nothing is on the wire. What must be proven before the next command is proven first."""
        self._enter_idle()
        if not self._ready:
            self._ready = True
            self._emit(LinkReady())
        if self._alarmed or self._emergency is not None:
            return
        if not self._ids.proven:
            self._enter(Phase.SYNC, now)
        elif self._dialect.poll_interval_s > 0:
            self._deadline = now + self._dialect.poll_interval_s

    def _poll(self, now: float) -> None:
        """Nothing was heard for a while: a question that moves nothing shows whether the machine is there."""
        self._enter(Phase.SYNC, now)

    def _lock(self, now: float) -> None:
        """READY is answered and nothing is executed: an alarm whose STATE was lost or came before this epoch."""
        self._alarmed = True
        self._ids.doubt()
        self._emit(LOCKED)
        self._fail_query("the machine is in alarm")
        self._go_idle(now)

    def _fail_query(self, why: str) -> None:
        """A query by hand that cannot be answered any more."""
        self._listing = None
        if self._query_token is not None:
            token, self._query_token = self._query_token, None
            self._emit(CommandFailed(token, None, why))

    def _report_file_begun(self) -> None:
        """The program from the SD card runs, or may have run: RUN was RECEIVED and no ERROR came."""
        if self._file is not None and self._file.token is not None:
            self._emit(CommandDone(self._file.token))
        self._file = None

    def _report_unproven(self, position: Position) -> None:
        """The batch is done, whatever may come now: its OK came."""
        if self._unproven is not None:
            batch, self._unproven = self._unproven, None
            self._emit(BatchDone(batch.id, batch.inferred, position if batch.locate and position else None))

    def _close(self, reason: str) -> None:
        """Give the link up. What was open stays open: the next epoch settles it."""
        if self._unproven is not None and not self._unproven.repeated:
            self._report_unproven({})
        self._report_file_begun()
        self._fail_query("the link was lost")
        if self._flight is not None and self._flight.token is not None:
            self._emit(
                CommandFailed(self._flight.token, None, "the link was lost; whether it was executed is not known")
            )
        if self._emergency is not None:
            self._emergency = None
            for token in self._emergency_tokens:
                self._emit(CommandFailed(token, None, "the machine does not answer: use its own emergency button"))
            self._emergency_tokens.clear()
        self._enter_idle()
        self._phase = Phase.CLOSED
        self._emit(LinkLost(reason))
