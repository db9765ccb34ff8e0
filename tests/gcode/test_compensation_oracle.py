"""Cutter radius compensation against LinuxCNC's interpreter: every end, centre and direction, and what is refused.

`rs274` comes with Debian's linuxcnc-uspace. It prints four decimals, and does not go on after a fault.
"""

import os
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, copysign, hypot, pi
from pathlib import Path
from random import Random

import pytest

from gcode.compensated import refusal
from gcode.compensation import LEFT, RIGHT, Move
from gcode.executor import Note
from gcode.interpreter import Interpreter
from gcode.offsetpath import TANGENT_RAD
from gcode.profile import load_profile
from gcode.segments import CCW, CW, PLANE_AXES, RAPID
from gcode.words import code_name, parse_block
from tests.harness.contours import (
    Contour,
    Step,
    arc_step,
    compensated,
    corner,
    is_reversal,
    polygon,
    random_contour,
    sweep_of,
    with_starts,
)

RS274 = shutil.which("rs274")
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(RS274 is None, reason="no rs274 here: apt-get install linuxcnc-uspace brings the reference"),
]

PRINTED_MM = 1.1e-4
"""Four decimals, and the last digit of what was written in six."""

REFUSALS = 10

_CALL = re.compile(r"(STRAIGHT_TRAVERSE|STRAIGHT_FEED|ARC_FEED|COMMENT)\((.*)\)")


@dataclass(frozen=True)
class Answer:
    """What the reference makes of a contour: canonical calls from G41 on, and its complaint."""

    calls: list[tuple[str, list[float]]]
    fault: str


def ask(contours: Sequence[Contour], folder: Path) -> list[Answer]:
    """One process for all of them; after a fault another one for the rest."""
    answers: list[Answer] = []
    while len(answers) < len(contours):
        answers += _ask_until_fault(contours[len(answers) :], folder)
    return answers


def reference(lines: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """One program through rs274. It maps its tool table from a file in HOME, and dies if another one writes there."""
    program = folder / "program.ngc"
    program.write_text("\n".join([*lines, "M2", ""]))
    command = [str(RS274), "-g", "-v", str(folder / "rs274.var"), str(program)]
    home = {**os.environ, "HOME": str(folder)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, cwd=folder, env=home)
    assert done.returncode >= 0, done.returncode
    return done


def _ask_until_fault(contours: Sequence[Contour], folder: Path) -> list[Answer]:
    lines = ["G21 G90 G94 F100"]
    for contour in contours:
        lines += ["(CASE)", *contour.words(), "(DONE)", "G0 X0"]
    done = reference(lines, folder)
    answers, calls, inside = [], [], False
    for name, words in _CALL.findall(done.stdout):
        if name != "COMMENT":
            calls.append((name, [float(word) for word in words.split(",")]))
        elif '"CASE"' in words:
            calls, inside = [], True
        elif '"DONE"' in words:
            answers.append(Answer(calls[1:], ""))
            inside = False
    if inside:
        complaint = done.stderr.replace("executing", "").strip().splitlines()
        answers.append(Answer(calls[1:], complaint[0] if complaint else "nothing said"))
    assert answers, done.stderr
    return answers


def as_call(contour: Contour, move: Move, start: tuple[float, ...]) -> tuple[str, list[float]]:
    """A move as the reference prints it."""
    if move.centre is None:
        return ("STRAIGHT_TRAVERSE" if move.kind == RAPID else "STRAIGHT_FEED"), [*move.end, 0.0, 0.0, 0.0]
    first, second, normal = ("XYZ".index(axis) for axis in contour.axes)
    centre = [start[first] + move.centre[0], start[second] + move.centre[1]]
    turns = (1 if move.kind == CCW else -1) * move.turns
    return "ARC_FEED", [move.end[first], move.end[second], *centre, turns, move.end[normal], 0.0, 0.0, 0.0]


def as_calls(contour: Contour, moves: Sequence[Move]) -> list[tuple[str, list[float]]]:
    here = contour.position(contour.start, 0.0)
    calls = []
    for move in moves:
        calls.append(as_call(contour, move, here))
        here = move.end
    return calls


def assert_same(contour: Contour, moves: Sequence[Move], answer: Answer) -> None:
    ours = as_calls(contour, moves)
    assert [name for name, _ in ours] == [name for name, _ in answer.calls], contour.words()
    for (_, mine), (_, theirs) in zip(ours, answer.calls, strict=True):
        assert mine == pytest.approx(theirs, abs=PRINTED_MM), contour.words()


def runs_back(contour: Contour, answer: Answer) -> bool:
    """Whether the reference moves against the program, having cut more off a move than it is long.

    It looks for that only before some corners, and not at all at the way in.
    """
    ways = _ways(contour)
    here = list(contour.start)
    first, second, _ = ("XYZ".index(axis) for axis in contour.axes)
    for number, (name, numbers) in enumerate(answer.calls[:-1]):
        end = numbers[:2] if name == "ARC_FEED" else [numbers[first], numbers[second]]
        if name == "ARC_FEED" and _sweeps_too_far(contour, here, numbers, way_in=number == 0):
            return True
        if number and name != "ARC_FEED" and hypot(end[0] - here[0], end[1] - here[1]) > 2 * PRINTED_MM:
            way = complex(end[0] - here[0], end[1] - here[1])
            along = [(way * step.conjugate()).real for step in ways if _parallel(way, step)]
            if along and max(along) < 0:
                return True
        here = end
    return False


def _ways(contour: Contour) -> list[complex]:
    ways = [complex(*step.to) - complex(*start) for start, step in with_starts(contour) if step.centre is None]
    return [way for way in ways if abs(way) > PRINTED_MM]


def _parallel(one: complex, two: complex) -> bool:
    return abs((one * two.conjugate()).imag) <= 2 * PRINTED_MM * abs(two)


def _sweeps_too_far(contour: Contour, here: list[float], numbers: list[float], *, way_in: bool) -> bool:
    """An arc of the contour that became longer by over half a turn; only that of the way in has another centre."""
    end, centre, turn = numbers[:2], complex(*numbers[2:4]), 1 if numbers[4] > 0 else -1
    theirs = sweep_of((here[0], here[1]), Step((end[0], end[1]), centre=(centre.real, centre.imag), turn=turn))
    meant = [
        sweep_of(start, step)
        for start, step in with_starts(contour)[: 1 if way_in else None]
        if step.centre is not None
        and step.turn == turn
        and (way_in or abs(complex(*step.centre) - centre) < PRINTED_MM)
    ]
    return bool(meant) and theirs > min(meant) + pi


def fixed_contours(plane: int) -> list[tuple[str, Contour]]:
    """Shapes that a workshop cuts, from both sides."""
    square = [(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0)]
    star = [(0.0, 0.0), (30.0, 8.0), (60.0, 0.0), (50.0, 25.0), (62.0, 50.0), (30.0, 40.0), (-5.0, 52.0), (9.0, 25.0)]
    found: list[tuple[str, Contour]] = []
    for side in (LEFT, RIGHT):
        for radius in (0.0, 0.5, 3.0, 4.9, -2.0):
            found += [
                ("square", polygon(side, radius, square, start=(-20.0, -7.0), plane=plane)),
                ("square, other way round", polygon(side, radius, square[::-1], start=(-20.0, 9.0), plane=plane)),
                ("star", polygon(side, radius, star, start=(-15.0, -15.0), plane=plane)),
                ("star, other way round", polygon(side, radius, star[::-1], start=(25.0, 20.0), plane=plane)),
                ("rounded, counter-clockwise", rounded(side, radius, 1, plane)),
                ("rounded, clockwise", rounded(side, radius, -1, plane)),
                ("circle", circle(side, radius, 1, plane)),
                ("circle, clockwise", circle(side, radius, -1, plane)),
                ("three turns", circle(side, radius, 1, plane, turns=3)),
                ("way in along an arc", arc_entry(side, radius, 1, plane)),
                ("way in along an arc, clockwise", arc_entry(side, radius, -1, plane)),
                ("slot", polygon(side, radius, [(20, 0), (20, 30), (26, 30), (26, 0)], start=(-9, -9), plane=plane)),
                ("back and forth", polygon(side, radius, [(20, 0), (40, 0), (10, 0)], start=(0, 0), plane=plane)),
                ("rapids and heights", hops(side, radius, plane)),
            ]
    return found


def rounded(side: int, radius: float, turn: int, plane: int) -> Contour:
    """A rectangle with corners of radius 5, tangent."""
    flip = 1 if turn > 0 else -1
    points = [
        Step((30.0, 0.0)),
        Step((50.0, 0.0)),
        Step((55.0, 5.0 * flip), centre=(50.0, 5.0 * flip), turn=turn),
        Step((55.0, 25.0 * flip), -1.0),
        Step((50.0, 30.0 * flip), centre=(50.0, 25.0 * flip), turn=turn),
        Step((10.0, 30.0 * flip)),
        Step((5.0, 25.0 * flip), centre=(10.0, 25.0 * flip), turn=turn),
        Step((5.0, 5.0 * flip)),
        Step((10.0, 0.0), -2.0, centre=(10.0, 5.0 * flip), turn=turn),
        Step((30.0, 0.0), -2.0),
    ]
    return Contour(side, radius, (22.0, 12.0 * side * flip), tuple(points), plane, (22.0, 12.0))


def circle(side: int, radius: float, turn: int, plane: int, turns: int = 1) -> Contour:
    """A whole circle of radius 12 between a way in and a way out, both at right angles to it."""
    whole = Step((12.0, 0.0), -3.0, centre=(0.0, 0.0), turn=turn, turns=turns)
    start = (0.0, 0.0) if side == turn else (30.0, 0.0)
    return Contour(side, radius, start, (Step((12.0, 0.0)), whole), plane, (20.0, 3.0))


def arc_entry(side: int, radius: float, turn: int, plane: int) -> Contour:
    """A quarter turn onto a straight that it is tangent to."""
    way_in = arc_step((0.0, 0.0), (12.0, 0.0), turn * pi / 2)
    straight_on = Step((way_in.to[0] + 20.0, way_in.to[1]))
    return Contour(side, radius, (0.0, 0.0), (way_in, straight_on), plane, (50.0, 0.0))


def hops(side: int, radius: float, plane: int) -> Contour:
    """Out of the cut and in again, on a straight, in an inside and an outside corner."""
    steps = [Step((20.0, 0.0)), Step((20.0, 0.0), 5.0, rapid=True), Step((20.0, 25.0), 5.0, rapid=True)]
    steps += [Step((20.0, 25.0), -1.0), Step((20.0, 25.0), -2.0), Step((45.0, 25.0), -2.0), Step((45.0, 25.0), 5.0)]
    steps += [Step((45.0, 0.0), 5.0, rapid=True), Step((70.0, 0.0), 5.0, rapid=True), Step((70.0, 40.0), -1.0)]
    return Contour(side, radius, (0.0, 0.0), tuple(steps), plane, (0.0, 0.0))


@pytest.mark.parametrize("plane", [17, 18])
def test_fixed_contours(plane: int, tmp_path: Path) -> None:
    contours = fixed_contours(plane)
    answers = ask([contour for _, contour in contours], tmp_path)
    refused = Counter()
    for (name, contour), answer in zip(contours, answers, strict=True):
        moves, fault = compensated(contour)
        assert bool(fault) == bool(answer.fault), (name, contour, fault, answer.fault)
        if fault is None:
            assert_same(contour, moves, answer)
        refused[name] += fault is not None
    assert 0 < sum(refused.values()) < len(contours) / 3
    assert refused["square, other way round"] == refused["three turns"] == 0


@pytest.mark.parametrize(("seed", "plane"), [(1, 17), (2, 17), (3, 18), (4, 18)])
def test_random_contours(seed: int, plane: int, tmp_path: Path) -> None:
    random = Random(seed)
    made = [random_contour(random, random.randint(2, 7), plane=plane) for _ in range(300)]
    made = [contour for contour in made if not turns_back_between_arcs(contour)]
    passed = [contour for contour in made if compensated(contour)[1] is None]
    # Every fault costs a process: what we refuse is only sampled.
    contours = passed + [contour for contour in made if contour not in passed][:REFUSALS]
    agreed: Counter[str] = Counter()
    for contour, answer in zip(contours, ask(contours, tmp_path), strict=True):
        agreed[judge(contour, answer)] += 1
    assert agreed["same"] + agreed["too strict"] == len(passed) > 0.6 * len(made), agreed
    assert agreed["too strict"] <= 2, agreed
    assert agreed["both refuse"] > 0.6 * REFUSALS, agreed


def judge(contour: Contour, answer: Answer) -> str:
    """Equal, or why not; where only we refuse, the reference is shown to be wrong."""
    moves, fault = compensated(contour)
    if fault is None and answer.fault:
        assert answer.fault.startswith("Arc move in concave corner")
        assert nearly_tangent_to_an_arc(contour), contour.words()
        return "too strict"
    if fault is None:
        assert_same(contour, moves, answer)
        return "same"
    if answer.fault:
        return "both refuse"
    if fault.code == "compensation_entry" and contour.steps[0].centre is not None:
        assert swings_wrong(contour, answer), contour.words()
        return "it swings the wrong way"
    assert fault.code == "compensation_corner", (contour.words(), fault)
    assert runs_back(contour, answer), contour.words()
    return "it runs back"


def nearly_tangent_to_an_arc(contour: Contour) -> bool:
    """Whether an arc begins at a corner that is taken as none.

    The tool then starts a little before the arc's own start, and the reference may take the arc for stretched.
    """
    steps = with_starts(contour)
    return any(
        two.centre is not None and 1e-4 < abs(corner(start, one, two)) < TANGENT_RAD
        for (start, one), (_, two) in pairwise(steps)
    )


def swings_wrong(contour: Contour, answer: Answer) -> bool:
    """Whether the way in along an arc ends against the direction of the programmed one."""
    numbers = answer.calls[0][1]
    step = contour.steps[0]
    assert step.centre is not None
    theirs = complex(numbers[0] - numbers[2], numbers[1] - numbers[3])
    programmed = complex(step.to[0] - step.centre[0], step.to[1] - step.centre[1])
    return (theirs * programmed.conjugate()).real < 0


def turns_back_between_arcs(contour: Contour) -> bool:
    """Whether one arc turns straight back into another: the reference then looks at the bend of one of them alone."""
    steps = [(start, step) for start, step in with_starts(contour) if step.to != start or step.centre is not None]
    return any(
        one.centre is not None and two.centre is not None and is_reversal(start, one, two)
        for (start, one), (_, two) in pairwise(steps)
    )


def through_the_interpreter(contour: Contour) -> tuple[list[tuple[str, list[float]]], list[Note]]:
    """The same contour as a program, in the language of the reference: its segments as the reference prints them."""
    interpreter = Interpreter(load_profile("rs274ngc"))
    for line, text in enumerate(["G21 G90 G94 F100", *contour.words()], 1):
        interpreter.step(line, parse_block(text))
    interpreter.finish()
    found = interpreter.take()
    calls = []
    for row in range(1, len(found)):  # the first is the rapid to the start
        end = [float(value) for value in found.end[:3, row]]
        if found.kind[row] in (CW, CCW):
            first, second, normal = ("XYZ".index(axis) for axis in PLANE_AXES[int(found.plane[row])])
            centre = [float(found.start[axis, row] + found.centre[n, row]) for n, axis in enumerate((first, second))]
            turns = copysign(ceil(abs(found.sweep[row]) / (2 * pi) - 1e-6), found.sweep[row])
            calls.append(("ARC_FEED", [end[first], end[second], *centre, turns, end[normal], 0.0, 0.0, 0.0]))
        else:
            name = "STRAIGHT_TRAVERSE" if found.kind[row] == RAPID else "STRAIGHT_FEED"
            calls.append((name, [*end, 0.0, 0.0, 0.0]))
    assert all((found.end[:3, :-1] == found.start[:3, 1:]).all(axis=0))
    return calls, interpreter.notes


def test_programs_through_the_interpreter(tmp_path: Path) -> None:
    """G41.1 D, the moves and G40 as words: what the machine would do is what the reference does."""
    random = Random(6)
    made = [random_contour(random, random.randint(2, 7), plane=random.choice((17, 18))) for _ in range(120)]
    made += [contour for _, contour in fixed_contours(17)]
    contours = [contour for contour in made if not turns_back_between_arcs(contour) and not compensated(contour)[1]]
    assert len(contours) > 150
    for contour, answer in zip(contours, ask(contours, tmp_path), strict=True):
        calls, notes = through_the_interpreter(contour)
        assert not notes
        assert [name for name, _ in calls] == [name for name, _ in answer.calls], contour.words()
        for (_, mine), (_, theirs) in zip(calls, answer.calls, strict=True):
            assert mine == pytest.approx(theirs, abs=PRINTED_MM), contour.words()


@pytest.mark.parametrize("text", ["G1 X1", "G3 X20 Y2 J1"])
def test_a_fault_is_a_note_with_its_line(text: str, tmp_path: Path) -> None:
    """In the interpreter and in the reference alike; behind it the program is followed as it stands."""
    lines = ["G21 G17 G90 G94 F100", "G0 X0 Y0 Z0", "G41.1 D6", *(["G1 X20"] if "G3" in text else []), text, "G40"]
    done = reference(lines, tmp_path)
    assert done.stderr.strip().endswith(text)
    interpreter = Interpreter(load_profile("rs274ngc"))
    for line, block in enumerate([*lines, "G0 X50 Y50"], 1):
        interpreter.step(line, parse_block(block))
    interpreter.finish()
    (note,) = interpreter.notes
    assert (note.line, note.level) == (lines.index(text) + 1, "error")
    assert note.code in ("compensation_entry", "compensation_radius")
    assert [float(value) for value in interpreter.take().end[:2, -1]] == [50.0, 50.0]


BETWEEN = (
    "G18",
    "G17",
    "G55",
    "G54",
    "G92 X0",
    "G52 X1",
    "G92.1",
    "G43.1 Z1",
    "G49",
    "T1 M6",
    "G28",
    "G30",
    "G28.1",
    "G53 G0 X1",
    "G38.2 X40",
    "G81 X30 Z-1 R1",
    "G73 X30 Z-1 R1 Q1",
    "G33 Z1 K1",
    "G41.1 D6",
    "G42.1 D6",
    "G64",
    "G61",
    "G20",
    "G21",
    "G91",
    "G90.1",
    "G93",
    "G94",
    "M3 S100",
    "M8",
    "M5",
    "G4 P0.1",
    "M61 Q1",
)


@pytest.mark.parametrize("text", BETWEEN)
def test_what_may_stand_between_g41_and_g40(text: str, tmp_path: Path) -> None:
    done = reference(["G21 G17 G90 G94 F100", "G0 X0 Y0 Z5", "G41.1 D6", "G1 X20", text], tmp_path)
    known = load_profile("rs274ngc").codes
    codes = [known[code_name(word.letter, word.text)] for word in parse_block(text).words if word.letter in "GM"]
    assert any(refusal(code, 17) for code in codes) == done.stderr.strip().endswith(text)
