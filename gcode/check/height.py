"""Rapids where material may be: straight down, across below the surface, and the first way across at an unknown Z.

For machines with X, Y and Z, in program coordinates. What is taken for the surface is Z0 of the program, which is
the top of the stock in most programs and the table in the others; below it a rapid is wrong in both. The one rule:
what has been cut is air, so a rapid down is reported only where it goes below everything that was cut before.
"""

import numpy as np

from gcode.check.moves import Moves
from gcode.check.piece import MACHINE_CODES, Piece, Reporter
from gcode.profile import Profile
from gcode.segments import Floats, Ints

SURFACE_MM = 0.0
"""Z of the surface in program coordinates."""

SLACK_MM = 1e-3
"""Z0 that inches or offsets have rounded."""


class HeightRules:
    """What is remembered: how deep it has been cut, and whether the first way across was at a known height."""

    def __init__(self, profile: Profile, reporter: Reporter) -> None:
        self._reporter = reporter
        self._is_mill = {"x", "y", "z"} <= set(profile.axes)
        self._deepest_mm = np.inf
        self._by_machine = False
        self._crossed = False
        self._blind_line: int | None = None

    def look(self, piece: Piece, moves: Moves) -> None:
        """One piece of the program."""
        row = moves.segments.row("Z")
        if not self._is_mill or row is None or not len(moves):
            return
        end = moves.segments.end[row]
        if np.isnan(end[0]) and np.isnan(np.fmin.reduce(end)):
            # Z has never been named: a laser, a plotter.
            self._first(piece, moves, end)
            return
        start, end = self._heights(piece, moves, row)
        self._first(piece, moves, end)
        surface = SURFACE_MM - SLACK_MM
        low = end < surface
        if low.any() or start[0] < surface:
            rapid = moves.is_rapid & (low | (start < surface))
            if rapid.any():
                self._rapids(piece, moves, start, end, np.flatnonzero(rapid))
            self._deepest_mm = min(self._deepest_mm, float(np.fmin.reduce(np.where(moves.is_cut, end, np.inf))))

    def _heights(self, piece: Piece, moves: Moves, row: int) -> tuple[Floats, Floats]:
        """Z before and after each segment; NaN from a way in machine coordinates (G53, G28, G30) to the next Z.

        How high that is above the work, only the offsets on the machine say.
        """
        start, end = moves.work_start(row), moves.work_end(row)
        machine = piece.rows_of(*MACHINE_CODES)
        if not self._by_machine and not len(machine):
            return start, end
        places = np.flatnonzero(moves.way(row) != 0.0)
        own = np.isin(moves.rows[places], machine)
        states = np.concatenate(([self._by_machine], own))
        after = states[np.searchsorted(places, np.arange(len(moves)), side="right")]
        before = np.concatenate(([self._by_machine], after[:-1]))
        self._by_machine = bool(states[-1])
        return np.where(before, np.nan, start), np.where(after, np.nan, end)

    def _rapids(self, piece: Piece, moves: Moves, start: Floats, end: Floats, rapids: Ints) -> None:
        """Rapids that begin or end below the surface."""
        cut = np.fmin.accumulate(np.where(moves.is_cut, end, np.inf))
        before = np.minimum(self._deepest_mm, np.concatenate(([np.inf], cut[:-1])))
        deeper = end[rapids] < np.minimum(before[rapids], SURFACE_MM) - SLACK_MM
        down = rapids[deeper & ~(end[rapids] >= start[rapids])]

        def plunge(place: int) -> str:
            at = down[place]
            return f"a rapid down to Z{end[at]:.3f}, below Z0 and below all that was cut before: into the material?"

        self._reporter.rows(piece, moves.rows[down], "warning", "rapid_into_material", plunge, at="Z")
        across = moves.moves_in("X", "Y")[rapids] & (start[rapids] < SURFACE_MM - SLACK_MM)
        low = rapids[across]

        def cross(place: int) -> str:
            return (
                f"a rapid in X or Y at Z{max(start[low[place]], end[low[place]]):.3f}, below Z0: through the material?"
            )

        self._reporter.rows(piece, moves.rows[low], "warning", "rapid_below_surface", cross)

    def _first(self, piece: Piece, moves: Moves, end: Floats) -> None:
        """The first way across before Z was lifted: at a Z that nobody knows, or at one below the surface."""
        if not self._crossed:
            places = np.flatnonzero(moves.is_way & moves.moves_in("X", "Y"))
            if len(places):
                self._crossed = True
                at = int(places[0])
                line = piece.line(int(moves.rows[at]))
                if np.isnan(end[at]):
                    self._blind_line = line
                elif end[at] < SURFACE_MM - SLACK_MM:
                    text = f"the first way in X or Y is at Z{end[at]:.3f}, below Z0: lift Z first"
                    self._reporter.once("warning", line, 1, "first_move_low", text)
        if self._blind_line is not None and not np.isnan(np.fmax.reduce(end)):
            # A program that never names Z (a laser) means it so; this one does, only later.
            text = "the first way in X or Y comes before the program says where Z is: lift Z first"
            self._reporter.once("warning", self._blind_line, 1, "first_move_low", text)
            self._blind_line = None
