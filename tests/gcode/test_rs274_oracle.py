"""Against LinuxCNC: the same programs through its interpreter and through ours give the same motion.

Fixed programs for what is rare, seeded random ones for what is common. Compared is every end point, arc centre and
turn, feed and dwell, as far as the oracle prints digits. Units stand in a line of their own: LinuxCNC takes an F on
the line of a G20 in the units before it, Grbl in those behind it, as we do (rs274 §3).
"""

from collections.abc import Callable
from math import cos, pi, sin
from pathlib import Path
from random import Random

import pytest

from gcode.interpreter import Interpreter, power_on
from gcode.profile import load_profile
from gcode.words import parse_block
from tests.harness.canon import Event, events_of, run_rs274

PLACE_MM = 2e-4
"""Four digits are printed of a coordinate and of each offset; in a program in inches they are 25.4 times as coarse."""


def ours(program: str) -> list[Event]:
    profile = load_profile("rs274ngc")
    state = power_on(profile)
    zeros = [0.0] * len(state.axes)
    state.position = list(zeros)
    state.systems = {number: list(zeros) for number in range(1, 10)}
    state.homes = {28: list(zeros), 30: list(zeros)}
    interpreter = Interpreter(profile, state)
    for number, line in enumerate(program.splitlines(), 1):
        interpreter.step(number, parse_block(line))
    assert not interpreter.notes, (interpreter.notes, program)
    return events_of(interpreter.take())


def compare(program: str, folder: Path, *, feeds: bool = True) -> None:
    theirs, mine = run_rs274(program, folder), ours(program)
    scale = 25.4 if "G20" in program else 1.0
    for place, (one, other) in enumerate(zip(theirs, mine, strict=False)):
        where = f"event {place}: LinuxCNC {one}, ours {other}\n{program}"
        assert one.kind == other.kind, where
        assert other.end == pytest.approx(one.end, abs=PLACE_MM * scale), where
        assert other.centre == pytest.approx(one.centre, abs=PLACE_MM * scale), where
        assert (other.rotation, other.dwell_s) == (one.rotation, pytest.approx(one.dwell_s, abs=1e-4)), where
        if feeds:
            assert other.feed == pytest.approx(one.feed, rel=1e-4, abs=2e-3 * scale), where
    assert len(theirs) == len(mine), f"LinuxCNC {theirs[len(mine) :]}, ours {mine[len(theirs) :]}\n{program}"
    assert len(theirs) > 2, program


FIXED = {
    "offsets": """G21 G17 G90 F100
        G0 X1 Y2 Z3
        G92 X0
        G0 X1
        G10 L2 P2 X5 Y6
        G55 G0 X0
        G53 G0 X1
        G10 L20 P2 X3 Z7
        G1 X1 Y1 Z1
        G92 Y9 Z8
        G1 X2 Y2 Z2
        G92.2
        G1 X1 Y1 Z1
        G92.3
        G1 X2 Y2 Z2
        G54
        G1 X1 Y1 Z1
        G92.1
        G1 X2 Y2 Z2
        G59.3 G10 L2 P9 X100
        G1 X1 Y1 Z1
        G52 X4 Y4
        G1 X2 Y2 Z2
        G10 L2 P0 Y7
        G1 X3 Y3
        M2
        """,
    "homes": """G21 G90 F100
        G0 X3 Y4 Z5
        G28.1
        G0 X9 Y9 Z9
        G30.1
        G92 X1 Y1
        G28
        G0 X7 Y8 Z9
        G28 X2
        G30 X3 Z2
        G91 G28 Z1
        G30
        G90 G1 X1 Y1 Z1
        M2
        """,
    "tool length": """G21 G90 F100
        G0 X1 Y1 Z9
        G43.1 Z2
        G1 Z5
        G92 Z0
        G1 Z5
        G43.1 X1 Z3
        G1 X5 Y5 Z5
        G10 L1 P3 Z1.5 X.5
        G43 H3
        G1 X1 Y1 Z1
        G43.2 H3
        G1 X2 Y2 Z2
        G49
        G1 X3 Y3 Z3
        M2
        """,
    "feed modes": """G21 G90 F100 S500
        M3
        G1 X10
        G93 G1 X20 F2
        Y20 Z5 F.5
        G2 X30 I5 F4
        G94 F250
        G1 X0
        G95 F.2
        G1 X5
        Y5 F.4
        G94 F80
        X9
        M2
        """,
    "units": """G20
        G90 F10
        G0 X1 Y2 Z.5
        G1 X2
        G2 X3 I.5
        G92 X0 Y0
        G1 X1 Y1
        G21
        G1 X30 Y30 F200
        G20
        F9
        G91 X1 Y1 F20
        G90 G3 X1 Y1 R2
        G10 L2 P2 X1 Y1
        G55
        G1 X0 Y0
        G81 X1 Y1 Z-.5 R.1
        G83 X2 Z-1 R.1 Q.3
        M2
        """,
    "arcs": """G21 G90 G17 F100
        G0 X10 Y0
        G2 X10 Y0 I5
        G3 I5
        G3 I5 P3 Z4
        G2 X20 Y0 R5 P2
        G3 X10 Y10 R-20
        G90.1 G2 X20 Y10 I15 J10
        G91.1 G91 G3 X5 Y5 I0 J5
        G91 G2 I3 J4 Z1
        G18 G90 G0 X0 Y0 Z0
        G2 X10 Z10 I10 K0
        G3 X0 Z0 R20 Y3
        G19 G2 Y13 Z0 J5 K0
        G3 Y3 Z0 J-5 K0 X4
        G90.1 G2 Y13 Z0 J8 K0
        M2
        """,
    "cycles XY": """G21 G17 G90 F100
        G0 X1 Y2 Z9
        G99 G81 X1 Y1 Z-1 R2 L2
        G98 X5
        G99 X6
        X7 R5
        G98 G83 X3 Y3 Z-5 R1 Q2
        G99 X4 Z-3 Q.7
        G0 Z20
        G98 G81 X9 Z-3 R2
        G0 Z1
        G81 X10 Z-3 R2
        X11 Z-4
        G91 X1 Y1 L3
        X1 R-1 Z-2
        G90 G80
        G0 Z9
        M3 S10
        G82 X1 Y1 Z0 R5 P.5
        X2
        X3 P1
        G85 X1 Y1 Z0 R5
        G86 X1 Z0 R2 P.5
        G87 X1 Y1 Z0 R5 I1 J1 K2
        X5
        G89 X1 Y1 Z0 R5 P1
        G73 X1 Z-3 R5 Q3
        G84 X2 Z-3 R5 P1
        G80
        G0 Z12
        G88 X1 Y1 Z0 R5 P1
        G80 G0 X1 Z3
        M2
        """,
    "cycles ZX, YZ": """G21 G18 G90 F100
        M3 S10
        G0 X0 Y20 Z0
        G82 X1 Z2 Y-3 R5 P1
        G98 G83 X2 Z3 Y-3 R5 Q3
        G80
        G91 G81 X1 Z1 Y-3 R-1 L3
        G80 G90
        G87 X1 Z0 Y0 R5 I1 J2 K1
        G80
        G19 G0 X30 Y1 Z1
        G91 G83 Y1 Z2 X-7 R-5 Q3 L2
        G99 G73 Y1 X-4 R-1 Q1.5
        G90 G85 Y1 Z1 X3 R10
        G80
        M2
        """,
    "order and modes": """G21 G90 F100
        G0 X1
        X5 G91
        G1 X5 Y5 F50
        G90
        G92 X7
        G1 X0
        G4 P.25
        G1 X9 G4 P1.5
        G7 X20 Y5
        G8 X20
        G80
        G0 A90 B10 C-20
        G1 A45 F300
        X1 A40
        M70
        G91 G1 X1 F77
        M72
        X1 Y1
        M2
        """,
}


@pytest.mark.parametrize("name", FIXED)
def test_fixed_programs(name: str, tmp_path: Path) -> None:
    program = FIXED[name].replace("        ", "")
    compare(program, tmp_path)


def number(random: Random, low: float = -50, high: float = 50) -> str:
    return f"{random.uniform(low, high):.3f}"


def some_axes(random: Random, letters: str = "XYZ") -> str:
    chosen = [letter for letter in letters if random.random() < 0.6] or [letters[0]]
    return " ".join(letter + number(random) for letter in chosen)


def straights(random: Random) -> list[str]:
    return [
        f"{random.choice(('G0', 'G1', ''))} {random.choice(('', '', 'G90', 'G91'))} {some_axes(random, 'XYZA')} "
        f"{random.choice(('', 'F200', 'F' + number(random, 1, 900)))}"
        for _ in range(12)
    ]


PLANES = {"G17": ("X", "Y", "Z", "I", "J"), "G18": ("Z", "X", "Y", "K", "I"), "G19": ("Y", "Z", "X", "J", "K")}


def arcs(random: Random) -> list[str]:
    lines = []
    for _ in range(10):
        plane = random.choice(tuple(PLANES))
        first, second, third, along, across = PLANES[plane]
        radius, begin, turn = random.uniform(1, 20), random.uniform(0, 2 * pi), random.uniform(0.2, 6)
        start = (round(random.uniform(-9, 9), 4), round(random.uniform(-9, 9), 4))
        centre = (round(start[0] - radius * cos(begin), 6), round(start[1] - radius * sin(begin), 6))
        end = (centre[0] + radius * cos(begin + turn), centre[1] + radius * sin(begin + turn))
        lines.append(f"G90 G0 {plane} {first}{start[0]:.4f} {second}{start[1]:.4f}")
        helix = f" {third}{number(random)}" if random.random() < 0.4 else ""
        code = random.choice(("G2", "G3"))
        place = f"{first}{end[0]:.6f} {second}{end[1]:.6f}{helix}"
        middle = f"{along}{centre[0] - start[0]:.6f} {across}{centre[1] - start[1]:.6f}"
        match random.randrange(5):
            case 0:
                lines.append(f"{code} {place} R{random.choice((1, -1)) * radius * random.uniform(1, 1.5):.5f}")
            case 1:
                lines.append(f"{code} {helix} {middle}")
            case 2:
                lines += ["G90.1", f"{code} {place} {along}{centre[0]:.6f} {across}{centre[1]:.6f}", "G91.1"]
            case 3:
                way = f"{first}{end[0] - start[0]:.6f} {second}{end[1] - start[1]:.6f}{helix}"
                lines.append(f"G91 {code} {way} {middle} P{random.randint(1, 4)}")
            case _:
                lines.append(f"{code} {place} {middle}")
    return lines


CYCLE_WORDS = {
    "G73": "Q2.5",
    "G81": "",
    "G82": "P.5",
    "G83": "Q3.1",
    "G85": "",
    "G86": "P.2",
    "G89": "P.3",
    "G84": "P.1",
}


def cycles(random: Random) -> list[str]:
    plane = random.choice(tuple(PLANES))
    first, second, third, _, _ = PLANES[plane]
    lines = [plane, f"G0 {third}{random.uniform(0, 30):.3f}", "M3 S100"]
    for _ in range(4):
        # This version of LinuxCNC mixes the axes up when it taps in another plane than XY.
        code = random.choice([code for code in CYCLE_WORDS if code != "G84" or plane == "G17"])
        distance = random.choice(("G90", "G91"))
        bottom = number(random, -20, -1) if distance == "G90" else number(random, -9, -1)
        top = number(random, 0, 20) if distance == "G90" else number(random, -5, 5)
        lines.append(
            f"{distance} {random.choice(('G98', 'G99'))} {code} {first}{number(random)} {second}{number(random)} "
            f"{third}{bottom} R{top} {CYCLE_WORDS[code]} L{random.randint(1, 3)}"
        )
        lines += [
            f"{random.choice(('', '', 'G98', 'G99'))} {some_axes(random, first + second)}"
            for _ in range(random.randint(0, 3))
        ]
        if random.random() < 0.4:
            lines.append(f"G80 G90 G0 {third}{number(random, 0, 30)}")
    return [*lines, "G80 G90"]


def shifted(random: Random) -> list[str]:
    lines = []
    for _ in range(12):
        match random.randrange(9):
            case 0:
                lines.append(f"G92 {some_axes(random)}")
            case 1:
                lines.append(f"G10 L2 P{random.randint(0, 9)} {some_axes(random)}")
            case 2:
                lines.append(f"G10 L20 P{random.randint(0, 9)} {some_axes(random)}")
            case 3:
                lines.append(random.choice(("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")))
            case 4:
                lines.append(f"G43.1 {some_axes(random)}")
            case 5:
                lines.append(random.choice(("G49", "G92.1", "G92.2", "G92.3", "G28.1", "G30.1")))
            case 6:
                lines.append(f"G90 G53 G0 {some_axes(random)}")
            case 7:
                lines.append(f"{random.choice(('G28', 'G30'))} {some_axes(random)}")
            case _:
                lines.append(f"G52 {some_axes(random)}")
        lines.append(f"{random.choice(('G90', 'G91'))} G1 {some_axes(random)}")
    return lines


def inverse(random: Random) -> list[str]:
    lines = ["G93"]
    for _ in range(8):
        lines.append(f"{random.choice(('G90', 'G91'))} G1 {some_axes(random)} F{number(random, 0.5, 9)}")
        lines.append(f"G91 G3 X5 Y5 I5 F{number(random, 0.5, 9)}")
    return [*lines, "G94"]


MAKERS: dict[str, Callable[[Random], list[str]]] = {
    "straights": straights,
    "arcs": arcs,
    "cycles": cycles,
    "shifted": shifted,
    "inverse": inverse,
}


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("name", MAKERS)
def test_random_programs(name: str, seed: int, tmp_path: Path) -> None:
    random = Random(f"{name} {seed}")
    lines = MAKERS[name](random)
    unit = random.choice(("G20", "G21"))
    program = "\n".join([unit, "G90 G17 G94 F120", "G0 X1 Y1 Z1", *lines, "G1 X3 Y4 Z5 F100", "X1", "M2", ""])
    compare(program, tmp_path)
