"""Commands on their way: sent, RECEIVED, OK. Second layer of the engine (see `exchange.py`).

The one rule: the same bytes under the same ID until RECEIVED (elvinto §5), and never a second copy of something that
moves without a restart probe in between.
"""

import math
from abc import ABC, abstractmethod
from typing import Literal

from protocol.commands import Position, SendBatch
from protocol.elvinto.codec import encode_gcode
from protocol.elvinto.exchange import Exchange
from protocol.elvinto.homing import homing
from protocol.elvinto.phases import STEPS, Flight, Phase, Unproven
from protocol.elvinto.settle import Case, possible
from protocol.errors import LocalError, MessageTooLongError
from protocol.events import (
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    Homed,
    ProgramEnded,
    StateReported,
)

IDLE_REPORTS_OF_AN_END = 2
"""STATE `idle` on so many consecutive reports after RECEIVED means that the command has ended (elvinto §5.3)."""


BLIND_REPEATS = 3
"""Repetitions of something that moves, once anything was heard since it was sent. The header's ID is under no checksum:
a digit that flips upwards makes a silent machine execute the repetition of what it has executed already. Further
repetitions are left to `settling.py`, which asks where the machine stands instead: that may be repeated at will."""


class Flights(Exchange, ABC):
    """What is in flight, at most one command."""

    _ignores_home = False
    """It was told to ignore G28 (W93)."""

    def _submit_batch(self, batch: SendBatch, now: float) -> None:
        if batch.id != self._ids.next:
            raise LocalError(f"batch {batch.id} is out of turn: the next ID is {self._ids.next}")
        if self._alarmed:
            raise LocalError("a batch was submitted while the machine is in alarm")
        self._take_off(Flight(batch, encode_gcode(batch.blocks), dict(self._standing)), now)

    def _submit_message(
        self,
        message: bytes,
        now: float,
        *,
        token: int,
        kind: Literal["gcode", "alarm", "file"],
        blocks: tuple[str, ...] = (),
        expected_s: float = 1.0,
    ) -> None:
        batch = SendBatch(self._ids.next, blocks, expected_s)
        self._take_off(Flight(batch, message, dict(self._standing), token, kind), now)

    def _take_off(self, flight: Flight, now: float) -> None:
        self._flight = flight
        self._send_flight(now)  # raises MessageTooLongError before anything has changed
        self._ids.take()

    def _send_flight(self, now: float) -> None:
        flight = self._flight
        assert flight is not None
        try:
            wire_s = self._send(flight.message, flight.id)
        except MessageTooLongError:
            self._flight = None
            raise
        self._phase, self._turn = Phase.SENT, None
        flight.attempts += 1
        if flight.attempts == 1:
            flight.sent_at = now
        if flight.token is None:
            self._emit(BatchSent(flight.id, flight.attempts))
        flight.probed = flight.repeatable
        self._deadline = now + wire_s + self._dialect.retry_interval_s * (1.0 if flight.probed else 0.5)

    def _on_flight_unheard(self, now: float) -> None:
        """No RECEIVED in time. Half-way to the repetition a restart probe goes out: a machine that has restarted
        would take the repetition for a new command and execute it somewhere else."""
        flight = self._flight
        assert flight is not None
        if flight.seen_running:
            self._on_flight_quiet(now)
        elif not flight.probed:
            flight.probed = True
            wire_s = self._send(STEPS[Phase.PROBE].message, self._ids.probe())
            self._deadline = now + wire_s + self._dialect.retry_interval_s / 2
        elif self._may_repeat(flight):
            self._send_flight(now)
        else:
            self._give_up_flight(flight, now)

    def _may_repeat(self, flight: Flight) -> bool:
        limit = self._dialect.max_retries
        if not flight.repeatable and not self._silent_since(flight.sent_at):
            limit = min(limit, BLIND_REPEATS)
        return flight.attempts <= limit

    def _silent_since(self, instant: float) -> bool:
        return max(self._heard_at, self._noise_at) <= instant

    def _give_up_flight(self, flight: Flight, now: float) -> None:
        """Repetitions without RECEIVED (elvinto §5.4): the link is lost, or the fate of the command is."""
        if self._case is not None:
            self._ask(now)
        elif self._silent_since(flight.sent_at):
            self._close("the machine does not answer")
        elif flight.kind == "gcode":
            self._open_case(Case((flight.batch,), flight.start, math.inf), now)
        else:
            assert flight.token is not None
            self._flight = None
            self._ids.doubt()
            self._emit(CommandFailed(flight.token, None, "the machine did not answer; try again"))
            self._go_idle(now)

    @abstractmethod
    def _open_case(self, case: Case, now: float) -> None:
        """Find out what happened to batches (`settling.py`)."""

    @abstractmethod
    def _settle_next(self, now: float) -> None:
        """A repeated batch of the open case is done: go on with the case (`settling.py`)."""

    @abstractmethod
    def _ask(self, now: float) -> None:
        """Ask where the machine stands, to settle the open case (`settling.py`)."""

    def _flight_received(self, now: float) -> None:
        flight = self._flight
        assert flight is not None
        if flight.kind == "file":
            self._file_accepted(flight, now)
            return
        if flight.token is None:
            self._emit(BatchReceived(flight.id))
        flight.received_at = now
        self._phase = Phase.RUNNING
        self._deadline = now + flight.batch.expected_s + self._dialect.probe_after_s

    def _on_flight_quiet(self, now: float) -> None:
        """RECEIVED came, OK did not: after `probe_after` of silence its end is asked for (elvinto §5.3)."""
        flight = self._flight
        assert flight is not None
        began_at = flight.sent_at if flight.received_at is None else flight.received_at
        due = max(began_at + flight.batch.expected_s, self._heard_at) + self._dialect.probe_after_s
        if now < due:
            self._deadline = due
        elif self._case is not None:
            self._ask(now)
        else:
            accepted = flight.received_at is not None
            self._open_case(Case((flight.batch,), flight.start, math.inf, accepted), now)

    def _flight_idle(self, report: StateReported, now: float) -> None:
        """STATE `idle` while a command is in flight."""
        flight = self._flight
        assert flight is not None
        if self._phase is Phase.SENT:
            self._idle_without_received(flight, report, now)
            return
        flight.idle_reports += 1
        if flight.idle_reports < IDLE_REPORTS_OF_AN_END:
            return
        if possible(flight.batch.end, report.position, self._dialect.position_tolerance_mm):
            self._flight_done(now, inferred=True)
        elif self._case is None:
            self._open_case(Case((flight.batch,), flight.start, math.inf, accepted=True), now)

    def _idle_without_received(self, flight: Flight, report: StateReported, now: float) -> None:
        """The last report of a motion whose RECEIVED was lost, the answer to a restart probe, or nothing new."""
        if flight.kind != "gcode" or flight.repeatable or self._case is not None:
            return
        if flight.probed or flight.seen_running:
            self._suspect_restart(now)
        elif self._stands_only(flight.batch.end, flight.start, report):
            flight.attempts += 1  # the memory is not proven: RECEIVED never came
            self._flight_done(now, inferred=True)

    def _suspect_restart(self, now: float) -> None:
        """Find out by the restart probe before anything is sent again that moves."""
        flight = self._flight
        if flight is None or flight.kind != "gcode" or flight.repeatable or self._case is not None:
            return
        accepted = flight.received_at is not None
        self._open_case(Case((flight.batch,), flight.start, math.inf, accepted), now)

    def _stands_only(self, place: Position, other: Position, report: StateReported) -> bool:
        """The machine reports to stand at `place`, and that is not `other`."""
        tolerance_mm = self._dialect.position_tolerance_mm
        return possible(place, report.position, tolerance_mm) and not possible(other, report.position, tolerance_mm)

    def _flight_runs(self, now: float) -> None:
        """STATE `run` while a command is in flight: without RECEIVED it is no use to repeat it."""
        flight = self._flight
        assert flight is not None
        flight.idle_reports = 0
        if self._phase is Phase.SENT and self._case is None and flight.kind == "gcode":
            flight.seen_running = True
            self._deadline = now + self._dialect.probe_after_s

    def _flight_done(self, now: float, *, inferred: bool = False) -> None:
        """The command in flight is executed. OK without RECEIVED counts as both (elvinto §5.2)."""
        flight = self._flight
        assert flight is not None
        self._flight = None
        # A repeated command may have run under an ID that a flipped digit made higher; M30 makes the machine forget;
        # a command by hand leaves it who knows where. Each is followed by the question where it stands.
        once = flight.attempts == 1 and self._case is None
        if once and not flight.batch.ends_program and flight.token is None:
            self._ids.prove(flight.id)
        else:
            self._ids.doubt()
        self._standing = flight.batch.end
        if self._case is not None:
            self._case.finished(flight.id)
            self._settle_next(now)
            return
        self._report_done(flight, inferred=inferred)
        if flight.kind == "alarm":
            self._alarmed = False
            if not self._initialised:
                self._enter(Phase.INIT, now)
                return
        self._go_idle(now)

    def _report_done(self, flight: Flight, *, inferred: bool) -> None:
        homed, self._ignores_home = homing(flight.batch.blocks, ignored=self._ignores_home)
        if flight.token is not None:
            if homed:
                self._emit(Homed(()))
            self._emit(CommandDone(flight.token))
        elif flight.batch.locate_after or (flight.attempts > 1 and not flight.repeatable):
            repeated = flight.attempts > 1
            self._unproven = Unproven(flight.id, inferred, flight.batch.locate_after, repeated)
            self._ids.doubt()  # so that idle begins with the question
        else:
            self._emit(BatchDone(flight.id, inferred))

    def _flight_failed(
        self, reason: Literal["error", "alarm", "estop", "restart"], code: int | None, message: str
    ) -> None:
        """The command in flight did not run to its end, or nobody knows (elvinto §5.7, §5.8)."""
        if self._flight is None:
            return
        flight, self._flight = self._flight, None
        if flight.token is not None:
            self._emit(CommandFailed(flight.token, code, message))
        else:
            self._emit(BatchFailed(flight.id, reason, code, message))

    # --- a program from the SD card -------------------------------------------------------------------------------

    def _file_accepted(self, flight: Flight, now: float) -> None:
        """RECEIVED: it is going to run, unless ERROR follows at once (there is no such file)."""
        self._flight, self._file = None, flight
        self._ids.doubt()  # the program's M30 will make the machine forget
        self._phase, self._turn, self._file_idle_reports = Phase.FILE, None, 0
        self._deadline = now + self._dialect.retry_interval_s

    def _on_file_quiet(self, now: float) -> None:
        """Nothing heard while a file runs: PROGRAM_END may be lost. W95 is executed only when the program has ended.

        There is no end to this: a program may run for hours without a word when STATE during moves is off.
        """
        self._report_file_begun()
        due = self._heard_at + self._dialect.probe_after_s
        if now < due:
            self._deadline = due
            return
        wire_s = self._send(STEPS[Phase.SYNC].message, self._ids.take())
        self._deadline = now + wire_s + self._dialect.probe_after_s

    def _file_idle(self, now: float) -> None:
        self._file_idle_reports += 1
        if self._file_idle_reports >= IDLE_REPORTS_OF_AN_END:
            self._file_ended(now)

    def _file_refused(self, code: int | None, message: str, now: float) -> None:
        """ERROR of RUN before the program began."""
        assert self._file is not None
        assert self._file.token is not None
        self._emit(CommandFailed(self._file.token, code, message))
        self._file = None
        self._go_idle(now)

    def _file_ended(self, now: float) -> None:
        self._report_file_begun()
        self._emit(ProgramEnded())
        self._go_idle(now)
