"""Cutter radius compensation (G41, G42, G40; gcode §2): the programmed contour in, the way of the tool's centre out.

Geometry in one plane, move by move, no words and no machine: positions are tuples over `axes`, what else belongs to a
move (feed, spindle, ...) is a payload that goes through untouched. The reference is LinuxCNC's interpreter.
The last move is held back until the next one tells where it ends, with all that stands still behind it: that is all
the look-ahead, so a tool too big for the gap between moves that are not neighbours is not seen here (nor there).
The one rule: never silently cut into the contour; a corner or an arc that the tool does not fit into is a fault.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import ceil, inf, isfinite, pi
from typing import Any, NamedTuple

from gcode.arcs import COINCIDENT_MM
from gcode.offsetpath import Curve, arc, crossing, is_inside, straight, swing
from gcode.segments import CCW, CW, DWELL, FEED, PLANE_AXES, RAPID

LEFT, RIGHT = 1, -1

ASIDE = DWELL
"""Kind of what is no motion (a dwell, spindle, coolant) but keeps its place among the moves."""

MAX_HELD = 1000
"""Most moves that stand still in the plane (Z, dwells) between two that do not; a contour has a handful."""

MAX_COORDINATE_MM = 1e7
"""Ten kilometres. Beyond, a double no longer holds the nanometres that the geometry counts on."""

MAX_TURNS = 1_000_000

FIT_MM = 1e-6
"""A move may be so much shorter than the tool needs: a tool that fits exactly does fit."""

SPECK_MM = 1e-3
"""What is left of an arc between two corners, or an arc round a corner, is a straight when it is shorter: controllers
take numbers of three decimals, and an arc whose ends fall together there is a full circle."""

_GAP_MM, _SMALL_GAP_MM, _GAP_SHARE = 0.5, 0.005, 0.001
"""An arc closes when its radii differ by less than the first, and by less than one of the others (rs274 §4)."""

Position = tuple[float, ...]


class Move(NamedTuple):
    """One move of the tool's centre. `kind` RAPID, FEED, CW, CCW or ASIDE; `end` over `axes`.

    `centre` of an arc is measured from the move's own start, in the plane's first and second axis; `turns` from 1.
    An arc round an outside corner has the line and the payload of the move behind it.
    """

    line: int
    kind: int
    end: Position
    centre: tuple[float, float] | None = None
    turns: int = 1
    payload: Any = None


class CompensationFault(Exception):  # noqa: N818 - the standard's word, and what it is called everywhere in gcode/
    """The program cannot be compensated at `line`; `code` is stable, `message` for people.

    `moves` is how to go on all the same, so that the rest of the program can be looked at: what was held back, then
    a straight to where the faulty move ends as programmed. All further moves go through unchanged until G40.
    """

    def __init__(self, line: int, code: str, message: str, moves: Sequence[Move] = ()) -> None:
        super().__init__(f"line {line}: {message}")
        self.line = line
        self.code = code
        self.message = message
        self.moves = list(moves)


class Phase(Enum):
    """Where compensation stands.

    OFF -- G41/G42 -> ENTERING -- first move -> CUTTING -- G40 -> LEAVING -- straight move -> OFF.
    OFF -- G41/G42 with radius 0 -> THROUGH -- G40 -> OFF. A fault: anything -> THROUGH.
    """

    OFF = "off"
    ENTERING = "entering"
    CUTTING = "cutting"
    LEAVING = "leaving"
    THROUGH = "through"


@dataclass(slots=True)
class _Held:
    """The last move in the plane: as programmed, its parallel, and the move that it becomes.

    `spare`: how far its end may still be pulled back, in the measure of `path.extent`.
    """

    contour: Curve
    path: Curve
    move: Move
    spare: float


class Compensator:
    """Cutter radius compensation of one program. All lengths mm; constant memory.

    Every method gives the moves that are certain now, in order; CompensationFault is all that they raise.
    `programmed` is the point that the program believes to be at: absolute coordinates that a block leaves out, and
    G91, count from there, also after G40 (the tool itself is only taken there by the next straight move).
    `plane` 17, 18 or 19 is that of the last begin().
    """

    def __init__(self, axes: str) -> None:
        self._axes = axes
        self._phase = Phase.OFF
        self.plane = 17
        self._side = LEFT
        self._radius = 0.0
        self._straight_next = False
        self._held: _Held | None = None
        self._behind: list[Move] = []
        self._first = self._second = self._normal = -1
        self.programmed: Position = (0.0,) * len(axes)
        self._contour_at = 0j
        self._tool = self.programmed

    @property
    def phase(self) -> Phase:
        """Where compensation stands."""
        return self._phase

    @property
    def active(self) -> bool:
        """Whether moves are to go through here: from begin() to the first straight move after end()."""
        return self._phase is not Phase.OFF

    @property
    def tool(self) -> Position:
        """Where the tool's centre stands after the moves given out so far."""
        return self._tool

    @property
    def held_line(self) -> int | None:
        """The line of the move that is held back, as it was given; None: all moves so far have been given out."""
        return self._held.move.line if self._held else None

    @property
    def engaged(self) -> bool:
        """Whether G41/G42 is in force: no change of plane, offsets or tool now."""
        return self._phase in (Phase.ENTERING, Phase.CUTTING, Phase.THROUGH)

    def begin(self, line: int, side: int, radius_mm: float, at: Sequence[float], plane: int = 17) -> None:
        """G41 (LEFT) or G42 (RIGHT) from the programmed point `at`; a negative radius changes sides."""
        if self.engaged:
            raise CompensationFault(line, "compensation_on", "compensation is already on: G40 comes before G41 or G42")
        if not isfinite(radius_mm) or abs(radius_mm) > MAX_COORDINATE_MM:
            raise CompensationFault(line, "compensation_radius", f"the tool has no such radius: {radius_mm} mm")
        self._side = side if radius_mm >= 0 else -side
        self._radius = abs(radius_mm)
        if not self._use_plane(plane):
            raise CompensationFault(line, "compensation_plane", f"there is no plane G{plane} with axes {self._axes}")
        self.programmed = tuple(at)
        self._contour_at = self._in_plane(self.programmed)
        if self._phase is not Phase.LEAVING:
            self._tool = self.programmed
        self._phase = Phase.ENTERING if self._radius > 0 else Phase.THROUGH

    def straight(self, line: int, end: Sequence[float], *, rapid: bool = False, payload: Any = None) -> list[Move]:
        """G0 or G1 to the programmed point `end`."""
        move = Move(line, RAPID if rapid else FEED, tuple(end), payload=payload)
        self._straight_next = False
        if self._phase not in (Phase.ENTERING, Phase.CUTTING):
            return self._through(move)
        target = self._checked(move)
        if self._phase is Phase.CUTTING and abs(target - self._contour_at) <= COINCIDENT_MM:
            return self._stand(move)
        if self._phase is Phase.CUTTING:
            along = straight(self._contour_at, target)
            return self._follow(along, along.parallel(self._side * self._radius), move)
        length = abs(target - self._contour_at)
        if length <= max(self._radius, COINCIDENT_MM):
            raise self._fault(
                move,
                "compensation_entry",
                f"the first move after G41 or G42 must be longer than the tool's radius of {self._radius:g} mm: "
                f"it is {length:.4g} mm in the plane",
            )
        contour = straight(self._contour_at, target)
        path = contour.parallel(self._side * self._radius)
        assert path is not None  # a straight always has one
        # The way in is no part of the contour: a first inside corner may move its end anywhere along the parallel.
        return self._hold(contour, path, move, inf)

    def arc(
        self,
        line: int,
        end: Sequence[float],
        centre: tuple[float, float],
        *,
        clockwise: bool,
        turns: int = 1,
        payload: Any = None,
    ) -> list[Move]:
        """G2 or G3 to the programmed point `end`; `centre` from the programmed start, in the plane's two axes."""
        move = Move(line, CW if clockwise else CCW, tuple(end), centre, turns, payload)
        if self._straight_next:
            raise self._fault(move, "compensation_exit", "the first move after G40 must be straight, not an arc")
        if self._phase not in (Phase.ENTERING, Phase.CUTTING):
            return self._through(move)
        target = self._checked(move)
        contour = self._programmed_arc(move, target)
        path = contour.parallel(self._side * self._radius)
        if path is None:
            raise self._fault(
                move,
                "compensation_radius",
                f"the tool of radius {self._radius:g} mm does not fit into an arc of radius {contour.radius:.4g} mm",
            )
        if self._phase is Phase.ENTERING:
            return self._enter_by_arc(contour, path, move)
        return self._follow(contour, path, move)

    def aside(self, line: int, payload: Any = None) -> list[Move]:
        """What is no motion but happens where the tool then stands: a dwell, the spindle, coolant."""
        if self._held is None:
            return [Move(line, ASIDE, self._tool, payload=payload)]
        return self._stand(Move(line, ASIDE, self.programmed, payload=payload))

    def end(self) -> list[Move]:
        """G40, or the end of the program: the last move in full. The tool stays where it is until the next one."""
        moves = self._release(self._held.path.end) if self._held else []
        if self._phase is Phase.CUTTING:
            self._phase, self._straight_next = Phase.LEAVING, True
        elif self._phase is not Phase.LEAVING:
            self._phase = Phase.LEAVING if self._straight_next else Phase.OFF
        return moves

    def reset(self) -> None:
        """Forget everything: something else has moved the tool."""
        self._phase, self._straight_next = Phase.OFF, False
        self._held, self._behind = None, []

    # -- one move after the other

    def _follow(self, contour: Curve, path: Curve | None, move: Move) -> list[Move]:
        """The corner between the move held back and this one: what comes before this one is certain now."""
        held = self._held
        assert held is not None  # CUTTING has always one
        assert path is not None  # a straight always has one, and arc() has seen to it
        inside = is_inside(held.contour, contour, self._side)
        if inside:
            return self._inside_corner(held, contour, path, move)
        moves = self._release(held.path.end)
        if inside is False:
            moves.append(self._round(contour.start, path.start, move))
        self._hold(contour, path, move, path.extent)
        return moves

    def _inside_corner(self, held: _Held, contour: Curve, path: Curve, move: Move) -> list[Move]:
        """Both parallels end where they cross; neither may be shorter than what is cut off it."""
        meet = crossing(held.path, path)
        if meet is not None:
            back, ahead = held.path.before_end(meet), path.after_start(meet)
            too_far = held.path.millimetres(back - held.spare) > FIT_MM
            if not too_far and -FIT_MM <= path.millimetres(ahead) <= path.length + FIT_MM:
                moves = self._release(meet, held.spare - back)
                self._hold(contour, path, move, path.extent - ahead)
                return moves
        raise self._fault(
            move,
            "compensation_corner",
            f"the tool of radius {self._radius:g} mm does not fit into the inside corner between line "
            f"{held.move.line} and line {move.line}",
        )

    def _enter_by_arc(self, contour: Curve, path: Curve, move: Move) -> list[Move]:
        """The way in along an arc swings the tool out to the parallel."""
        length = abs(contour.end - contour.start)
        if length <= max(self._radius, COINCIDENT_MM):
            raise self._fault(
                move,
                "compensation_entry",
                f"the ends of the arc after G41 or G42 must be further apart than the tool's radius of "
                f"{self._radius:g} mm: they are {length:.4g} mm",
            )
        way_in = swing(path, contour.start)
        if way_in is None:
            raise self._fault(
                move, "compensation_entry", "the arc after G41 or G42 is too short or too long to swing the tool in"
            )
        return self._hold(contour, way_in, move, way_in.extent)

    def _round(self, corner: complex, target: complex, move: Move) -> Move:
        """Round an outside corner. A rapid goes straight: there are no rapid arcs, and it is not to cut."""
        end = self._placed(move.end, target, stay=True)
        start, self._tool = self._in_plane(self._tool), end
        if move.kind == RAPID or abs(target - start) < SPECK_MM:
            return Move(move.line, RAPID if move.kind == RAPID else FEED, end, payload=move.payload)
        from_start, kind = corner - start, CW if self._side == LEFT else CCW
        return Move(move.line, kind, end, (from_start.real, from_start.imag), payload=move.payload)

    # -- holding back and letting go

    def _hold(self, contour: Curve, path: Curve, move: Move, spare: float) -> list[Move]:
        self._held = _Held(contour, path, move, spare)
        self._contour_at = contour.end
        self.programmed = move.end
        self._phase = Phase.CUTTING
        return []

    def _stand(self, move: Move) -> list[Move]:
        """A move of other axes alone, or none at all: it happens where the move before it will have ended."""
        if len(self._behind) >= MAX_HELD:
            raise self._fault(move, "compensation_still", f"over {MAX_HELD} moves without a motion in the plane")
        self._behind = [*self._behind, move]  # never in place: a copy of all this keeps its own
        self.programmed = move.end
        return []

    def _release(self, end: complex, left: float | None = None) -> list[Move]:
        """The move held back, ending at `end`, and all that stands behind it; `left`: of an arc's angle."""
        held = self._held
        assert held is not None
        moves = [self._finished(held, end, held.spare if left is None else left)]
        moves += [move._replace(end=self._placed(move.end, end)) for move in self._behind]
        self._held, self._behind, self._tool = None, [], moves[-1].end
        return moves

    def _finished(self, held: _Held, end: complex, left: float) -> Move:
        """The move held back as it is given out."""
        move = held.move
        placed = self._placed(move.end, end)
        if not held.path.turn:
            return Move(move.line, move.kind, placed, move.centre, move.turns, move.payload)
        if left * held.path.radius < SPECK_MM:
            return Move(move.line, FEED, placed, payload=move.payload)
        from_start = held.path.centre - self._in_plane(self._tool)
        turns = max(1, ceil(left / (2 * pi) - 1e-9))
        return Move(move.line, move.kind, placed, (from_start.real, from_start.imag), turns, move.payload)

    def _through(self, move: Move) -> list[Move]:
        """Not compensated. After G40 it brings the tool back to the programmed way."""
        self.programmed = self._tool = move.end
        if self._phase is Phase.LEAVING:
            self._phase = Phase.OFF
        return [move]

    def _fault(self, move: Move, code: str, message: str) -> CompensationFault:
        """Give up until G40; whoever goes on goes on with the moves of the fault."""
        moves = self._release(self._held.path.end) if self._held else []
        to_end = Move(move.line, FEED if move.kind in (CW, CCW) else move.kind, move.end, payload=move.payload)
        self._phase = Phase.OFF if self._phase in (Phase.OFF, Phase.LEAVING) else Phase.THROUGH
        self._straight_next = False
        self.programmed = self._tool = move.end
        return CompensationFault(move.line, code, message, [*moves, to_end])

    # -- positions

    def _use_plane(self, plane: int) -> bool:
        """Look up the axes of a plane; whether the machine has both of it (a lathe has no Y)."""
        first, second, normal = (self._axes.find(axis) for axis in PLANE_AXES.get(plane, "???"))
        self.plane = plane
        self._first, self._second, self._normal = first, second, normal
        return first >= 0 and second >= 0

    def _in_plane(self, position: Position) -> complex:
        return complex(position[self._first], position[self._second])

    def _placed(self, position: Position, point: complex, *, stay: bool = False) -> Position:
        """`position` with the plane's axes at `point`; `stay`: and the axis that stands on it where it was."""
        placed = list(position)
        placed[self._first], placed[self._second] = point.real, point.imag
        if stay and self._normal >= 0:
            placed[self._normal] = self.programmed[self._normal]
        return tuple(placed)

    def _checked(self, move: Move) -> complex:
        """Where a move ends in the plane, that and its start being known and on this earth."""
        target = self._in_plane(move.end)
        if not (_sane(self._contour_at) and _sane(target)):
            raise self._fault(
                move, "compensation_unknown", "compensation needs to know where both ends of a move are in the plane"
            )
        return target

    def _programmed_arc(self, move: Move, target: complex) -> Curve:
        assert move.centre is not None
        from_start = complex(*move.centre)
        centre = self._contour_at + from_start
        if not _sane(centre) or abs(from_start) <= COINCIDENT_MM or not 1 <= move.turns <= MAX_TURNS:
            raise self._fault(move, "compensation_arc", "there is no arc of these words")
        radius, end_radius = abs(from_start), abs(target - centre)
        gap = abs(radius - end_radius)
        if min(radius, end_radius) <= COINCIDENT_MM or gap > _GAP_MM or gap > max(_SMALL_GAP_MM, _GAP_SHARE * radius):
            raise self._fault(
                move, "compensation_arc", f"the arc does not close: radius {radius:.4f} mm, at its end {end_radius:.4f}"
            )
        return arc(self._contour_at, target, centre, turn=-1 if move.kind == CW else 1, turns=move.turns)


def _sane(point: complex) -> bool:
    return abs(point.real) <= MAX_COORDINATE_MM and abs(point.imag) <= MAX_COORDINATE_MM
