"""Whether the link keeps up: told where the queue would run dry, and nowhere else."""

import pytest

from gcode.motion import Motion
from tests.harness.checks import checked, found

FAST = Motion(max_rate={"x": 20000.0, "y": 20000.0}, acceleration={"x": 20000.0, "y": 20000.0})
HEAD = "G21 G90 G94|M3 S1000 F12000|G0 X0 Y0|"


def short_lines(count: int, step_mm: float = 0.1, begin_mm: float = 0.0) -> str:
    return "|".join(f"G1 X{begin_mm + step_mm * number:.3f} Y0.000" for number in range(1, count + 1))


@pytest.mark.parametrize(("baud", "starves"), [(9600, True), (115200, True), (1_000_000, False), (None, False)])
def test_fine_segments_starve_on_a_slow_link(baud: int | None, starves: bool) -> None:
    # 0.1 mm at 200 mm/s are 0.5 ms a line of 16 bytes: 32,000 bytes/s.
    report = checked(HEAD + short_lines(400) + "|M30", motion=FAST, baud=baud)
    assert bool(found(report, "link_too_slow")) is starves
    assert (report.link_seconds is None) is (baud is None)


def test_one_place_is_one_finding_and_names_both_its_ends() -> None:
    slow = short_lines(300) + "|G1 X1000|" + "|".join(f"G1 X{1000 + 50 * number}" for number in range(1, 60))
    program = HEAD + slow + "|" + short_lines(300, begin_mm=5000) + "|M30"
    report = checked(program, motion=FAST, baud=115200)
    first, second = found(report, "link_too_slow")
    assert first.line < 30
    assert 290 < int(first.message.split("line ")[1].split(":")[0]) < 330
    assert 340 < second.line < 400
    assert "the link carries 11520" in first.message


def test_a_few_short_lines_are_what_the_queue_is_for() -> None:
    long = "|".join(f"G1 X{50 * number}" for number in range(1, 40))
    few = "|".join(f"G1 X{2000 + number / 10:.1f}" for number in range(1, 6))
    program = HEAD + long + "|" + few + "|" + "|".join(f"G1 X{2000 + 50 * n}" for n in range(1, 40)) + "|M30"
    assert found(checked(program, motion=FAST, baud=19200), "link_too_slow") == []


def test_pieces_do_not_matter() -> None:
    whole = checked(HEAD + short_lines(70_000, 0.01) + "|M30", motion=FAST, baud=115200)
    assert len(found(whole, "link_too_slow")) == 1


def test_bytes_without_motion_wait_for_the_next_segment() -> None:
    codes = "|".join(["G90 G21 G94 G17"] * 3000)
    report = checked(HEAD + "G1 X1|" + codes + "|" + short_lines(20, 1.0, 1.0) + "|M30", motion=FAST, baud=9600)
    (finding,) = found(report, "link_too_slow")
    assert finding.message.startswith("the machine will starve up to line ")
    assert report.link_seconds == pytest.approx(report.wire_bytes * 10 / 9600)
