"""A whole program on the virtual lathe: it ends where the program does, and takes as long as it was planned.

From the lines of a program to bytes with a check byte, and from these to the carriage, which shares no line with us.
"""

from random import Random

import pytest

from gcode.motion import Motion
from gcode.ncframe.reader import FrameReader
from gcode.ncframe.rules import FrameRules
from protocol.ncframe.codec import Frame
from sim.ncframe.carriage import Carriage
from sim.ncframe.codec import decode, remainder
from sim.ncframe.settings import SimSettings
from tests.harness.frameprograms import LATHE, ORIGIN

FAST = Motion(max_rate={"x": 3000.0, "z": 3000.0}, acceleration={"x": 1e6, "z": 1e6})


def shaft(seed: int) -> list[str]:
    """Grooves, cones and fillets along a shaft, absolute and in steps, in mm and inches, with dwells and stops."""
    random = Random(seed)
    lines = ["G21,G90,G18,T1,M3,S9", "G0 X40 Z5;G1 X30 Z1 F120"]
    z = 1.0
    for _ in range(120):
        z -= random.uniform(0.5, 3.0)
        x = random.uniform(10, 30)
        kinds = (
            f"G1 X{x:.4f} Z{z:.4f}",
            f"G91 G1 X{random.uniform(-0.01, 0.01):.5f} Z-0.00037",
            "G1 U0.33333 W-0.33333",
            f"G{random.choice((2, 3))} X{x:.4f} Z{z:.4f} R{random.uniform(150, 200):.3f}",
            f"G3 U0 W0 K{random.uniform(-4, 4):.4f} I{random.uniform(1, 4):.4f}",
            "G4 P0.25",
            f"G20 G1 X{x / 25.4:.5f} F{random.uniform(3, 9):.2f}",
            f"G50 X{random.uniform(0, 9):.3f}",
            "M0",
        )
        lines += [random.choice(kinds), "G90 G21"]
    return [*lines, "G0 X50 Z50", "M30"]


@pytest.mark.parametrize("seed", range(6))
def test_the_carriage_ends_where_the_program_does(seed: int) -> None:
    settings = SimSettings(auxiliary_s=0.0)
    carriage = Carriage(settings)
    program = enumerate((line.encode() for line in shaft(seed)), 1)
    reader = FrameReader(program, LATHE, FAST, FrameRules(), ORIGIN)
    planned = 0.0
    taken = 0.0
    while not reader.ended:
        for block in reader.more(50)[0]:
            data = Frame.from_text(block.text).sendable.to_bytes()
            heard = decode(data + bytes([remainder(data, "crc8")]), "crc8")
            carriage.x, carriage.z, seconds = carriage.take(heard)
            planned += block.seconds
            taken += seconds
            assert (carriage.x * 0.001, carriage.z * 0.001) == pytest.approx(block.end, abs=1e-9)
    assert (carriage.x * 0.001, carriage.z * 0.001) == pytest.approx(reader.place, abs=1e-9)
    assert planned == pytest.approx(taken, rel=0.1)
