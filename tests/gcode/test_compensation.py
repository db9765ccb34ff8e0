"""Cutter radius compensation: by hand, by geometry, and against anything at all."""

from itertools import pairwise
from math import atan2, cos, hypot, inf, isclose, nan, pi, sin, sqrt, tan
from random import Random

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gcode.compensation import (
    ASIDE,
    LEFT,
    MAX_HELD,
    RIGHT,
    SPECK_MM,
    CompensationFault,
    Compensator,
    Move,
    Phase,
)
from gcode.executor import Note
from gcode.interpreter import Interpreter
from gcode.offsetpath import REVERSAL_RAD, TANGENT_RAD
from gcode.profile import load_profile
from gcode.segments import CCW, CW, FEED, PROBE, RAPID, Segments
from gcode.words import parse_block
from tests.harness.contours import (
    Contour,
    Point,
    Step,
    arc_step,
    compensated,
    corner,
    distance_to,
    feed,
    polygon,
    random_contour,
    walk,
    with_starts,
)
from tests.harness.programs import quick

ORIGIN = (0.0, 0.0, 0.0)
EXACT_MM = 1e-6

contours = st.builds(lambda seed, steps: random_contour(Random(seed), steps), st.integers(0, 2**32), st.integers(1, 8))
radii = st.floats(0.05, 3.0).map(lambda value: round(value, 3))
sides = st.sampled_from((LEFT, RIGHT))


def begun(side: int = LEFT, radius: float = 3.0, axes: str = "XYZ", plane: int = 17) -> Compensator:
    compensator = Compensator(axes)
    compensator.begin(1, side, radius, (0.0,) * len(axes), plane)
    return compensator


def moves_of(contour: Contour) -> list[Move]:
    moves, fault = compensated(contour)
    assert fault is None, fault
    return moves


def near_tangent(contour: Contour) -> bool:
    """Whether some corner is so small that it is taken as none, or so near to a reversal that it is taken as one."""
    steps = [(start, step) for start, step in with_starts(contour) if step.to != start or step.centre is not None]
    corners = [abs(corner(start, one, two)) for (start, one), (_, two) in pairwise(steps)]
    return any(1e-9 < angle < 1.01 * TANGENT_RAD or 1e-9 < pi - angle < 1.01 * REVERSAL_RAD for angle in corners)


def off_at_tangent(contour: Contour) -> float:
    """How far off the tool may be where a corner is taken as none: square to the first way, it is so far from the
    second. Inside an arc that is more than along a straight."""
    radius, along = contour.radius, cos(1.01 * TANGENT_RAD)
    arcs = [
        hypot(start[0] - step.centre[0], start[1] - step.centre[1])
        for start, step in with_starts(contour)
        if step.centre
    ]
    inside = [sqrt(arc**2 + radius**2 - 2 * arc * radius * along) - abs(arc - radius) for arc in arcs]
    return max([radius * (1 - along), *inside])


# -- by hand


def test_a_square_from_outside() -> None:
    """G41 clockwise round a square of 30: arcs of the tool's radius round its corners, the way in to its side."""
    moves = moves_of(polygon(LEFT, 3.0, [(10, 0), (10, 30), (40, 30), (40, 0)], start=(0, 0)))
    assert [(move.kind, move.end[:2], move.centre) for move in moves] == [
        (FEED, pytest.approx((7, 3)), None),  # an inside corner between the way in and the first side
        (FEED, pytest.approx((7, 30)), None),
        (CW, pytest.approx((10, 33)), pytest.approx((3, 0))),
        (FEED, pytest.approx((40, 33)), None),
        (CW, pytest.approx((43, 30)), pytest.approx((0, -3))),
        (FEED, pytest.approx((43, 0)), None),
        (CW, pytest.approx((40, -3)), pytest.approx((-3, 0))),
        (FEED, pytest.approx((10, -3)), None),
        (FEED, (0, 0), None),
    ]
    assert [move.line for move in moves] == [1, 2, 3, 3, 4, 4, 5, 5, 7]


def test_a_square_from_inside() -> None:
    moves = moves_of(polygon(RIGHT, 3.0, [(0, 0), (0, 30), (40, 30), (40, 0)], start=(20, 0)))
    assert [move.end[:2] for move in moves[1:4]] == [
        pytest.approx((3, 27)),
        pytest.approx((37, 27)),
        pytest.approx((37, 3)),
    ]
    assert all(move.centre is None for move in moves)


@pytest.mark.parametrize(("side", "clockwise", "radius"), [(LEFT, True, 13), (LEFT, False, 7), (RIGHT, True, 7)])
def test_an_arc_gets_the_radius_of_the_tool_more_or_less(side: int, clockwise: bool, radius: float) -> None:
    compensator = begun(side)
    compensator.straight(2, (20, 0, 0))
    (way_in,) = compensator.arc(
        3, (30, -10 if clockwise else 10, 0), (0, -10 if clockwise else 10), clockwise=clockwise
    )
    (move,) = compensator.end()
    assert way_in.end == pytest.approx((20, 3 * side, 0))
    assert move.kind == (CW if clockwise else CCW)
    assert move.centre is not None
    assert hypot(*move.centre) == pytest.approx(radius)
    assert move.end == pytest.approx((20 + radius, -10 if clockwise else 10, 0))


def test_the_lathe_plane_counts_z_first() -> None:
    """G18: Z is the first axis and X the second, so left of a cut towards the chuck (-Z) is smaller X."""
    compensator = begun(LEFT, 0.8, axes="XZ", plane=18)
    assert compensator.straight(2, (20.0, -10.0)) == []
    (way_in,) = compensator.straight(3, (20.0, -40.0))
    (cut,) = compensator.end()
    assert way_in.end[0] == pytest.approx(19.2)
    assert cut.end == pytest.approx((19.2, -40.0))


def test_heights_and_asides_happen_where_the_move_before_them_ends() -> None:
    """A retract in an inside corner: the corner is known only when the tool is down again."""
    compensator = begun()
    compensator.straight(2, (20, 0, 0), payload="in")
    assert compensator.aside(3, "dwell") == []
    assert compensator.straight(4, (20, 0, 5), rapid=True) == []
    moves = compensator.straight(5, (20, 25, 5))
    assert [(move.line, move.kind) for move in moves] == [(2, FEED), (3, ASIDE), (4, RAPID)]
    assert [move.end for move in moves] == [pytest.approx((17, 3, z)) for z in (0, 0, 5)]
    assert [move.payload for move in moves] == ["in", "dwell", None]
    assert begun().aside(2, "spindle") == [Move(2, ASIDE, ORIGIN, payload="spindle")]


def test_round_an_outside_corner_the_height_stays_and_the_turntable_turns() -> None:
    compensator = begun(RIGHT, 3.0, axes="XYZA")
    compensator.straight(2, (20, 0, -1, 0))
    way_in, round_it = compensator.straight(3, (20, 25, -4, 90))
    assert way_in.end == pytest.approx((20, -3, -1, 0))
    assert (round_it.kind, round_it.line) == (CCW, 3)
    assert round_it.end == pytest.approx((23, 0, -1, 90))


def test_a_rapid_takes_an_outside_corner_straight() -> None:
    compensator = begun(RIGHT)
    compensator.straight(2, (20, 0, 0))
    _, across = compensator.straight(3, (20, 25, 0), rapid=True)
    assert across == Move(3, RAPID, pytest.approx((23, 0, 0)))  # type: ignore[arg-type]


def test_straight_there_and_back_goes_round_the_end() -> None:
    compensator = begun()
    compensator.straight(2, (20, 0, 0))
    (_, round_it) = compensator.straight(3, (5, 0, 0))
    assert round_it.end == pytest.approx((20, -3, 0))
    assert (round_it.kind, round_it.centre) == (CW, pytest.approx((0, -3)))


def test_arcs_that_turn_straight_back_are_told_by_their_bends() -> None:
    """Back along a narrower arc the tool is in the cusp between the two; along a wider one it goes round the end."""
    for second_radius, kinds in ((2.0, [FEED, CCW, CW]), (8.0, [FEED, CCW, CW, CW])):
        compensator = begun(LEFT, 1.0)
        compensator.straight(1, (20, 0, 0))
        moves = compensator.arc(2, (25, 5, 0), (0, 5), clockwise=False)
        moves += compensator.arc(3, (25 - 2 * second_radius, 5, 0), (-second_radius, 0), clockwise=True)
        moves += compensator.end()
        assert [move.kind for move in moves] == kinds
        at_corner = (22 + 2 / 3, 5 - 80**0.5 / 3) if second_radius < 5 else (24, 5)
        assert moves[1].end[:2] == pytest.approx(at_corner)


def test_nearly_back_is_no_reversal() -> None:
    """A wedge of one degree: there is no room for the tool but far away from its point."""
    refused("compensation_corner", 2, Step((20, 0)), Step((0, 0.35)))
    moves = moves_of(Contour(LEFT, 0.05, (0, 0), (Step((20, 0)), Step((0, 0.35)))))
    assert moves[0].end[0] == pytest.approx(20 - 0.05 / tan(atan2(0.35, 20) / 2))


def test_the_rest_of_turns_after_a_corner() -> None:
    """Three turns that end in an inside corner stay three; what is cut off is less than a turn."""
    compensator = begun(LEFT, 1.0)
    compensator.straight(2, (10, 0, 0))
    compensator.arc(3, (10, 0, -9), (0, 10), clockwise=False, turns=3)
    (helix,) = compensator.straight(4, (5, 10, -9))
    assert helix.turns == 3
    assert helix.end[2] == -9
    assert compensator.end()[0].line == 4


def test_after_g40_the_tool_stays_until_a_straight_move() -> None:
    compensator = begun()
    compensator.straight(2, (20, 0, 0))
    (last,) = compensator.end()
    assert last.end == compensator.tool == pytest.approx((20, 3, 0))
    assert compensator.programmed == (20, 0, 0)
    assert compensator.phase is Phase.LEAVING
    assert compensator.active
    assert not compensator.engaged
    assert compensator.aside(3, None)[0].end == pytest.approx((20, 3, 0))
    (move,) = compensator.straight(4, (20, 0, 7))
    assert move.end == (20, 0, 7)
    assert not compensator.active


def test_on_again_before_any_move() -> None:
    """The next way in starts where the program believes to be; it must be straight."""
    for arc in (False, True):
        compensator = begun()
        compensator.straight(2, (20, 0, 0))
        compensator.end()
        compensator.begin(3, RIGHT, 2.0, compensator.programmed)
        if arc:
            with pytest.raises(CompensationFault, match="first move after G40 must be straight"):
                compensator.arc(4, (40, 0, 0), (10, 0), clockwise=True)
        else:
            assert compensator.straight(4, (40, 0, 0)) == []
            assert compensator.end()[0].end == pytest.approx((40, -2, 0))


def test_g41_and_g40_without_a_move_are_nothing() -> None:
    compensator = begun()
    assert compensator.end() == []
    assert not compensator.active
    assert compensator.end() == []


def test_radius_nothing_holds_nothing_back() -> None:
    compensator = begun(radius=0.0)
    assert compensator.engaged
    assert compensator.straight(2, (1, 0, 0)) == [Move(2, FEED, (1, 0, 0))]
    assert compensator.arc(3, (1, 0, 0), (1, 0), clockwise=True) == [Move(3, CW, (1, 0, 0), (1, 0))]
    assert compensator.end() == []
    assert compensator.arc(5, (1, 0, 0), (1, 0), clockwise=True)[0].kind == CW


def test_a_negative_radius_is_the_other_side() -> None:
    assert moves_of(polygon(LEFT, -2.0, [(9, 0), (9, 9)], start=(0, 0))) == moves_of(
        polygon(RIGHT, 2.0, [(9, 0), (9, 9)], start=(0, 0))
    )


def test_something_else_moved_the_tool() -> None:
    compensator = begun()
    compensator.straight(2, (20, 0, 0))
    compensator.reset()
    assert not compensator.active
    assert compensator.end() == []


# -- what is refused


def refused(code: str, line: int, *steps: Step, side: int = LEFT, radius: float = 3.0) -> CompensationFault:
    _, fault = compensated(Contour(side, radius, (0, 0), steps))
    assert fault is not None
    assert (fault.code, fault.line) == (code, line)
    assert fault.message
    return fault


def test_the_way_in_is_longer_than_the_radius() -> None:
    refused("compensation_entry", 1, Step((3, 0)))
    refused("compensation_entry", 1, Step((0, 0), 5))  # nor may it be a height alone
    refused("compensation_entry", 1, arc_step((0, 0), (0, 4), 0.5))
    assert compensated(Contour(LEFT, 3.0, (0, 0), (Step((3.001, 0)),)))[1] is None


def test_a_way_in_along_an_arc_that_cannot_swing_the_tool_in() -> None:
    """Too short an arc inside a circle: the parallel is left behind already."""
    refused("compensation_entry", 1, arc_step((0, 0), (0, 10), 0.6))


def test_a_tool_too_big_for_an_arc() -> None:
    refused("compensation_radius", 2, Step((20, 0)), arc_step((20, 0), (20, 3), pi))
    refused("compensation_radius", 1, arc_step((0, 0), (0, 3), pi))
    assert compensated(Contour(RIGHT, 3.0, (0, 0), (Step((20, 0)), arc_step((20, 0), (20, 3), pi))))[1] is None


def test_a_tool_too_big_for_a_slot() -> None:
    """The bottom of a slot 5.9 wide has no room for a tool of 6; in 6 it fits exactly."""
    slot = (Step((20, 30)), Step((20, 0)), Step((25.9, 0)), Step((25.9, 30)))
    fault = refused("compensation_corner", 4, *slot)
    assert "between line 3 and line 4" in fault.message
    exact = (Step((20, 30)), Step((20, 0)), Step((26, 0)), Step((26, 30)))
    moves = moves_of(Contour(LEFT, 3.0, (0, 30), exact))
    assert moves[-3].end == pytest.approx((23, 3, 0))


def test_a_bump_in_a_straight_is_too_much() -> None:
    refused("compensation_corner", 3, Step((20, 0)), Step((21, -1)), Step((20, 3)))


def test_concentric_arcs_have_no_corner_to_go_to() -> None:
    """From one arc into a smaller one around the same centre, by a straight that is too short for the tool."""
    steps = (Step((20, 0)), arc_step((20, 0), (20, 20), pi / 2), Step((37, 20)), arc_step((37, 20), (20, 20), -pi / 2))
    refused("compensation_corner", 4, *steps, radius=2.0)


def test_an_arc_that_does_not_close_is_not_compensated() -> None:
    refused("compensation_arc", 2, Step((20, 0)), Step((30, 0), centre=(26, 0), turn=-1))
    refused("compensation_arc", 2, Step((20, 0)), Step((30, 0), centre=(20, 0), turn=-1))
    refused("compensation_arc", 2, Step((20, 0)), Step((30, 0), centre=(nan, 0), turn=-1))
    refused("compensation_arc", 2, Step((20, 0)), Step((30, 0), centre=(25, 0), turn=-1, turns=0))


def test_unknown_places_are_not_guessed() -> None:
    refused("compensation_unknown", 1, Step((nan, 0)))
    refused("compensation_unknown", 1, Step((1e300, 0)))
    compensator = Compensator("XYZ")
    compensator.begin(1, LEFT, 3.0, (nan, 0.0, nan))
    with pytest.raises(CompensationFault):
        compensator.straight(2, (10.0, 0.0, 0.0))
    compensator = Compensator("XYZ")
    compensator.begin(1, LEFT, 3.0, (0.0, 0.0, nan))
    compensator.straight(2, (10.0, 0.0, nan))
    assert compensator.end()[0].end[:2] == pytest.approx((10, 3))


@pytest.mark.parametrize(
    ("code", "arguments"),
    [
        ("compensation_radius", (LEFT, nan, ORIGIN)),
        ("compensation_radius", (LEFT, inf, ORIGIN)),
        ("compensation_plane", (LEFT, 1.0, ORIGIN, 17.1)),
    ],
)
def test_compensation_that_cannot_begin(code: str, arguments: tuple[int, float, tuple[float, ...]]) -> None:
    compensator = Compensator("XYZ")
    with pytest.raises(CompensationFault) as caught:
        compensator.begin(7, *arguments)
    assert (caught.value.line, caught.value.code, caught.value.moves) == (7, code, [])
    assert not compensator.active


def test_a_lathe_has_no_plane_xy() -> None:
    with pytest.raises(CompensationFault, match="G17"):
        Compensator("XZ").begin(1, LEFT, 1.0, (0.0, 0.0), 17)


def test_compensation_is_on_once() -> None:
    compensator = begun()
    with pytest.raises(CompensationFault, match="already on"):
        compensator.begin(2, RIGHT, 3.0, ORIGIN)
    assert compensator.engaged


def test_what_stands_still_is_bounded() -> None:
    compensator = begun()
    compensator.straight(2, (20, 0, 0))
    for line in range(MAX_HELD):
        assert compensator.straight(line, (20, 0, line)) == []
    with pytest.raises(CompensationFault) as caught:
        compensator.straight(5000, (20, 0, 0))
    assert caught.value.code == "compensation_still"
    assert len(caught.value.moves) == MAX_HELD + 2


def test_after_a_fault_the_program_goes_through_as_it_stands() -> None:
    compensator = begun()
    compensator.straight(2, (20, 0, 0))
    with pytest.raises(CompensationFault) as caught:
        compensator.arc(3, (20, 2, 0), (0, 1), clockwise=False, payload="small")
    assert [(move.line, move.kind, move.end) for move in caught.value.moves] == [
        (2, FEED, pytest.approx((20, 3, 0))),
        (3, FEED, (20, 2, 0)),
    ]
    assert caught.value.moves[1].payload == "small"
    assert compensator.programmed == compensator.tool == (20, 2, 0)
    assert compensator.straight(4, (9, 9, 9))[0].end == (9, 9, 9)
    assert compensator.end() == []
    assert not compensator.active


# -- by geometry


@given(contours)
@quick
def test_every_move_keeps_the_radius_from_its_own(contour: Contour) -> None:
    """Whatever the corners: along a straight and along an arc exactly the radius, and round a corner."""
    moves, _ = compensated(contour)
    slack = 3 * EXACT_MM + (off_at_tangent(contour) if near_tangent(contour) else 0.0)
    starts = with_starts(contour)
    here = contour.position(contour.start, 0.0)
    for move, after in pairwise(moves):
        if move.payload > 1:
            start, step = starts[move.payload - 1]
            if after.payload != move.payload:
                away = [off(point, start, step) - contour.side * contour.radius for point in walk(contour, move, here)]
            elif move.kind == RAPID:
                away = [0.0]
            else:
                away = [hypot(x - start[0], y - start[1]) - contour.radius for x, y in walk(contour, move, here)]
            assert (step.to == start and step.centre is None) or max(map(abs, away)) <= slack
        here = move.end


def off(point: Point, start: Point, step: Step) -> float:
    """How far a point lies to the left of a step, prolonged."""
    if step.centre is not None:
        ray, inner = (hypot(p[0] - step.centre[0], p[1] - step.centre[1]) for p in (point, step.to))
        return step.turn * (inner - ray)
    way = (step.to[0] - start[0], step.to[1] - start[1])
    return (way[0] * (point[1] - start[1]) - way[1] * (point[0] - start[0])) / (hypot(*way) or 1.0)


@given(contours)
@quick
def test_arcs_close_and_lines_go_on(contour: Contour) -> None:
    """Every arc given out closes; every programmed move is there once, in order, with its height and payload."""
    moves, fault = compensated(contour)
    slack = 2e-6 + (contour.radius * 0.002 if near_tangent(contour) else 0.0)
    here = contour.position(contour.start, 0.0)
    for move in moves:
        if move.centre is not None:
            centre = (here[0] + move.centre[0], here[1] + move.centre[1])
            assert isclose(hypot(*move.centre), hypot(move.end[0] - centre[0], move.end[1] - centre[1]), abs_tol=slack)
        here = move.end
    lines = [move.line for move in moves]
    assert lines == sorted(lines)
    if fault is None:
        assert set(lines) == {*range(1, len(contour.steps) + 1), len(contour.steps) + 2}
        last = {move.line: move for move in moves}
        assert [last[n].end[2] for n in range(1, len(contour.steps) + 1)] == [step.height for step in contour.steps]


@given(contours)
@quick
def test_the_mirrored_contour_from_the_other_side_is_the_mirrored_path(contour: Contour) -> None:
    moves, fault = compensated(contour)
    mirrored, other_fault = compensated(contour.mirrored())
    assert (fault and fault.code, fault and fault.line) == (
        other_fault and other_fault.code,
        other_fault and other_fault.line,
    )
    flip = {CW: CCW, CCW: CW}
    assert [move.kind for move in mirrored] == [flip.get(move.kind, move.kind) for move in moves]
    for one, two in zip(moves, mirrored, strict=True):
        assert two.end == pytest.approx((-one.end[0], *one.end[1:]), abs=1e-6)


@given(contours)
@quick
def test_radius_nothing_changes_nothing(contour: Contour) -> None:
    bare = Contour(contour.side, 0.0, contour.start, contour.steps, contour.plane, None)
    moves = moves_of(bare)
    assert [move.end for move in moves] == [bare.position(step.to, step.height) for step in bare.steps]
    assert [move.centre for move in moves] == [
        step.centre and (step.centre[0] - start[0], step.centre[1] - start[1]) for start, step in with_starts(bare)
    ]


@st.composite
def convex(draw: st.DrawFn) -> list[Point]:
    """Counter-clockwise corners on a circle."""
    angles = sorted(draw(st.lists(st.integers(0, 359), min_size=3, max_size=9, unique=True)))
    size = draw(st.floats(5, 60))
    assume(all((two - one) % 360 >= 12 for one, two in pairwise([*angles, angles[0]])))
    return [(round(size * cos(a * pi / 180), 4), round(size * sin(a * pi / 180), 4)) for a in angles]


def closed(points: list[Point], *, fillet: float) -> list[Step]:
    """All round a polygon and some way on; with `fillet` its corners are tangent arcs."""
    steps: list[Step] = []
    count = len(points)
    for number in range(1, count + 1):
        before, at, after = points[number - 1], points[number % count], points[(number + 1) % count]
        if not fillet:
            steps.append(Step(at))
            continue
        one, two = unit(at, before), unit(at, after)
        half = abs(hypot(one[0] + two[0], one[1] + two[1])) / 2  # cosine of half the corner
        back = fillet * half / (1 - half * half) ** 0.5
        assume(back < 0.45 * min(hypot(at[0] - p[0], at[1] - p[1]) for p in (before, after)))
        to_centre = fillet / (1 - half * half) ** 0.5
        middle = unit((0, 0), (one[0] + two[0], one[1] + two[1]))
        steps.append(Step((at[0] + one[0] * back, at[1] + one[1] * back)))
        centre = (at[0] + middle[0] * to_centre, at[1] + middle[1] * to_centre)
        steps.append(Step((at[0] + two[0] * back, at[1] + two[1] * back), centre=centre, turn=1))
    return steps


def unit(start: Point, end: Point) -> Point:
    length = hypot(end[0] - start[0], end[1] - start[1])
    return ((end[0] - start[0]) / length, (end[1] - start[1]) / length)


@given(convex(), radii, sides, st.sampled_from((0.0, 1.0, 4.0)))
@quick
def test_round_a_convex_part_no_point_is_nearer_than_the_radius(
    points: list[Point], radius: float, side: int, fillet: float
) -> None:
    """The whole path from the whole contour: in a convex one all that can happen happens between neighbours."""
    steps = closed(points, fillet=fillet)
    first = ((points[0][0] + points[1][0]) / 2, (points[0][1] + points[1][1]) / 2)
    along = unit(points[0], points[1])
    start = (first[0] - along[0] * 2 * radius, first[1] - along[1] * 2 * radius)
    # The last side is cut up to where the first began, so that the way in is the only move that is no contour.
    contour = Contour(side, radius, start, (Step(first), *steps, Step(first)))
    moves, fault = compensated(contour)
    if fault is not None:
        assert side == LEFT  # outside, any tool fits
        assert fault.code in ("compensation_corner", "compensation_radius")
        return
    wall = [(at, step) for at, step in with_starts(contour)[1:]]
    nearly_filled = side == LEFT and 0 < fillet - radius < 2 * SPECK_MM
    specks = {line for line, (_, step) in enumerate(wall, 2) if step.centre is not None} if nearly_filled else set()
    here = moves[0].end
    for move in moves[1:-1]:
        for point in walk(contour, move, here, 8):
            distances = [distance_to(point, at, step) for at, step in wall]
            # What is left of a fillet that the tool nearly fills is a straight.
            assert min(distances) == pytest.approx(radius, abs=SPECK_MM if move.payload in specks else EXACT_MM)
        here = move.end


@given(st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40)), min_size=3, max_size=7), radii, sides)
@quick
def test_no_straight_comes_nearer_to_its_neighbours(points: list[Point], radius: float, side: int) -> None:
    points = [(round(x, 3), round(y, 3)) for x, y in points]
    assume(all(hypot(one[0] - two[0], one[1] - two[1]) > 0.1 for one, two in pairwise([(0, 0), *points])))
    contour = Contour(side, radius, (0.0, 0.0), tuple(Step(point) for point in points), 17, None)
    assume(not near_tangent(contour))
    moves, _ = compensated(contour)
    wall = with_starts(contour)
    here = moves[0].end if moves else ORIGIN
    # The last one before a fault is left out: it may be the arc round a corner of which the move itself is missing.
    for move, after in pairwise(moves[1:]):
        is_corner = after.payload == move.payload
        for at, step in wall[max(1, move.payload - 2) : move.payload + (0 if is_corner else 1)]:
            assert all(distance_to(point, at, step) >= radius - EXACT_MM for point in walk(contour, move, here, 4))
        here = move.end


# -- anything at all

numbers = st.one_of(
    st.floats(-50, 50).map(lambda value: round(value, 1)), st.floats(), st.sampled_from((0.0, 1.0, 1e-9, 1e-300, 1e300))
)
triples = st.tuples(numbers, numbers, numbers)
calls = st.one_of(
    st.tuples(st.just("begin"), st.integers(0, 9), sides, numbers, triples, st.sampled_from((17, 18, 19, 0))),
    st.tuples(st.just("straight"), st.integers(0, 9), triples, st.booleans()),
    st.tuples(st.just("arc"), st.integers(0, 9), triples, st.tuples(numbers, numbers), st.booleans(), st.integers()),
    st.tuples(st.just("aside"), st.integers(0, 9)),
    st.tuples(st.just("end")),
)


@given(st.lists(calls, max_size=20))
@quick
def test_nothing_is_raised_but_the_fault_and_no_move_is_lost(program: list[tuple]) -> None:  # type: ignore[type-arg]
    compensator = Compensator("XYZ")
    given_in, given_out = 0, 0
    for name, *arguments in program:
        try:
            match name:
                case "begin":
                    compensator.begin(*arguments)
                    continue
                case "straight":
                    given_in += 1
                    moves = compensator.straight(arguments[0], arguments[1], rapid=arguments[2], payload=given_in)
                case "arc":
                    given_in += 1
                    line, end, centre, clockwise, turns = arguments
                    moves = compensator.arc(line, end, centre, clockwise=clockwise, turns=turns, payload=given_in)
                case "aside":
                    given_in += 1
                    moves = compensator.aside(arguments[0], given_in)
                case _:
                    moves = compensator.end()
        except CompensationFault as fault:
            moves = fault.moves
        given_out += len({move.payload for move in moves})
        assert all(len(move.end) == 3 for move in moves)
        if moves:
            assert moves[-1].end == pytest.approx(compensator.tool, nan_ok=True)
    given_out += len({move.payload for move in compensator.end()})
    assert given_out >= given_in


def test_a_long_program_holds_one_move_back() -> None:
    """Constant memory: what comes out is never more than two behind what goes in."""
    contour = polygon(LEFT, 1.0, [(20, 0), (40, 10), (60, 0)] * 200, start=(0, 0))
    compensator = Compensator("XYZ")
    behind = [number - moves[-1].line for number, moves in enumerate(feed(contour, compensator), 1) if moves]
    assert set(behind[1:-2]) <= {0, 1}


# -- in the interpreter


def followed(*lines: str) -> tuple[Segments, list[Note]]:
    """A program from unknown places on, in the language of the reference."""
    interpreter = Interpreter(load_profile("rs274ngc"))
    for number, line in enumerate(lines, 1):
        interpreter.step(number, parse_block(line))
    interpreter.finish()
    return interpreter.take(), interpreter.notes


BEGINNING = ("G21 G17 G90 G94 F100", "G0 X0 Y0", "G42.1 D6", "G1 X20")


def test_feeds_and_dwells_stay_with_their_moves() -> None:
    """What is held back keeps the feed of its own block; only the plane's axes have to be known."""
    found, notes = followed(*BEGINNING, "F200", "G4 P1", "G1 Y20 F300", "G40", "G1 X0")
    assert not notes
    assert list(found.kind[1:]) == [FEED, ASIDE, CCW, FEED, FEED]
    assert list(found.feed[[1, 3, 4]]) == [100, 300, 300]
    assert list(found.line[1:]) == [4, 6, 7, 7, 9]
    assert tuple(found.end[:2, 2]) == pytest.approx((20, -3))


def test_inverse_time_counts_the_programmed_way() -> None:
    """G93 F2: 20 mm in half a minute; the arc round the corner is cut at the same feed."""
    found, notes = followed(*BEGINNING, "G93 G1 Y20 F2", "G40", "G94 F50 G1 X0")
    assert not notes
    assert list(found.feed[2:]) == [40, 40, 50]


def test_the_plane_of_g41_is_that_of_its_arcs() -> None:
    """In one block the plane changes before compensation ends (rs274 §3)."""
    found, _ = followed(*BEGINNING, "G3 X30 Y10 J10", "G40 G18", "G1 X0")
    assert (found.kind[2], found.plane[2], found.radius[2]) == (CCW, 17, pytest.approx(13))


def test_nobody_guides_a_probe() -> None:
    found, notes = followed(*BEGINNING, "G38.2 X40", "G40")
    assert [(note.line, note.code) for note in notes] == [(5, "compensation")]
    assert list(found.kind[1:]) == [FEED, PROBE]
    assert tuple(found.end[:2, 1]) == tuple(found.start[:2, 2]) == pytest.approx((20, -3))
    _, notes = followed(*BEGINNING, "G40", "G38.2 X40")
    assert not notes
