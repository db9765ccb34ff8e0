"""What every code of a block needs: the words in mm, where axis words lead, segments, notes, compensation.

Not the meaning of codes (motions.py, actions.py) and not their order (interpreter.py). The one rule: `state.position`
and every segment's end are known together or NaN together; a segment begins where the machine stands.
"""

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field
from math import isnan, nan
from typing import Literal, NamedTuple

from gcode.compensation import LEFT, RIGHT, CompensationFault, Compensator, Move, Phase
from gcode.profile import Code, Profile
from gcode.rows import NO_TOOL, ArcWords, Row, Rows
from gcode.segments import CCW, CW, DWELL, FEED, HOMING, PLANE_AXES, PROBE, RAPID, ROTARY_AXES
from gcode.state import State
from gcode.words import Block

MM_PER_INCH = 25.4

AXIS_LETTERS = frozenset("XYZABCUVW")

_WITHOUT_FEED = frozenset((RAPID, DWELL))


class Note(NamedTuple):
    """Something wrong with a block: `code` is stable, `message` for people; `line` and `column` from 1."""

    line: int
    column: int
    code: str
    message: str
    level: Literal["error", "warning"] = "error"


@dataclass(slots=True)
class Work:
    """One block under execution. `values` as written, by letter; `used`: the letters that something has taken.

    `machine`: G53 stands in the block. `inverse`: the F of this block in G93, 1/min.
    """

    line: int
    block: Block
    values: dict[str, float]
    codes: list[Code]
    used: set[str] = field(default_factory=set)
    machine: bool = False
    inverse: float | None = None


class Mark(NamedTuple):
    """What `Executor.back` comes back to."""

    compensator: Compensator | None
    tool_at: list[float] | None
    notes: int


class Executor:
    """State, segments and notes of one program."""

    def __init__(self, profile: Profile, state: State) -> None:
        self.profile = profile
        self.state = state
        self.rows = Rows(state.axes)
        self.notes: list[Note] = []
        self.axis_rows = {axis: row for row, axis in enumerate(state.axes)}
        self.scalable = [axis not in ROTARY_AXES for axis in state.axes]
        self.strict = "strict_words" in profile.features
        stepping = "incremental_uw" in profile.features
        self._steps = {
            letter: self.axis_rows[axis]
            for letter, axis in (("U", "X"), ("V", "Y"), ("W", "Z"))
            if stepping and letter not in self.axis_rows and axis in self.axis_rows
        }
        self.coordinate_letters = frozenset((*self.axis_rows, *self._steps))
        self._compensator: Compensator | None = None
        self._tool_at: list[float] | None = None

    # --- words ----------------------------------------------------------------------------------------------------

    def note(
        self, work: Work, code: str, message: str, letter: str = "", level: Literal["error", "warning"] = "error"
    ) -> None:
        """Something is wrong with this block, at the word of `letter` (or of a code, "G41") where there is one."""
        words = work.block.words
        column = next((word.column for word in reversed(words) if letter in (word.letter, word.code)), 1)
        self.notes.append(Note(work.line, column, code, message, level))

    def length(self, work: Work, letter: str) -> float | None:
        """The value of a letter in mm."""
        value = work.values.get(letter)
        if value is None:
            return None
        work.used.add(letter)
        return value * MM_PER_INCH if self.state.inches else value

    def number(self, work: Work, letter: str) -> float | None:
        """The value of a letter that is no length."""
        work.used.add(letter)
        return work.values.get(letter)

    def named(self, work: Work) -> dict[int, float]:
        """The axis words by row, mm."""
        found = {}
        state = self.state
        for letter, value in work.values.items():
            row = self.axis_rows.get(letter)
            if row is None:
                continue
            work.used.add(letter)
            if state.inches and self.scalable[row]:
                value *= MM_PER_INCH
            if state.diameter_mode and letter == "X":
                value /= 2
            found[row] = value
        return found

    def steps(self, work: Work) -> dict[int, float]:
        """U and W of a lathe, which are steps of X and Z, mm."""
        found = {}
        for letter, row in self._steps.items():
            value = self.length(work, letter)
            if value is not None:
                found[row] = value / 2 if self.state.diameter_mode and letter == "U" else value
        return found

    def has_axes(self, work: Work) -> bool:
        """Whether the block has any word of an axis of this machine."""
        return not self.coordinate_letters.isdisjoint(work.values)

    def target(self, work: Work) -> tuple[list[float], dict[int, float]]:
        """Where the axis words lead, machine coordinates, and the ways of the axes that are named by a step."""
        state = self.state
        start, frame = state.position, state.frame
        end = list(start)
        ways: dict[int, float] = {}
        for row, value in self.named(work).items():
            if work.machine:
                end[row] = value
            elif state.absolute:
                end[row] = value + frame[row] if frame[row] else value
            elif state.absolute is False:
                end[row] = start[row] + value
                ways[row] = value
            else:
                end[row] = ways[row] = nan
        if self._steps:
            for row, value in self.steps(work).items():
                end[row] = end[row] + value
                ways[row] = value
        return end, ways

    def plane_rows(self) -> list[int | None]:
        """The rows of the plane's two axes and of the one that stands on it; None where the machine has it not."""
        return [self.axis_rows.get(axis) for axis in PLANE_AXES[self.state.plane]]

    # --- motion ---------------------------------------------------------------------------------------------------

    def emit(
        self,
        work: Work,
        kind: int,
        end: list[float],
        *,
        arc: ArcWords | None = None,
        dwell_s: float = 0.0,
        turning: int = 1,
        feed: float | None = None,
    ) -> None:
        """A segment to `end`, where the machine stands then. `turning`: -1 for a spindle that turns the other way."""
        state = self.state
        inverse = work.inverse is not None and kind not in _WITHOUT_FEED
        row = Row(
            line=work.line,
            kind=kind,
            start=state.position,
            end=end,
            feed=work.inverse if inverse and work.inverse is not None else self.feed() if feed is None else feed,
            spindle=state.speed * float(state.spindle or 0) * turning,
            tool=NO_TOOL if state.tool is None else state.tool,
            sync=state.sync,
            frame=self.rows.frame_of(state.frame),
            dwell_s=dwell_s,
            inverse=inverse,
            arc=arc,
        )
        state.sync = False
        state.position = end
        if self._compensator is not None:
            self._guide(row, self._compensator)
        else:
            self.rows.add(row)

    def feed(self) -> float:
        """mm/min in force, NaN where none was ever set."""
        state = self.state
        if state.feed is None:
            return nan
        return state.feed * abs(state.speed) if state.feed_mode == 95 else state.feed

    def lose(self, rows: Iterable[int] | None = None) -> None:
        """The position along these axes, or all, is not known any more."""
        place = self.state.position
        lost = range(len(place)) if rows is None else frozenset(rows)
        if any(not isnan(place[row]) for row in lost):
            self.state.position = [nan if row in lost else value for row, value in enumerate(place)]

    # --- compensation ---------------------------------------------------------------------------------------------

    @property
    def compensating(self) -> bool:
        """Whether moves go through the compensation: from G41 to the first straight move after G40."""
        return self._compensator is not None

    @property
    def held_line(self) -> int | None:
        """The line of the move that compensation holds back, if there is one."""
        return self._compensator.held_line if self._compensator is not None else None

    @property
    def cutting(self) -> bool:
        """Whether the tool goes along a compensated contour: behind the way in, before G40."""
        return self._compensator is not None and self._compensator.phase is Phase.CUTTING

    def guide(self, rows: Iterable[Row]) -> None:
        """Programmed moves of plain blocks through the compensation, while `cutting`."""
        for row in rows:
            assert self._compensator is not None  # G40 is no plain block
            self._guide(row, self._compensator)

    def mark(self) -> "Mark":
        """Where the compensation stands, to come `back` to. Rows are not part of it."""
        return Mark(copy(self._compensator), self._tool_at, len(self.notes))

    def back(self, mark: "Mark") -> None:
        """As it stood there."""
        self._compensator, self._tool_at = mark.compensator, mark.tool_at
        del self.notes[mark.notes :]

    def compensate(self, work: Work, side: int) -> None:
        """G41 or G42; 41 or 42 in `side`."""
        state = self.state
        state.compensation = side
        radius = state.radius
        at = state.position
        name = next((code.name for code in work.codes if code.sets.startswith("compensation_")), "")
        if radius is None:
            where = "D" if "D" in work.values else name
            self.note(work, "compensation", f"{name}: the radius of the tool is not known", where)
            return
        if self._compensator is None:
            self._compensator, self._tool_at = Compensator(state.axes), at
        try:
            self._compensator.begin(work.line, LEFT if side == 41 else RIGHT, radius, at, state.plane)
        except CompensationFault as fault:
            self.note(work, fault.code, fault.message, name)
            self._guided(fault.moves)

    def end_compensation(self, *, entirely: bool = False) -> None:
        """G40: what was held back. `entirely`: the end of the program, or something else moves the tool."""
        self.state.compensation = 40
        if self._compensator is None:
            return
        self._guided(self._compensator.end())
        if entirely or not self._compensator.active:
            self._compensator.reset()
            self._compensator = None

    def _guide(self, row: Row, compensator: Compensator) -> None:
        if row.kind in (HOMING, PROBE):
            self._leave(row, compensator)
            return
        if row.inverse:
            row = self._rated(row)
        try:
            if row.kind == DWELL:
                moves = compensator.aside(row.line, row)
            elif row.kind in (CW, CCW):
                moves = self._guided_arc(row, compensator)
            else:
                moves = compensator.straight(row.line, row.end, rapid=row.kind == RAPID, payload=row)
        except CompensationFault as fault:
            self.notes.append(Note(row.line, 1, fault.code, fault.message))
            moves = fault.moves
        self._guided(moves)
        if not compensator.active:
            self._compensator = None

    def _leave(self, row: Row, compensator: Compensator) -> None:
        """A way that is not the program's own: it starts where the tool is, and nobody guides it."""
        if compensator.engaged:
            self.notes.append(Note(row.line, 1, "compensation", "homing or probing while compensation is on"))
        self._guided(compensator.end())
        compensator.reset()
        self._compensator = None
        self.rows.add(row._replace(start=self._tool_at or row.start))

    def _rated(self, row: Row) -> Row:
        """In G93 the programmed way tells the feed: the tool's own is longer or shorter, and has arcs added."""
        alone = Rows(self.state.axes)
        alone.add(row._replace(frame=0))
        return row._replace(feed=float(alone.take().feed[0]), inverse=False)

    def _guided_arc(self, row: Row, compensator: Compensator) -> list[Move]:
        arc = row.arc
        clockwise = row.kind == CW
        centre = None if arc is None else arc.at(clockwise=clockwise)
        turns = 1 if arc is None else arc.turns
        # An arc that cannot be has its centre nowhere: the compensator's own fault.
        return compensator.arc(row.line, row.end, centre or (nan, nan), clockwise=clockwise, turns=turns, payload=row)

    def _guided(self, moves: Iterable[Move]) -> None:
        """Moves of the tool's centre to rows; what else belongs to them is in the row that they came from."""
        for move in moves:
            row = move.payload
            start = self._tool_at or list(move.end)
            if not isinstance(row, Row):
                continue
            end = list(move.end)
            if row.kind == DWELL:
                self.rows.add(row._replace(start=end, end=end))
            else:
                arc = self._arc_of(move, start, end) if move.kind in (CW, CCW) else None
                self.rows.add(Row(move.line, move.kind, start, end, *row[4:-1], arc))
            self._tool_at = end

    def _arc_of(self, move: Move, start: list[float], end: list[float]) -> ArcWords | None:
        """In the plane that G41 was given in, whatever has been selected since."""
        compensator = self._compensator
        if compensator is None or move.centre is None:
            return None
        first, second = (self.axis_rows[axis] for axis in PLANE_AXES[compensator.plane][:2])
        way = (end[first] - start[first], end[second] - start[second])
        return ArcWords(compensator.plane, way, move.centre, None, move.turns)


__all__ = ["FEED", "Executor", "Note", "Work"]
