"""What is known of each line: how far it takes a linear axis. Places and times are looked at in test_batch.py."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.motion import Motion
from gcode.profile import load_profile
from jobs.batch import BatchLimits, BatchPlanner
from jobs.journal import BODY_FIELDS
from tests.harness.programs import arc_blocks, elvinto, move_blocks, numbered

WIDE = BatchLimits(max_batch_seconds=1e9, max_batch_bytes=100_000, max_batch_blocks=10_000, position_tolerance_mm=None)
HERE = {"x": 0.0, "y": 0.0, "z": 5.0}


def planned(lines: str, *, here: dict[str, float] = HERE, compact: bool = True) -> list[tuple[str, float]]:
    """Every block with its reach in mm."""
    source = BatchPlanner(numbered(lines), load_profile("grbl-1.1"), Motion(), WIDE, compact=compact, position=here)
    found: list[tuple[str, float]] = []
    while batch := source.next():
        assert len(batch.reach_mm) == len(batch.blocks)
        found += zip(batch.blocks, batch.reach_mm, strict=True)
    return found


@pytest.mark.parametrize("compact", [True, False])
@pytest.mark.parametrize(
    ("program", "reaches_mm"),
    [
        ("G21 G90\nG0 X10\nG0 X10 Y2 Z4", [0.0, 10.0, 2.0]),
        ("G21 G91 G1 F100\nX1\nX1 Y-3", [0.0, 1.0, 3.0]),
        ("G20 G90\nG0 X1", [0.0, 25.4]),
        ("G90 G1 X10 F100\nG2 X10 I5\nG3 X12 I1", [10.0, 0.0, 2.0]),
        ("G90 G0 X1\nG4 P1\nM8\nS5\nX2", [1.0, 0.0, 0.0, 0.0, 1.0]),
        ("G90 G0 X1\nG92 X5\nG0 X6", [1.0, 0.0, 1.0]),
    ],
)
def test_how_far_each_block_goes(program: str, reaches_mm: list[float], compact: bool) -> None:
    assert [reach_mm for _, reach_mm in planned(program, compact=compact)] == pytest.approx(reaches_mm)


@pytest.mark.parametrize("way", ["G28", "G38.2 Z-9 F10", "G30 X1"])
def test_a_way_that_may_come_otherwise_reaches_nowhere(way: str) -> None:
    assert planned(f"G90 G0 X1\n{way}")[1][1] == 0.0


def test_from_an_unknown_place_nothing_is_known_of_the_first_way() -> None:
    assert [reach_mm for _, reach_mm in planned("G90\nG0 X1\nX2", here={})] == [0.0, 0.0, 1.0]


def test_a_batch_that_is_cut_takes_the_reach_of_its_blocks_along() -> None:
    source = BatchPlanner(numbered("G90\nG0 X1\nX3"), load_profile("grbl-1.1"), Motion(), WIDE, position=HERE)
    batch = source.next()
    assert batch is not None
    first, rest = batch.cut(2, {"x": 1.0})
    assert (first.reach_mm, rest.reach_mm) == ((0.0, 1.0), (2.0,))
    assert "reach_mm" not in BODY_FIELDS, "the journal has no use for it"


@given(st.lists(st.one_of(move_blocks, move_blocks, arc_blocks), max_size=12))
def test_as_far_as_the_ends_of_the_block_are_apart(lines: list[str]) -> None:
    """With one block a batch the places before and behind it are told."""
    single = BatchLimits(max_batch_seconds=1e9, max_batch_blocks=1, position_tolerance_mm=None)
    source = BatchPlanner(numbered("\n".join(lines)), elvinto(), Motion(), single, position=HERE)
    while batch := source.next():
        ways = [
            abs(end - batch.start[axis]) for axis, end in batch.end.items() if axis in "xyz" and axis in batch.start
        ]
        assert batch.reach_mm == pytest.approx([max(ways, default=0.0)])
