"""What blocks make the mill do: positions, ways, modal state, the working field."""

import math

import pytest

from sim.elvinto.gcode import ERR_BAD_ARC, ERR_BAD_CYCLE, ERR_PARAMETER, BlockError
from sim.elvinto.mill import ALARM_END_BORDER, ALARM_START_BORDER, Mill, Plan
from sim.elvinto.settings import SimSettings
from sim.motion import Point


def do(mill: Mill, *blocks: str) -> Plan:
    """Executes blocks to their ends; the plan of the last one."""
    plan = Plan()
    for block in blocks:
        plan = mill.begin(block)
        mill.stop(plan, 0, None)
    return plan


def at(mill: Mill) -> tuple[float, float, float]:
    return mill.shown[0], mill.shown[1], mill.shown[2]


def ends(plan: Plan) -> list[tuple[float, float, float]]:
    return [(leg.end[0], leg.end[1], leg.end[2]) for leg in plan.legs]


@pytest.fixture
def mill() -> Mill:
    return Mill(SimSettings(safe_z=30.0))


def test_absolute_and_relative(mill: Mill) -> None:
    do(mill, "G0X10Y20", "G91", "X5Z-1", "G90", "Y0")
    assert at(mill) == (15.0, 0.0, -1.0)


def test_w70_w71_keep_the_kind_of_coordinates(mill: Mill) -> None:
    do(mill, "G91", "W70", "G90", "W71", "G0X5", "X5")
    assert at(mill) == (10.0, 0.0, 0.0)
    assert not mill.absolute


def test_a_block_without_a_code_goes_on_with_the_motion_before_it(mill: Mill) -> None:
    do(mill, "G1X10F600")
    leg = mill.begin("X20").legs[0]
    assert leg.speed_mm_s == 10.0
    assert mill.begin("G0X20").legs[0].speed_mm_s == 100.0


def test_feed_before_any_f(mill: Mill) -> None:
    assert mill.begin("G1X10").legs[0].speed_mm_s == pytest.approx(500 / 60)


def test_arcs_by_centre_and_by_radius_are_the_same(mill: Mill) -> None:
    by_centre = mill.begin("G2X10Y10I10J0").legs[0]
    by_radius = mill.begin("G2X10Y10R10").legs[0]
    assert by_centre.length_mm == pytest.approx(math.pi * 5)
    assert by_radius.length_mm == pytest.approx(by_centre.length_mm)
    assert by_radius.at(0.5) == pytest.approx(by_centre.at(0.5))


@pytest.mark.parametrize("block", ["G2X10Y10", "G2X10Y0R1", "G3X5I0J0"])
def test_arcs_that_do_not_exist(mill: Mill, block: str) -> None:
    with pytest.raises(BlockError) as caught:
        mill.begin(block)
    assert caught.value.num == ERR_BAD_ARC
    assert mill.motion == "G0"


def test_an_arc_code_alone_sets_the_mode(mill: Mill) -> None:
    assert do(mill, "G2").legs == []
    assert mill.motion == "G2"


def test_drilling(mill: Mill) -> None:
    do(mill, "G0Z10")
    plan = do(mill, "G81X5Y5Z-3R2F100")
    assert ends(plan) == [(5, 5, 10), (5, 5, 2), (5, 5, -3), (5, 5, 10)]
    assert [leg.speed_mm_s for leg in plan.legs] == pytest.approx([100, 100, 100 / 60, 100])
    assert ends(do(mill, "X8"))[-2:] == [(8, 5, -3), (8, 5, 10)]
    assert ends(do(mill, "G81.99X9"))[-1] == (9, 5, 2)
    do(mill, "G80", "X0")
    assert at(mill) == (0, 5, 2)


def test_peck_drilling_goes_down_in_steps(mill: Mill) -> None:
    do(mill, "G0Z5")
    plan = do(mill, "G83X0Y0Z-5R1Q2F100")
    bottoms = [leg.end[2] for leg in plan.legs if leg.speed_mm_s < 2]
    assert bottoms == [-1, -3, -5]
    assert at(mill) == (0, 0, 5)


@pytest.mark.parametrize("block", ["G81X1", "G83X1Z-1R1", "G83X1Z-900R1Q0.001"])
def test_cycles_that_cannot_be(mill: Mill, block: str) -> None:
    with pytest.raises(BlockError) as caught:
        mill.begin(block)
    assert caught.value.num == ERR_BAD_CYCLE


def test_g28_goes_to_the_switches_z_first_and_counts_from_them() -> None:
    mill = Mill(SimSettings(start_position=(120.0, 80.0, 10.0), safe_z=30.0))
    do(mill, "G0X5Y5", "G92X100")
    plan = do(mill, "G28")
    # Shown coordinates until the switches are found: 100, 5 is 125, 85 from them.
    assert ends(plan)[:3] == [(100, 5, 20), (100, -80, 20), (-25, -80, 20)]
    assert at(mill) == (0, 0, 30)
    assert mill.true[:3] == (0, 0, 30)
    assert mill.offset == (0, 0, 0, 0, 0, 0)
    assert mill.envelope


def test_g29_comes_back_and_knows_where_it_is() -> None:
    mill = Mill(SimSettings(start_position=(120.0, 80.0, 10.0), safe_z=30.0))
    plan = do(mill, "G29")
    assert ends(plan)[-2:] == [(120, 80, 30), (120, 80, 10)]
    assert at(mill) == (120, 80, 10)


def test_g27_homes_once_since_power_on(mill: Mill) -> None:
    assert do(mill, "G27").homes
    assert not do(mill, "G0X5", "G27").homes
    mill.forget()
    assert do(mill, "G27").homes


def test_w93_ignores_g28_until_w94(mill: Mill) -> None:
    do(mill, "G0X5", "W93", "G28", "G29", "G27")
    assert at(mill) == (5, 0, 0)
    assert not mill.envelope
    assert do(mill, "W94", "G28").homes


def test_setting_coordinates_moves_nothing(mill: Mill) -> None:
    do(mill, "G0X10Y20Z5", "G92X1Y2")
    assert at(mill) == (1, 2, 5)
    do(mill, "M210")
    assert at(mill) == (1, 2, 0)
    do(mill, "M200", "G0X1")
    assert at(mill) == (1, 0, 0)
    assert mill.true[:3] == (11, 20, 5)


def test_power_on_forgets_where_the_carriage_stands(mill: Mill) -> None:
    do(mill, "G0X10", "G91", "W90", "W72")
    mill.forget()
    assert at(mill) == (0, 0, 0)
    assert mill.absolute
    assert not mill.envelope
    assert not mill.reports_moves
    assert mill.true[0] == 10


@pytest.mark.parametrize(
    ("block", "alarm", "stop"),
    [
        ("G0X900Y300", (ALARM_END_BORDER, 1), (800, pytest.approx(300 * 8 / 9), 0)),
        ("G0X-1", (ALARM_START_BORDER, 1), (0, 0, 0)),
        ("G1Z-200F600", (ALARM_START_BORDER, 3), (0, 0, -150)),
        ("G0Y700", (ALARM_END_BORDER, 2), (0, 600, 0)),
    ],
)
def test_the_field_is_guarded_once_it_is_switched_on(
    mill: Mill, block: str, alarm: tuple[int, int], stop: Point
) -> None:
    assert do(mill, block).alarm is None, "off at power-on (standard §7)"
    mill.forget()
    fresh = Mill(SimSettings())
    plan = do(fresh, "W72", block)
    assert plan.alarm == alarm
    assert at(fresh) == stop
    assert do(fresh, "W73", block).alarm is None


def test_the_field_stays_with_the_switches_when_coordinates_are_set(mill: Mill) -> None:
    do(mill, "G28", "G0X100", "G92X0")
    assert do(mill, "G0X700").alarm is None
    plan = do(mill, "X701")
    assert plan.alarm == (ALARM_END_BORDER, 1)
    assert at(mill)[0] == 700


def test_modal_state_survives_m99_but_not_m30(mill: Mill) -> None:
    assert do(mill, "G91", "G1X1F100", "M3S1000", "M99").ends_program
    assert not mill.absolute
    assert mill.motion == "G1"
    assert do(mill, "M30").ends_program
    assert mill.absolute
    assert mill.motion == "G0"
    assert not mill.spindle_on


def test_tool_change_lifts_and_never_lowers(mill: Mill) -> None:
    plan = do(mill, "T2", "M6")
    assert plan.tool == 2
    assert at(mill)[2] == 30
    do(mill, "G0Z50")
    assert do(mill, "M06T4").tool == 4
    assert at(mill)[2] == 50


def test_milling_a_plane_ends_in_the_opposite_corner(mill: Mill) -> None:
    assert len(do(mill, "G100X40Y22F500").legs) == 9
    assert at(mill) == (40, 22, 0)
    do(mill, "G101X0Y0")
    assert at(mill) == (0, 0, 0)
    for block in ("G100X5", "G100X1Y999999"):
        with pytest.raises(BlockError) as caught:
            mill.begin(block)
        assert caught.value.num == ERR_PARAMETER


def test_plasma_and_the_turning_axis(mill: Mill) -> None:
    do(mill, "M7", "G76S100")
    assert (mill.plasma_on, mill.a_turning) == (True, 100.0)
    do(mill, "M8")
    assert not mill.plasma_on


def test_a_stop_in_the_middle_of_homing_keeps_the_old_coordinates() -> None:
    mill = Mill(SimSettings(start_position=(100.0, 0.0, 0.0), safe_z=30.0))
    plan = mill.begin("G28")
    mill.stop(plan, 0, plan.legs[0].seconds / 2)
    assert at(mill) == (0, 0, pytest.approx(15))
    assert mill.true[:3] == (100, 0, pytest.approx(15))
    assert not mill.envelope
