"""Whether the link keeps up: the bytes that the machine needs beside the time that its motion takes.

Not a model of a protocol: what waits for answers on the way is slower still. The one rule: a place is reported where
the queue of the machine, full at first, runs dry, and not where a few short lines follow each other.
"""

from dataclasses import dataclass

import numpy as np

from gcode.check.moves import Moves
from gcode.check.piece import Piece, Reporter
from gcode.segments import Floats, Ints

BITS_A_BYTE = 10
"""Start bit, eight bits, stop bit (gcode §5)."""

MAX_PLACES = 100
"""Stretches that are told one by one."""


@dataclass(slots=True)
class _Stretch:
    """Consecutive windows in which the link is too slow."""

    first_line: int
    last_line: int
    ratio: float
    rate_bytes_s: float


class LinkRules:
    """Slides a window of as many segments as the machine can queue over the program.

    In a window the link must carry its bytes in the time that the segments of the window take.
    """

    def __init__(self, reporter: Reporter, baud: int, planner_blocks: int) -> None:
        self._reporter = reporter
        self._bytes_s = baud / BITS_A_BYTE
        self._window = max(2, planner_blocks)
        self._left_over = 0
        self._seconds: Floats = np.zeros(0)
        self._bytes: Floats = np.zeros(0)
        self._lines: Ints = np.zeros(0, np.int64)
        self._stretch: _Stretch | None = None

    def look(self, piece: Piece, moves: Moves) -> None:
        """One piece of the program: which bytes go out before each segment. What moves nothing goes with the next."""
        sent = piece.sent_bytes
        total = np.cumsum(sent + (sent > 0))
        here = (
            np.concatenate(([-self._left_over], total[np.maximum(moves.rows, 0)]))
            if len(total)
            else np.full(len(moves) + 1, -self._left_over)
        )
        self._left_over = int(total[-1] - here[-1]) if len(total) else self._left_over
        self._lines = np.concatenate((self._lines, piece.lines(moves.rows)))
        self._bytes = np.concatenate((self._bytes, np.diff(here).astype(np.float64)))

    def take_seconds(self, seconds: Floats) -> None:
        """The seconds of the next segments, in their order."""
        self._seconds = np.concatenate((self._seconds, seconds))
        count = len(self._seconds) - self._window + 1
        if count <= 0:
            return
        need = _sums(self._bytes[: len(self._seconds)], self._window) / self._bytes_s
        have = _sums(self._seconds, self._window)
        slow = np.flatnonzero(need > have)
        if len(slow):
            self._stretches(slow, need, have)
        elif self._stretch:
            self._close_stretch()
        # The last windows begin in what is kept, so no window is looked at twice.
        self._lines, self._bytes, self._seconds = self._lines[count:], self._bytes[count:], self._seconds[count:]

    def close(self) -> None:
        """At the end of the program."""
        if self._stretch:
            self._close_stretch()

    def _stretches(self, slow: Ints, need: Floats, have: Floats) -> None:
        """Windows that overlap or follow each other are one place."""
        breaks = np.flatnonzero(np.diff(slow) > self._window)
        for part in np.split(slow, breaks + 1)[: MAX_PLACES + 1]:
            first, last = int(part[0]), int(part[-1])
            if self._stretch and first > self._window:
                self._close_stretch()
            with np.errstate(divide="ignore"):
                ratios = need[part] / have[part]
            worst = int(np.argmax(ratios))
            ratio = float(ratios[worst])
            rate = self._bytes_s * ratio
            last_line = int(self._lines[last + self._window - 1])
            if self._stretch is None:
                self._stretch = _Stretch(int(self._lines[first]), last_line, ratio, rate)
            else:
                self._stretch.last_line = last_line
                if ratio > self._stretch.ratio:
                    self._stretch.ratio, self._stretch.rate_bytes_s = ratio, rate
            if last < len(need) - self._window:
                self._close_stretch()

    def _close_stretch(self) -> None:
        stretch, self._stretch = self._stretch, None
        if stretch is None:
            return
        needed = f"{stretch.rate_bytes_s:.0f}" if np.isfinite(stretch.rate_bytes_s) else "any number of"
        text = (
            f"the machine will starve up to line {stretch.last_line}: its motion needs {needed} bytes/s, "
            f"the link carries {self._bytes_s:.0f}"
        )
        self._reporter.found.add("warning", stretch.first_line, 0, "link_too_slow", text)


def _sums(values: Floats, window: int) -> Floats:
    """The sum of each window."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    sums: Floats = total[window:] - total[:-window]
    return sums
