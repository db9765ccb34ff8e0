"""Whether the changer is there: only an external one has a connection that can be missing or lost.

It moves no pin and aborts nothing (control.py does).
The one rule: a changer that is not there is always seen: by a time limit at the start, by a message when it is lost.
"""

from protocol.iocontrol.board import Board
from protocol.iocontrol.events import OperatorMessage, WaitingFor
from protocol.iocontrol.tables import CONNECTION, Connection, ConnectionTrigger, Region


class ChangerLink:
    """`timeout_s`: after the start, in which the changer is to connect; 0 waits without a message."""

    def __init__(self, board: Board, *, external: bool, timeout_s: float) -> None:
        self._board = board
        self._region = Region("connection", CONNECTION, Connection.ABSENT if external else Connection.CONNECTED)
        self._since_at = board.now
        self._overdue = False
        self.deadline_at = board.now + timeout_s if external and timeout_s else None

    @property
    def connected(self) -> bool:
        return self._region.state is Connection.CONNECTED

    @property
    def lost(self) -> bool:
        return self._region.state is Connection.LOST

    def connect(self) -> None:
        self._board.go(self._region, ConnectionTrigger.CONNECT)
        self.deadline_at = None
        self._overdue = False

    def disconnect(self) -> None:
        self._board.go(self._region, ConnectionTrigger.DISCONNECT)
        self._since_at = self._board.now
        self._overdue = True  # people are told at once

    def time_out(self) -> None:
        """It has not connected since the start."""
        self.deadline_at = None
        self._overdue = True
        self._board.emit(OperatorMessage("The tool changer has not connected.", "error"))

    def waiting(self, tool: int | None) -> WaitingFor:
        return WaitingFor("connection", tool, self._since_at, self.deadline_at, self._overdue)
