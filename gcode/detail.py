"""Coarser levels of a drawing: corners left out, with a bound on how far the path may run from what it was.

Not the corners themselves (vertices.py). Corner m between a and b goes when error + distance(m, ab) stays within the
tolerance, where error is what the edges a-m and m-b are off already: the distance to a straight line is convex, so
every point of the path is within that sum. An arc becomes an edge when its bulge is within the tolerance, and the bulge
is the error of that edge. The one rule: the bound holds for the whole path, after however many passes.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcode.segments import CCW, CW, FEED, Bools, Floats, Ints
from gcode.vertices import START, UNIT, Vertices

TOLERANCES_MM = (0.02, 0.1, 0.5, 2.5)
"""Of the levels that are made; which of them are worth keeping is seen in the end."""

_IDLE_SHARE = 20
"""A pass that leaves out less than one in so many is the last of its kind."""

_STALE = -1.0


class Thinning:
    """A piece of path on its way to the coarser levels. `chosen`: which of the piece's vertices are left."""

    def __init__(self, vertices: Vertices) -> None:
        self._vertices = vertices
        self._kind = vertices.kind.copy()
        self._curved = np.ones(len(vertices.arcs), np.bool_)
        self._moving = [row for row in vertices.position if np.any(row != row[0])]
        self._error = np.zeros(len(vertices))
        # What the path would be off without the corner, as long as its neighbours stay.
        self._cost = np.full(len(vertices), _STALE)
        self._same = _same(vertices)
        self._free = self._freed()
        self.chosen: Ints = np.arange(len(vertices))

    def thin(self, tolerance_mm: float) -> Ints:
        """Leave out what may be left out; the numbers of those that stay. The first and the last do."""
        tolerance = tolerance_mm / UNIT
        self._straighten(tolerance)
        idle, parity = 0, 0
        while idle < 2 and len(self.chosen) > 2:
            before = len(self.chosen)
            self._pass(tolerance, 1 + parity)
            parity = 1 - parity
            idle = idle + 1 if (before - len(self.chosen)) * _IDLE_SHARE < before else 0
        return self.chosen

    def left(self) -> Vertices:
        """The corners that are left, and the arcs."""
        whole, chosen = self._vertices, self.chosen
        curved = np.flatnonzero(self._curved)
        at = whole.arcs.at[curved]
        return Vertices(
            whole.position[:, chosen],
            whole.line[chosen],
            self._kind[chosen],
            whole.feed[chosen],
            whole.tool[chosen],
            whole.frame[chosen],
            whole.unknown[chosen],
            whole.arcs.picked(curved, np.searchsorted(chosen, at)),
        )

    def _straighten(self, tolerance: float) -> None:
        arcs = self._vertices.arcs
        flat = np.flatnonzero(self._curved & (arcs.bulge <= tolerance))
        if not len(flat):
            return
        self._curved[flat] = False
        self._kind[arcs.at[flat]] = FEED
        # Neither end of an arc has gone yet.
        self._error[np.searchsorted(self.chosen, arcs.at[flat])] = arcs.bulge[flat]
        self._free = self._freed()[self.chosen]

    def _freed(self) -> Bools:
        """Corners that may go, of all: the ways before and behind are straight and of one kind. No order is lost:
        what has gone was between two of a kind.
        """
        kind = self._kind
        free = self._same.copy()
        straight = kind != CW
        straight &= kind != CCW
        straight &= kind < START
        free[1:-1] &= (kind[1:-1] == kind[2:]) & straight[1:-1]
        return free

    def _pass(self, tolerance: float, first: int) -> None:
        """Every second corner from `first` is tried: neighbours must not go at once."""
        middle = first + 2 * np.flatnonzero(self._free[first:-1:2])
        stale = middle[self._cost[middle] == _STALE]
        if len(stale):
            error = np.maximum(self._error[stale], self._error[stale + 1])
            error += _distance(self._moving, *(self.chosen[stale + step] for step in (-1, 0, 1)))
            self._cost[stale] = error
        gone = middle[self._cost[middle] <= tolerance]
        if not len(gone):
            return
        self._error[gone + 1] = self._cost[gone]
        self._cost[gone - 1] = self._cost[gone + 1] = _STALE
        stay = np.ones(len(self.chosen), np.bool_)
        stay[gone] = False
        kept = np.flatnonzero(stay)
        self._error, self._cost, self._free = self._error[kept], self._cost[kept], self._free[kept]
        self.chosen = self.chosen[kept]


def _same(vertices: Vertices) -> Bools:
    """Corners with one tool and frame before and behind, and nothing unknown anew.

    The feed may change: it is worth a colour, not a corner.
    """
    found = np.zeros(len(vertices), np.bool_)
    if len(vertices) < 3:
        return found
    same = vertices.unknown[:-2] == vertices.unknown[1:-1]
    for column in (vertices.tool, vertices.frame, vertices.unknown):
        same &= column[1:-1] == column[2:]
    found[1:-1] = same
    return found


def _distance(axes: Sequence[NDArray[np.int32]], before: Ints, middle: Ints, behind: Ints) -> Floats:
    """Of each point from the straight line between its neighbours, ends included."""
    along = np.zeros(len(middle))
    length = np.zeros(len(middle))
    ways = []
    for row in axes:
        start = row[before].astype(np.float64)
        way, here = row[behind] - start, row[middle] - start
        along += way * here
        length += way * way
        ways.append((way, here))
    share = np.clip(along / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    square = np.zeros(len(middle))
    for way, here in ways:
        here -= way * share
        square += here * here
    return np.sqrt(square)
