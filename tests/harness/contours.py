"""Contours for the tests of cutter radius compensation: as G-code, or fed to the compensator; random ones too."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import atan2, cos, hypot, pi, sin
from random import Random

from gcode.compensation import LEFT, CompensationFault, Compensator, Move
from gcode.offsetpath import TANGENT_RAD
from gcode.segments import PLANE_AXES

OFFSET_WORD = {"X": "I", "Y": "J", "Z": "K"}
Point = tuple[float, float]


@dataclass(frozen=True)
class Step:
    """One programmed move. `to` in the plane; `centre` (absolute, in the plane) makes it an arc, `turn` 1 is G3."""

    to: Point
    height: float = 0.0
    rapid: bool = False
    centre: Point | None = None
    turn: int = 0
    turns: int = 1


@dataclass(frozen=True)
class Contour:
    """Steps from `start`, the first of them the way in. `back`: where the straight move after G40 goes."""

    side: int
    radius: float
    start: Point
    steps: tuple[Step, ...]
    plane: int = 17
    back: Point | None = field(default=(0.0, 0.0))

    @property
    def axes(self) -> tuple[str, str, str]:
        return PLANE_AXES[self.plane]

    def words(self) -> list[str]:
        """The G-code of it, from a rapid to the start; every number to six decimals."""
        first, second, normal = self.axes
        code = "G41.1" if self.side == LEFT else "G42.1"
        lines = [f"G{self.plane} G40", f"G0 {first}{self.start[0]:.6f} {second}{self.start[1]:.6f} {normal}0"]
        lines.append(f"{code} D{2 * self.radius:.6f}")
        here = self.start
        for step in self.steps:
            lines.append(self._words_of(step, here))
            here = step.to
        lines.append("G40")
        if self.back is not None:
            lines.append(f"G1 {first}{self.back[0]:.6f} {second}{self.back[1]:.6f}")
        return lines

    def _words_of(self, step: Step, here: Point) -> str:
        first, second, normal = self.axes
        where = f"{first}{step.to[0]:.6f} {second}{step.to[1]:.6f} {normal}{step.height:.6f}"
        if step.centre is None:
            return f"G{0 if step.rapid else 1} {where}"
        from_start = " ".join(
            f"{OFFSET_WORD[axis]}{there - now:.6f}"
            for axis, there, now in zip((first, second), step.centre, here, strict=True)
        )
        turns = f" P{step.turns}" if step.turns > 1 else ""
        return f"G{3 if step.turn > 0 else 2} {where} {from_start}{turns}"

    def position(self, point: Point, height: float) -> tuple[float, ...]:
        """Over X, Y, Z."""
        first, second, normal = self.axes
        place = {first: point[0], second: point[1], normal: height}
        return tuple(place[axis] for axis in "XYZ")

    def mirrored(self) -> "Contour":
        """In the plane's first axis, cut from the other side."""
        return replace(
            self,
            side=-self.side,
            start=_flip(self.start),
            steps=tuple(
                replace(
                    step,
                    to=_flip(step.to),
                    centre=step.centre and _flip(step.centre),
                    turn=-step.turn,
                )
                for step in self.steps
            ),
            back=self.back and _flip(self.back),
        )


def _flip(point: Point) -> Point:
    return (-point[0], point[1])


def feed(contour: Contour, compensator: Compensator) -> Iterator[list[Move]]:
    """What each programmed move gives; the line of a step is its number, from 1; 0 is G41, the last but one G40."""
    compensator.begin(0, contour.side, contour.radius, contour.position(contour.start, 0.0), contour.plane)
    here = contour.start
    for line, step in enumerate(contour.steps, 1):
        end = contour.position(step.to, step.height)
        if step.centre is None:
            yield compensator.straight(line, end, rapid=step.rapid, payload=line)
        else:
            centre = (step.centre[0] - here[0], step.centre[1] - here[1])
            yield compensator.arc(line, end, centre, clockwise=step.turn < 0, turns=step.turns, payload=line)
        here = step.to
    yield compensator.end()
    if contour.back is not None:
        end = contour.position(contour.back, contour.steps[-1].height)
        yield compensator.straight(len(contour.steps) + 2, end, payload=0)


def compensated(contour: Contour) -> tuple[list[Move], CompensationFault | None]:
    """All moves, up to a fault (those that go on after it are in the fault)."""
    moves: list[Move] = []
    try:
        for some in feed(contour, Compensator("XYZ")):
            moves += some
    except CompensationFault as fault:
        return moves, fault
    return moves, None


def arc_step(here: Point, centre: Point, sweep: float, height: float = 0.0) -> Step:
    """An arc from `here` around `centre` by `sweep` rad, positive counter-clockwise."""
    dx, dy = here[0] - centre[0], here[1] - centre[1]
    if abs(sweep) >= 2 * pi:
        to = here
    else:
        to = (centre[0] + dx * cos(sweep) - dy * sin(sweep), centre[1] + dx * sin(sweep) + dy * cos(sweep))
    return Step(_round(to), height, centre=centre, turn=1 if sweep > 0 else -1)


def _round(point: Point) -> Point:
    """As it is written in the program."""
    return (round(point[0], 6), round(point[1], 6))


def random_contour(random: Random, steps: int = 5, *, plane: int = 17) -> Contour:
    """Straights and arcs at random angles, some tangent, nearly so or straight back; rapids, heights, full circles."""
    side = random.choice((-1, 1))
    radius = round(random.uniform(0.2, 4.0), 3)
    here, heading = (0.0, 0.0), random.uniform(0, 2 * pi)
    made: list[Step] = []
    for number in range(steps):
        if made and random.random() < 0.1:
            made.append(replace(made[-1], to=here, height=-1.0, centre=None, turn=0, rapid=random.random() < 0.5))
            continue
        heading += random.choice((0.0, 0.0, 0.0, random.uniform(-0.1, 0.1), pi, *(random.uniform(-2.8, 2.8),) * 5))
        height = random.choice((0.0, -2.5))
        if random.random() < (0.5 if number else 0.15):
            step, heading = _random_arc(random, here, heading, height)
        else:
            length = random.uniform(4.5, 30.0)
            to = _round((here[0] + length * cos(heading), here[1] + length * sin(heading)))
            step = Step(to, height, rapid=random.random() < 0.1)
        made.append(step)
        here = step.to
    back = _round((here[0] + random.uniform(-20, 20), here[1] + random.uniform(-20, 20)))
    return Contour(side, radius, (0.0, 0.0), tuple(made), plane, back)


def _random_arc(random: Random, here: Point, heading: float, height: float) -> tuple[Step, float]:
    turn, radius = random.choice((-1, 1)), random.uniform(1.0, 15.0)
    to_centre = heading + turn * pi / 2
    centre = _round((here[0] + radius * cos(to_centre), here[1] + radius * sin(to_centre)))
    sweep = 2 * pi if random.random() < 0.1 else random.uniform(0.3, 5.0)
    return arc_step(here, centre, turn * sweep, height), heading + turn * sweep


def polygon(side: int, radius: float, points: list[Point], *, start: Point, plane: int = 17) -> Contour:
    """From `start` to the first point, round all of them and back to it."""
    steps = tuple(Step(point) for point in [*points, points[0]])
    return Contour(side, radius, start, steps, plane, start)


def distance_to(point: Point, start: Point, step: Step) -> float:
    """From a point to a programmed step."""
    if step.centre is None:
        return _distance_to_straight(point, start, step.to)
    angle_span = sweep_of(start, step)
    ray = (point[0] - step.centre[0], point[1] - step.centre[1])
    from_start = (start[0] - step.centre[0], start[1] - step.centre[1])
    if step.turns > 1 or _between(from_start, ray, step.turn) <= angle_span:
        return abs(hypot(*ray) - hypot(*from_start))
    return min(hypot(point[0] - start[0], point[1] - start[1]), hypot(point[0] - step.to[0], point[1] - step.to[1]))


def _distance_to_straight(point: Point, start: Point, end: Point) -> float:
    way = (end[0] - start[0], end[1] - start[1])
    square = way[0] ** 2 + way[1] ** 2
    if square == 0.0:
        return hypot(point[0] - start[0], point[1] - start[1])
    part = ((point[0] - start[0]) * way[0] + (point[1] - start[1]) * way[1]) / square
    part = min(1.0, max(0.0, part))
    return hypot(point[0] - start[0] - part * way[0], point[1] - start[1] - part * way[1])


def with_starts(contour: Contour) -> list[tuple[Point, Step]]:
    """Every step with where it starts."""
    starts = [contour.start, *(step.to for step in contour.steps)]
    return list(zip(starts, contour.steps, strict=False))


def heading(start: Point, step: Step, *, at_end: bool) -> float:
    """Direction of travel at an end of a step, rad."""
    if step.centre is None:
        return atan2(step.to[1] - start[1], step.to[0] - start[0])
    point = step.to if at_end else start
    return atan2(point[1] - step.centre[1], point[0] - step.centre[0]) + step.turn * pi / 2


def corner(start: Point, one: Step, two: Step) -> float:
    """Change of direction between two steps, -pi to pi, positive to the left."""
    change = heading(one.to, two, at_end=False) - heading(start, one, at_end=True)
    return (change + pi) % (2 * pi) - pi


def is_reversal(start: Point, one: Step, two: Step) -> bool:
    """Straight back, but for the little that no corner is made of."""
    return abs(corner(start, one, two)) > pi - 1.01 * TANGENT_RAD


def sweep_of(start: Point, step: Step) -> float:
    """Of an arc, rad, without further turns."""
    assert step.centre is not None
    span = _between(
        (start[0] - step.centre[0], start[1] - step.centre[1]),
        (step.to[0] - step.centre[0], step.to[1] - step.centre[1]),
        step.turn,
    )
    return span or 2 * pi


def _between(first: Point, second: Point, turn: int) -> float:
    return (turn * (atan2(second[1], second[0]) - atan2(first[1], first[0]))) % (2 * pi)


def walk(contour: Contour, move: Move, start: tuple[float, ...], steps: int = 24) -> list[Point]:
    """Points of a compensated move in the plane, its ends among them."""
    rows = ["XYZ".index(axis) for axis in contour.axes[:2]]
    here, end = (start[rows[0]], start[rows[1]]), (move.end[rows[0]], move.end[rows[1]])
    if move.centre is None:
        return [
            (here[0] + (end[0] - here[0]) * n / steps, here[1] + (end[1] - here[1]) * n / steps)
            for n in range(steps + 1)
        ]
    centre = (here[0] + move.centre[0], here[1] + move.centre[1])
    turn = -1 if move.kind == 2 else 1
    span = sweep_of(here, Step(end, centre=centre, turn=turn))
    ray = (here[0] - centre[0], here[1] - centre[1])
    angles = [turn * span * n / steps for n in range(steps + 1)]
    return [
        (centre[0] + ray[0] * cos(a) - ray[1] * sin(a), centre[1] + ray[0] * sin(a) + ray[1] * cos(a)) for a in angles
    ]
