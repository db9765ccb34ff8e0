"""Generated programs: the same by seed, as long as asked for, and fit for the machine that they are for."""

from collections.abc import Callable, Iterator
from functools import partial

import pytest

from bench import programs
from gcode.check import check_program
from gcode.motion import Motion
from tests.harness.programs import elvinto

TRAVEL = {"x": (0.0, 800.0), "y": (0.0, 600.0), "z": (-150.0, 60.0)}
ALL: dict[str, Callable[[int], Iterator[str]]] = {
    "relief": partial(programs.relief, lines=3000),
    "relief, modal": partial(programs.relief, lines=3000, wordy=False),
    "part": partial(programs.part, features=12),
    "strokes": partial(programs.strokes, lines=500),
}


@pytest.mark.parametrize("name", ALL)
def test_the_seed_decides(name: str) -> None:
    assert list(ALL[name](1)) == list(ALL[name](1))
    assert list(ALL[name](1)) != list(ALL[name](2))


@pytest.mark.parametrize("name", ALL)
def test_they_run_on_the_machine_as_they_are(name: str) -> None:
    lines = [line.encode() for line in ALL[name](3)]
    report = check_program(lines, elvinto(), Motion(travel=TRAVEL)).to_json()
    assert report["errors"] == []
    assert [finding for finding in report["warnings"] if "travel" in finding["code"]] == []


def test_programs_are_as_long_as_asked_for() -> None:
    assert len(list(programs.relief(1, 1234))) == 1234
    assert len(list(programs.strokes(1, 77))) == 77


def test_both_writings_of_a_relief_are_the_same_motion() -> None:
    wordy, modal = (
        check_program([line.encode() for line in programs.relief(5, 900, wordy=wordy)], elvinto(), Motion()).to_json()
        for wordy in (True, False)
    )
    assert wordy["bounds"] == modal["bounds"]
    assert wordy["cut_mm"] == pytest.approx(modal["cut_mm"])
