"""The handshake, resets, alarms, the end of the link: second layer of the engine (see `traffic.py`).

The one rule: between 0x18 and the banner every answer is ignored, and what was in the controller is told, batch by
batch: lines certainly executed, lines certainly not, and the doubt between them.
"""

from typing import Final, Literal, TypeAlias

from protocol.commands import ReadFirmware, ReadOffsets, ReadSettings
from protocol.engine import OpenWork
from protocol.events import (
    Alarm,
    BatchFailed,
    CommandDone,
    ControllerReset,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    LineRefused,
    LinkLost,
    LinkReady,
    MachineRestarted,
    ProtocolFault,
    StateReported,
)
from protocol.grbl import asking, codes
from protocol.grbl.asking import Request
from protocol.grbl.dialect import Dialect
from protocol.grbl.errands import Errand
from protocol.grbl.flow import Flow
from protocol.grbl.messages import AlarmRaised, Banner
from protocol.grbl.phases import Phase
from protocol.grbl.realtime import SOFT_RESET
from protocol.grbl.traffic import HANDSHAKE_TRIES

Reason: TypeAlias = Literal["error", "alarm", "estop", "restart", "stop", "link"]

RESET_TRIES: Final = 3
ASKING_S: Final = 5.0
"""Silence after which nobody is there: five questions."""
RESTART_WAIT_S: Final = 2.0
"""A controller that was to reset itself and says no banner has not: $C off takes 30 ms, $RST some 100 ms."""


class Resets(Flow):
    """What begins, breaks and ends."""

    def __init__(self, dialect: Dialect, first_id: int, now: float, open_work: OpenWork | None) -> None:
        super().__init__(dialect, first_id)
        self._open_work = open_work
        self._ready = False
        self._restarted = False  # a banner was seen in this epoch that nobody had asked for
        self._settings_read = False
        self._reset_tokens: list[int] = []
        self._reset_tries = 0
        self._position_kept = True
        self._stop_reason: tuple[Reason, int | None, str] = ("stop", None, "stopped by hand")
        if open_work is not None and open_work.batches:
            self._emit(FateUnknown(tuple(batch.id for batch in open_work.batches)))
        if dialect.resets_on_open:
            self._phase = Phase.OPENING
            self._due["phase"] = now + dialect.banner_wait_s
        else:
            self._ask(now)

    # --- handshake ----------------------------------------------------------------------------------------------

    def _ask(self, now: float) -> None:
        self._phase = Phase.ASKING
        self._poll.begin(now)
        self._due["phase"] = now + ASKING_S

    def _on_nobody(self, _: float) -> None:
        self._close("nobody answers to ?: no controller, another baud rate, or an alarm that needs a reset")

    def _read(self, now: float) -> None:
        """Ask for everything that is to be known before lines are taken."""
        self._phase = Phase.READING
        self._poll.begin(now)
        questions = [asking.question(ReadFirmware, None), asking.modal_question(), asking.question(ReadOffsets, None)]
        if not self._settings_read:
            questions.append(asking.question(ReadSettings, None))
        for asked in questions:
            self._hand.append(Errand(self._lines(asked.lines), request=asked))
        self._due["phase"] = now + self._dialect.answer_timeout_s

    def _attend(self) -> None:
        """It parses no lines now. What runs in it can be held and reset by hand."""
        self._phase = Phase.ATTENDING
        self._due.pop("phase", None)
        self._window.clear()
        for errand in self._internal:
            self._hand.remove(errand)
        self._announce()

    def _read_on(self, now: float) -> None:
        """An answer came while READING: the next question has its own time, the last one ends the handshake."""
        self._due["phase"] = now + self._dialect.answer_timeout_s
        if not self._internal:
            self._become_ready(now)

    @property
    def _internal(self) -> list[Errand]:
        return [errand for errand in self._hand if errand.token is None]

    def _on_reading_silence(self, now: float) -> None:
        """A question without an answer: once more, then without it; nothing at all is known without `$I`."""
        self._window.clear()
        errand = self._internal[0]
        asked = errand.request
        assert asked is not None
        asked.tries += 1
        asked.heard.clear()
        errand.sent = errand.answered = 0
        if asked.tries > HANDSHAKE_TRIES:
            self._hand.remove(errand)
            if asked.lines[0] == "$I":
                self._close("the controller reports its state but answers no line; reset it")
                return
        self._read_on(now)

    def _become_ready(self, now: float) -> None:
        self._phase = Phase.READY
        self._due.pop("phase", None)
        self._progress_at = now
        self._tell_fate()
        self._announce()

    def _announce(self) -> None:
        if not self._ready:
            self._ready = True
            self._emit(LinkReady())

    def _tell_fate(self) -> None:
        """What the epoch before had in the controller cannot be asked for: Grbl has no memory of lines."""
        work, self._open_work = self._open_work, None
        if work is None:
            return
        ids = tuple(batch.id for batch in work.batches)
        if ids or self._restarted:
            why = "the controller was reset" if self._restarted else "the link broke while lines were in the controller"
            self._emit(FateInDoubt((), ids, why))
        else:
            self._emit(FateSettled((), ()))

    # --- resets -------------------------------------------------------------------------------------------------

    def _reset(self, reason: Reason, code: int | None, message: str, now: float, *, parked: bool = False) -> None:
        """0x18, at once. `parked`: the controller parses nothing any more (Hold:0, II.4)."""
        self._fail_batches(reason, code, message, parked=parked)
        self._forget(message)
        self._lane.put(SOFT_RESET)
        # Asleep the motors are without current; Grbl itself wakes up in alarm.
        kept = self._status != "sleep" and (self._alarm is None or self._alarm_kept_position)
        # Pressed twice: the alarm that answered the first one (ALARM:3) has said it already.
        self._position_kept = kept and (self._phase is not Phase.RESETTING or self._position_kept)
        self._phase = Phase.RESETTING
        self._reset_tries = 1
        self._due["phase"] = now + self._dialect.reset_wait_s

    @property
    def _alarm_kept_position(self) -> bool:
        return self._alarm is not None and not codes.alarm(self._alarm.code).position_lost

    def _on_no_banner(self, now: float) -> None:
        if self._reset_tries >= RESET_TRIES:
            self._close("the controller does not answer to a reset: use the machine's own emergency button")
            return
        self._reset_tries += 1
        self._lane.put(SOFT_RESET)
        self._due["phase"] = now + self._dialect.reset_wait_s

    def _on_no_restart(self, now: float) -> None:
        """It was to reset itself and has not said so: everything is read anew all the same."""
        self._forget("the controller was to reset itself")
        self._read(now)

    def _restarting(self, now: float) -> None:
        self._fail_batches("restart", None, "the controller resets itself")
        self._settings_read = False
        self._await_restart(now, position_kept=True)

    def _await_restart(self, now: float, *, position_kept: bool) -> None:
        """What goes out before its banner may be lost, or may be executed without an answer that counts."""
        self._phase, self._position_kept = Phase.RESTARTING, position_kept
        self._due["phase"] = now + RESTART_WAIT_S

    def _stop(self, reason: Reason, code: int | None, message: str, now: float) -> None:
        """Come to a stand first; then the reset keeps the position."""
        self._stop_reason = (reason, code, message)
        if self._phase in (Phase.READY, Phase.READING, Phase.ATTENDING) and self._status != "home":
            self._phase = Phase.STOPPING
            self._hold()
            self._poll.begin(now)
            self._due["phase"] = now + self._dialect.stop_timeout_s
        elif self._phase is not Phase.STOPPING:
            self._reset(reason, code, message, now)

    def _stop_for(self, refused: LineRefused, now: float) -> None:
        self._stop("error", refused.code, f"line {refused.index + 1} of the batch was refused: {refused.message}", now)

    def _stopped(self, now: float, *, parked: bool) -> None:
        """It stands (or took too long to)."""
        self._reset(*self._stop_reason, now, parked=parked)

    def _on_banner(self, banner: Banner, now: float) -> None:
        """grbl II.4: RX, planner and parser state are gone."""
        if banner.flavour == "grblhal":
            self._flavour = "grblhal"
        asked_for = self._phase in (Phase.RESETTING, Phase.RESTARTING)
        if asked_for:
            self._emit(ControllerReset(position_kept=self._position_kept))
        elif self._ready or self._open_work is not None:
            self._restarted = True
            self._fail_batches("restart", None, "the controller has restarted")
            self._emit(MachineRestarted(banner.text))
        self._forget("the controller was reset")
        self._blocks.trust()
        if not asked_for:
            self._settings_read = False
        for token in self._reset_tokens:
            self._emit(CommandDone(token))
        self._reset_tokens.clear()
        self._alarm = None
        self._status = None
        self._lane.take()
        self._read(now)

    def _forget(self, why: str) -> None:
        """Everything that was in the controller, and everything by hand."""
        for errand in tuple(self._hand):
            self._drop(errand, f"not executed: {why}" if errand.sent == 0 else f"it may not have been executed: {why}")
        for window in (self._window, self._by_hand):
            if window is not None:
                window.clear()
        self._by_hand = None
        self._executed.clear()
        self._held_at, self._refused, self._jogging = None, False, False
        for token in self._cancels:
            self._emit(CommandDone(token))
        self._cancels.clear()

    # --- failures -----------------------------------------------------------------------------------------------

    def _fail_batches(self, reason: Reason, code: int | None, message: str, *, parked: bool = False) -> None:
        """`parked`: beyond the line that may be half-way planned, no unanswered line was parsed or will be."""
        self._settle(self._executed.behind(self._planner_blocks))
        head = self._window.head
        for errand in self._batches:
            assert errand.batch is not None
            errand.failed = True
            touched = errand.sent
            if parked:
                touched = errand.answered + (head is not None and head[0] is errand)
            self._emit(BatchFailed(errand.batch.id, reason, code, message, errand.done, touched))
        self._batches.clear()
        self._executed.clear()

    def _on_alarm(self, raised: AlarmRaised, now: float) -> None:
        """`ALARM:N`: data, not a fault. What was inside is refused (3-9) or dropped by the reset (1, 2), II.4."""
        code = codes.alarm(raised.code, grblhal=self._flavour == "grblhal")
        if self._phase is Phase.RESETTING:
            self._position_kept = self._position_kept and not code.position_lost
            return
        message = raised.text or f"{code.meaning}; {code.remedy}"
        self._alarm = Alarm(raised.code, None, message, emergency=code is codes.GRBLHAL_EMERGENCY)
        self._status = "alarm"
        self._emit(StateReported("alarm", {}, alarm=self._alarm, frame="machine"))
        self._raise_alarm()
        if self._phase is Phase.STOPPING:
            self._stopped(now, parked=True)
        elif raised.code in codes.HOMING_FAILED and self._phase in (Phase.READY, Phase.ATTENDING):
            self._await_restart(now, position_kept=False)
            self._announce()
        elif code.needs_reset and self._phase is not Phase.OPENING:
            self._phase = Phase.LOCKED
            self._due.pop("phase", None)
            self._announce()

    def _raise_alarm(self) -> None:
        """Whether its line has come or only a report says so: nothing that was asked before it goes out after it."""
        alarm = self._alarm
        assert alarm is not None
        self._fail_batches("alarm", alarm.code, alarm.message, parked=True)
        for errand in tuple(self._hand):
            if errand.token is not None:
                self._drop(errand, f"alarm {alarm.code}: {alarm.message}" if alarm.code else alarm.message)
        self._jogging, self._held_at, self._refused = False, None, False

    def _on_lost_answer(self, now: float) -> None:
        """The machine stands, nothing is in its buffer, and a line has no answer: bytes were lost one way or the other.
        Half a line may stand in the controller. A reset at rest keeps the position and clears it."""
        message = "an answer was lost on the wire; which line had which answer is not certain any more"
        self._emit(ProtocolFault("lost_answer", message))
        self._reset("link", None, message, now)

    def _close(self, reason: str) -> None:
        """Give the link up. What was open stays open: the next epoch tells its fate."""
        self._phase = Phase.CLOSED
        self._due.clear()
        for errand in tuple(self._hand):
            self._drop(errand, "the link was lost; whether it was executed is not known")
        for token in (*self._reset_tokens, *self._cancels, *self._lane.take()[1]):
            self._fail(token, None, "the controller does not answer: use the machine's own emergency button")
        self._reset_tokens.clear()
        self._cancels.clear()
        self._emit(LinkLost(reason))

    def _submit_request(self, asked: Request) -> None:
        self._hand.append(Errand(self._lines(asked.lines), token=asked.token, request=asked))
