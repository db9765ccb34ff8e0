"""Soft and hard limits (grbl II.3, II.4, II.9)."""

import pytest

from tests.harness.grblconsole import Console

SOFT = {20: 1, 22: 1}
HARD = {21: 1}
BANNER = ["", "Grbl 1.1h ['$' for help]"]
LOCK = "[MSG:'$H'|'$X' to unlock]"


def soft() -> Console:
    return Console(dollar=SOFT, homing_lock=False)


def test_a_soft_limit_locks_everything_until_a_reset() -> None:
    console = soft()
    console.tell("G1X-50F6000\n")
    console.wait(0.3)
    assert console.tell("G1X5\n") == []
    said = console.timeline(5.0)
    assert [line for _, line in said] == ["ALARM:2", "[MSG:Reset to continue]"]
    assert said[1][0] - said[0][0] == pytest.approx(0.5)
    assert console.tell("?$X\n$G\n") == []
    assert console.tell(b"\x18") == ["ok"]
    assert console.rest() == [*BANNER, LOCK]
    assert -50 < console.place()[0] < -10, "a controlled stop, the position is good"
    assert console.tell("$X\n") == ["[MSG:Caution: Unlocked]", "ok"]


def test_a_soft_limit_from_rest() -> None:
    console = soft()
    assert console.tell("G0X1\n") == ["ALARM:2"]
    console.rest()
    assert console.tell(b"\x18") == ["ok"]
    assert console.rest() == [*BANNER, LOCK]


def test_a_reset_within_the_half_second_is_lost() -> None:
    console = soft()
    console.tell("G0X1\n")
    console.wait(0.2)
    console.tell(b"\x18")
    assert console.rest() == ["[MSG:Reset to continue]"]
    assert console.tell(b"\x18") == ["ok"]
    assert console.rest() == [*BANNER, LOCK]


def test_the_edge_itself_is_inside() -> None:
    console = soft()
    assert console.tell("G0X-200Y-200Z-200\nG0X0Y0Z0\n") == ["ok", "ok"]
    console.rest()
    assert console.state() == "Idle"


def test_soft_limits_work_in_check_mode_too() -> None:
    console = soft()
    console.tell("$C\n")
    assert console.tell("G0X1\n") == ["ALARM:2"]


def test_a_hard_limit_stops_dead() -> None:
    console = Console(dollar=HARD)
    console.tell("G1X100F6000\n")
    console.wait(0.5)
    console.machine.press("X", console.now)
    assert console.heard() == ["ALARM:1"]
    place = console.machine.position
    assert console.rest() == ["[MSG:Reset to continue]"]
    assert console.tell("?") == []
    console.tell(b"\x18")
    assert console.rest() == [*BANNER, "[MSG:Check Limits]", LOCK]
    assert console.machine.position == place
    assert console.field("Pn") == "X"


def test_check_limits_is_said_only_while_the_switch_is_closed() -> None:
    console = Console(dollar=HARD)
    console.machine.press("Y", 0.0)
    console.heard()
    console.rest()
    console.machine.release("Y", console.now)
    console.tell(b"\x18")
    assert console.rest() == [*BANNER, LOCK]


def test_the_tool_runs_into_a_switch() -> None:
    console = Console(dollar=HARD)
    console.tell("G1X100F6000\n")  # the switch is 50 mm away
    said = console.rest()
    assert said == ["ALARM:1", "[MSG:Reset to continue]"]
    assert console.machine.true_position["X"] == pytest.approx(0.0, abs=0.01)


def test_without_hard_limits_a_switch_only_shows() -> None:
    console = Console()
    console.tell("G1X10F600\n")
    console.machine.press("X", console.now)
    assert console.field("Pn") == "X"
    assert console.rest() == []
    assert console.at(10, 0, 0)


def test_a_blocked_line_gets_its_ok_after_the_reset() -> None:
    console = Console(dollar=HARD)
    for nth in range(17):
        console.tell(f"G1X{nth % 2 * 5}F600\n")
    console.machine.press("Z", console.now)
    assert console.heard() == ["ALARM:1"]
    console.rest()
    assert console.tell(b"\x18") == ["ok"]


def test_ii_4_after_alarm_1_and_2_the_ring_is_not_read_and_the_reset_flushes_it() -> None:
    console = Console(dollar=HARD)
    console.tell("G1X10F600\n")
    console.machine.press("X", console.now)
    console.machine.release("X", console.now)
    console.rest()
    assert console.tell("G21\n$X\nG1X5\n") == []
    console.tell(b"\x18")
    assert console.rest() == [*BANNER, LOCK]
    assert [line.text for line in console.machine.executed] == ["G1X10F600"]
