"""The frames of one block: which of its words go into which, and in what order (ncframe §2; order of rs274 §3).

M6 goes before everything else, M0, M1, M2 and M30 behind the motion, each in a frame of its own; of several other M
codes each has one. The first motion, the last of these M codes, F and S share a frame, as in the source's example.
Not which motion; that is in the rows of the interpreter. The one rule: `counts` is where the machine stands after the
frames that were made, in whole counts, and the next increment starts there.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan

from gcode.executor import Note
from gcode.ncframe.arcs import Lattice, pieces
from gcode.ncframe.frame import BlockLine, Frame, Pending, Stop
from gcode.ncframe.offset import Offset
from gcode.ncframe.rates import RateError, feed_byte, speed_byte
from gcode.ncframe.rules import FrameRules
from gcode.ncframe.writer import DWELL_G, Memory
from gcode.profile import Code
from gcode.rows import Row
from gcode.segments import CCW, CW, DWELL, FEED, RAPID
from gcode.state import State
from gcode.words import Block

MS = 1000.0

MOTION_G = {"rapid": 0, "feed": 1, "arc_cw": 2, "arc_ccw": 3}
"""The G of each motion mode by its effect."""

_KIND_G = {RAPID: 0, FEED: 1, CW: 2, CCW: 3}
_BEFORE = frozenset(("load_tool", "tool_change"))
_BEHIND = frozenset(("pause", "program_end"))

GAP_MM, SMALL_GAP_MM, GAP_SHARE = 0.5, 0.005, 0.001
"""An arc closes when its radii differ by no more than the first, and by no more than one of the others (rs274 §4)."""


class BlockWriter:
    """Blocks with all their rows in, frames out. `counts` over the axes of the state."""

    def __init__(self, rules: FrameRules, state: State, errors: list[Note]) -> None:
        self.memory = Memory()
        self._rules = rules
        self._state = state
        self._errors = errors
        self._lattice = Lattice(rules.resolution_mm)
        self._offset = Offset(rules, state.axes)
        self._x, self._z = state.axes.index("X"), state.axes.index("Z")
        self._speed_said = False
        self.stand(state.position)

    def stand(self, position: list[float]) -> None:
        """The machine stands here, by somebody else's account."""
        self.counts = [self._lattice.counts(value) for value in position]

    @property
    def place(self) -> tuple[float, ...]:
        """Where the machine stands, mm from the host's zero."""
        return tuple([count * self._rules.resolution_mm for count in self.counts])

    @property
    def added(self) -> tuple[float, ...]:
        """What compensation "offset" has added to the program's position, mm."""
        return self._offset.applied

    @property
    def has_its_offset(self) -> bool:
        """Whether no axis is still to take, or to leave, what "offset" adds."""
        return self._offset.settled

    # --- a block before and behind its execution --------------------------------------------------------------------

    def begin(self, line: BlockLine, block: Block, codes: list[Code], values: Mapping[str, float]) -> Pending:
        """A block that is about to be executed."""
        return Pending(line, block, codes, values, self._errors)

    def complete(self, pending: Pending) -> None:
        """It has been executed: what else of the state belongs to it."""
        state = self._state
        self._speed_said |= "S" in pending.values
        pending.speed = state.speed if self._speed_said else None
        pending.feed, pending.per_turn = state.feed, state.feed_mode == 95
        if pending.feed is not None and pending.per_turn:
            pending.feed *= abs(state.speed)
        self._offset.take(pending.codes, pending.values, 0 if state.tool is None else state.tool)

    def write(self, pending: Pending) -> list[Frame]:
        """Its frames, when all of its rows have come."""
        rows, before = pending.rows, self._offset.applied
        if not self._offset.apply(pending.values, [row.kind for row in rows]):
            pending.note("compensation", "the tool's offset begins and ends with a straight move, not with an arc")
        if any(before) or any(self._offset.applied):
            pending.rows = self._moved(rows, before)
        codes = [code for code in pending.codes if code.name.startswith("M")]
        frames = self._around(pending, codes) if codes else self._motion(pending, None) or self._still(pending)
        for frame in frames:
            for letter, message in frame.items.faults():
                unit = f" (counts of {self._rules.resolution_mm:g} mm)" if letter in "XZR" else ""
                pending.note("frame_range", message + unit, letter)
        return frames

    def _around(self, pending: Pending, codes: list[Code]) -> list[Frame]:
        """A block with M codes: what goes before its motion, with it, and behind it."""
        before = [code for code in codes if code.effect in _BEFORE]
        behind = [code for code in codes if code.effect in _BEHIND]
        others = [code for code in codes if code.effect not in _BEFORE and code.effect not in _BEHIND]
        frames = [self._stop(pending, code, with_rates=False) for code in before]
        frames += [self._alone(pending, code) for code in others[:-1]]
        main = self._motion(pending, _number(others[-1]) if others else None)
        if main or not behind:
            frames += main or self._still(pending)
        return frames + [self._stop(pending, code, with_rates=True) for code in behind]

    # --- frames without motion --------------------------------------------------------------------------------------

    def _alone(self, pending: Pending, code: Code) -> Frame:
        """An M code by itself; T and S go with the first, for the spindle may start there."""
        made = self.memory.items(m=_number(code), s=self._speed(pending), t=self._tool(pending))
        return Frame(int(pending.line), made, self.place)

    def _stop(self, pending: Pending, code: Code, *, with_rates: bool) -> Frame:
        """A code that nothing may overtake. Behind it, somebody else may have been at the machine."""
        if with_rates:
            made = self.memory.items(
                g=None if pending.rows else self._mode(pending),
                m=_number(code),
                f=self._feed_now(pending),
                s=self._speed(pending),
                t=self._tool(pending),
            )
        else:
            made = self.memory.items(m=_number(code), t=self._tool(pending))
        changes_tool = code.effect in _BEFORE
        stop = Stop(code.locate, code.effect == "program_end", changes_tool, code.name == "M0")
        self.memory.forget(tool=not changes_tool)
        return Frame(
            int(pending.line), made, self.place, stop=stop, tool=self._state.selected if changes_tool else None
        )

    def _still(self, pending: Pending) -> list[Frame]:
        """Words that move nothing; no frame where nothing that they name is new."""
        rates = not pending.values.keys().isdisjoint("FS")
        made = self.memory.items(
            g=self._mode(pending),
            f=self._feed_now(pending) if rates else None,
            s=self._speed(pending) if "S" in pending.values else None,
            t=self._tool(pending),
        )
        return [Frame(int(pending.line), made, self.place)] if made else []

    def _mode(self, pending: Pending) -> int | None:
        """The G of a motion mode that the block names."""
        return next((MOTION_G[code.effect] for code in pending.codes if code.effect in MOTION_G), None)

    # --- motion -----------------------------------------------------------------------------------------------------

    def _motion(self, pending: Pending, m: int | None) -> list[Frame]:
        """The rows of a block; its last M code, T, F and S go with the first frame, which there is for these alone."""
        frames: list[Frame] = []
        s, t = self._speed(pending), self._tool(pending)
        for row in pending.rows:
            if any(map(isnan, (*row.start, *row.end))):
                pending.note("position_unknown", "where this leads is not known")
                continue
            feed = self._feed(pending, row)
            for steps in self._steps(pending, row):
                x, z = steps.way
                made = self.memory.items(g=steps.g, m=m, x=x, z=z, r=steps.r, f=feed, s=s, t=t)
                m = None
                if made:
                    frames.append(Frame(int(pending.line), made, self.place, row, steps.share))
        if m is not None:
            made = self.memory.items(g=self._mode(pending), m=m, f=self._feed_now(pending), s=s, t=t)
            frames.append(Frame(int(pending.line), made, self.place))
        return frames

    def _steps(self, pending: Pending, row: Row) -> Iterator["_Steps"]:
        """The frames of one row; `counts` goes along with each."""
        if row.kind == DWELL:
            yield _Steps(DWELL_G, (round(row.dwell_s * MS), 0))
            return
        g = _KIND_G.get(row.kind)
        if g is None:
            pending.note("not_followed", "this motion is the controller's own: no frame can say it")
            return
        if row.kind in (CW, CCW):
            yield from self._arc(pending, row, g)
            return
        yield _Steps(g, self._advance(row.end))

    def _arc(self, pending: Pending, row: Row, g: int) -> Iterator["_Steps"]:
        centre = self._centre(pending, row)
        if centre is None:
            return
        start, end = row.start, row.end
        first, second = complex(start[self._z], start[self._x]), complex(end[self._z], end[self._x])
        for piece in pieces(self._lattice, first, second, first + centre, clockwise=row.kind == CW):
            place = list(end)
            place[self._z], place[self._x] = piece.end.real, piece.end.imag
            yield _Steps(g, self._advance(place), piece.radius_counts, piece.share)

    def _centre(self, pending: Pending, row: Row) -> complex | None:
        """From the start, Z and X; None, with an error, where no arc of these words exists."""
        arc = row.arc
        if arc is None or arc.plane != 18:
            pending.note("arc_plane", "an arc in another plane than G18")
            return None
        chord = abs(complex(*arc.way))
        if arc.radius is not None:
            found = arc.at(clockwise=row.kind == CW)
            if found is None:
                what = (
                    "an arc with R cannot end where it begins"
                    if chord <= self._rules.resolution_mm
                    else (f"the ends of the arc are {chord:.4f} mm apart, more than 2R = {2 * abs(arc.radius):.4f} mm")
                )
                pending.note("arc_impossible", what, "R")
            return None if found is None else complex(*found)
        centre = complex(*arc.centre)
        radius, end_radius = abs(centre), abs(complex(*arc.way) - centre)
        gap = abs(radius - end_radius)
        if not isfinite(radius) or radius == 0.0:
            pending.note("arc_impossible", "the centre of this arc is its start: I and K are 0")
            return None
        if gap > GAP_MM or (gap > SMALL_GAP_MM and gap > GAP_SHARE * radius):
            text = f"the arc does not close: radius {radius:.4f} mm at its start, {end_radius:.4f} mm at its end"
            pending.note("arc_not_closed", text)
            return None
        return centre

    def _moved(self, rows: list[Row], begin: Sequence[float]) -> list[Row]:
        """With what "offset" adds: the first of them from what was added before the block."""
        moved = []
        for row in rows:
            moved.append(row._replace(start=_sum(row.start, begin), end=_sum(row.end, self._offset.applied)))
            begin = self._offset.applied
        return moved

    def _advance(self, place: Sequence[float]) -> tuple[int, int]:
        """The increments of X and Z to the count nearest to this place."""
        before, self.counts = self.counts, [self._lattice.counts(value) for value in place]
        return self.counts[self._x] - before[self._x], self.counts[self._z] - before[self._z]

    # --- F, S, T ----------------------------------------------------------------------------------------------------

    def _feed(self, pending: Pending, row: Row) -> int | None:
        """The F that a row needs; a rapid and a dwell only what is in force."""
        if row.kind in (RAPID, DWELL):
            return self._feed_now(pending)
        if pending.per_turn and self._rules.speed_unit_rpm is None:
            pending.note("feed_missing", "G95 needs the speed in rpm, and S is the number of a step here")
            return None
        if not row.feed > 0.0:
            pending.note("feed_missing", "a feed move without a feed: no F before it, or F0", "F")
            return None
        return self._byte_of_feed(pending, row.feed)

    def _feed_now(self, pending: Pending) -> int | None:
        """The F in force, where there is one already: in G95 that is so when S has been said."""
        if pending.feed is None or not pending.feed > 0.0 or (pending.per_turn and self._rules.speed_unit_rpm is None):
            return None
        return self._byte_of_feed(pending, pending.feed)

    def _byte_of_feed(self, pending: Pending, feed: float) -> int | None:
        try:
            return feed_byte(feed, self._rules)
        except RateError as error:
            # In G95 a new speed is a new feed.
            if not pending.values.keys().isdisjoint("FS"):
                pending.note("frame_range", str(error), "F")
            return None

    def _speed(self, pending: Pending) -> int | None:
        if pending.speed is None:
            return None
        try:
            return speed_byte(pending.speed, self._rules)
        except RateError as error:
            # Said where it is programmed, and not again for every block behind it.
            if "S" in pending.values:
                pending.note("frame_range", str(error), "S")
            return None

    def _tool(self, pending: Pending) -> int | None:
        """T where it is programmed; the machine has it until it is programmed anew."""
        tool = pending.values.get("T")
        if tool is None:
            return None
        if tool != int(tool):
            pending.note("frame_range", f"T{tool:g} is no tool", "T")
            return None
        return int(tool)


@dataclass(frozen=True, slots=True)
class _Steps:
    """One frame of a row: its G, the increments of X and Z (of G4: the milliseconds), R, its share of the row."""

    g: int
    way: tuple[int, int]
    r: int | None = None
    share: float = 1.0


def _sum(place: Sequence[float], added: Sequence[float]) -> list[float]:
    return [value + more for value, more in zip(place, added, strict=True)]


def _number(code: Code) -> int:
    """M30 is 30."""
    return int(float(code.name[1:]))
