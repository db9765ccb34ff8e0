"""Holds, doors, sleep, resumes (grbl II.2, II.3, II.4, II.5)."""

import pytest

from tests.harness.grblconsole import Console


def moving(**settings: object) -> Console:
    console = Console(**settings)  # type: ignore[arg-type]
    console.tell("M3S500\nG1X100F6000\n")
    console.wait(0.4)
    assert console.state() == "Run"
    return console


def test_ii_5_feed_hold_brakes_then_stands() -> None:
    console = moving()
    before = console.place()[0]
    console.tell("!")
    assert console.state() == "Hold:1"
    console.wait(0.2)
    assert console.state() == "Hold:1"
    console.wait(0.4)
    assert console.state() == "Hold:0"
    after = console.place()[0]
    speed = 80.0  # mm/s after 0.4 s at 200 mm/s²
    assert after - before == pytest.approx(speed**2 / 400, abs=0.05)
    assert console.field("FS") == "0,500", "a hold leaves the spindle on"


def test_ii_4_while_braking_lines_are_still_taken_and_in_hold_0_none() -> None:
    console = moving()
    console.tell("!")
    assert console.tell("G1X120\n") == ["ok"]
    console.wait(1.0)
    assert console.state() == "Hold:0"
    assert console.tell("G1X130\n$G\n") == []
    assert console.wait(10.0) == []
    assert console.tell("~") != [], "all answers come after the resume"
    console.rest()
    assert console.at(130, 0, 0)


def test_ii_4_in_hold_0_the_ring_keeps_filling() -> None:
    console = moving(dollar={10: 3})
    console.tell("!")
    console.wait(1.0)
    console.tell("G21\n" * 4)
    assert console.field("Bf") == "14,112"


def test_ii_2_trap_hold_in_idle_needs_a_resume() -> None:
    console = Console()
    console.tell("!")
    assert console.state() == "Hold:0"
    assert console.tell("G21\n") == []
    assert console.tell("~") == ["ok"]
    assert console.state() == "Idle"


def test_a_hold_is_resumed_where_it_was() -> None:
    console = moving()
    console.tell("!")
    console.wait(1.0)
    place = console.place()
    console.wait(5.0)
    assert console.place() == place
    console.tell("~")
    assert console.state() == "Run"
    console.rest()
    assert console.at(100, 0, 0)
    assert console.machine.executed[-1].finished


def test_a_resume_while_still_braking_does_nothing() -> None:
    console = moving()
    console.tell("!")
    console.tell("~")
    console.wait(1.0)
    assert console.state() == "Hold:0"


def test_a_hold_over_short_blocks_goes_on_through_them() -> None:
    console = Console()
    console.tell("".join(f"G1X{n}F6000\n" for n in range(1, 15)))
    console.wait(0.25)
    before = console.place()[0]
    console.tell("!")
    console.wait(1.0)
    after = console.place()[0]
    assert after - before > 1.0, "more than one block of 1 mm"
    console.tell("~")
    console.rest()
    assert console.at(14, 0, 0)


def test_ii_2_hold_is_ignored_in_alarm_check_and_sleep() -> None:
    console = Console(dollar={22: 1})
    console.tell("!")
    assert console.state() == "Alarm"
    console.tell("$X\n$C\n!")
    assert console.state() == "Check"
    console.tell("$C\n")
    console.rest()
    console.tell("$SLP\n!")
    assert console.state() == "Sleep"


def test_ii_3_m0_waits_for_motion_then_holds_until_resumed() -> None:
    console = Console()
    console.tell("G1X10F600\n")
    assert console.tell("M0\nG21\n") == []
    assert console.rest() == []
    assert console.state() == "Hold:0"
    assert console.at(10, 0, 0)
    assert console.tell("~") == ["ok", "ok"]
    assert console.state() == "Idle"


# The door.


def test_ii_2_the_door_byte_works_without_a_door() -> None:
    console = moving()
    assert console.tell(b"\x84") == ["[MSG:Check Door]"]
    assert console.state() == "Door:2"
    console.wait(1.0)
    assert console.state() == "Door:0"
    assert console.field("FS") == "0,0", "the spindle is off"
    console.tell("~")
    assert console.state() == "Door:3"
    assert console.field("FS") == "0,500"
    console.wait(3.9)
    assert console.state() == "Door:3"
    console.wait(0.2)
    assert console.state() == "Run"
    console.rest()
    assert console.at(100, 0, 0)


def test_ii_5_with_a_door_it_cannot_be_resumed_before_it_is_closed() -> None:
    console = moving(door_pin=True)
    console.machine.press("D", console.now)
    assert console.heard() == ["[MSG:Check Door]"]
    console.wait(1.0)
    assert console.state() == "Door:1"
    assert console.field("Pn") == "D"
    console.tell("~")
    console.wait(10.0)
    assert console.state() == "Door:1"
    console.machine.release("D", console.now)
    assert console.state() == "Door:0"
    console.tell("~")
    console.wait(2.0)
    assert console.state() == "Door:3"
    console.machine.press("D", console.now)
    console.wait(0.1)
    assert console.state() == "Door:1"


def test_ii_5_reset_in_door_2_and_3_is_an_alarm_and_in_door_0_none() -> None:
    console = moving()
    console.tell(b"\x84")
    assert console.tell(b"\x18")[0] == "ALARM:3"
    console = moving()
    console.tell(b"\x84")
    console.wait(1.0)
    assert console.state() == "Door:0"
    console.tell("~")
    assert console.state() == "Door:3"
    assert console.tell(b"\x18")[0] == "ALARM:3"
    console = moving()
    console.tell(b"\x84")
    console.wait(1.0)
    assert not console.tell(b"\x18")
    assert "ALARM:3" not in console.rest()


def test_the_door_in_hold_and_in_idle() -> None:
    console = Console()
    assert console.tell(b"\x84") == ["[MSG:Check Door]"]
    assert console.state() == "Door:0"
    console.tell("~")
    assert console.state() == "Idle"
    console = moving()
    console.tell("!")
    console.wait(1.0)
    console.tell(b"\x84")
    assert console.state() == "Door:0"


def test_the_door_brings_coolant_back_too() -> None:
    console = Console()
    console.tell("M8\nG1X100F6000\n")
    console.wait(0.3)
    console.tell(b"\x84")
    console.wait(1.0)
    console.tell("~")
    console.wait(0.9)
    assert console.state() == "Door:3"
    console.wait(0.2)
    assert console.state() == "Run"


def test_the_door_in_a_jog_ends_the_jog_first() -> None:
    console = Console()
    console.tell("$J=G91X100F6000\n")
    console.wait(0.3)
    console.tell(b"\x84")
    assert console.state() == "Jog"
    console.wait(1.0)
    assert console.state() == "Door:0"
    console.tell("~")
    assert console.rest() == []
    assert console.state() == "Idle"


def test_error_13_with_the_door_open() -> None:
    console = Console(door_pin=True, dollar={22: 1})
    console.machine.press("D", 0.0)
    assert console.tell("$X\n$H\n") == ["error:13", "error:13"]
    console = Console(door_pin=True)
    console.machine.press("D", 0.0)
    console.tell(b"\x18")
    assert console.rest()[-1] == "[MSG:Check Door]"
    assert console.state() == "Door:1"


# Sleep.


def test_ii_3_sleep_is_left_by_a_reset_into_alarm() -> None:
    console = Console()
    assert console.tell("$SLP\n") == ["ok", "[MSG:Sleeping]"]
    assert console.state() == "Sleep"
    assert console.tell("G21\n~") == []
    console.tell(b"\x18")
    assert console.rest() == ["", "Grbl 1.1h ['$' for help]", "[MSG:'$H'|'$X' to unlock]"]
    assert console.state() == "Alarm"
    assert console.tell("$SLP\n") == ["ok", "[MSG:Sleeping]"]


# Buttons.


def test_the_buttons_on_the_machine_are_the_same_as_the_bytes() -> None:
    console = moving()
    console.machine.press("H", console.now)
    console.wait(1.0)
    assert console.state() == "Hold:0"
    assert console.field("Pn") == "H"
    console.machine.release("H", console.now)
    console.machine.press("S", console.now)
    assert console.state() == "Run"
    console.machine.press("R", console.now)
    assert console.heard() == ["ALARM:3"]


def test_ii_2_spindle_stop_only_while_held_and_at_once_back_at_the_resume() -> None:
    console = moving()
    console.tell(b"\x9e")
    assert console.field("FS") == "4800,500"
    console.tell("!")
    console.wait(1.0)
    console.tell(b"\x9e")
    assert console.field("FS") == "0,0"
    console.tell(b"\x9e")
    assert console.field("FS") == "0,500"
    console.tell(b"\x9e")
    assert console.tell("~") == ["[MSG:Restoring spindle]"]
    console.wait(0.1)
    assert console.state() == "Run"
    idle = Console()
    idle.tell(b"!\x9e")
    assert idle.tell("~") == []
    assert idle.state() == "Idle"


def test_a_grblhal_waits_for_its_spindle_after_a_spindle_stop() -> None:
    console = Console(flavour="grblHAL")
    console.tell("M3S500\nG1X40F4800\n")
    console.wait(0.1)
    console.tell("!")
    console.wait(1.0)
    console.tell(b"\x9e")
    assert console.tell("~") == ["[MSG:Restoring spindle]"]
    console.wait(3.9)
    assert console.state() == "Hold:0"
    console.wait(0.2)
    assert console.state() == "Run"
