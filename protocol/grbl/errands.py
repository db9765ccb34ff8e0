"""Lines of one owner, and when they are known to be executed: done is not acknowledged (grbl I).

`ok` means parsed and planned. What proves more is told here, each proof by its own verb.
The one rule: a line counts as executed only by a proof of this file, and in order.
"""

from collections import deque
from dataclasses import dataclass, field
from math import inf
from typing import TypeAlias

from protocol.commands import SendBatch
from protocol.grbl.asking import Request
from protocol.grbl.blocks import DISPLACED_BLOCKS
from protocol.grbl.lines import Line

SEGMENTS_AHEAD = 12
"""A block leaves the planner when its last segment is prepared; so many blocks more may wait in the step segment
buffer (Grbl 5, grblHAL 9) and would be lost with a reset."""


@dataclass(slots=True, eq=False)
class Errand:
    """A batch of a job, blocks by hand, or a request. `done` counts lines from the front."""

    lines: tuple[Line, ...]
    batch: SendBatch | None = None
    token: int | None = None
    request: Request | None = None
    sent: int = 0
    answered: int = 0
    done: int = 0
    failed: bool = False
    reach_mm: tuple[float, ...] = ()

    @property
    def waiting(self) -> bool:
        """It has lines that were not sent yet."""
        return not self.failed and self.sent < len(self.lines)


_Acknowledged: TypeAlias = tuple[Errand, int, bool, int]
"""Errand; number; whether it is inert; certain blocks planned up to this line, it included. A bare tuple, for there is
one for every line."""


@dataclass(slots=True)
class Executed:
    """Acknowledged lines of programs whose execution is not proven yet, oldest first."""

    count: int = 0  # lines ever acknowledged
    blocks: int = 0  # certain blocks ever planned, less those that may be none after all
    _open: deque[_Acknowledged] = field(default_factory=deque)

    @property
    def empty(self) -> bool:
        """Everything that was acknowledged is executed."""
        return not self._open

    def acknowledged(
        self, errand: Errand, *, inert: bool, certain: bool, rests: bool = False, planner: int | None = None
    ) -> list[Errand]:
        """One more line was answered. `inert`: it moves nothing (or was refused); `certain`: it has made a block;
        `rests`: its answer proves that everything is executed. `planner`: the most blocks that it holds, if known."""
        self.count = number = self.count + 1
        self.blocks = blocks = self.blocks + certain
        self._open.append((errand, number, inert, blocks))
        return self._take(number if rests else 0, -inf if planner is None else blocks - planner - SEGMENTS_AHEAD)

    def displaced(self) -> None:
        """The controller may not stand where the plan believes: some lines that go somewhere may go nowhere."""
        self.blocks -= DISPLACED_BLOCKS

    def at_rest(self, number: int) -> list[Errand]:
        """The machine stood with an empty planner after line `number` was acknowledged."""
        return self._take(number, -inf)

    def in_planner(self, blocks: int) -> list[Errand]:
        """No more than so many blocks are in the planner: what lies further back than these, and than the segments that
        are prepared already, is executed."""
        return self._take(0, self.blocks - blocks - SEGMENTS_AHEAD)

    def clear(self) -> None:
        """What is open now will never be known."""
        self._open.clear()

    def _take(self, number: int, blocks: float) -> list[Errand]:
        """Every line up to `number` is executed, and every one with no more than `blocks` certain blocks up to it, and
        the inert lines right behind; the errands that have come to their end with that."""
        ended: list[Errand] = []
        waiting = self._open
        while waiting:
            errand, line, inert, planned = waiting[0]
            if line > number and planned > blocks and not inert:
                break
            waiting.popleft()
            errand.done = done = errand.done + 1
            if done == len(errand.lines):
                ended.append(errand)
        return ended
