"""Bounds and travel: arcs by their true extremes, machine coordinates apart, sizes that cannot be meant."""

import pytest

from gcode.motion import Motion
from tests.harness.checks import checked, found, level_of

HEAD = "G21 G90 G94|M3 S1000|G0 Z5|G0 X0 Y0 F600|"
TRAVEL = Motion(travel={"x": (0.0, 100.0), "y": (-10.0, 100.0), "z": (-50.0, 50.0)})


def test_bounds_are_in_program_coordinates() -> None:
    report = checked(HEAD + "G1 X10 Y-5|G92 X0|G1 X7|M30")
    assert report.bounds == {"x": (0.0, 10.0), "y": (-5.0, 0.0), "z": (5.0, 5.0)}


def test_bounds_without_what_is_not_known() -> None:
    report = checked("G21 G91|M3 S1|G1 X1 F100|G90|G1 Y5|M30")
    assert report.bounds == {"y": (5.0, 5.0)}


@pytest.mark.parametrize(
    ("arc", "x", "y"),
    [
        ("G3 X10 Y0 I5 J0", (0, 10), (-5, 0)),
        ("G2 X10 Y0 I5 J0", (0, 10), (0, 5)),
        ("G2 X0 Y0 I5 J0", (0, 10), (-5, 5)),
        ("G2 X10 Y0 R5", (0, 10), (0, 5)),
        ("G2 X5 Y5 R5", (0, 5), (0, 5)),
        ("G2 X5 Y5 R-5", (-5, 5), (0, 10)),
    ],
)
def test_arcs_reach_as_far_as_they_bulge(arc: str, x: tuple[float, float], y: tuple[float, float]) -> None:
    bounds = checked(HEAD + arc + "|M30").bounds
    assert bounds["x"] == pytest.approx(x)
    assert bounds["y"] == pytest.approx(y)


def test_arcs_in_other_planes_bulge_there() -> None:
    bounds = checked(HEAD + "G18 G2 X10 Z5 I5|M30").bounds
    assert bounds["z"] == pytest.approx((0.0, 5.0)) or bounds["z"] == pytest.approx((5.0, 10.0))
    bounds = checked(HEAD + "G19 G3 Y0 Z5 J3 K4|M30").bounds
    assert bounds["y"] == pytest.approx((-2, 8))
    assert bounds["z"] == pytest.approx((4, 14))


def test_outside_the_travel_by_axis_with_the_first_line_and_the_worst_value() -> None:
    report = checked(HEAD + "X50|X120|X150 Y101|X130|M30", motion=TRAVEL, envelope=True)
    assert [(f.line, f.count, f.message[0]) for f in report.errors] == [(6, 3, "X"), (7, 2, "Y")]
    assert report.errors[0].message == "X leaves the travel of 0 to 100 mm, as far as 150.000"


def test_outside_is_a_warning_where_the_coordinates_may_be_others() -> None:
    program = HEAD + "X120|M30"
    assert level_of(checked(program, motion=TRAVEL), "outside_travel") == "warning"
    assert level_of(checked(program, motion=TRAVEL, envelope=True), "outside_travel") == "error"


def test_an_arc_leaves_the_travel_by_its_bulge() -> None:
    report = checked(HEAD + "G3 X20 Y0 I10 J0|M30", motion=TRAVEL)
    assert found(report, "outside_travel") == []
    report = checked(HEAD + "G3 X22 Y0 I11 J0|M30", motion=TRAVEL)
    assert found(report, "outside_travel")[0].message.endswith("as far as -11.000")


def test_machine_coordinates_are_told_apart() -> None:
    report = checked(HEAD + "G53 G0 X-5|G0 X-7|M30", motion=TRAVEL)
    assert [finding.line for finding in found(report, "outside_travel_machine")] == [5]
    assert [finding.line for finding in found(report, "outside_travel")] == [6]
    assert "in machine coordinates" in found(report, "outside_travel_machine")[0].message


def test_the_travel_is_that_of_the_machine_whatever_the_offsets() -> None:
    report = checked(HEAD + "X50|G92 X500|G0 X510|M30", motion=TRAVEL)
    assert found(report, "outside_travel") == []
    report = checked(HEAD + "X50|G92 X500|G0 X551|M30", motion=TRAVEL)
    assert found(report, "outside_travel")[0].message.endswith("as far as 101.000")


def test_rounding_leaves_no_travel() -> None:
    steps = "G91|" + "G0 X0.1|" * 1000
    assert found(checked(HEAD + steps + "M30", motion=TRAVEL), "outside_travel") == []


@pytest.mark.parametrize(
    ("cut", "expected"),
    [
        ("G1 X2540 Y10", True),
        ("G1 X190 Y10", False),
        ("G1 X0.3 Y0.3", True),
        ("G1 X0.3 Y5", False),
        ("G0 X2540", False),
        ("G1 Z-0.1", False),
    ],
)
def test_sizes_that_cannot_be_meant(cut: str, expected: bool) -> None:
    report = checked(HEAD + cut + "|M30", motion=TRAVEL)
    assert (level_of(report, "size_implausible") == "warning") is expected


def test_without_travel_a_part_of_metres_is_implausible() -> None:
    assert found(checked(HEAD + "G1 X2900|M30"), "size_implausible") == []
    assert found(checked(HEAD + "G1 X3100|M30"), "size_implausible") != []
