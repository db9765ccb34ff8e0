"""Rapids where material may be."""

import pytest

from tests.harness.checks import checked, found, level_of

HEAD = "G21 G90 G94|M3 S1000 F600|"


def lines(program: str, code: str, profile: str = "grbl-1.1") -> list[int]:
    report = checked(HEAD + program + "|M30", profile)
    assert level_of(report, code) in (None, "warning")
    return [finding.line for finding in found(report, code)]


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        ("G0 Z5|G0 X1 Y1|G0 Z-1", [5]),
        ("G0 Z5|G0 X1 Y1|G0 Z0|G1 Z-1", []),
        # What has been cut is air: back down to just above the bottom, as in a peck written out.
        ("G0 Z5|G0 X1|G1 Z-3|G0 Z5|G0 Z-2.9|G1 Z-6|G0 Z5|G0 Z-5.9", []),
        ("G0 Z5|G0 X1|G1 Z-3|G0 Z5|G0 Z-3.1", [7]),
        # Up is out, wherever it begins.
        ("G0 Z5|G0 X1|G1 Z-3|G0 Z-1|G0 Z5", []),
        ("G91|G0 Z5|G0 X1|G0 Z-6", []),
        ("G0 Z5|G0 X1|G91|G0 Z-6", [6]),
        # An offset moves Z0.
        ("G0 Z5|G92 Z0|G0 X1|G0 Z-1", [6]),
        ("G0 Z-5|G92 Z10|G0 X1|G0 Z5", [3]),
    ],
)
def test_rapids_into_the_material(program: str, expected: list[int]) -> None:
    assert lines(program, "rapid_into_material") == expected


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        ("G0 Z5|G0 X1|G1 Z-3|G0 X5", [6]),
        ("G0 Z5|G0 X1|G1 Z-3|G0 X5 Z5", [6]),
        ("G0 Z5|G0 X1|G1 Z-3|G0 Z5|G0 X5", []),
        ("G0 Z5|G0 X1|G1 Z-3|G1 X5|G0 Z0|Y7", []),
    ],
)
def test_rapids_across_below_the_surface(program: str, expected: list[int]) -> None:
    assert lines(program, "rapid_below_surface") == expected


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        ("G0 X5|G0 Z5|G0 X7", [3]),
        ("G0 Z5|G0 X5", []),
        ("G0 X5 Z5", []),
        ("G0 Z-2|G0 X5", [4]),
        # A laser has no Z.
        ("G0 X5|G1 X7", []),
    ],
)
def test_the_first_way_across(program: str, expected: list[int]) -> None:
    assert lines(program, "first_move_low") == expected


@pytest.mark.parametrize("code", ["G53 G0 Z-2", "G28 Z0", "G91 G28 Z0|G90", "G53 G0 X1 Z-2"])
def test_a_way_in_machine_coordinates_says_nothing_of_the_surface(code: str) -> None:
    program = f"G0 Z5|G0 X1|G1 Z-3|{code}|G0 X5|G0 Y5"
    assert lines(program, "rapid_into_material") == lines(program, "rapid_below_surface") == []
    # From the next Z on it is known again.
    assert lines(program + "|G0 Z-4", "rapid_into_material") == [9 + code.count("|")]


def test_depth_is_remembered_from_piece_to_piece() -> None:
    many = "|".join(["G1 X1", "G1 X2"] * 60_000)
    assert lines("G0 Z5|G0 X0|G1 Z-3|" + many + "|G0 Z5|G0 Z-2.9|G0 Z-3.1", "rapid_into_material") == [120_008]
    assert lines("G0 X0|" + many + "|G0 Z5", "first_move_low") == [3]


def test_a_lathe_has_its_own_z() -> None:
    report = checked("G21 G90|M3 S500 F100|G0 X50 Z5|G0 Z-10|G0 X60|M30", "ncframe-lathe")
    assert found(report, "rapid_into_material") == found(report, "rapid_below_surface") == []
