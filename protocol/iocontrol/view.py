"""What may be read of an I/O control block, by people, by the API and by whoever runs a job. Nothing is changed here.

The one rule: everything is derived from the tables and the pins; nothing is stored beside them.
"""

from collections.abc import Mapping

from protocol.iocontrol.board import Board, PinState
from protocol.iocontrol.changerlink import ChangerLink
from protocol.iocontrol.config import IoConfig
from protocol.iocontrol.estop import EStopChain
from protocol.iocontrol.events import WaitingFor
from protocol.iocontrol.handshake import Handshake
from protocol.iocontrol.latch import FaultLatch
from protocol.iocontrol.pins import Pin
from protocol.iocontrol.tables import EStop, State
from protocol.iocontrol.tooltable import ToolTable

ANSWERS = {
    State.PREPARING: Pin.TOOL_PREPARED,
    State.STARTING: Pin.START_CHANGE_ACK,
    State.CHANGING: Pin.TOOL_CHANGED,
    State.ABORTING: Pin.EMC_ABORT_ACK,
}
"""The level that each state waits for."""


class IoView:
    """The readable side of `IoControl`."""

    config: IoConfig
    _board: Board
    _latch: FaultLatch
    _handshake: Handshake
    _estop: EStopChain
    _link: ChangerLink
    _unwired: frozenset[Pin]

    @property
    def state(self) -> State:
        return self._handshake.state

    @property
    def estop_state(self) -> EStop:
        return self._estop.state

    @property
    def tool(self) -> int | None:
        """The tool in the spindle: 0 none, None not known."""
        return self._handshake.tool

    @property
    def tool_certain(self) -> bool:
        """Nobody can have changed it unseen; else a person is asked for it though it is thought to be in."""
        return self._handshake.spindle.certain

    @property
    def prepared(self) -> int | None:
        """The tool that an M6 would load."""
        return None if self._handshake.prepared is None else self._handshake.prepared.number

    @property
    def tool_table(self) -> ToolTable | None:
        return self._handshake.table

    @property
    def faulted(self) -> bool:
        return self._latch.faulted

    @property
    def parameters(self) -> Mapping[int, float]:
        """#5060, #5600, #5601 (sheet §3)."""
        return self._latch.parameters

    @property
    def connected(self) -> bool:
        """An external changer is connected; always, for the other kinds."""
        return self._link.connected

    @property
    def waiting_for(self) -> WaitingFor:
        """What the block waits for, with `what` None for nothing."""
        if not self._link.connected and self.state is not State.DOUBTING:
            return self._link.waiting(self._handshake.wanted)
        return self._handshake.waiting()

    @property
    def change_pending(self) -> bool:
        return self._handshake.change_pending

    @property
    def change_needed(self) -> bool:
        """An M6 would ask for something: the wanted tool is not in the spindle, for all that is known."""
        wanted = self._handshake.wanted
        return wanted is None or self._handshake.spindle.needs(wanted)

    @property
    def motion_allowed(self) -> bool:
        """A program may move the machine: no M6 is open, no abort waits to be acknowledged, no e-stop.

        The abort of a changer that has connected anew is none of a job's that is cutting.
        """
        aborting = self.state is State.ABORTING and not self._handshake.starting_up
        return self._estop.enabled and not self.change_pending and not aborting

    @property
    def change_moves_allowed(self) -> bool:
        """The moves to the change position, between `ChangeStarted` and `change`."""
        return self._estop.enabled and self.state is State.MOVING

    @property
    def start_refusal(self) -> str | None:
        """Why no job may start now; None: it may."""
        if not self._estop.enabled:
            return "the e-stop is not reset"
        if not self._link.connected:
            return "the tool changer is not connected"
        if self._handshake.in_doubt or self.tool is None:
            return "it is not known which tool is in the spindle"
        if self.state is State.ABORTING:
            return "the tool changer has not acknowledged the last abort"
        if self.change_pending:
            return "a tool change is pending"
        return None

    @property
    def may_confirm(self) -> bool:
        """A person may answer: for a manual change, in doubt, or where the changer is late or has no time limit."""
        if self._handshake.in_doubt:
            return True
        if self.state is State.CHANGING and self.config.kind == "manual":
            return True
        return self._link.connected and self.state in ANSWERS and self._handshake.wait.open_to_people

    @property
    def may_fail(self) -> bool:
        """A person may say that what is under way has failed."""
        return self._handshake.busy

    @property
    def may_clear_fault(self) -> bool:
        return self.faulted and self._link.connected and not self._board[Pin.TOOLCHANGER_FAULT]

    @property
    def drivable(self) -> frozenset[str]:
        """The inputs that may be driven from outside."""
        return frozenset(map(str, self._unwired))

    def pins(self) -> tuple[PinState, ...]:
        """All pins with value and since when."""
        return self._board.states(frozenset() if self._link.connected else self._unwired)
