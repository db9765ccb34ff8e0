"""G38 (grbl II.3, II.9)."""

import pytest

from tests.harness.grblconsole import Console

# The tool stands at machine Z -50 and calls it 0: a plate at -60 is found at Z -10.


def test_a_hit_is_told_in_machine_coordinates_before_the_ok() -> None:
    console = Console(probe_z=-60.0)
    console.tell("G92Z7\n")
    assert console.tell("G38.2Z-20F600\n") == []
    assert console.rest() == ["[PRB:0.000,0.000,-10.000:1]", "ok"]
    assert console.place()[2] == pytest.approx(-10.5, abs=0.01), "it brakes after the contact: 10²/(2·100) mm"
    assert console.tell("$#\n")[-2] == "[PRB:0.000,0.000,-10.000:1]"


def test_it_goes_on_from_where_it_stands() -> None:
    console = Console(probe_z=-60.0)
    console.tell("G38.2Z-20F600\nG91G0X5Z1\n")
    console.rest()
    assert console.place()[0] == 5.0
    assert console.place()[2] == pytest.approx(-9.5, abs=0.01)


def test_a_miss_is_alarm_5_and_half_a_second_later_prb_0_and_ok() -> None:
    console = Console()
    console.tell("G38.2Z-5F600\n")
    said = console.timeline(5.0)
    assert [line for _, line in said] == ["ALARM:5", "[PRB:0.000,0.000,0.000:0]", "ok"]
    assert said[1][0] - said[0][0] == pytest.approx(0.5)
    assert console.state() == "Alarm"
    assert console.tell("G0X1\n") == ["error:9"]
    assert console.tell("$X\n")[-1] == "ok"


def test_a_miss_of_g38_3_is_none() -> None:
    console = Console()
    console.tell("G38.3Z-5F600\n")
    assert console.rest() == ["[PRB:0.000,0.000,-5.000:0]", "ok"]
    assert console.state() == "Idle"


@pytest.mark.parametrize("code", ["G38.2", "G38.3"])
def test_alarm_4_when_it_is_closed_at_the_start(code: str) -> None:
    console = Console()
    console.machine.press("P", 0.0)
    assert console.tell(f"{code}Z-5F600\n") == ["ALARM:4"]
    assert console.rest() == ["ok"]
    assert console.at(0, 0, 0)


def test_away_from_contact() -> None:
    console = Console(probe_z=-50.0)
    console.tell("G38.4Z5F600\n")
    assert console.rest() == ["[PRB:0.000,0.000,0.000:1]", "ok"]
    console = Console()
    assert console.tell("G38.5Z5F600\n") == ["ALARM:4"]


def test_a_probe_pressed_by_hand() -> None:
    console = Console()
    console.tell("G38.2X50F600\n")
    console.wait(2.0)
    console.machine.press("P", console.now)
    said = console.rest()
    assert said[0].startswith("[PRB:19.")
    assert said[-1] == "ok"
    assert 19 < console.place()[0] < 21


def test_probing_waits_for_what_was_planned() -> None:
    console = Console(probe_z=-60.0)
    console.tell("G1X10F600\n")
    assert console.tell("G38.2Z-20F600\n") == []
    assert console.rest()[0] == "[PRB:10.000,0.000,-10.000:1]"


def test_a_reset_in_it_is_an_alarm_with_a_late_ok() -> None:
    console = Console()
    console.tell("G38.2Z-50F600\n")
    console.wait(1.0)
    assert console.tell(b"\x18") == ["ALARM:3"]
    assert console.rest()[0] == "ok"


def test_errors() -> None:
    console = Console()
    assert console.tell("G38.2F100\nG38.2Z0F100\nG38.2Z-1F0\nG38.1Z-1\n") == [
        "error:26",
        "error:33",
        "error:22",
        "error:20",
    ]


def test_instant() -> None:
    console = Console(probe_z=-60.0, instant=True)
    assert console.tell("G38.2Z-20F600\n") == ["[PRB:0.000,0.000,-10.000:1]", "ok"]
    assert console.place()[2] == pytest.approx(-10.0, abs=0.001)


def test_check_mode_does_not_probe() -> None:
    console = Console(probe_z=-60.0)
    console.tell("$C\n")
    assert console.tell("G38.2Z-20F600\n") == ["ok"]
