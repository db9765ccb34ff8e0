"""Frames on their way, one at a time. Second layer of the engine (see `exchange.py`).

The one rule: a frame goes out again only where it is known not to be executed: by NAK, and with a counter by the count
as well. Frames are increments, so nothing is worse than one that runs twice.
"""

import math
from abc import abstractmethod
from typing import Final

from protocol.commands import SendBatch
from protocol.events import (
    Alarm,
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    FateInDoubt,
    MachineRestarted,
    MessageSeen,
    ProtocolFault,
)
from protocol.ncframe import codec
from protocol.ncframe.answers import NAMES
from protocol.ncframe.codec import COUNT_MODULUS, Frame, seal
from protocol.ncframe.exchange import REPORT_S, Exchange
from protocol.ncframe.phases import Flight, Inquiry, Phase, Reason

REST_S: Final = 1.0
"""After so long without a word the machine is asked before something moves: it may have been switched off and on."""
EARLY: Final = 0.25
"""Of the estimated run time: an ACK before it is not believed without asking, where nothing is counted."""
OF_THE_WIRE: Final = 0.9
"""Of the time that a frame takes on the line: before it no answer to the frame can be on its way."""

NAK_WITHIN: Final = 2.0
"""Times `gap_s` behind a frame: so soon its NAK is said. A later one need not be the machine's word on this frame."""
HIGHEST_AFTER_RESTART: Final = 1
"""What a machine can count that has restarted unnoticed: 0, or 1 when the frame on its way came behind the restart.
Where that is what it had counted before, it proves nothing."""


class Flights(Exchange):
    """What is in flight, at most one batch or one command by hand."""

    def _take_off(self, batch: SendBatch, frames: tuple[Frame, ...], now: float, *, token: int | None = None) -> None:
        position = dict(self._standing)
        steps = [self._pace.steps(frame) for frame in frames]
        for axis, at in batch.end.items():  # where it begins is known by where it ends
            position.setdefault(axis, round(at - sum(step.get(axis, 0.0) for step in steps), 6))
        self._flight = Flight(batch, frames, token, position)
        if now - self._proven_at > REST_S:
            self._enquire(Phase.PROVE, now, expected=self._counted)
        else:
            self._send_next(now)

    def _send_next(self, now: float) -> None:
        """The next frame, unless somebody holds; or the end."""
        flight = self._flight
        assert flight is not None
        if flight.done == len(flight.frames):
            self._land(flight, now)
        elif self._stop_tokens:
            self._fail("stop", None, "stopped by hand behind a frame", located=True)
            self._answer_stops()
            self._tell(self._resting_status, now)
            self._go_idle(now)
        elif self._xoff or self._hold:
            self._phase = Phase.HELD
            self._answer_stops()
            if self._status != "hold":
                self._tell("hold", now)
            self._arm_rest(now)
        else:
            self._send_frame(flight, now)

    def _send_frame(self, flight: Flight, now: float) -> None:
        frame = flight.frames[flight.done]
        estimate_s = self._pace.take(frame)
        flight.run_s = flight.batch.expected_s if estimate_s is None else estimate_s
        flight.least_s = estimate_s or 0.0
        if frame.m is not None or frame.t is not None:
            flight.run_s += self._dialect.auxiliary_s
        flight.sent = flight.done + 1
        flight.acked, flight.refused_at = False, math.inf
        flight.sent_at = now
        flight.on_wire_at = now + self._wire.send(seal(frame.sendable, self._dialect.check))
        self._emit(MessageSeen(">", frame.to_text()))
        self._phase = Phase.SENT
        self._deadline = flight.expected_end_at + self._dialect.ack_timeout_s
        if flight.token is None and not flight.announced:
            flight.announced = True
            self._emit(BatchSent(flight.batch.id, flight.attempts))
        if self._status != "run":
            self._tell("run", now)

    # --- what the machine says, byte by byte ----------------------------------------------------------------------

    def _hear(self, byte: int, now: float) -> None:
        """Outside an exchange of ENQ."""
        self._emit(MessageSeen("<", NAMES.get(byte, f"{byte:02X}")))
        match byte:
            case codec.XON | codec.XOFF:
                self._flow(byte == codec.XOFF, now)
            case codec.CAN:
                self._cancelled(now)
            case codec.ACK | codec.NAK if self._phase is Phase.SENT and self._may_be_answered(now):
                if byte == codec.ACK:
                    self._on_ack(now)
                else:
                    self._on_nak(now)
            case _:
                self._emit(ProtocolFault("unasked_answer", f"{byte:02X} while the engine {self._phase.value}"))

    def _may_be_answered(self, now: float) -> bool:
        """Whether an answer to the frame can be here already."""
        flight = self._flight
        assert flight is not None
        wire_s = flight.on_wire_at - flight.sent_at
        return not self._wire.pending and now >= flight.sent_at + wire_s * OF_THE_WIRE

    def _on_ack(self, now: float) -> None:
        flight = self._flight
        assert flight is not None
        flight.acked = True
        if self._counted is not None:  # it counts
            after = (self._counted + 1) % COUNT_MODULUS
            self._enquire(Phase.CONFIRM, now, expected=after, until=flight.expected_end_at)
        elif now < flight.on_wire_at + flight.least_s * EARLY:
            self._listen(flight, now)
        else:
            self._executed(flight, now)

    def _on_nak(self, now: float) -> None:
        flight = self._flight
        assert flight is not None
        flight.refused_at = now
        if self._counted is not None:
            self._enquire(Phase.ASK, now, until=flight.expected_end_at, settle=True)
        else:
            self._listen(flight, now)

    def _listen(self, flight: Flight, now: float) -> None:
        """Nothing is counted, so the ACKs are: the machine answers ENQ only when it stands, once for each."""
        until = flight.expected_end_at + self._dialect.ack_timeout_s
        self._enquire(Phase.LISTEN, now, until=until, settle=True, once=True)

    def _on_no_answer(self, now: float) -> None:
        if self._phase is Phase.LISTEN:
            self._doubt("the machine did not answer what became of a frame, and it counts none", now)
        else:
            super()._on_no_answer(now)

    def _on_silence(self, now: float) -> None:
        """No answer to the frame. It is never sent again for that."""
        flight = self._flight
        assert flight is not None
        self._emit(ProtocolFault("lost_answer", f"no answer to {flight.frames[flight.done].to_text()}"))
        if self._counted is not None:
            self._enquire(Phase.ASK, now)
        else:
            self._doubt("the machine did not answer a frame, and it counts none", now)

    # --- verdicts -------------------------------------------------------------------------------------------------

    def _on_count(self, inquiry: Inquiry, count: int | None, now: float) -> None:
        """CONFIRM and ASK: the count tells whether the frame was executed."""
        flight = self._flight
        assert flight is not None
        assert count is not None
        assert self._counted is not None
        refused = flight.refused_at <= flight.on_wire_at + NAK_WITHIN * self._dialect.gap_s
        if count == (self._counted + 1) % COUNT_MODULUS and (count or flight.acked):
            self._executed(flight, now)
        elif count != self._counted:
            self._miscounted(count, now)
        elif count > HIGHEST_AFTER_RESTART or (refused and not flight.acked and not inquiry.acks):
            self._again(flight, now)
        else:
            self._doubt(f"the machine counts {count} as before: it may as well have restarted since", now)

    def _on_listened(self, inquiry: Inquiry, _: int | None, now: float) -> None:
        """LISTEN: the frame's own answers and the one ACK of ENQ."""
        flight = self._flight
        assert flight is not None
        refused = flight.refused_at < math.inf or inquiry.naks > 0
        if not refused:
            self._executed(flight, now)
        elif inquiry.acks == 1 and not flight.acked:
            self._again(flight, now)
        else:
            self._doubt("the machine said both ACK and NAK to a frame, and it counts none", now)

    def _again(self, flight: Flight, now: float) -> None:
        """The frame was not executed. That is the only reason to send it once more."""
        flight.naks += 1
        flight.sent = flight.done
        if flight.naks > self._dialect.max_naks:
            text = flight.frames[flight.done].to_text()
            self._fail("error", None, f"the machine has refused {text} {flight.naks} times", located=True)
            self._tell("idle", now)
            self._go_idle(now)
            return
        flight.attempts += 1
        flight.announced = False
        self._send_next(now)

    def _executed(self, flight: Flight, now: float) -> None:
        frame = flight.frames[flight.done]
        if self._counted is not None:
            self._counted = (self._counted + 1) % COUNT_MODULUS
        self._proven_at = now
        flight.position = self._pace.moved(frame, flight.position)
        flight.done += 1
        flight.sent = flight.done
        flight.naks = 0
        if flight.done == 1 and flight.token is None:
            self._emit(BatchReceived(flight.batch.id))
        if flight.done < len(flight.frames) and now - self._told_at >= REPORT_S:
            self._tell("run", now)
        self._send_next(now)

    def _land(self, flight: Flight, now: float) -> None:
        """Every frame is executed."""
        self._standing = {**flight.position, **flight.batch.end}
        self._flight = None
        self._answer_stops()
        if flight.token is not None:
            self._tell(self._resting_status, now)
            self._emit(CommandDone(flight.token))
        else:
            self._report_done(flight)
        self._go_idle(now)

    def _report_done(self, flight: Flight) -> None:
        self._next += 1
        self._emit(BatchDone(flight.batch.id))

    # --- what goes wrong ------------------------------------------------------------------------------------------

    def _fail(self, reason: Reason, code: int | None, message: str, *, located: bool = False) -> None:
        """What is in flight does not run to its end: the frames that are done are certain, and so are those that were
        not sent; the one between may be either. `located`: the machine has not moved of its own accord."""
        flight, self._flight = self._flight, None
        if flight is None:
            return
        self._standing = flight.position if flight.sent == flight.done else {}
        if flight.token is not None:
            doubt = "; the frame on the wire may have been executed" if flight.sent > flight.done else ""
            some = f" ({flight.done} of {len(flight.frames)} frames executed{doubt})"
            self._emit(CommandFailed(flight.token, code, message + some))
            return
        self._next += 1
        position = dict(flight.position) if located and flight.sent == flight.done else None
        self._emit(BatchFailed(flight.batch.id, reason, code, message, flight.done, flight.sent, position))

    def _doubt(self, reason: str, now: float) -> None:
        """Nobody knows whether the frame on the wire was executed: the position is not known any more."""
        flight = self._flight
        ids = () if flight is None or flight.token is not None else (flight.batch.id,)
        self._fail("link", None, reason)
        self._standing = {}
        self._emit(FateInDoubt((), ids, reason))
        self._tell(self._status, now)  # at once, that nobody takes it for standing where it was
        self._enquire(Phase.GREET, now, settle=True)

    def _miscounted(self, count: int, now: float) -> None:
        """The count is neither what it was nor one more."""
        assert self._counted is not None
        behind = (self._counted - count) % COUNT_MODULUS
        if count == 0 or behind < COUNT_MODULUS // 2:
            self._restarted(f"it counts {count} frames, and {self._counted} were executed", now)
            self._counted = count
            self._go_idle(now)
        else:
            self._doubt(f"the machine counts {count} frames, and {self._counted} were executed for this daemon", now)

    def _restarted(self, evidence: str, now: float) -> None:
        """Position and modes are lost, and what ran when the power went is in doubt."""
        self._emit(MachineRestarted(evidence))
        self._pace.forget()
        self._fail("restart", None, f"the machine has restarted: {evidence}")
        self._standing = {}
        self._fail_queries("the machine has restarted")
        self._answer_stops()
        self._tell("idle", now)

    def _raise_alarm(self, message: str, now: float) -> None:
        """The position is gone, and so is the count."""
        self._alarm = Alarm(None, None, message)
        self._pace.forget()
        self._counted = None
        self._standing = {}
        self._tell("alarm", now)

    @abstractmethod
    def _break_off(self, reason: Reason, message: str) -> None:
        """Whatever is under way ends here, each with its own report."""
