"""Batches whose fate was lost, and a machine that has restarted: the steps of elvinto §5.4 in their order.

Third layer of the engine (see `exchange.py`); `settle.py` holds the evidence and gives the verdicts.
The one rule: INIT is never sent while a case is open, and every case ends in exactly one report.
"""

import math
from typing import Literal

from protocol.elvinto.codec import encode_gcode
from protocol.elvinto.flights import Flights
from protocol.elvinto.ids import came_of
from protocol.elvinto.phases import Flight, Phase
from protocol.elvinto.settle import Case
from protocol.events import (
    BatchDone,
    BatchFailed,
    CommandDone,
    CommandFailed,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    MachineRestarted,
    StateReported,
)

RUNNING_PAUSE_S = 0.5
"""After a STATE `run` no probe goes out for so long: the machine executes and would not take it."""


class Settling(Flights):
    """Cases: opened by a silent flight or by the work that a new epoch inherits."""

    def _open_case(self, case: Case, now: float) -> None:
        self._case = case
        self._ids.doubt()
        if self._manual_flight is None and case.batches and not case.accepted:
            self._emit(FateUnknown(case.remaining_ids))
        remaining = case.remaining
        if remaining and remaining[0].ends_program:
            # A machine that has executed M30 has no memory and would answer the restart probe (elvinto §5.6).
            self._settle_next(now)
        else:
            self._enter(Phase.PROBE, now)

    @property
    def _manual_flight(self) -> Flight | None:
        """The flight whose fate is open, where it is a command by hand."""
        return self._flight if self._flight is not None and self._flight.token is not None else None

    def _on_probe_unanswered(self, now: float) -> None:
        """A round of the restart probe is over (elvinto §5.4.1)."""
        assert self._case is not None
        restarted = self._case.probe.end_round()
        if restarted is None:
            self._try(now)
        elif restarted:
            self._restarted("the machine executed the restart probe", now)
        else:
            self._settle_next(now)

    def _machine_runs(self, now: float) -> None:
        """STATE `run` while a case is open: no probe is needed, it has not restarted and is not done."""
        assert self._case is not None
        if self._phase is Phase.PROBE:
            self._case.probe.still_running()
            self._deadline = now + RUNNING_PAUSE_S
        elif self._phase is Phase.ASK:
            self._case.ask_until = max(self._case.ask_until, now + self._ask_patience_s)

    def _settle_next(self, now: float) -> None:
        """Repeat what may be repeated, else ask where the machine stands (elvinto §5.4.2, §5.4.3)."""
        case = self._case
        assert case is not None
        batch = case.next_to_repeat(self._dialect.position_tolerance_mm)
        if case.batches and not case.remaining:
            self._settled(now)
        elif batch is not None and now <= case.move_until:
            flight = self._flight if self._flight is not None and self._flight.id == batch.id else None
            self._flight = flight or Flight(batch, encode_gcode(batch.blocks), dict(case.start))
            self._flight.attempts = 0
            self._send_flight(now)
        else:
            self._ask(now)

    def _ask(self, now: float) -> None:
        assert self._case is not None
        self._case.ask_until = now + self._case.expected_s + self._ask_patience_s
        self._enter(Phase.ASK, now)

    @property
    def _ask_patience_s(self) -> float:
        return self._dialect.probe_after_s + self._dialect.max_retries * self._dialect.retry_interval_s

    def _on_ask_unanswered(self, now: float) -> None:
        """A machine that still executes takes the question when it is done; one in alarm never does."""
        assert self._case is not None
        if now < self._case.ask_until:
            self._try(now)
        else:
            self._case.ask_until = now + self._ask_patience_s
            self._tries_are_over(now)

    def _located(self, report: StateReported, now: float) -> None:
        """W95 was executed, so nothing else runs any more; the report says where the machine stands."""
        case = self._case
        assert case is not None
        if case.located(report.position, self._dialect.position_tolerance_mm):
            self._settled(now)
        elif case.batches:
            self._in_doubt("the position fits none, or more than one, of the places where a batch ends", now)
        else:
            self._in_doubt("the machine does not stand where the job left it", now)

    def _settled(self, now: float) -> None:
        case, flight = self._case, self._flight
        assert case is not None
        self._case = self._flight = None
        if flight is not None and flight.token is None and case.accepted and self._ids.proven:
            position = dict(self._standing) if flight.batch.locate_after else None
            self._emit(BatchDone(flight.id, inferred=True, position=position))
        elif flight is not None and case.accepted:
            self._report_done(flight, inferred=True)
        elif flight is not None and flight.token is not None:
            done = flight.id in case.done
            answer = CommandDone(flight.token) if done else CommandFailed(flight.token, None, "it was not executed")
            self._emit(answer)
        else:
            self._emit(FateSettled(tuple(case.done), case.remaining_ids, dict(self._standing)))
        self._go_idle(now)

    def _in_doubt(self, reason: str, now: float) -> None:
        self._report_doubt(reason)
        self._go_idle(now)

    def _report_doubt(self, reason: str) -> None:
        """End the open case, if there is one, without a verdict."""
        case, manual = self._case, self._manual_flight
        if case is None:
            return
        self._case = self._flight = None
        if manual is not None and manual.token is not None:
            self._emit(CommandFailed(manual.token, None, f"whether it was executed is not known: {reason}"))
        else:
            self._emit(FateInDoubt(tuple(case.done), case.remaining_ids, reason, dict(self._standing)))

    def _never_given(self, id: int, now: float) -> None:
        """An ID that nobody gave was acknowledged: a digit of a header changed. Was it that of a repetition, its bytes
        may have been executed under their own ID before, and the machine does not say so (elvinto §5)."""
        later = range(self._ids.next)
        self._ids.rise_above(id)
        unproven, flight = self._unproven, self._flight
        why = f"ID {id} was acknowledged, which was never given: a batch that was repeated may have been executed twice"
        if unproven is not None and unproven.repeated and came_of(id, later[unproven.id :]):
            self._unproven = None
            self._emit(FateInDoubt((), (unproven.id,), why, dict(self._standing)))
        elif flight is not None and flight.attempts > 1 and not flight.repeatable and came_of(id, later[flight.id :]):
            self._case = self._case or Case((flight.batch,), flight.start, math.inf)
            self._in_doubt(why, now)

    def _break_off(self, reason: Literal["error", "alarm", "estop", "restart"], code: int | None, message: str) -> None:
        """Whatever is under way ends here, each with its own report."""
        self._report_file_begun()
        self._report_unproven({})
        self._report_doubt(message)
        self._flight_failed(reason, code, message)
        self._fail_query(message)

    def _restarted(self, evidence: str, now: float) -> None:
        """The machine has lost its memory: position unknown. Initialise it; what was open is over (elvinto §5.4.1)."""
        self._emit(MachineRestarted(evidence))
        if self._unproven is not None and self._unproven.repeated:
            why = "the machine has restarted while the batch was being repeated: it may have been executed twice"
            self._emit(BatchFailed(self._unproven.id, "restart", None, why))
            self._unproven = None
        self._break_off("restart", None, f"the machine has restarted: {evidence}")
        self._standing = {}
        self._ignores_home = False
        self._alarmed = False
        self._initialised = False
        self._greetings = 0
        self._ids.doubt()
        self._enter(Phase.INIT, now)
