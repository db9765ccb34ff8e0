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
    """A batch of a job, blocks by hand, or a request. `done` counts lines from the front; `counted`: those with an
    answer of which `Executed` knows."""

    lines: tuple[Line, ...]
    batch: SendBatch | None = None
    token: int | None = None
    request: Request | None = None
    sent: int = 0
    answered: int = 0
    counted: int = 0
    done: int = 0
    failed: bool = False
    reach_mm: tuple[float, ...] = ()

    @property
    def waiting(self) -> bool:
        """It has lines that were not sent yet."""
        return not self.failed and self.sent < len(self.lines)


_Acknowledged: TypeAlias = tuple[Errand, int, int, bool, int]
"""Lines of an errand, which follow one another: how many; of the last one its number, whether it is inert, and the
certain blocks planned up to it, it included. Where they are several each has made a block."""


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
        errand.counted = errand.answered
        self._append(errand, 1, int(certain), inert=inert)
        return self._take(self.count if rests else 0, self._left(planner))

    def planned(self, errand: Errand, least_mm: float) -> None:
        """`acknowledged` for those lines of an errand which have their answer and were not counted yet: all of them
        move, and none is the last one. A line of so many mm and more has made a block."""
        reach_mm = errand.reach_mm[errand.counted : errand.answered]
        errand.counted = errand.answered
        if reach_mm and min(reach_mm) >= least_mm:
            self._append(errand, len(reach_mm), len(reach_mm))
            return
        for reach in reach_mm:
            self._append(errand, 1, int(reach >= least_mm))

    def behind(self, planner: int | None) -> list[Errand]:
        """What of the lines that are planned already has left a planner of so many blocks, if it is known."""
        return self._take(0, self._left(planner))

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

    def _append(self, errand: Errand, lines: int, blocks: int, *, inert: bool = False) -> None:
        self.count += lines
        self.blocks += blocks
        self._open.append((errand, lines, self.count, inert, self.blocks))

    def _left(self, planner: int | None) -> float:
        """So many blocks have left a planner that holds so many."""
        return -inf if planner is None else self.blocks - planner - SEGMENTS_AHEAD

    def _take(self, number: int, blocks: float) -> list[Errand]:
        """Every line up to `number` is executed, and every one with no more than `blocks` certain blocks up to it, and
        the inert lines right behind; the errands that have come to their end with that."""
        ended: list[Errand] = []
        waiting = self._open
        while waiting:
            errand, lines, last, inert, planned = waiting[0]
            short = 0 if inert or last <= number else min(last - number, planned - blocks)
            executed = lines - int(max(min(short, lines), 0))
            errand.done += executed
            if executed < lines:
                waiting[0] = (errand, lines - executed, last, inert, planned)
                break
            waiting.popleft()
            if errand.done == len(errand.lines):
                ended.append(errand)
        return ended
