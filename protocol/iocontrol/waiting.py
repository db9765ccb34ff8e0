"""One wait of the handshake: since when, until when, and whether people have been told that it takes too long.

The one rule: a wait whose timeout has passed stays a wait. It ends by its answer, by an abort or by a person, never by
a guess (sheet §2).
"""

from protocol.iocontrol.board import Board
from protocol.iocontrol.events import WaitingFor, What
from protocol.iocontrol.tables import PATIENCE, Patience, PatienceTrigger, Region


class Wait:
    """`deadline_at` in the caller's seconds, None where nothing is to happen by itself."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._region = Region("waiting", PATIENCE, Patience.ON_TIME)
        self._since_at = board.now
        self._timeout_s = 0.0
        self.deadline_at: float | None = None

    @property
    def overdue(self) -> bool:
        return self._region.state is Patience.WAITING

    @property
    def open_to_people(self) -> bool:
        """A person may answer in the changer's place: it is late, or has no time limit."""
        return self.overdue or self._timeout_s == 0.0

    def begin(self, timeout_s: float) -> None:
        """A wait begins; 0 is one without a limit."""
        self._since_at = self._board.now
        self._timeout_s = timeout_s
        self.deadline_at = self._since_at + timeout_s if timeout_s else None

    def over(self) -> None:
        """The wait has ended, in whichever way."""
        self.deadline_at = None
        if self.overdue:
            self._board.go(self._region, PatienceTrigger.OVER)

    def suspend(self) -> None:
        """Whoever is to answer is not connected: time does not count."""
        self.deadline_at = None

    def resume(self) -> None:
        """It is connected again: time counts from now."""
        self.over()
        self.begin(self._timeout_s)

    def time_out(self) -> None:
        """The deadline has come."""
        self.deadline_at = None
        self._board.go(self._region, PatienceTrigger.TIMEOUT)

    def describe(self, what: What, tool: int | None) -> WaitingFor:
        return WaitingFor(what, tool, self._since_at, self.deadline_at, self.overdue)
