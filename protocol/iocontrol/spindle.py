"""What is known of the tool in the spindle, and how well. Not how it came there (handshake.py).

A changer knows what it has done. A person is taken at their word, but hands are in the machine at other times too:
behind a start of the daemon, an abort or an M6 by hand the tool that was in is only thought to be there. The one rule:
a tool is taken as being in the spindle only where nobody can have changed it unseen.
"""

from typing import Final

from protocol.iocontrol.board import Board
from protocol.iocontrol.config import IoConfig
from protocol.iocontrol.pins import Pin

UNKNOWN: Final = -1
"""`tool-number` while nobody knows which tool is in the spindle."""


class Spindle:
    """`tool`: 0 none, None not known. `certain`: nobody can have changed it since it was told."""

    def __init__(self, board: Board, config: IoConfig, tool: int | None) -> None:
        self._board = board
        self._by_people = config.kind == "manual"
        self._always_ask = config.always_ask
        self.tool = tool
        self._told = False
        board.put(Pin.TOOL_NUMBER, UNKNOWN if tool is None else tool)

    @property
    def certain(self) -> bool:
        return self.tool is not None and (self._told or not self._by_people)

    def needs(self, number: int) -> bool:
        """This tool has to be put in, or a person has to be asked whether it is in."""
        return number != self.tool or not self.certain or self._always_ask

    def take(self, number: int) -> None:
        """This tool is in."""
        self.tool, self._told = number, True
        self._board.put(Pin.TOOL_NUMBER, number)

    def doubt(self) -> None:
        """Hands may have been in the machine."""
        self._told = False

    def lose(self) -> None:
        """Nobody knows what is in."""
        self.tool, self._told = None, False
        self._board.put(Pin.TOOL_NUMBER, UNKNOWN)
