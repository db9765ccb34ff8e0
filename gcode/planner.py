"""How long a program takes: Grbl's planner over columns of motion, seconds for each segment (gcode.md §5).

The same model with other numbers stands for other controllers. Not a queue that runs on anything: no clock, no
machine, no correction by experience. The one rule: feeding in pieces of any size gives the same seconds.
"""

from collections.abc import Iterator

import numpy as np

from gcode.chords import Cut
from gcode.linkfloor import LinkFloor
from gcode.lookahead import backward_limits, durations, forward_speeds
from gcode.motion import Motion
from gcode.planblocks import BlockMaker, no_blocks
from gcode.segments import DWELL, Floats, Segments

PIECE_BLOCKS = 1 << 14
"""Blocks that are worked on at once: few enough for the processor's cache and for the memory of a small machine."""

DWELL_STEP_S = 0.05
"""Grbl dwells in steps of 50 ms, rounded up (nuts_bolts.c, DWELL_TIME_STEP)."""

LONGEST_DWELL_S = 1e9


class Planner:
    """Seconds for segments in the order in which they come; the last blocks wait until the queue behind them is known.

    `feed_override`, `rapid_override`: factors as Grbl 1.1 applies them, in force from the beginning.
    """

    def __init__(self, motion: Motion, axes: str, *, feed_override: float = 1.0, rapid_override: float = 1.0) -> None:
        self._maker = BlockMaker(motion, axes, feed_override=feed_override, rapid_override=rapid_override)
        # Of the ring one slot is always free, and the block that is running cannot be entered any more.
        self._ahead = max(motion.planner_blocks - 2, 0)
        self._waiting = no_blocks()
        self._entry2 = 0.0
        self._seconds = np.zeros(0)
        self._link = LinkFloor(motion.planner_blocks - 1)
        self._floors = np.zeros(0)

    def feed(self, segments: Segments, link_floor_s: Floats | None = None, *, ends: bool = False) -> Floats:
        """Take these segments too; seconds of all that have become final, first in, first out.

        `link_floor_s`: seconds that the link needs for the line of each (bytes · 10 / baud); nothing where absent.
        `ends`: the program ends with them, as `flush` says; for a short one that is much less to do.
        """
        floors = np.zeros(len(segments)) if link_floor_s is None else np.clip(np.nan_to_num(link_floor_s), 0.0, 1e9)
        self._floors = np.concatenate((self._floors, floors))
        # What is infinite, or no number, on the way is replaced where it would be used: no warning about it.
        with np.errstate(all="ignore"):
            pieces = list(self._pieces(segments))
            final = [self._piece(piece, cut, last=ends and piece is pieces[-1][0]) for piece, cut in pieces]
        return self._slowed(np.concatenate(final) if final else np.zeros(0))

    def flush(self) -> Floats:
        """The seconds still outstanding: the program ends here, the queue runs dry."""
        self._maker.at_rest = True
        return self._slowed(self._finish())

    def _slowed(self, seconds: Floats) -> Floats:
        floors, self._floors = self._floors[: len(seconds)], self._floors[len(seconds) :].copy()
        return self._link.slowed(seconds, floors)

    def _pieces(self, segments: Segments) -> Iterator[tuple[Segments, Cut]]:
        """Cut so that no piece has many more blocks than PIECE_BLOCKS; a long arc is a piece of its own."""
        cut = self._maker.cut(segments)
        upto = np.cumsum(cut.lines)
        first = 0
        while first < len(upto):
            before = upto[first - 1] if first else 0
            last = max(int(np.searchsorted(upto, before + PIECE_BLOCKS, "right")), first + 1)
            yield segments.take(slice(first, last)), cut.take(slice(first, last))
            first = last

    def _piece(self, segments: Segments, cut: Cut, *, last: bool) -> Floats:
        blocks = self._maker.make(segments, cut)
        blocks.row += len(self._seconds)
        self._waiting = self._waiting.then(blocks)
        self._seconds = np.concatenate((self._seconds, _dwells(segments)))
        self._maker.at_rest |= last
        return self._finish()

    def _finish(self) -> Floats:
        """Work out all blocks whose speeds nothing can change any more; hand out the rows that they complete."""
        waiting, ahead = self._waiting, self._ahead
        count = len(waiting)
        energy = 2.0 * waiting.acceleration * waiting.length
        if self._maker.at_rest:
            # What comes next begins at rest: a stop stands behind the last block.
            nothing = np.zeros(max(ahead, 1))
            limits, energy = np.concatenate((waiting.limit2, nothing)), np.concatenate((energy, nothing))
            weight = np.concatenate((waiting.weight, np.ones(len(nothing))))
            known = count + 1
        else:
            limits, weight = waiting.limit2, waiting.weight
            known = count - max(ahead, 1) + 1
        if known < 2:
            return self._hand_out()
        allowed2 = backward_limits(limits, energy, ahead, weight)[:known]
        allowed2[0] = self._entry2
        entry2 = forward_speeds(allowed2, energy[:known])
        self._close(known - 1, entry2)
        return self._hand_out()

    def _close(self, done: int, entry2: Floats) -> None:
        """The first `done` blocks are final; `entry2` has one more, the speed at which it goes on."""
        blocks = self._waiting
        row = blocks.row[:done]
        seconds = durations(
            entry2[:-1], entry2[1:], blocks.nominal[:done], blocks.acceleration[:done], blocks.length[:done]
        )
        seconds = np.minimum(seconds, blocks.longest_s[:done]) + blocks.pause_s[:done]
        self._seconds += np.bincount(row, weights=seconds, minlength=len(self._seconds))
        self._waiting = blocks.since(done, 0)
        self._entry2 = float(entry2[-1])

    def _hand_out(self) -> Floats:
        rows = int(self._waiting.row[0]) if len(self._waiting) else len(self._seconds)
        out, self._seconds = self._seconds[:rows], self._seconds[rows:].copy()
        self._waiting.row -= rows
        return out


def plan(
    segments: Segments,
    motion: Motion,
    *,
    feed_override: float = 1.0,
    rapid_override: float = 1.0,
    link_floor_s: Floats | None = None,
) -> Floats:
    """Seconds of each segment of a whole program."""
    planner = Planner(motion, segments.axes, feed_override=feed_override, rapid_override=rapid_override)
    return planner.feed(segments, link_floor_s, ends=True)


def _dwells(segments: Segments) -> Floats:
    """Seconds of the dwells; 0 for all else."""
    dwells = (segments.kind == DWELL) & (segments.dwell_s > 0)
    steps = np.ceil(np.where(dwells, np.minimum(segments.dwell_s, LONGEST_DWELL_S), 0.0) / DWELL_STEP_S - 1e-6)
    return np.maximum(steps, 0.0) * DWELL_STEP_S
