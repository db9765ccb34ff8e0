"""Character counting: which lines are in the controller without an answer, and how many bytes they are (grbl I).

Not what the answers mean. The one rule: the bytes of unanswered lines never exceed `capacity`; a ring that overflows
drops bytes without a word (II.1).
"""

from collections import deque
from dataclasses import dataclass, field
from typing import TypeAlias

from protocol.grbl.dialect import SAFE_RX_BYTES
from protocol.grbl.errands import Errand
from protocol.grbl.lines import Line

Entry: TypeAlias = tuple[Errand, int, Line]
"""A line on its way: it is number `index` of its errand. A bare tuple, for there is one for every line."""


@dataclass(slots=True)
class Window:
    """`one_by_one`: the streaming mode `line`, an answer awaited after each. `entries`: what has no answer, oldest
    first, and `used_bytes` of it; changed here and in flow.py alone."""

    capacity: int = SAFE_RX_BYTES
    one_by_one: bool = False
    entries: deque[Entry] = field(default_factory=deque)
    used_bytes: int = 0

    def takes(self, line: Line) -> bool:
        """Whether there is room for the line now."""
        if not self.entries:
            return True
        if self.used_bytes + len(line.data) > self.capacity:
            return False
        return not (self.one_by_one or line.alone or self.entries[-1][2].alone)

    def fill(self, errand: Errand, end: int) -> tuple[Line, ...]:
        """As many of the errand's lines go out, up to number `end`, as there is room for now."""
        lines, start, index = errand.lines, errand.sent, errand.sent
        while index < end and self.takes(line := lines[index]):
            self.entries.append((errand, index, line))
            self.used_bytes += len(line.data)
            index += 1
        errand.sent = index
        return lines[start:index]

    def answer(self) -> Entry | None:
        """The oldest line has its answer; None: there is none."""
        if not self.entries:
            return None
        entry = self.entries.popleft()
        self.used_bytes -= len(entry[2].data)
        return entry

    @property
    def head(self) -> Entry | None:
        """The line that the next answer is for."""
        return self.entries[0] if self.entries else None

    @property
    def empty(self) -> bool:
        """Everything that was sent is answered."""
        return not self.entries

    def clear(self) -> None:
        """The controller has forgotten them."""
        self.entries.clear()
        self.used_bytes = 0
