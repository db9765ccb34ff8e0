"""Coarser levels of a drawing: corners left out, with a bound on how far the path may run from what it was.

Not the corners themselves (vertices.py). Corner m between a and b goes when error + distance(m, ab) stays within the
tolerance, where error is what the edges a-m and m-b are off already: the distance to a straight line is convex, so
every point of the path is within that sum. The one rule: the bound holds for the whole path, after however many passes.
"""

import numpy as np
from numpy.typing import NDArray

from gcode.segments import CCW, CW, FEED, Bools, Floats, Ints
from gcode.vertices import START, UNIT, Vertices

TOLERANCES_MM = (0.02, 0.1, 0.5, 2.5)
"""Of the levels that are made; which of them are worth keeping is seen in the end."""

_IDLE_SHARE = 50
"""A pass that leaves out less than one in so many is the last of its kind."""


class Thinning:
    """A piece of path on its way to the coarser levels. `chosen`: which of the piece's vertices are left."""

    def __init__(self, vertices: Vertices) -> None:
        moving = [row for row in vertices.position if np.any(row != row[0])]
        self._points = np.array(moving, np.float64).reshape(len(moving), len(vertices))
        self._error = np.zeros(len(vertices))
        self._free = _free(vertices)
        self.chosen: Ints = np.arange(len(vertices))

    def thin(self, tolerance_mm: float) -> Ints:
        """Leave out what may be left out; the numbers of those that stay. The first and the last do."""
        tolerance = tolerance_mm / UNIT
        idle, parity = 0, 0
        while idle < 2 and len(self.chosen) > 2:
            before = len(self.chosen)
            self._pass(tolerance, 1 + parity)
            parity = 1 - parity
            idle = idle + 1 if (before - len(self.chosen)) * _IDLE_SHARE < before else 0
        return self.chosen

    def _pass(self, tolerance: float, first: int) -> None:
        """Every second corner from `first` is tried: neighbours must not go at once."""
        middle = np.arange(first, len(self.chosen) - 1, 2)
        middle = middle[self._free[middle]]
        error = np.maximum(self._error[middle], self._error[middle + 1])
        error += _distance(self._points, middle)
        gone = middle[error <= tolerance]
        if not len(gone):
            return
        self._error[gone + 1] = error[error <= tolerance]
        stay = np.ones(len(self.chosen), np.bool_)
        stay[gone] = False
        self._points = self._points[:, stay]
        self._error, self._free, self.chosen = self._error[stay], self._free[stay], self.chosen[stay]


def _free(vertices: Vertices) -> Bools:
    """Corners that may go: the ways before and behind are of one kind, tool and frame, and nothing is unknown anew.

    Arcs count as straight cuts here. The feed may change: it is worth a colour, not a corner.
    """
    kind = _class(vertices.kind)
    free = np.zeros(len(vertices), np.bool_)
    if len(vertices) < 3:
        return free
    same = (kind[1:-1] == kind[2:]) & (kind[1:-1] < START)
    for column in (vertices.tool, vertices.frame, vertices.unknown):
        same &= column[1:-1] == column[2:]
    same &= vertices.unknown[:-2] == vertices.unknown[1:-1]
    free[1:-1] = same
    return free


def _class(kind: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """At a coarser level the chords of arcs are cuts like others."""
    return np.where((kind == CW) | (kind == CCW), np.uint8(FEED), kind)


def coarser(vertices: Vertices, chosen: Ints) -> Vertices:
    """The corners of a coarser level."""
    left = vertices.picked(chosen)
    left.kind = _class(left.kind)
    return left


def _distance(points: Floats, middle: Ints) -> Floats:
    """Of each point from the straight line between its neighbours, ends included."""
    along = np.zeros(len(middle))
    length = np.zeros(len(middle))
    ways = []
    for row in points:
        start = row[middle - 1]
        way, here = row[middle + 1] - start, row[middle] - start
        along += way * here
        length += way * way
        ways.append((way, here))
    share = np.clip(along / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    square = np.zeros(len(middle))
    for way, here in ways:
        here -= way * share
        square += here * here
    return np.sqrt(square)
