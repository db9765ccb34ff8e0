"""How far a job is: four counters that are never confused. Lines of the program, counted from 1; 0 is before it.

The one rule: done <= received <= sent <= read. What people are shown as progress is *done*.
"""

from dataclasses import dataclass


@dataclass(slots=True)
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

    def was_read(self, line: int) -> None:
        self.read = max(self.read, line)

    def was_sent(self, line: int) -> None:
        if line > self.sent:
            self.sent = line
            self.was_read(line)

    def was_received(self, line: int) -> None:
        if line > self.received:
            self.received = line
            self.was_sent(line)

    def was_done(self, line: int) -> None:
        if line > self.done:
            self.done = line
            self.was_received(line)

    def fell_back(self, line: int) -> None:
        """What was sent after `line` is proven never to have been executed and will go out again."""
        self.sent, self.received, self.done = min(self.sent, line), min(self.received, line), min(self.done, line)
