"""$H (grbl II.2, II.3, II.9, II.10)."""

import pytest

from tests.harness.grblconsole import Console

HOMING = {22: 1, 25: 3000, 24: 200}


def test_not_enabled_is_error_5() -> None:
    assert Console().tell("$H\n") == ["error:5"]


def test_ii_10_it_ends_off_the_switches_in_negative_space() -> None:
    console = Console(dollar=HOMING)
    assert console.tell("$H\n") == []
    began = console.now
    assert console.rest() == ["ok"]
    assert console.now - began > 3.0
    assert console.state() == "Idle"
    assert console.place() == (-1.0, -1.0, -1.0)
    assert console.machine.true_position == pytest.approx({"X": -1.0, "Y": -1.0, "Z": -1.0})


def test_the_direction_mask_homes_at_the_other_end() -> None:
    console = Console(dollar=HOMING | {23: 3, 27: 2})
    console.tell("$H\n")
    console.rest()
    assert console.place() == (-198.0, -198.0, -2.0)
    assert console.machine.true_position["X"] == pytest.approx(-198.0)


def test_z_goes_first() -> None:
    console = Console(dollar=HOMING, start_position=(-150.0, -150.0, -10.0))
    console.tell("$H\n")
    console.wait(0.3)
    assert console.machine.true_position["Z"] > -10
    assert console.machine.true_position["X"] == -150


def test_ii_2_a_question_is_answered_when_it_is_over_before_start_up_lines_and_ok() -> None:
    console = Console(dollar=HOMING)
    console.tell("$X\n$N0=G21G54\n")
    console.rest()
    console.tell("$H\n")
    assert console.tell("?") == []
    assert console.wait(0.5) == []
    said = console.rest()
    assert said[0].startswith("<Home|MPos:-1.000,-1.000,-1.000|")
    assert said[1:] == [">G21G54:ok", "ok"]


def test_alarm_6_by_a_reset() -> None:
    console = Console(dollar=HOMING)
    console.tell("$H\n")
    console.wait(0.5)
    assert console.tell(b"\x18") == ["ALARM:6"]
    assert console.rest() == ["ok", "", "Grbl 1.1h ['$' for help]", "[MSG:'$H'|'$X' to unlock]"]


def test_alarm_7_by_the_door() -> None:
    console = Console(dollar=HOMING)
    console.tell("$H\n")
    console.wait(0.5)
    assert console.tell(b"\x84") == ["ALARM:7"]
    console.rest()
    assert console.state() == "Alarm"


def test_alarm_8_when_the_switch_stays_closed() -> None:
    console = Console(dollar=HOMING)
    console.machine.press("Z", 0.0)
    console.tell("$H\n")
    assert console.rest()[0] == "ALARM:8"


def test_alarm_9_when_the_switch_is_out_of_reach() -> None:
    console = Console(
        dollar=HOMING | {130: 20, 131: 20},
        travel={"X": 300.0, "Y": 300.0, "Z": 100.0},
        start_position=(-299.0, -5.0, -5.0),
    )
    console.tell("$H\n")
    assert console.rest()[0] == "ALARM:9"
    assert console.state() == "Alarm"


def test_a_search_begins_at_zero_wherever_the_machine_was() -> None:
    console = Console(dollar=HOMING | {132: 20}, travel={"X": 9.0, "Y": 9.0, "Z": 300.0}, start_position=(-5, -5, -299))
    console.tell("$X\nG53G0X-4Z-290\n")
    console.rest()
    for _ in range(2):
        console.tell("$H\n")
        assert console.rest()[0] == "ALARM:9"
        assert console.place() == (-4.0, 0.0, 30.0)


def test_bytes_of_lines_wait_in_the_ring_meanwhile() -> None:
    console = Console(dollar=HOMING)
    console.tell("$H\nG21\nG90\n")
    assert console.machine.most_ring_bytes >= 8
    assert console.rest() == ["ok"] * 3


def test_single_axes_only_when_built_in() -> None:
    console = Console(dollar=HOMING)
    assert console.tell("$HX\n") == ["error:3"]
    console = Console(dollar=HOMING, single_axis_homing=True)
    console.tell("$HX\n")
    assert console.rest() == ["ok"]
    assert console.place() == (-1.0, 0.0, 0.0)
    assert console.tell("$HQ\n") == ["error:3"]


def test_afterwards_it_moves_as_it_should() -> None:
    console = Console(dollar=HOMING)
    console.tell("$H\n")
    console.rest()
    console.tell("G53G0X-100Y-20Z-5\n")
    console.rest()
    assert console.at(-100, -20, -5)
    assert console.machine.true_position["X"] == pytest.approx(-100)


def test_instant() -> None:
    console = Console(dollar=HOMING, instant=True)
    assert console.tell("$H\n") == ["ok"]
    assert console.place() == (-1.0, -1.0, -1.0)
