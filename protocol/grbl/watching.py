"""What status reports mean for the stream: third layer of the engine (see `traffic.py`).

The one rule: Idle proves that lines are executed only together with an empty planner, or when it was asked for after
the last acknowledgement (grbl II.4: a queue that waits for more lines is Idle as well).
"""

from collections.abc import Mapping

from protocol.engine import OpenWork
from protocol.events import (
    AccessoriesChanged,
    Alarm,
    CommandDone,
    OverridesChanged,
    PendantChanged,
    PinsChanged,
    ProgramEnded,
    StateReported,
    Status,
    ToolRequested,
)
from protocol.grbl import codes
from protocol.grbl.asking import named
from protocol.grbl.dialect import Dialect
from protocol.grbl.phases import STEPS, Phase
from protocol.grbl.realtime import FEED_HOLD, JOG_CANCEL
from protocol.grbl.reports import StatusReport
from protocol.grbl.resets import Resets
from protocol.grbl.traffic import CHECK_MODE, PARKED, STANDING

MODES: Mapping[bool, frozenset[Status]] = {True: frozenset({"idle", "run", "hold"}), False: frozenset({"check"})}
"""States in which the batches of a check (True), and all others, may not be inside."""
RESTS_OF_A_STAND = 2
"""Idle reports in a row, each asked for when nothing was open, that prove rest where the planner's room does not fit
what `[OPT:]` says."""


class Watching(Resets):
    """Reports, and what follows from them."""

    def __init__(self, dialect: Dialect, first_id: int, now: float, open_work: OpenWork | None) -> None:
        super().__init__(dialect, first_id, now, open_work)
        self._locates: list[tuple[int, int]] = []
        self._pins: frozenset[str] = frozenset()
        self._overrides: tuple[int, int, int] | None = None
        self._accessories: frozenset[str] = frozenset()
        self._told_rx_bytes: int | None = None
        self._substate: int | None = None
        self._reported_at = 0  # number of the question that the last report answers
        self._going_on: list[int] = []  # wishes to go on that wait for the machine to stand

    def _on_report(self, report: StatusReport, now: float) -> None:
        mark = self._poll.answered(now, self._interval_s(report))
        before, self._status = self._status, report.status
        self._substate, self._reported_at = report.substate, self._poll.asked
        if self._phase in (Phase.RESETTING, Phase.RESTARTING):
            return  # from before the reset
        self._watch_mode(report, now)
        self._tell(report)
        if report.status == "alarm" != before and (self._phase is Phase.READY or self._phase is Phase.STOPPING):
            self._raise_alarm()
        if report.mpg is not None and report.mpg != self._pendant:
            self._pendant = report.mpg
            self._executed.displaced()
            self._emit(PendantChanged(report.mpg))
        if self._card.seen(report, self._poll.asked):
            self._emit(ProgramEnded())
        self._watch_hold(report)
        # Once more where the `~` that was to end it did not arrive.
        unheard = self._left_tool_at is not None and self._poll.asked > self._left_tool_at + 1
        if report.status == "tool" and (before != "tool" or unheard):
            self._left_tool_at = None
            self._emit(ToolRequested(self._tool if report.tool is None or self._tool else report.tool))
        if report.status == "idle" and self._by_hand is not None and self._by_hand.empty:
            self._by_hand = None
        self._conclude(report, mark)
        for token, asked in self._locates:
            if self._poll.asked > asked:
                self._emit(CommandDone(token))
        self._locates = [kept for kept in self._locates if self._poll.asked <= kept[1]]
        self._watch_jogs(report)
        self._watch_phase(report, now)
        self._watch_answers(report, now)

    def _interval_s(self, report: StatusReport) -> float:
        """Until the next question. A job that streams says by itself how it goes on; where somebody waits for the
        machine (it is being held or stopped, it jogs, it homes) each report tells something."""
        dialect = self._dialect
        if report.status == "run" and self._batches and self._held_at is None and self._phase is Phase.READY:
            return dialect.stream_poll_s
        busy = report.status not in ("idle", "alarm", "sleep") or not self._window.empty
        return dialect.busy_poll_s if busy else dialect.idle_poll_s

    def _watch_mode(self, report: StatusReport, now: float) -> None:
        """Somebody else has switched the check mode, or a banner was garbled: what is a check must not move, and what
        is none must not be taken for executed. A reset at once drops what is inside."""
        batch = self._batches[0].batch if self._batches and self._phase is Phase.READY else None
        if batch is not None and report.status in MODES[batch.check]:
            self._reset("link", None, CHECK_MODE[batch.check], now)

    # --- events -------------------------------------------------------------------------------------------------

    def _tell(self, report: StatusReport) -> None:
        """As the vocabulary has it; positions in mm."""
        if report.status != "alarm":
            self._alarm = None
        elif self._alarm is None or (report.substate and report.substate != self._alarm.code):
            code = codes.alarm(report.substate or None, grblhal=self._flavour == "grblhal")
            message, emergency = f"{code.meaning}; {code.remedy}", code is codes.GRBLHAL_EMERGENCY
            self._alarm = Alarm(report.substate or None, None, message, emergency=emergency)
        machine = report.machine_position
        values = machine if machine is not None else report.work_position
        self._emit(
            StateReported(
                status=report.status,
                position={} if values is None else named(values, self._axes),
                feed_mm_min=report.feed_mm_min,
                spindle_rpm=report.spindle_rpm,
                alarm=self._alarm,
                frame="work" if machine is None and values is not None else "machine",
                work_offset=None if report.work_offset is None else named(report.work_offset, self._axes),
                substate=report.substate,
                tool=report.tool,
                homed=report.homed,
            )
        )
        if report.pins != self._pins:
            self._pins = report.pins
            self._emit(PinsChanged(report.pins))
        if report.overrides is not None and report.overrides != self._overrides:
            self._overrides = report.overrides
            self._emit(OverridesChanged(*report.overrides))
        if report.accessories is not None and report.accessories != self._accessories:
            self._accessories = report.accessories
            self._emit(AccessoriesChanged(report.accessories))

    # --- proofs -------------------------------------------------------------------------------------------------

    def _conclude(self, report: StatusReport, mark: int | None) -> None:
        """Which acknowledged lines this report proves to be executed."""
        free, blocks = report.planner_free, self._planner_blocks
        known = free is not None and blocks is not None
        if report.status in ("idle", "check"):
            self._poll.rested(mark)
            if known and free == blocks:
                self._came_to_rest(self._executed.count)
            elif mark is not None and (not known or self._poll.rests >= RESTS_OF_A_STAND):
                self._came_to_rest(mark)
            self._measure(report, mark)
        else:
            self._poll.rested(None)
            if known and free is not None and blocks is not None:
                self._settle(self._executed.in_planner(max(blocks - free, 0)))

    def _came_to_rest(self, number: int) -> None:
        self._settle(self._executed.at_rest(number))
        if self._window.empty:
            self._jogging = False

    def _measure(self, report: StatusReport, mark: int | None) -> None:
        """The room of an empty receive buffer (II.1: 128 in 1.1h, one less in older builds and in grblHAL). It is what
        the window is measured by: `[OPT:]` says the same number for both."""
        if mark is not None and self._window.empty and report.rx_free and self._told_rx_bytes is not None:
            self._window.capacity = max(1, min(self._told_rx_bytes, report.rx_free))

    def _learn_rx(self, told_bytes: int | None) -> None:
        """`[OPT:]`. One less until an idle report has shown how many an empty buffer takes."""
        self._told_rx_bytes = told_bytes
        if told_bytes:
            self._window.capacity = max(1, told_bytes - 1)

    # --- what waits for a state ---------------------------------------------------------------------------------

    @property
    def _slowing(self) -> bool:
        """A hold was asked for, and no report has said yet that the machine stands."""
        unseen = self._held_at is not None and self._reported_at <= self._held_at
        return unseen or (self._status == "hold" and self._substate == 1)

    def _go_on(self, token: int) -> None:
        """II.2: `~` is heard in Hold:0 and not while the machine decelerates; until then the wish waits."""
        if self._phase is Phase.STOPPING:
            self._fail(token, None, "it is being stopped")
        elif self._slowing:
            self._going_on.append(token)
        else:
            self._resume(token)

    def _hold(self, token: int | None = None) -> None:
        """A hold ends every wish to go on that is older."""
        self._give_up("it is held again")
        super()._hold(token)

    def _forget(self, why: str) -> None:
        self._give_up(why)
        if self._card.end():
            self._emit(ProgramEnded())
        super()._forget(why)

    def _give_up(self, why: str) -> None:
        tokens, self._going_on = self._going_on, []
        for token in tokens:
            self._fail(token, None, why)

    def _watch_hold(self, report: StatusReport) -> None:
        """A hold that was asked for before this report was asked for. Its byte may have been lost while the EEPROM was
        written (II.4): once more while it runs or would go on. Else it is over, ignored (Check), or was a jog's end."""
        if self._going_on and not self._slowing:
            tokens, self._going_on = self._going_on, []
            for token in tokens:
                self._resume(token)
            return
        if self._held_at is None or self._poll.asked <= self._held_at or report.status in ("hold", "door"):
            return
        if report.status == "run" or (report.status == "idle" and self._batches):
            self._hold()
        elif not self._refused:
            self._held_at = None

    def _watch_jogs(self, report: StatusReport) -> None:
        """II.7: unanswered jogs in the buffer run after the cancel, as new ones: cancel again while Jog persists."""
        if not self._cancels or self._poll.asked <= self._cancelled_at:
            return
        inside = any(errand.request is not None and errand.request.jog for errand, _, _ in self._active.entries)
        if report.status == "jog":
            self._lane.put(JOG_CANCEL)
        elif not inside:
            self._jogging = False
            for token in self._cancels:
                self._emit(CommandDone(token))
            self._cancels.clear()

    def _watch_phase(self, report: StatusReport, now: float) -> None:
        if self._phase in (Phase.ASKING, Phase.ATTENDING):
            if report.status in STANDING:
                self._read(now)
            else:
                self._attend()
        elif self._phase is Phase.READING and report.status in PARKED:
            self._attend()
        elif self._phase is Phase.LOCKED and report.status != "alarm":
            # It answers again: somebody has reset it at the machine and the banner was lost.
            self._read(now)
        elif self._phase is Phase.STOPPING and (self._held_at is None or self._poll.asked > self._held_at):
            self._watch_stop(report, now)

    def _watch_stop(self, report: StatusReport, now: float) -> None:
        still = report.substate in (0, None) if report.status == "hold" else (report.substate or 0) < 2
        match report.status:
            case "hold" | "door":
                if still:
                    self._stopped(now, parked=True)
            case "run" | "jog":
                self._lane.put(FEED_HOLD)
            case _:
                self._stopped(now, parked=False)

    def _watch_answers(self, report: StatusReport, now: float) -> None:
        """A line without an answer while nothing moves and the buffer is empty: it, or its answer, was lost."""
        head = self._window.head
        waits = report.rx_free is not None and report.rx_free < self._window.capacity  # lines are in its buffer
        standing = report.status in ("idle", "check", "alarm")
        if head is None or waits or not standing or self._phase is not Phase.READY:
            self._progress_at = now
            return
        if now - self._progress_at > self._dialect.answer_timeout_s + head[2].dwell_s:
            self._on_lost_answer(now)

    # --- silence ------------------------------------------------------------------------------------------------

    def _watch_silence(self, now: float) -> None:
        """II.2: no answer while homing, behind ALARM 1 and 2, while the EEPROM is written."""
        head = self._active.head
        tolerated = (
            STEPS[self._phase].silence == "tolerated"
            or self._status == "home"
            or self._pendant
            or (head is not None and head[0].request is not None and head[0].request.homing)
        )
        if tolerated:
            self._poll.heard(now)
        elif self._poll.silent_s(now) > self._dialect.report_timeout_s:
            self._close(f"no word from the controller for {self._dialect.report_timeout_s:g} s")
