"""Blocks that are ready to go, as columns: what the readers (upcoming.py, frames.py) give and batches are cut from.

Columns because there is one block for every line: a slice of a list is taken by the interpreter itself, an object for
each block would be most of the work. Not where a batch ends; that is batch.py. The one rule: a block that travels alone
is the last of its stretch, and in no column.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from jobs.barriers import Barrier

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
IoWords = tuple[tuple[str, int], ...]
"""Words for a tool changer in their order, as ("T", 3), ("M", 8)."""
SURELY = 0.999
"""Of a bound: the seconds of a batch, as the difference of two sums, are exact to far more digits."""


@dataclass(slots=True)
class Upcoming:
    """One block. `cost_s` counts against the bound of a batch: without end where the length is not known.

    `end`: where the machine stands behind it, program coordinates in the order of the state's axes, NaN unknown.
    `part`, `io`, `reach_mm`: as in jobs.batch.PlannedBatch. `behind`: further blocks of the same line that go with it.
    """

    line: int
    text: str
    seconds: float
    cost_s: float
    moves: bool
    end: tuple[float, ...]
    reach_mm: float = 0.0
    barrier: Barrier | None = None
    tool: int | None = None
    part: int = 0
    io: IoWords = ()
    behind: tuple[str, ...] = ()


@dataclass(slots=True)
class Stretch:
    """Consecutive blocks, each column as the field of Upcoming; `alone` comes behind them: the one with a barrier.

    `sizes`: bytes of each text. `moves`: a byte each, 0 or 1. `ends`: (blocks, axes). `parts`, `io`: of the few blocks
    that have any, by their place in the columns.
    """

    lines: Ints
    texts: list[str]
    sizes: Ints
    seconds: Floats
    cost_s: Floats
    moves: bytes
    ends: Floats
    reach_mm: Floats
    parts: Mapping[int, int] = field(default_factory=dict)
    io: Mapping[int, IoWords] = field(default_factory=dict)
    alone: Upcoming | None = None

    @classmethod
    def of(cls, blocks: Sequence[Upcoming], alone: Upcoming | None = None) -> Self:
        """Of blocks that were made one by one."""
        return cls(
            lines=np.array([block.line for block in blocks], np.int64),
            texts=[block.text for block in blocks],
            sizes=np.array([len(block.text) for block in blocks], np.int64),
            seconds=np.array([block.seconds for block in blocks], np.float64),
            cost_s=np.array([block.cost_s for block in blocks], np.float64),
            moves=bytes([block.moves for block in blocks]),
            ends=np.array([block.end for block in blocks], np.float64).reshape(len(blocks), -1 if blocks else 0),
            reach_mm=np.array([block.reach_mm for block in blocks], np.float64),
            parts={place: block.part for place, block in enumerate(blocks) if block.part},
            io={place: block.io for place, block in enumerate(blocks) if block.io},
            alone=alone,
        )

    def one(self, place: int) -> Upcoming:
        """A block of the columns by itself."""
        return Upcoming(
            line=int(self.lines[place]),
            text=self.texts[place],
            seconds=float(self.seconds[place]),
            cost_s=float(self.cost_s[place]),
            moves=bool(self.moves[place]),
            end=self.end(place),
            reach_mm=float(self.reach_mm[place]),
            part=self.parts.get(place, 0),
            io=self.io.get(place, ()),
        )

    def end(self, place: int) -> tuple[float, ...]:
        """Where the machine stands behind a block."""
        return tuple(self.ends[place].tolist())

    def since(self, first: int) -> "Stretch":
        """From the block `first` on."""
        return Stretch(
            self.lines[first:],
            self.texts[first:],
            self.sizes[first:],
            self.seconds[first:],
            self.cost_s[first:],
            self.moves[first:],
            self.ends[first:],
            self.reach_mm[first:],
            {place - first: part for place, part in self.parts.items() if place >= first},
            {place - first: words for place, words in self.io.items() if place >= first},
            self.alone,
        )

    def then(self, others: "Stretch") -> "Stretch":
        """These and the others behind them; nothing of these travels alone."""
        if not self.texts:
            return others
        if not others.texts:
            return replace(self, alone=others.alone)
        count = len(self.texts)
        return Stretch(
            np.concatenate((self.lines, others.lines)),
            self.texts + others.texts,
            np.concatenate((self.sizes, others.sizes)),
            np.concatenate((self.seconds, others.seconds)),
            np.concatenate((self.cost_s, others.cost_s)),
            self.moves + others.moves,
            np.concatenate((self.ends, others.ends)),
            np.concatenate((self.reach_mm, others.reach_mm)),
            {**self.parts, **{count + place: part for place, part in others.parts.items()}},
            {**self.io, **{count + place: words for place, words in others.io.items()}},
            others.alone,
        )


class Ahead:
    """The blocks that are in no batch yet: those of `blocks` from place `at` on, and the one that travels alone."""

    __slots__ = ("_leaps", "_upto_bytes", "_upto_s", "at", "blocks")

    def __init__(self) -> None:
        self.blocks = Stretch.of(())
        self.at = 0
        self._upto_bytes = np.zeros(1, np.int64)
        self._upto_s = np.zeros(1)
        self._leaps: list[int] = []

    @property
    def left(self) -> int:
        """How many are in the columns."""
        return len(self.blocks.texts) - self.at

    def add(self, others: Stretch) -> None:
        """These come behind all that are ahead."""
        self.blocks = self.blocks.since(self.at).then(others)
        self.at = 0
        # Each with a separator, as between two of a batch.
        self._upto_bytes = np.concatenate(([0], np.cumsum(self.blocks.sizes + 1)))
        self._upto_s = np.concatenate(([0.0], np.cumsum(self.blocks.cost_s)))
        self._leaps = (np.flatnonzero(np.diff(self.blocks.lines) != 1) + 1).tolist()

    def fitting(self, most_blocks: int, most_bytes: int, most_s: float) -> int:
        """How many fit into one batch. One motion alone may be too long: it cannot be divided."""
        at, upto_bytes, upto_s = self.at, self._upto_bytes, self._upto_s
        stop = min(at + most_blocks, len(self.blocks.texts))
        most_bytes += upto_bytes.item(at) + 1
        if upto_bytes.item(stop) > most_bytes:
            stop = int(upto_bytes.searchsorted(most_bytes, "right")) - 1
        if upto_s.item(stop) - upto_s.item(at) < SURELY * most_s:
            return stop - at
        sums_s = self.blocks.cost_s[at:stop].cumsum()
        count = int(sums_s.searchsorted(most_s, "right"))
        if count == stop - at or (count and sums_s[count - 1] > 0.0):
            return count
        # The first that takes any time is too long; what takes none goes with it.
        timed = np.flatnonzero(self.blocks.cost_s[at + count + 1 : stop])
        return count + 1 + int(timed[0]) if len(timed) else stop - at

    def up_to_motion(self, count: int) -> int:
        """So many of the next blocks as there are up to the last one of them that moves; 0: none moves."""
        last = self.blocks.moves.rfind(1, self.at, self.at + count)
        return last + 1 - self.at if last >= 0 else 0

    def lines(self, count: int) -> tuple[int, ...]:
        """The line of each of the next blocks; empty where they follow one another."""
        leap = bisect_right(self._leaps, self.at)
        if leap == len(self._leaps) or self._leaps[leap] >= self.at + count:
            return ()
        return tuple(self.blocks.lines[self.at : self.at + count].tolist())

    def end(self, count: int) -> tuple[float, ...]:
        """Where the machine stands behind the next blocks."""
        return self.blocks.end(self.at + count - 1)
