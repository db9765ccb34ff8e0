"""Feeds and arcs: missing, too high, not closed, impossible, in a plane that is not there."""

import pytest

from gcode.motion import Motion
from tests.harness.checks import checked, every, found, level_of

HEAD = "G21 G90 G94|M3 S1000|G0 Z5|G0 X0 Y0|"
RATES = Motion(max_rate={"x": 3000.0, "y": 3000.0, "z": 500.0})


def codes(block: str, profile: str = "grbl-1.1", motion: Motion | None = None) -> list[tuple[int, int, str]]:
    report = checked(HEAD + block + "|M30", profile, motion)
    return [(finding.line, finding.column, finding.code) for finding in every(report)]


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("G1 X1", (5, 1, "feed_missing")),
        ("G1 X1 F0", (5, 7, "feed_missing")),
        ("G2 X2 I1", (5, 1, "feed_missing")),
        ("F100 G2 X10 I4", (5, 13, "arc_not_closed")),
        ("F100 G2 X2 Y0 R0.9", (5, 1, "arc_impossible")),
        ("F100 G2 X2 Y0 I0 J0", (5, 1, "arc_impossible")),
        ("F100 G2 X0 Y0 R5", (5, 1, "arc_impossible")),
    ],
)
def test_errors(block: str, expected: tuple[int, int, str]) -> None:
    assert expected in codes(block)
    assert level_of(checked(HEAD + block + "|M30"), expected[2]) == "error"


def test_a_feed_is_missing_once_for_each_block() -> None:
    report = checked(HEAD + "G1 X1|X2|F100 X3|M30")
    assert [(finding.line, finding.count) for finding in found(report, "feed_missing")] == [(5, 1), (6, 1)]


def test_a_feed_that_came_before_counts() -> None:
    assert codes("F100|G0 X1|G1 X2|G2 X4 I1") == []


@pytest.mark.parametrize(
    ("gap_mm", "radius_mm", "closed"),
    # Grbl's limits (rs274 §4): 0.005 mm, or 0.1 % of the radius, but never 0.5 mm.
    [
        (0.004, 1.0, True),
        (0.006, 1.0, False),
        (0.006, 10.0, True),
        (0.09, 100.0, True),
        (0.11, 100.0, False),
        (0.49, 1000.0, True),
        (0.51, 1000.0, False),
    ],
)
def test_radii_may_differ_a_little(gap_mm: float, radius_mm: float, closed: bool) -> None:
    block = f"F100 G2 X{2 * radius_mm + gap_mm:.3f} I{radius_mm:.3f}"
    found_here = [code for _, _, code in codes(block)]
    assert ("arc_not_closed" in found_here) is not closed


def test_both_radii_are_shown() -> None:
    (finding,) = found(checked(HEAD + "F100 G2 X10 I4|M30"), "arc_not_closed")
    assert "radius 4.0000 mm at its start, 6.0000 mm at its end" in finding.message


def test_an_impossible_arc_says_why() -> None:
    reasons = [
        found(checked(HEAD + f"F100 G2 {words}|M30"), "arc_impossible")[0].message
        for words in ("X2 Y0 R0.9", "X2 Y0 I0", "X0 Y0 R5")
    ]
    assert "2.0000 mm apart" in reasons[0]
    assert "is its start" in reasons[1]
    assert "cannot end where it begins" in reasons[2]


def test_nothing_is_said_of_an_arc_whose_start_nobody_knows() -> None:
    report = checked("G21 G90|M3 S1|F100 G2 X5 Y5 I2|M30")
    assert found(report, "arc_impossible") == found(report, "arc_not_closed") == []


def test_planes_that_the_controller_lacks() -> None:
    program = HEAD + "G18|F100 G2 X2 Z5 I1|G17|G2 X4 I1|G19 G3 Y2 Z5 J1|G0 X0|M30"
    report = checked(program, "elvinto")
    assert [finding.line for finding in found(report, "arc_plane")] == [6, 9]
    assert found(checked(program), "arc_plane") == []


def test_the_plane_is_remembered_from_piece_to_piece() -> None:
    lines = "|".join(["G0 X1", "G0 X2"] * 60_000)
    report = checked(HEAD + "G18|" + lines + "|F100 G2 X2 Z5 I1|M30", "elvinto")
    assert [finding.line for finding in found(report, "arc_plane")] == [120_006]


# --- rates ----------------------------------------------------------------------------------------------------


def rates(block: str) -> list[tuple[str, str]]:
    report = checked(HEAD + block + "|M30", motion=RATES)
    return [(finding.code, finding.message) for finding in every(report)]


def test_a_feed_over_what_an_axis_can() -> None:
    assert rates("G1 X10 F3000") == []
    ((code, message),) = rates("G1 X10 F3600")
    assert code == "feed_over_rate"
    assert message.startswith("X is to move at 3600 mm/min and can do 3000")
    # Half of the way is in X, and the other half in Y: each has 0.7 of the feed.
    assert rates("G1 X10 Y10 F4000") == []
    ((_, message),) = rates("G1 X10 Z0 F1500")
    assert message.startswith("Z is to move at 671 mm/min")


def test_a_rapid_has_no_feed() -> None:
    assert rates("F9000|G0 X10") == []


def test_an_arc_has_the_feed_in_every_direction() -> None:
    assert [code for code, _ in rates("G2 X10 I5 F3600")] == ["feed_over_rate", "feed_over_rate"]
    assert rates("G3 X1 Y0.1 R5 F2900") == []


def test_ten_times_over_is_a_slip() -> None:
    assert "feed_implausible" in [code for code, _ in rates("G1 X10 F30001")]
    assert "feed_implausible" not in [code for code, _ in rates("G1 X10 F30000")]
