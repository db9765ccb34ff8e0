"""How far a job is: four counters that are never confused. Lines of the program, counted from 1; 0 is before it.

The one rule: done <= received <= sent <= read. What people are shown as progress is *done*.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cursor:
    """The last line that was read and planned, handed to the wire, accepted by the machine, executed by it."""

    read: int = 0
    sent: int = 0
    received: int = 0
    done: int = 0

    @classmethod
    def at(cls, line: int) -> "Cursor":
        """Everything up to `line` is behind us."""
        return cls(line, line, line, line)

    def was_read(self, line: int) -> "Cursor":
        return self if line <= self.read else Cursor(line, self.sent, self.received, self.done)

    def was_sent(self, line: int) -> "Cursor":
        return Cursor(max(self.read, line), max(self.sent, line), self.received, self.done)

    def was_received(self, line: int) -> "Cursor":
        return Cursor(max(self.read, line), max(self.sent, line), max(self.received, line), self.done)

    def was_done(self, line: int) -> "Cursor":
        return Cursor(max(self.read, line), max(self.sent, line), max(self.received, line), max(self.done, line))

    def fell_back(self, line: int) -> "Cursor":
        """What was sent after `line` is proven never to have been executed and will go out again."""
        return Cursor(self.read, min(self.sent, line), min(self.received, line), min(self.done, line))
