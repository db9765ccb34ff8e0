"""Programs by seed: a fine relief of many short moves, an ordinary part, long strokes.

Lines come one by one, however many. The one rule: the same arguments give the same program, and it runs on the virtual
machine as it is (800 x 600 mm).
"""

import math
from collections.abc import Callable, Iterator
from random import Random

STEP_MM = 0.4
RELIEF_DEPTH_MM = 6.0
RELIEF_HEAD = ("%", "(relief)", "G21 G90", "G0 Z5", "M3 S12000", "G0 X0 Y0")
RELIEF_TAIL = ("G0 Z5", "M5", "M30")


def relief(seed: int, lines: int, *, wordy: bool = True, feed_mm_min: int = 1800) -> Iterator[str]:
    """A surface cut row by row, `lines` lines long; `wordy` as most CAM writes it, every word in every line."""
    random = Random(seed)
    surface = _surface(random)
    points = lines - len(RELIEF_HEAD) - len(RELIEF_TAIL)
    row = max(20, math.isqrt(max(points, 0)))
    yield from RELIEF_HEAD
    for index in range(points):
        y, x = divmod(index, row)
        x_mm = STEP_MM * (row - 1 - x if y % 2 else x)
        y_mm = STEP_MM * y
        z_mm = surface(x_mm, y_mm)
        if wordy:
            yield f"N{index * 10 + 100} G1 X{x_mm:.3f} Y{y_mm:.3f} Z{z_mm:.3f} F{feed_mm_min}.0"
        elif x == 0:
            yield f"G1 Y{y_mm:.3f} Z{z_mm:.3f} F{feed_mm_min}"
        else:
            yield f"X{x_mm:.3f} Z{z_mm:.3f}"
    yield from RELIEF_TAIL


def strokes(seed: int, lines: int) -> Iterator[str]:
    """Long moves here and there: each takes seconds, so each travels in a batch of its own."""
    random = Random(seed)
    yield "G21 G90"
    yield "G1 F1200"
    x_mm = 20.0
    for _ in range(lines - 3):
        x_mm = 760.0 - x_mm + random.uniform(-15, 15)
        x_mm = min(max(x_mm, 5.0), 755.0)
        yield f"G1 X{x_mm:.3f} Y{random.uniform(20, 580):.3f}"
    yield "M30"


def _surface(random: Random) -> Callable[[float, float], float]:
    waves = [(random.uniform(0.02, 0.6), random.uniform(0.02, 0.6), random.uniform(0, math.tau)) for _ in range(4)]

    def height(x_mm: float, y_mm: float) -> float:
        total = sum(math.sin(x_mm * fx + y_mm * fy + phase) for fx, fy, phase in waves)
        return RELIEF_DEPTH_MM * (total / len(waves) - 1.0) / 2

    return height


def part(seed: int, features: int = 24) -> Iterator[str]:
    """Pockets with rounded corners, in several depths, and holes: moves of some millimetres to some centimetres."""
    random = Random(seed)
    yield from ("%", "O1001 (PART)", "N10 G21 G90 G17", "N20 G00 Z15.000", "N30 M03 S8000")
    number = 40
    for feature in range(features):
        x, y = random.uniform(40, 560), random.uniform(40, 360)
        blocks = _hole(x, y, random) if feature % 3 == 2 else _pocket(x, y, random)
        for block in blocks:
            yield f"N{number} {block}"
            number += 10
    yield from (f"N{number} G00 Z15.000", f"N{number + 10} M05", f"N{number + 20} M30", "%")


def _pocket(x: float, y: float, random: Random) -> Iterator[str]:
    width, height, radius = random.uniform(30, 120), random.uniform(30, 120), random.uniform(3, 10)
    yield f"(POCKET {width:.1f} X {height:.1f})"
    yield f"G00 X{x:.3f} Y{y:.3f}"
    for depth in range(1, random.randint(3, 6)):
        yield f"G01 Z{-1.5 * depth:.3f} F300.0"
        for ring in range(3):
            w, h = width - 8 * ring, height - 8 * ring
            yield f"G01 X{x + w:.3f} Y{y:.3f} F1200.0"
            yield f"G03 X{x + w + radius:.3f} Y{y + radius:.3f} I0.000 J{radius:.3f} F1200.0"
            yield f"G01 X{x + w + radius:.3f} Y{y + h:.3f} F1200.0"
            yield f"G01 X{x + w:.3f} Y{y + h:.3f} F1200.0"
            yield f"G01 X{x:.3f} Y{y + h:.3f} F1200.0"
            yield f"G01 X{x:.3f} Y{y:.3f} F1200.0"
    yield "G00 Z15.000"


def _hole(x: float, y: float, random: Random) -> Iterator[str]:
    yield f"G00 X{x:.3f} Y{y:.3f}"
    yield "G00 Z2.000"
    for peck in range(1, random.randint(3, 8)):
        yield f"G01 Z{-2.0 * peck:.3f} F150.0"
        yield "G00 Z2.000"


def as_bytes(lines: Iterator[str]) -> bytes:
    """The file."""
    return "".join(f"{line}\n" for line in lines).encode()


def arcs(seed: int, lines: int) -> Iterator[str]:
    """Rings of arcs with centres, as a pocket is cleared."""
    random = Random(seed)
    yield from ("G21 G90 G17", "M3 S12000", "G0 X300 Y300 Z5", "G1 Z-1 F300")
    radius_mm = 5.0
    for index in range(lines - 6):
        if index % 2 == 0:
            radius_mm = random.uniform(4.0, 60.0)
            yield f"G1 X{300 - radius_mm:.4f} Y300.0000 F1200"
        else:
            yield f"G2 X{300 + radius_mm:.4f} Y300.0000 I{radius_mm:.4f} J0.0000"
    yield from ("G0 Z5", "M30")


def four_axis(seed: int, lines: int) -> Iterator[str]:
    """A turned surface: the rotary axis goes round while X goes along."""
    random = Random(seed)
    yield from ("G21 G90", "M3 S12000", "G0 Z30", "G0 X0 Y0 A0", "G1 Z20 F600")
    for index in range(lines - 7):
        yield f"X{0.01 * (index % 30_000):.3f} Z{18 + random.uniform(-2, 2):.3f} A{3.0 * index:.3f} F{1200 + index % 5}"
    yield from ("G0 Z30", "M30")


def raster(seed: int, lines: int) -> Iterator[str]:
    """A picture by a laser: short moves in G91, the power in every line."""
    random = Random(seed)
    yield from ("G21 G91", "M4 S0", "G1 F6000")
    for index in range(lines - 5):
        forth = 0.1 if index // 4000 % 2 == 0 else -0.1
        yield "G1Y0.1S0" if index % 4000 == 3999 else f"X{forth}S{random.randrange(0, 1000)}"
    yield from ("M5", "M30")
