"""The e-stop of an I/O control block: pressed by a user, opened by the external chain, reset by people only.

It stops no machine: `EStopped` tells the daemon to. The external chain's own level is read in control.py.
The one rule: nothing but a reset that somebody asked for leads out of an e-stop.
"""

from protocol.iocontrol.board import Board
from protocol.iocontrol.config import AbortReason
from protocol.iocontrol.events import EStopCleared, EStopped, OperatorMessage, RequestIgnored
from protocol.iocontrol.handshake import Handshake
from protocol.iocontrol.latch import FaultLatch
from protocol.iocontrol.pins import Pin
from protocol.iocontrol.requests import Failure
from protocol.iocontrol.tables import ESTOP, EStop, EStopTrigger, Region

CHAIN_WITHIN_S = 1.0
"""How long a reset waits for emc-enable-in. Latches and relays answer in some tenths of a second, a HAL behind a
network needs its way there and back; longer than a person looks at the key the chain must not switch on by itself."""


class EStopChain:
    """`pulse_s` is the length of the pulse of user-request-enable, in seconds. `reset_until` is its end, and then,
    while the chain is still open, that of the reset."""

    def __init__(self, board: Board, handshake: Handshake, latch: FaultLatch, *, pulse_s: float, stopped: bool) -> None:
        self._board = board
        self._handshake = handshake
        self._latch = latch
        self._pulse_s = pulse_s
        self._region = Region("e-stop", ESTOP, EStop.USER if stopped else EStop.ENABLED)
        self.reset_until: float | None = None
        board.put(Pin.USER_ENABLE_OUT, not stopped)

    @property
    def state(self) -> EStop:
        return self._region.state

    @property
    def enabled(self) -> bool:
        return self.state is EStop.ENABLED

    def press(self) -> None:
        """By a user: user-enable-out_, all outputs 0 | emc-abort^ reason 6 (§2). What is a fact stays: tool-number,
        the acknowledgement of a fault that is still there, an abort that is not acknowledged yet."""
        if self.state is EStop.USER:
            return
        self._board.next_step()
        self._board.put(Pin.USER_ENABLE_OUT, False)
        self._board.put(Pin.USER_REQUEST_ENABLE, False)
        self.reset_until = None
        self._handshake.drop_outputs()
        self._latch.clear("estop")
        self._board.go(self._region, EStopTrigger.PRESSED)
        self._board.emit(EStopped("user"))
        self._handshake.abort(AbortReason.ESTOP, Failure("estop", "e-stop by a user"))
        self._handshake.forget_prepared()

    def open(self) -> None:
        """By the external chain: requests are dropped, emc-abort^ reason 2 (§2)."""
        if self.state is EStop.RESETTING:
            self._board.go(self._region, EStopTrigger.GIVEN_UP)
        if not self.enabled:
            return
        self._board.go(self._region, EStopTrigger.OPENED)
        self._board.emit(EStopped("external"))
        self._handshake.abort(AbortReason.AUX_ESTOP, Failure("estop", "external e-stop"))
        self._handshake.forget_prepared()

    def reset(self, fault_line: bool | None) -> None:
        """user-enable-out^, the pulse, emc-abort^ reason 5 (§2). A fault that is still there is latched again."""
        if self.state in (EStop.ENABLED, EStop.RESETTING):
            self._board.emit(RequestIgnored("e-stop reset", "there is no e-stop"))
            return
        self._board.next_step()
        self._board.put(Pin.USER_ENABLE_OUT, True)
        self._board.put(Pin.USER_REQUEST_ENABLE, True)
        self.reset_until = self._board.now + self._pulse_s
        self._board.go(self._region, EStopTrigger.RESET)
        if fault_line and not self._latch.faulted:
            self._latch.set(int(self._board[Pin.TOOLCHANGER_REASON]))
        failure = Failure("aborted", "the e-stop was reset")
        self._handshake.abort(AbortReason.ESTOP_RESET, failure, same_step=True)

    def close(self) -> None:
        """The chain is closed, and a reset was asked for. The pulse has its length all the same."""
        if not self._board[Pin.USER_REQUEST_ENABLE]:
            self.reset_until = None
        self._board.go(self._region, EStopTrigger.CLOSED)
        self._board.emit(EStopCleared())

    def end_wait(self, chain: bool | None) -> None:
        """The pulse is over, or the time for the chain: `reset_until`. `chain`: emc-enable-in, None where its driver is
        not connected: then there is nothing to wait for."""
        self.reset_until = None
        pulsed = bool(self._board[Pin.USER_REQUEST_ENABLE])
        self._board.next_step()
        self._board.put(Pin.USER_REQUEST_ENABLE, False)
        if self.state is EStop.RESETTING:
            if pulsed and chain is not None and self._pulse_s < CHAIN_WITHIN_S:
                self.reset_until = self._board.now + CHAIN_WITHIN_S - self._pulse_s
                return
            self._board.go(self._region, EStopTrigger.GIVEN_UP)
            why = "the external chain is open (emc-enable-in is FALSE)"
            if chain is None:
                why = "whether the external chain is closed is not known: the tool changer is not connected"
            self._board.emit(OperatorMessage(f"The e-stop stays: {why}.", "error"))
