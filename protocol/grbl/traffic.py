"""Lines on their way and their answers: the lowest layer of the engine.

`settling.py` knows resets, alarms and the handshake, `watching.py` status reports, `engine.py` the five verbs.
The one rule: a line goes out only when every gate is open and the window has room, and each answer goes to the oldest
line without one.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, TypeAlias

from protocol.commands import CheckMode, ListFiles, RunFile
from protocol.events import (
    Alarm,
    BatchDone,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    Event,
    LineRefused,
    ProtocolFault,
    StateReported,
    Status,
)
from protocol.grbl import asking, codes
from protocol.grbl.asking import Request
from protocol.grbl.blocks import BlockCounter
from protocol.grbl.card import CardRun
from protocol.grbl.dialect import Dialect
from protocol.grbl.errands import Errand, Executed
from protocol.grbl.lane import Lane
from protocol.grbl.lines import Line, read_lines
from protocol.grbl.messages import Flavour
from protocol.grbl.phases import READING, READY, STEPS, Phase
from protocol.grbl.polling import Poll
from protocol.grbl.realtime import CYCLE_START, FEED_HOLD, SOFT_RESET, STATUS
from protocol.grbl.window import Entry, Window

RECORDED_MESSAGES = 400
"""Bytes and lines kept for the job's events at a fault: some seconds of a full stream, 40 KB."""
MAX_BATCHES = 65
"""Batches that may be with the engine: enough that the planner never runs dry where each holds a single line. A job
uses one place less (server/config/grbl.py), so that what is asked by hand beside it can be handed over."""
MAX_BY_HAND = 8
HANDSHAKE_TRIES = 2

STANDING: frozenset[Status] = frozenset({"idle", "alarm", "check", "tool"})
PARKED: frozenset[Status] = frozenset({"hold", "door", "sleep", "home"})
"""The main program of the controller is parked: it parses no line (II.4)."""
SHUT_BY: Mapping[Status, str] = {
    "alarm": "alarm",
    "hold": "held",
    "door": "held",
    "tool": "tool",
    "jog": "jogging",
    "home": "homing",
    "sleep": "homing",
}
"""The gate that a state shuts."""
CHECK_MODE: Mapping[bool, str] = {
    True: "the controller is not in its check mode: the lines of a check would be executed",
    False: "the controller is in its check mode: the lines of the job would be answered and not executed",
}
"""What stands against a batch, by its `check`."""


Seen: TypeAlias = tuple[float, Literal[">", "<"], str]
"""When, which way, what."""


def _first_waiting(errands: Iterable[Errand]) -> Errand | None:
    """The first of which a line was not sent yet."""
    for errand in errands:
        if errand.sent < len(errand.lines) and not errand.failed:
            return errand
    return None


class Traffic(ABC):
    """State of one epoch, and the stream."""

    def __init__(self, dialect: Dialect, first_id: int) -> None:
        self._dialect = dialect
        self._phase = Phase.CLOSED
        self._next_id = first_id
        self._events: deque[Event] = deque()
        self.news = True
        self._quiet = False  # all that may go out has been taken
        self._seen: list[Seen] = []  # for the console, not handed over yet
        self._recorded: deque[Seen] = deque(maxlen=RECORDED_MESSAGES)  # what was, and what no console shows
        self._due: dict[str, float] = {}
        self._lane = Lane()
        self._poll = Poll()
        self._window = Window(one_by_one=dialect.streaming == "line")
        self._by_hand: Window | None = None  # grblHAL's second input buffer, after the tool change was acknowledged
        self._batches: deque[Errand] = deque()
        self._hand: deque[Errand] = deque()
        self._proofs = Executed()
        self._flowing: Errand | None = None  # of its answers some are not counted yet (flow.py)
        self._blocks = BlockCounter()
        self._status: Status | None = None
        self._alarm: Alarm | None = None
        self._held_at: int | None = None  # question number at which a hold was asked for
        self._refused = False
        self._pendant = False
        self._jogging = False
        self._cancels: list[int] = []
        self._cancelled_at = 0
        self._card = CardRun()
        self._tool = 0
        self._left_tool_at: int | None = None  # question number at which a tool change was ended
        self._flavour: Flavour = "grbl"
        self._axes: tuple[str, ...] = ()
        self._planner_blocks: int | None = None
        self._progress_at = 0.0

    # --- what higher layers do ----------------------------------------------------------------------------------

    @abstractmethod
    def _restarting(self, now: float) -> None:
        """The controller resets itself behind this ok."""

    @abstractmethod
    def _stop_for(self, refused: LineRefused, now: float) -> None:
        """The job's policy is to stop at a refused line."""

    # --- small things -------------------------------------------------------------------------------------------

    def _emit(self, event: Event) -> None:
        self._events.append(event)
        self.news = True

    @property
    def _executed(self) -> Executed:
        """What is proven, with all that was answered."""
        self._count()
        return self._proofs

    def _count(self) -> None:
        if self._flowing is not None:
            self._proofs.planned(self._flowing, self._blocks.least_mm)
            self._flowing = None

    def _fail(self, token: int | None, code: int | None, message: str) -> None:
        if token is not None:
            self._emit(CommandFailed(token, code, message))

    @property
    def _active(self) -> Window:
        """Where lines go now."""
        return self._window if self._by_hand is None else self._by_hand

    def _hold(self, token: int | None = None) -> None:
        self._lane.put(FEED_HOLD, token)
        self._held_at = self._poll.asked

    def _resume(self, token: int | None) -> None:
        """`~`. After a tool change the first input buffer goes on (grblHAL, M6)."""
        self._lane.put(CYCLE_START, token)
        self._held_at, self._refused = None, False
        if self._status == "tool":
            self._left_tool_at = self._poll.asked
        if self._by_hand is not None:
            for entry in self._by_hand.entries:
                self._drop(entry[0], "the program went on before it was answered")
            self._by_hand = None

    def _drop(self, errand: Errand, why: str) -> None:
        """A command by hand that will not be executed any more."""
        if not errand.failed:
            errand.failed = True
            self._fail(errand.token, None, why)
        if errand in self._hand:
            self._hand.remove(errand)

    # --- out ----------------------------------------------------------------------------------------------------

    def _write(self, now: float) -> bytes:
        """The real-time lane, then as many lines as may go. Nothing behind a soft reset: it would be lost."""
        out = b"" if self._lane.idle else self._take_lane(now)
        if SOFT_RESET not in out:
            while (errand := self._next_errand()) is not None and (data := self._launch(errand, now)):
                out += data
                if errand.batch is not None and errand.sent < len(errand.lines):
                    break  # the window is full
        return out

    def _take_lane(self, now: float) -> bytes:
        urgent, tokens = self._lane.take()
        for token in tokens:
            self._emit(CommandDone(token))
        if STATUS in urgent:
            self._poll.sent(now, self._executed.count if self._window.empty else None)
        for byte in urgent:
            shown = self._recorded if byte == STATUS[0] else self._seen
            shown.append((now, ">", chr(byte) if 0x20 < byte < 0x7F else f"0x{byte:02X}"))
        return urgent

    def _launch(self, errand: Errand, now: float) -> bytes:
        """The next line of an errand, of a batch as many as there is room for; nothing where there is none."""
        window = self._window if self._by_hand is None else self._by_hand
        first, batch = errand.sent, errand.batch
        data = b""
        for line in window.fill(errand, first + 1 if batch is None else len(errand.lines)):
            if line.tool is not None:
                self._tool = line.tool
            self._seen.append((now, ">", line.text))
            data += line.data
        if not data:
            return data
        self._progress_at = now
        if batch is not None and not first:
            self._emit(BatchSent(batch.id, 1))
        elif (asked := errand.request) is not None:
            self._jogging |= asked.jog
            if asked.homing:  # while it homes it says nothing of itself (II.2)
                self._status = "home"
                self._emit(StateReported("home", {}, frame="machine"))
        return data

    def _next_errand(self) -> Errand | None:
        """Whose line goes out next, when there is room for it."""
        if (self._phase is not READY and self._phase is not READING) or self._pendant or self._card.running:
            return None  # gates "pendant" and "card"
        if self._hand and (errand := _first_waiting(self._hand)) is not None:
            return errand if self._hand_may_go(errand) else None  # gate "by hand"
        return _first_waiting(self._batches) if self._gate() is None else None

    def _gate(self) -> str | None:
        """The gate (phases.GATES) that holds lines of programs back, or None."""
        if self._refused:
            return "refused"
        if self._held_at is not None:
            return "held"
        if self._by_hand is not None:
            return "tool"
        if self._jogging:
            return "jogging"
        return SHUT_BY.get(self._status) if self._status is not None else None

    def _hand_may_go(self, errand: Errand) -> bool:
        asked = errand.request
        acknowledged = self._by_hand is not None
        if self._status in ("hold", "door", "sleep", "home") or (self._status == "tool" and not acknowledged):
            return False
        if asked is None:
            return acknowledged or self._gate() is None
        if asked.jog:
            still = self._executed.empty or acknowledged
            return not self._cancels and still and self._status in ("idle", "jog", "tool")
        if asked.needs_idle:
            at_rest = self._status in STANDING and self._executed.empty and not self._jogging
            return acknowledged or at_rest
        return True

    # --- in -----------------------------------------------------------------------------------------------------

    def _answered(self, code: int | None, text: str, now: float, *, refused: bool) -> None:
        """An ok or an error: the oldest line without an answer has it."""
        phase = self._phase
        reading = phase is READING
        if phase is not READY and not STEPS[phase].counts:
            return  # grbl II.3: a reset is under way, or lines of the epoch before are being answered
        window = self._window if self._by_hand is None else self._by_hand
        if reading and not refused and self._unanswered(window.head):
            return  # the ok of a line from before this epoch; our question is not answered before its rows came
        entry = window.answer()
        if entry is None:
            self._emit(ProtocolFault("unasked_answer", f"error:{code}" if refused else "ok without a line"))
            return
        self._progress_at = now
        errand = entry[0]
        asked = errand.request
        self._count()  # what was answered before this one
        errand.answered += 1
        if errand.failed:
            return
        if asked is not None:
            self._request_answered(errand, asked, code, text, now, refused=refused)
        else:
            self._block_answered(entry, code, text, now, refused=refused)

    def _unanswered(self, entry: Entry | None) -> bool:
        """It is a question of which no row has come."""
        asked = None if entry is None else entry[0].request
        return asked is not None and not asked.complete

    def _request_answered(
        self, errand: Errand, asked: Request, code: int | None, text: str, now: float, *, refused: bool
    ) -> None:
        if refused and asked.token is None and asked.tries < HANDSHAKE_TRIES:
            # Half a line of an epoch before may have stood in front of ours.
            asked.tries += 1
            asked.heard.clear()
            errand.sent = errand.answered = 0
        elif refused:
            self._hand.remove(errand)
            errand.failed = True
            if isinstance(asked.command, ListFiles):
                self._report(asking.refused_card(asked, codes.error(code, text)))
            else:
                self._fail(errand.token, code, codes.error(code, text))
        elif errand.answered == len(errand.lines):
            self._hand.remove(errand)
            self._report(asking.results(asked, self._flavour, self._axes))
            if asked.jog or asked.homing:
                self._executed.displaced()
            if asked.resets:
                self._restarting(now)
            elif isinstance(asked.command, RunFile):
                self._card.begin(self._poll.asked)
            elif isinstance(asked.command, CheckMode):
                self._status = "check"  # known before the next report: a wish to leave it must not be taken for done
                self._emit(StateReported("check", {}, frame="machine"))

    def _report(self, events: Iterable[Event]) -> None:
        for event in events:
            self._emit(event)

    def _block_answered(self, entry: Entry, code: int | None, text: str, now: float, *, refused: bool) -> None:
        errand, index, line = entry
        reach_mm, certain = errand.reach_mm, False
        if refused or not line.steady or errand.batch is None:
            self._executed.displaced()
            if self._batches and (refused or errand.batch is None):
                self._blocks.doubt(line.text)
        elif reach_mm:
            certain = reach_mm[index] >= self._blocks.least_mm
            if not certain:
                self._blocks.heed(line.text)
        rests = (line.syncs and not refused) or self._status == "check"
        ended = self._executed.acknowledged(
            errand, inert=refused or line.inert, certain=certain, rests=rests, planner=self._planner_blocks
        )
        if errand.batch is not None and errand.answered == len(errand.lines):
            self._emit(BatchReceived(errand.batch.id, begins=False))
        if refused:
            self._refuse(entry, code, text, now)
        if ended:
            self._settle(ended)

    def _refuse(self, entry: Entry, code: int | None, text: str, now: float) -> None:
        """grbl II.4: the controller goes on executing what is already in its buffer."""
        errand, index, line = entry
        batch = errand.batch
        message = codes.error(code, text)
        if batch is None:
            errand.failed = True
            self._hand.remove(errand)
            self._fail(errand.token, code, f"block {index + 1}, {line.text}: {message}")
            return
        ignored = batch.on_error == "ignore" and (not batch.ignored_errors or code in batch.ignored_errors)
        action = "ignored" if ignored else "stopped" if batch.on_error == "stop" else "held"
        inside = tuple([(other.batch.id, at) for other, at, _ in self._window.entries if other.batch is not None])
        refused = LineRefused(batch.id, index, line.text, code, message, action, inside)  # type: ignore[arg-type]
        self._emit(refused)
        if action == "held":
            self._hold()
            self._refused = True
        elif action == "stopped":
            self._stop_for(refused, now)

    def _settle(self, ended: Iterable[Errand]) -> None:
        """Errands of which the last line is known to be executed."""
        for errand in ended:
            if errand.failed:
                continue
            if errand.batch is not None and errand in self._batches:
                self._batches.remove(errand)
                self._emit(BatchDone(errand.batch.id))
            elif errand in self._hand:
                self._hand.remove(errand)
                assert errand.token is not None
                self._emit(CommandDone(errand.token))

    def _lines(self, texts: Sequence[str]) -> tuple[Line, ...]:
        return read_lines(texts, self._dialect.line_chars)
