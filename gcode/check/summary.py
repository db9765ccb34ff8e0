"""What the program will do, in numbers: ways, times, tools, feeds, shortest and median segment. Not a judgement.

The one rule: memory does not grow with the program; what cannot be summed is counted in classes.
"""

from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gcode.check.moves import Moves
from gcode.check.piece import Piece
from gcode.findings import ToolUse
from gcode.segments import DWELL, Floats, Ints

MAX_LISTED = 100
"""Most tools and feeds that a report lists."""

_CLASS_BITS = 17
"""Of a float32 as an integer so many bits are dropped: the exponent and 6 bits stay, classes of 1 to 1.6 %."""

_CLASSES = 1 << (31 - _CLASS_BITS)


@dataclass(slots=True)
class _Tool:
    cut_mm: float = 0.0
    rapid_mm: float = 0.0
    seconds: float = 0.0


class Summary:
    """Sums over the pieces of a program."""

    def __init__(self) -> None:
        self.lines = 0
        self.wire_bytes = 0
        self.cut_mm = self.rapid_mm = self.plunge_mm = 0.0
        self.seconds = self.dwell_seconds = 0.0
        self.segments = self.arcs = 0
        self.shortest_mm: float | None = None
        self.spindle: tuple[float, float] | None = None
        self._classes: Ints = np.zeros(_CLASSES, np.int64)
        self._feeds: set[float] = set()
        self._named: set[int] = set()
        self._tools: dict[int, _Tool] = {}
        self._waiting: deque[tuple[int, int]] = deque()  # tool, segments whose seconds are still to come

    def look(self, piece: Piece, moves: Moves) -> None:
        """One piece of the program."""
        self.lines += piece.columns.lines
        sent = piece.sent_bytes
        self.wire_bytes += int(sent.sum()) + int(np.count_nonzero(sent))
        if "T" in piece.letters and len(self._named) < MAX_LISTED:
            self._named.update(map(int, np.unique(piece.values("T"))[:MAX_LISTED]))
        if "S" in piece.letters:
            speeds = piece.values("S")
            least, most = self.spindle or (np.inf, -np.inf)
            self.spindle = min(least, float(speeds.min())), max(most, float(speeds.max()))
        if len(moves):
            self._ways(moves)
            self._in_force(moves)

    def _ways(self, moves: Moves) -> None:
        segments, lengths = moves.segments, moves.lengths
        self.segments += len(moves)
        self.arcs += len(moves.arcs)
        dwells = segments.kind == DWELL
        if dwells.any():
            self.dwell_seconds += float(np.fmax(segments.dwell_s[dwells], 0.0).sum())
        cut, rapid = lengths * moves.is_cut, lengths * moves.is_rapid
        self.cut_mm += float(cut.sum())
        self.rapid_mm += float(rapid.sum())
        row = segments.row("Z")
        if row is not None:
            falling = moves.way(row) < 0.0
            if falling.any():
                self.plunge_mm += float(cut[falling & ~moves.moves_in("X", "Y")].sum())
        self._lengths(cut)
        for tool, places in _groups(segments.tool):
            if tool not in self._tools and len(self._tools) >= MAX_LISTED:
                continue
            use = self._tools.setdefault(tool, _Tool())
            use.cut_mm += float(cut[places].sum())
            use.rapid_mm += float(rapid[places].sum())
        self._wait(segments.tool)

    def _lengths(self, cut: Floats) -> None:
        lengths = cut.astype(np.float32)
        counts = np.bincount(lengths.view(np.int32) >> _CLASS_BITS, minlength=_CLASSES)
        self._classes += counts
        self._classes[0] = 0
        least = np.min(cut, where=cut > 0.0, initial=np.inf)
        if np.isfinite(least):
            self.shortest_mm = float(least) if self.shortest_mm is None else min(self.shortest_mm, float(least))

    def _in_force(self, moves: Moves) -> None:
        feed = moves.segments.feed
        if len(self._feeds) < MAX_LISTED:
            changed = np.concatenate(([True], feed[1:] != feed[:-1]))
            feeds = np.unique(feed[changed])
            self._feeds.update(feeds[feeds > 0.0][: MAX_LISTED - len(self._feeds)].tolist())

    # --- times --------------------------------------------------------------------------------------------------

    def _wait(self, tools: "np.ndarray[tuple[int], np.dtype[np.int32]]") -> None:
        ends = np.flatnonzero(tools[1:] != tools[:-1]) + 1
        bounds = [0, *ends.tolist(), len(tools)]
        for begin, end in pairwise(bounds):
            tool = int(tools[begin])
            if self._waiting and self._waiting[-1][0] == tool:
                self._waiting[-1] = tool, self._waiting[-1][1] + end - begin
            else:
                self._waiting.append((tool, end - begin))

    def take_seconds(self, seconds: Floats) -> None:
        """The seconds of the next segments, in their order."""
        self.seconds += float(seconds.sum())
        at = 0
        while at < len(seconds) and self._waiting:
            tool, count = self._waiting.popleft()
            taken = min(count, len(seconds) - at)
            if tool in self._tools:
                self._tools[tool].seconds += float(seconds[at : at + taken].sum())
            at += taken
            if taken < count:
                self._waiting.appendleft((tool, count - taken))

    # --- at the end ---------------------------------------------------------------------------------------------

    @property
    def feeds(self) -> tuple[float, ...]:
        """Feeds in force, mm/min, the first MAX_LISTED of them."""
        return tuple(sorted(self._feeds))

    @property
    def tools(self) -> tuple[int, ...]:
        """Tools that the program names."""
        return tuple(sorted(self._named))

    @property
    def by_tool(self) -> tuple[ToolUse, ...]:
        """What each tool does, by its number."""
        found = sorted(self._tools.items())[:MAX_LISTED]
        return tuple(ToolUse(tool, use.cut_mm, use.rapid_mm, use.seconds) for tool, use in found)

    @property
    def median_mm(self) -> float | None:
        """The median length of what cuts, to 1 %; None where nothing does."""
        total = np.cumsum(self._classes)
        if not total[-1]:
            return None
        place = int(np.searchsorted(total, (total[-1] + 1) // 2))
        # The middle of the class.
        bits = np.array([(place << _CLASS_BITS) + (1 << (_CLASS_BITS - 1))], np.int32)
        return float(bits.view(np.float32)[0])


def _groups(tools: "np.ndarray[tuple[int], np.dtype[np.int32]]") -> list[tuple[int, "np.ndarray | slice"]]:
    if tools.min() == tools.max():
        return [(int(tools[0]), slice(None))]
    return [(int(tool), tools == tool) for tool in np.unique(tools)[:MAX_LISTED]]
