"""The fault latch: a changer's fault is remembered until somebody clears it, with its reason and its parameters.

It aborts nothing: what a fault does to a T or an M6 is in handshake.py.
The one rule: the reason is that which stood with the fault; what the pin says later is not read (sheet §1).
"""

from collections.abc import Mapping
from typing import Literal

from protocol.iocontrol.board import Board
from protocol.iocontrol.events import FaultCleared, FaultLatched
from protocol.iocontrol.pins import Pin
from protocol.iocontrol.tables import LATCH, Latch, LatchTrigger, Region

_TRIGGERS: dict[str, LatchTrigger] = {
    "pin": LatchTrigger.CLEARED,
    "operator": LatchTrigger.CLEARED,
    "estop": LatchTrigger.ESTOP,
}


class FaultLatch:
    """`reason` is that of the latched fault, 0 without one."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._region = Region("fault", LATCH, Latch.CLEAR)
        self.reason = 0

    @property
    def faulted(self) -> bool:
        return self._region.state is Latch.FAULTED

    @property
    def parameters(self) -> Mapping[int, float]:
        """For programs: the page calls the first #5060, the program #5600; #5601 is the reason (seed §5)."""
        fault = 1.0 if self.faulted else 0.0
        return {5060: fault, 5600: fault, 5601: float(self.reason)}

    def set(self, reason: int) -> None:
        """A fault, perhaps a second one: the later reason counts."""
        self._board.put(Pin.TOOLCHANGER_FAULTED, True)
        self.reason = reason
        self._board.go(self._region, LatchTrigger.FAULT)
        self._board.emit(FaultLatched(reason))

    def clear(self, by: Literal["pin", "operator", "estop"]) -> None:
        """Nothing happens where nothing is latched."""
        if not self.faulted:
            return
        self._board.put(Pin.TOOLCHANGER_FAULTED, False)
        self.reason = 0
        self._board.go(self._region, _TRIGGERS[by])
        self._board.emit(FaultCleared(by))
