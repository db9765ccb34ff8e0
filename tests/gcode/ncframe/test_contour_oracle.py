"""Frames of compensated contours against LinuxCNC's interpreter: a machine that executes them is where that says.

Random contours in G18, cut from both sides. What the oracle refuses is refused, and its ends are passed in order.
"""

import shutil
from pathlib import Path
from random import Random

import pytest

from gcode.compensation import LEFT
from tests.gcode.test_compensation_oracle import Answer, ask, turns_back_between_arcs
from tests.harness.contours import Contour, compensated, random_contour
from tests.harness.frameprograms import Way, executed, translation

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(shutil.which("rs274") is None, reason="no rs274 here (Debian: linuxcnc-uspace)"),
]

CONTOURS = 60
LIMIT_COUNTS = 2.0
"""The oracle prints four decimals; each end is rounded to a count besides."""


def lathe_words(contour: Contour) -> str:
    """The same contour without the axis that a lathe has not, from its start."""
    side = "G41" if contour.side == LEFT else "G42"
    words = [" ".join(word for word in line.split() if not word.startswith(("Y", "D"))) for line in contour.words()]
    return "|".join([side if word in ("G41.1", "G42.1") else word for word in ["G21 G90 G94 F100", *words]])


def ends_of(answer: Answer) -> list[complex]:
    """Where each call of the oracle ends, in counts."""
    return [
        complex(numbers[0], numbers[1]) * 1000 if name == "ARC_FEED" else complex(numbers[2], numbers[0]) * 1000
        for name, numbers in answer.calls
    ]


def test_a_machine_passes_every_end_of_the_reference(tmp_path: Path) -> None:
    random = Random(20)
    made = [random_contour(random, random.randint(2, 6), plane=18) for _ in range(CONTOURS)]
    made = [contour for contour in made if not turns_back_between_arcs(contour)]
    refused = [contour for contour in made if compensated(contour)[1] is not None]
    for contour in refused:
        assert translation(lathe_words(contour), tool_radius_mm=contour.radius).errors, contour.words()
    contours = [contour for contour in made if contour not in refused]
    assert len(contours) > len(refused) > 0
    cut = 0
    for contour, answer in zip(contours, ask(contours, tmp_path), strict=True):
        found = translation(lathe_words(contour), tool_radius_mm=contour.radius)
        assert found.errors == [], contour.words()
        if answer.fault:
            continue  # Nearly tangent arcs, at which the reference is the stricter one (test_compensation_oracle.py).
        cut += 1
        here = complex(0, 0)
        ways = iter(executed(found).ways)
        for end in ends_of(answer):
            # Moves of Y alone are none on a lathe. An arc of the reference may be several frames.
            while abs(here - end) > LIMIT_COUNTS:
                here = next(ways, Way(here, complex("nan"), 0)).end
                assert here == here, (end, contour.words())
    assert cut >= len(contours) - 2
