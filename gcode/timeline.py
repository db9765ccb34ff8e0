"""Planned seconds up to any line of a program: a table of about a thousand places, and what overrides do to them.

Not the planner, which it asks, and not what a machine really takes: that is learned from runs (jobs/experience.py).
The one rule: memory depends on the number of places, never on the length of the program.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

import numpy as np

from gcode.motion import ASSUMED_FEED_MM_MIN, Motion
from gcode.planner import Planner
from gcode.segments import CCW, CW, FEED, RAPID, Floats, Ints, Segments

PLACES = 1000
"""Rows of the table. A program of fewer lines is known line by line; else there is a straight line in between."""

MOST_ASKED = 16
"""Answers that are kept."""

MOST_S = 1e9
"""Of one segment; what is longer, infinite or no number is an odd program and no estimate."""

FEED_ROW, RAPID_ROW, OTHER_ROW, LINK_ROW = range(4)
"""Rows of the table: what the feed override changes, what the rapid override changes, what neither does, the link."""


@dataclass(frozen=True, slots=True)
class Overrides:
    """Factors in force; 1 is what the program says."""

    feed: float = 1.0
    rapid: float = 1.0


AS_PROGRAMMED = Overrides()


class Span(NamedTuple):
    """Planned seconds of consecutive lines.

    `feed_s` would be the time of the cuts at their programmed feed; `rapid_s` is that of the rapids; `other_s` is what
    no override changes: speeding up and slowing down between the cuts, dwells, homing, probes. `link_s`: what the bytes
    need on the link, 0 where its rate is not known; it runs beside the motion.
    """

    feed_s: float
    rapid_s: float
    other_s: float
    link_s: float

    def seconds(self, overrides: Overrides = AS_PROGRAMMED) -> float:
        """Of the motion under these overrides."""
        return self.feed_s / overrides.feed + self.rapid_s / overrides.rapid + self.other_s


class Timeline:
    """`table`: cumulative seconds (4, places + 1) before the first line and behind the lines of each place."""

    __slots__ = ("_asked", "_step", "_table", "lines", "total_s")

    def __init__(self, table: Floats, lines: int) -> None:
        self.lines = max(lines, 1)
        self._table = table
        self._step = _step(self.lines)
        self._asked: dict[int, list[float]] = {}
        self.total_s = self.between(0, self.lines).seconds()
        """Planned seconds of the whole program."""

    @classmethod
    def of(cls, segments: Iterable[Segments], motion: Motion, axes: str, lines: int) -> "Timeline":
        """Of the motion of a program of so many lines, in order."""
        maker = TimelineMaker(motion, axes, lines)
        for piece in segments:
            maker.add(piece)
        return maker.finish()

    def seconds_before(self, line: int) -> float:
        """Planned seconds of everything that stands before this line."""
        return self.between(0, line - 1).seconds()

    def between(self, behind: int, last: int) -> Span:
        """Of the lines after `behind`, up to and with `last`; nothing where there are none."""
        feed_s, rapid_s, other_s, link_s = self._at(behind)
        feed_to, rapid_to, other_to, link_to = self._at(max(last, behind))
        return Span(feed_to - feed_s, rapid_to - rapid_s, other_to - other_s, link_to - link_s)

    def _at(self, line: int) -> list[float]:
        """The table behind `line`. While a job runs most questions have an end in common with the one before."""
        if line not in self._asked:
            if len(self._asked) >= MOST_ASKED:
                self._asked.clear()
            self._asked[line] = self._interpolated(min(max(line, 0), self.lines))
        return self._asked[line]

    def _interpolated(self, line: int) -> list[float]:
        """A straight line within a place."""
        place = min(line // self._step, self._table.shape[1] - 2)
        begin = place * self._step
        end = min(begin + self._step, self.lines)
        share = (line - begin) / (end - begin)
        # Not before + share · (behind - before): behind the last line of a place exactly what stands in the table.
        return [
            before * (1.0 - share) + behind * share for before, behind in self._table[:, place : place + 2].tolist()
        ]


class TimelineMaker:
    """Takes the motion of a program piece by piece; `lines` it has at most."""

    def __init__(self, motion: Motion, axes: str, lines: int) -> None:
        self._planner = Planner(motion, axes)
        self._lines = max(lines, 1)
        self._step = _step(self._lines)
        self._sums = np.zeros((4, -(-self._lines // self._step)))
        self._place: Ints = np.zeros(0, np.int64)
        self._kind = np.zeros(0, np.uint8)
        self._at_feed_s = np.zeros(0)

    def add(self, segments: Segments, link_floor_s: Floats | None = None) -> None:
        """The next segments; `link_floor_s` as for the planner."""
        self._place = np.concatenate((self._place, self._places(segments.line)))
        self._kind = np.concatenate((self._kind, segments.kind))
        self._at_feed_s = np.concatenate((self._at_feed_s, _at_feed_s(segments)))
        self._settle(self._planner.feed(segments, link_floor_s))

    def add_link(self, lines: Ints, seconds: Floats) -> None:
        """What these lines need on the link."""
        self._count(LINK_ROW, self._places(lines), seconds)

    def add_rests(self, lines: Ints, seconds: Floats) -> None:
        """How long the machine stands at these lines, beside what the planner knows of."""
        self._count(OTHER_ROW, self._places(lines), seconds)

    def finish(self) -> Timeline:
        """The table. To be called once."""
        self._settle(self._planner.flush())
        table = np.zeros((4, self._sums.shape[1] + 1))
        np.cumsum(self._sums, axis=1, out=table[:, 1:])
        return Timeline(table, self._lines)

    def _places(self, lines: Ints) -> Ints:
        places: Ints = np.clip(lines - 1, 0, self._lines - 1) // self._step
        return places

    def _settle(self, seconds: Floats) -> None:
        """The seconds of the segments that have waited longest."""
        count = len(seconds)
        if not count:
            return
        seconds = np.where(np.isfinite(seconds), np.clip(seconds, 0.0, MOST_S), 0.0)
        place, kind, at_feed = self._place[:count], self._kind[:count], self._at_feed_s[:count]
        rapid = kind == RAPID
        by_feed = np.minimum(at_feed, seconds)
        self._count(FEED_ROW, place, by_feed)
        self._count(RAPID_ROW, place, seconds * rapid)
        self._count(OTHER_ROW, place, (seconds - by_feed) * ~rapid)
        self._place, self._kind = self._place[count:].copy(), self._kind[count:].copy()
        self._at_feed_s = self._at_feed_s[count:].copy()

    def _count(self, row: int, place: Ints, seconds: Floats) -> None:
        self._sums[row] += np.bincount(place, weights=seconds, minlength=self._sums.shape[1])


def overrides_of(percent: Mapping[str, float]) -> Overrides:
    """Factors from per cent by name (`feed`, `rapid`), as machines report them; what makes no sense counts as 100."""
    return Overrides(*(_factor(percent.get(name, 100.0)) for name in ("feed", "rapid")))


def _factor(percent: float) -> float:
    return percent / 100.0 if isfinite(percent) and percent > 0 else 1.0


def _step(lines: int) -> int:
    return -(-lines // PLACES)


def _at_feed_s(segments: Segments) -> Floats:
    """What each cut takes at its feed all the way; 0 for all that the feed override does not change."""
    governed = (segments.kind == FEED) | (segments.kind == CW) | (segments.kind == CCW)
    feed = np.where(np.isnan(segments.feed), ASSUMED_FEED_MM_MIN, segments.feed)
    with np.errstate(all="ignore"):
        seconds = segments.lengths() / feed * 60.0
    return np.where(governed & np.isfinite(seconds) & (seconds > 0.0), seconds, 0.0)
