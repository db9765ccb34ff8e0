"""What a program must have said before it moves, before it cuts and before it ends; and what comes after its end.

The one rule: a word counts for the block that it stands in (rs274 §3), so the order of words in a block is nothing.
"""

import numpy as np

from gcode.check.moves import Moves
from gcode.check.piece import Piece, Reporter
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.segments import Ints
from gcode.state import State

SPINDLE_ON = ("M3", "M4")
STORING = ("set_data", "store_home", "store_second_home")


class CourseRules:
    """See the head of this file. What is remembered is what the program has said so far."""

    def __init__(self, profile: Profile, motion: Motion, reporter: Reporter) -> None:
        self._reporter = reporter
        self._laser = motion.laser
        groups: dict[str, list[str]] = {}
        for code in profile.codes.values():
            groups.setdefault(code.group, []).append(code.name)
        self._distance = tuple(groups.get("distance", ()))
        self._units = tuple(groups.get("units", ()))
        self._ends = tuple(code.name for code in profile.codes.values() if code.effect == "program_end")
        # M7 lights the plasma where the profile says so; elsewhere it is coolant (elvinto §6).
        self._on = (*SPINDLE_ON, *(name for name in groups.get("plasma", ()) if name == "M7"))
        self._stores = tuple(code.name for code in profile.codes.values() if code.effect in STORING)
        self._takes_speed = "S" in profile.letters
        self._cancels_shift = "G92.1" in profile.codes
        self._said: set[str] = set()
        self._moved = self._started = self._ended = False
        self._unit = ""
        self._speed: float | None = None
        self._blocks = 0
        self._last_line = 1

    def look(self, piece: Piece, moves: Moves) -> None:
        """One piece of the program."""
        self._end(piece)
        if not self._moved:
            self._first_motion(piece, moves)
        if not self._started:
            self._first_cut(piece, moves)
        self._mixed_units(piece)
        self._spindle(piece)
        self._storing(piece)
        self._last_line = piece.line(piece.columns.lines - 1) if piece.columns.lines else self._last_line

    def close(self, state: State, *, compensating: bool = False) -> int:
        """At the end of the program, with the state that it leaves; the number of its blocks."""
        found = self._reporter.found
        if self._blocks and not self._ended:
            ends = " or ".join(self._ends) or "M30"
            found.add("warning", self._last_line, 1, "no_end", f"the program has no end ({ends})")
        if not self._blocks:
            found.add("error", 1, 0, "no_blocks", "there is nothing to execute in this file")
        if state.shift_active and self._cancels_shift:
            text = "the program ends with the offset of G92 in force: G92.1 takes it back"
            found.add("warning", self._last_line, 1, "offset_left", text)
        if compensating:
            text = "the program ends with cutter compensation on: G40 is missing"
            found.add("warning", self._last_line, 1, "compensation_left", text)
        return self._blocks

    # --- before the first motion --------------------------------------------------------------------------------

    def _first_motion(self, piece: Piece, moves: Moves) -> None:
        first = _first(moves.rows[moves.is_way]) if len(moves) else None
        for kind, names, text in (
            ("distance_not_set", self._distance, "the program moves before it says G90 or G91"),
            ("units_not_set", self._units, f"the program moves before it says {' or '.join(self._units[::-1])}"),
        ):
            said = _first(piece.rows_of(*names))
            if said is not None and (first is None or said <= first):
                self._said.add(kind)
            if first is not None and names and kind not in self._said:
                self._reporter.once("warning", piece.line(first), 1, kind, text)
        self._moved = first is not None

    def _first_cut(self, piece: Piece, moves: Moves) -> None:
        on = _first(piece.rows_of(*self._on))
        cut = _first(moves.rows[moves.is_cut]) if len(moves) else None
        if cut is not None and (on is None or on > cut):
            text = "feed moves before the spindle was ever started"
            self._reporter.once("warning", piece.line(cut), 1, "spindle_off", text)
        self._started = on is not None or cut is not None

    # --- units and spindle --------------------------------------------------------------------------------------

    def _mixed_units(self, piece: Piece) -> None:
        named = [name for name in self._units if name in piece.codes]
        if not named or named == [self._unit]:
            return
        rows = np.concatenate([piece.rows_of(name) for name in named])
        which = np.repeat(np.arange(len(named)), [len(piece.rows_of(name)) for name in named])
        order = np.argsort(rows, kind="stable")
        rows, which = rows[order], which[order]
        before = named.index(self._unit) if self._unit in named else (-1 if self._unit else int(which[0]))
        changes = np.flatnonzero(np.concatenate(([before], which[:-1])) != which)
        self._unit = named[int(which[-1])]

        def message(place: int) -> str:
            return (
                f"{named[which[changes[place]]]} in a program that used other units before: are all lengths meant so?"
            )

        self._reporter.rows(piece, rows[changes], "warning", "units_mixed", message)

    def _spindle(self, piece: Piece) -> None:
        """M3 or M4 with S0: the spindle does not turn. A laser is switched on in this way."""
        words = piece.of_letter("S")
        on = piece.rows_of(*SPINDLE_ON)
        speeds = piece.columns.value[words]
        if len(on) and not self._laser and self._takes_speed:
            before = np.nan if self._speed is None else self._speed
            places = np.searchsorted(piece.columns.row[words], on, side="right")
            zero = on[np.concatenate(([before], speeds))[places] == 0.0]
            if len(zero):
                text = "the spindle is switched on with S0: it does not turn"
                self._reporter.rows(piece, zero, "warning", "spindle_zero", text)
        if len(words):
            self._speed = float(speeds[-1])

    def _storing(self, piece: Piece) -> None:
        """Grbl carries these out in its check mode as well, with the places of a motion that never was."""
        for name in self._stores:
            text = f"the controller keeps what {name} sets when the program has ended"
            self._reporter.rows(piece, piece.rows_of(name), "info", "stored", text, at=name, subject=name)

    # --- the end ------------------------------------------------------------------------------------------------

    def _end(self, piece: Piece) -> None:
        sent = piece.sent_bytes > 0
        self._blocks += int(np.count_nonzero(sent))
        if not self._ended:
            ends = _first(piece.rows_of(*self._ends))
            if ends is None:
                return
            self._ended = True
            sent[: ends + 1] = False
        after = _first(np.flatnonzero(sent))
        if after is not None:
            text = "there are blocks after the end of the program"
            self._reporter.once("warning", piece.line(after), 1, "after_end", text)


def _first(rows: Ints) -> int | None:
    return int(rows[0]) if len(rows) else None
