"""Lines of one owner, and when they are known to be executed: done is not acknowledged (grbl I).

`ok` means parsed and planned. What proves more is told here, each proof by its own verb.
The one rule: a line counts as executed only by a proof of this file, and in order.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from protocol.commands import SendBatch
from protocol.grbl.asking import Request
from protocol.grbl.lines import Line

SEGMENTS_AHEAD = 12
"""A block leaves the planner when its last segment is prepared; so many blocks more may wait in the step segment
buffer (Grbl 5, grblHAL 9) and would be lost with a reset."""


@dataclass(slots=True, eq=False)
class Errand:
    """A batch of a job, blocks by hand, or a request. `lines_done` counts from the front."""

    lines: tuple[Line, ...]
    batch: SendBatch | None = None
    token: int | None = None
    request: Request | None = None
    sent: int = 0
    answered: int = 0
    done: int = 0
    failed: bool = False

    @property
    def waiting(self) -> bool:
        """It has lines that were not sent yet."""
        return not self.failed and self.sent < len(self.lines)


class _Acknowledged(NamedTuple):
    errand: Errand
    number: int
    inert: bool
    blocks: int  # certain blocks planned up to this line, it included


@dataclass(slots=True)
class Executed:
    """Acknowledged lines of programs whose execution is not proven yet, oldest first."""

    count: int = 0  # lines ever acknowledged
    blocks: int = 0  # certain blocks ever planned
    _open: deque[_Acknowledged] = field(default_factory=deque)

    @property
    def empty(self) -> bool:
        """Everything that was acknowledged is executed."""
        return not self._open

    def acknowledged(self, errand: Errand, *, inert: bool, certain: bool) -> list[Errand]:
        """One more line was answered. `inert`: it moves nothing (or was refused); `certain`: it has made a block."""
        self.count += 1
        self.blocks += certain
        self._open.append(_Acknowledged(errand, self.count, inert, self.blocks))
        return self._take(0) if self._open[0].inert else []

    def at_rest(self, number: int) -> list[Errand]:
        """The machine stood with an empty planner after line `number` was acknowledged."""
        return self._take(number)

    def in_planner(self, blocks: int) -> list[Errand]:
        """No more than so many blocks are in the planner: what lies further back than these, and than the segments that
        are prepared already, is executed."""
        left = self.blocks - blocks - SEGMENTS_AHEAD  # of certain blocks, so many have been executed
        waiting = self._open
        if not waiting or waiting[0].blocks > left:
            return []
        number = 0
        for line in waiting:
            if line.blocks > left:
                break
            number = line.number
        return self._take(number)

    def clear(self) -> None:
        """What is open now will never be known."""
        self._open.clear()

    def _take(self, number: int) -> list[Errand]:
        """Everything up to `number` is executed, and the inert lines right behind it; the errands they are of."""
        touched: list[Errand] = []
        while self._open and (self._open[0].number <= number or self._open[0].inert):
            errand = self._open.popleft().errand
            errand.done += 1
            if not touched or touched[-1] is not errand:
                touched.append(errand)
        return touched
