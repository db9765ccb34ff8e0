"""Feeds and arcs: moves without a feed, feeds that no axis reaches, arcs that cannot be. Not where the moves lead.

The one rule: an arc or a feed that depends on something nobody knows is not judged.
"""

import numpy as np

from gcode.check.moves import Moves
from gcode.check.piece import Piece, Reporter
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.segments import PLANE_AXES, Ints

ARC_GAP_MM = 0.005
"""Radii at start and end may differ by so much, or by ARC_GAP of the radius (Grbl's limits, rs274 §4)."""

ARC_GAP = 0.001

ARC_GAP_MAX_MM = 0.5
"""No radius is so large that they may differ by more."""

IMPLAUSIBLE_RATIO = 10.0
"""A feed so many times over what the fastest axis can is a slip: of the units, or of a digit."""

_ROUNDING = 1.0 + 1e-6
_PLANES = ("G17", "G18", "G19")


class MotionRules:
    """See the head of this file. What is remembered is the plane that the program named last."""

    def __init__(self, profile: Profile, motion: Motion, reporter: Reporter) -> None:
        self._profile = profile
        self._motion = motion
        self._reporter = reporter
        self._plane = f"G{profile.initial.get('plane', 17)}"

    def look(self, piece: Piece, moves: Moves) -> None:
        """One piece of the program."""
        if len(moves):
            self._feeds(piece, moves)
            self._rates(piece, moves)
        self._arcs(piece, moves)

    # --- feeds --------------------------------------------------------------------------------------------------

    def _feeds(self, piece: Piece, moves: Moves) -> None:
        missing = moves.is_cut & ~(moves.segments.feed > 0.0)
        if missing.any():
            rows = np.unique(moves.rows[missing])
            rows = rows[piece.unnoted(rows)]
            text = "a feed move without a feed: no F before it, or F0"
            self._reporter.rows(piece, rows, "error", "feed_missing", text, at="F")

    def _rates(self, piece: Piece, moves: Moves) -> None:
        """Feeds beyond what the axes can: the controller would go slower, and the times of the program are wrong."""
        rates = {axis: rate for axis, rate in self._motion.max_rate.items() if axis.upper() in moves.segments.axes}
        if not rates:
            return
        feed = np.where(moves.is_cut, moves.segments.feed, 0.0)
        most = np.fmax.reduce(feed)
        if not most > min(rates.values()) * _ROUNDING:
            return
        fastest = max(rates.values())
        wild = np.unique(moves.rows[feed > IMPLAUSIBLE_RATIO * fastest])
        text = f"a feed {IMPLAUSIBLE_RATIO:g} times over what the fastest axis can ({fastest:g} mm/min): is it a slip?"
        self._reporter.rows(piece, wild, "warning", "feed_implausible", text, at="F")
        for axis, rate in sorted(rates.items()):
            self._rate(piece, moves, axis, rate)

    def _rate(self, piece: Piece, moves: Moves, axis: str, rate: float) -> None:
        """One axis: on a line its share of the feed; on an arc the mean of it, or all from half a turn on."""
        segments = moves.segments
        row = segments.axes.index(axis.upper())
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.abs(moves.way(row)) / moves.lengths
        for plane, axes in PLANE_AXES.items():
            if axis.upper() in axes[:2]:
                far = moves.arcs[(segments.plane[moves.arcs] == plane) & (np.abs(segments.sweep[moves.arcs]) >= np.pi)]
                share[far] = 1.0
        asked = np.where(moves.is_cut, segments.feed, 0.0) * share
        over = asked > rate * _ROUNDING
        if not over.any():
            return
        rows, first = np.unique(moves.rows[over], return_index=True)
        speeds = asked[over][first]

        def message(place: int) -> str:
            return f"{axis.upper()} is to move at {speeds[place]:.0f} mm/min and can do {rate:g}: it will take longer"

        self._reporter.rows(piece, rows, "warning", "feed_over_rate", message, at="F", subject=axis)

    # --- arcs ---------------------------------------------------------------------------------------------------

    def _arcs(self, piece: Piece, moves: Moves) -> None:
        arcs = self._in_plane(piece, moves, moves.arcs)
        if piece.noted:
            arcs = arcs[piece.unnoted(moves.rows[arcs])]
        if not len(arcs):
            return
        segments = moves.segments
        radius, end_radius = segments.radius[arcs], segments.end_radius[arcs]
        gap = np.abs(radius - end_radius)
        open_ = (gap > ARC_GAP_MAX_MM) | ((gap > ARC_GAP_MM) & (gap > ARC_GAP * radius))
        if open_.any():
            self._open(piece, moves, arcs[open_])
        if np.isnan(radius.sum()):
            self._impossible(piece, moves, arcs[np.isnan(radius)])

    def _in_plane(self, piece: Piece, moves: Moves, arcs: Ints) -> Ints:
        """Reports arcs in planes that the controller lacks; gives the others."""
        allowed = self._profile.arc_planes
        named = [name for name in _PLANES if name in piece.codes]
        if not named and self._plane in allowed:
            return arcs
        rows = [piece.rows_of(name) for name in named]
        places = np.concatenate([np.zeros(0, np.int64), *rows])
        planes = np.concatenate(
            [
                np.zeros(0, np.int64),
                *[np.full(len(here), _PLANES.index(name)) for name, here in zip(named, rows, strict=True)],
            ]
        )
        order = np.argsort(places, kind="stable")
        places, planes = places[order], np.concatenate(([_PLANES.index(self._plane)], planes[order])).astype(np.int64)
        self._plane = _PLANES[int(planes[-1])]
        lacking = np.array([name not in allowed for name in _PLANES])
        # The plane on a line holds for that line already (rs274 §3).
        wrong = lacking[planes[np.searchsorted(places, moves.rows[arcs], side="right")]]
        if wrong.any():
            planes_text = ", ".join(sorted(allowed)) or "none"
            text = f"an arc in another plane than {self._profile.title} has arcs in ({planes_text})"
            self._reporter.rows(piece, np.unique(moves.rows[arcs[wrong]]), "error", "arc_plane", text)
        others: Ints = arcs[~wrong]
        return others

    def _open(self, piece: Piece, moves: Moves, arcs: Ints) -> None:
        segments = moves.segments

        def message(place: int) -> str:
            at = arcs[place]
            radii = f"radius {segments.radius[at]:.4f} mm at its start, {segments.end_radius[at]:.4f} mm at its end"
            return f"the arc does not close: {radii}"

        def column(place: int) -> int:
            return _offset_column(piece, int(moves.rows[arcs[place]]))

        self._reporter.rows(piece, moves.rows[arcs], "error", "arc_not_closed", message, at=column)

    def _impossible(self, piece: Piece, moves: Moves, arcs: Ints) -> None:
        """Arcs that no centre or radius makes; where the start is not known, nothing can be said."""
        segments = moves.segments
        chords = np.full(len(arcs), np.nan)
        for plane, (first, second, _) in PLANE_AXES.items():
            rows = [row for axis in (first, second) if (row := segments.row(axis)) is not None]
            here = segments.plane[arcs] == plane
            if here.any() and len(rows) == 2:
                chords[here] = np.hypot(*(moves.way(row)[arcs[here]] for row in rows))
        known = ~np.isnan(chords)
        arcs, chords = arcs[known], chords[known]

        def message(place: int) -> str:
            letters = {word.letter: word.value for word in piece.words(int(moves.rows[arcs[place]]))}
            if "R" not in letters:
                return "the centre of this arc is its start: I, J and K are 0"
            if chords[place] == 0.0:
                return "an arc with R cannot end where it begins: write a full circle with I, J or K"
            return f"no arc of radius {letters['R']:g} joins its ends, which are {chords[place]:.4f} mm apart"

        self._reporter.rows(piece, moves.rows[arcs], "error", "arc_impossible", message)


def _offset_column(piece: Piece, row: int) -> int:
    """Where the first of the words stands that say where the centre is."""
    columns = [word.column for word in piece.words(row) if word.letter in "IJKR"]
    return min(columns, default=1)
