"""`$` lines: where they are allowed and what they do (grbl II.3, II.6)."""

import pytest

from sim.grbl.events import BytesLost
from tests.harness.grblconsole import Console

BANNER = ["", "Grbl 1.1h ['$' for help]"]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("$Q", 2),
        ("$$$", 3),
        ("$GG", 3),
        ("$CC", 3),
        ("$XX", 3),
        ("$##", 3),
        ("$S", 3),
        ("$SLEEP", 3),
        ("$RST", 3),
        ("$RST=", 3),
        ("$RST=&", 3),
        ("$RST=$$", 3),
        ("$I5", 3),
        ("$N=G21", 2),
        ("$N0G21", 3),
        ("$N5=G21", 3),
        ("$N0=G999", 20),
        ("$100", 3),
        ("$100=", 2),
        ("$100=5X", 3),
        ("$999=1", 3),
        ("$7=1", 3),
        ("$103=1", 3),
        ("$140=1", 3),
        ("$100=-1", 4),
        ("$0=2", 6),
        ("$20=1", 10),
        ("$H", 5),
    ],
)
def test_ii_8_refusals(text: str, code: int) -> None:
    assert Console().tell(text + "\n") == [f"error:{code}"]


def test_error_12_and_17_by_options() -> None:
    console = Console(max_step_rate_hz=30_000.0)
    assert console.tell("$110=7300\n") == ["error:12"]
    assert console.tell("$100=400\n") == ["error:12"]
    assert Console(variable_spindle=False).tell("$32=1\n") == ["error:17"]


@pytest.mark.parametrize("text", ["$#", "$I", "$N", "$RST=$", "$SLP", "$H", "$11=0.02", "$N0=", "$C"])
def test_ii_6_not_while_it_moves(text: str) -> None:
    console = Console()
    console.tell("G1X50F600\n")
    assert console.tell(text + "\n") == ["error:8"]


@pytest.mark.parametrize("text", ["$", "$G"])
def test_ii_6_any_time(text: str) -> None:
    console = Console()
    console.tell("G1X50F600\n")
    assert console.tell(text + "\n")[-1] == "ok"


def test_a_setting_is_written_and_read_back() -> None:
    console = Console()
    console.tell("$11=0.0251\n")
    assert console.rest() == ["ok"]
    console.tell("$22=7\n$20=1\n")
    console.rest()
    console.tell("$13=1.9\n")
    console.rest()
    settings = console.settings()
    assert (settings[11], settings[22], settings[20], settings[13]) == ("0.025", "1", "1", "1")
    console.tell("$22=0\n")
    console.rest()
    assert console.settings()[20] == "0", "no soft limits without homing"


def test_every_setting_of_ii_10_in_order() -> None:
    assert list(Console().settings()) == [
        *range(7), *range(10, 14), *range(20, 28), *range(30, 33), *range(100, 103), *range(110, 113),
        *range(120, 123), *range(130, 133),
    ]  # fmt: skip


def test_settings_survive_resets_and_power() -> None:
    console = Console()
    console.tell("$12=0.5\n$N1=G91\n")
    console.rest()
    console.machine.restart(console.now)
    assert console.rest() == [*BANNER, ">G91:ok"]
    assert console.settings()[12] == "0.500"


# EEPROM.


def test_ii_4_while_the_eeprom_is_written_bytes_are_lost() -> None:
    console = Console()
    assert console.tell("$11=0.02\n") == []
    console.tell("G21\n?")
    assert console.rest() == ["ok"]
    lost = []
    while (event := console.machine.next_event()) is not None:
        lost.append(event)
    assert BytesLost("eeprom", 4) in lost
    assert BytesLost("eeprom", 1) in lost


def test_ii_4_it_takes_3_4_ms_a_byte_that_changes() -> None:
    console = Console()
    console.tell("$11=0.02\n")
    assert console.timeline(1) == [(pytest.approx(5 * 0.0034), "ok")]
    assert console.tell("$11=0.02\n") == ["ok"], "nothing changes, nothing is written"


@pytest.mark.parametrize("text", ["G10L2P1X1", "G10L20P2Y3", "$I=MILL", "$N0=G21", "$RST=#", "$5=1"])
def test_ii_4_lines_that_write(text: str) -> None:
    console = Console()
    assert "ok" not in console.tell(text + "\n")
    assert console.machine.core.deaf_until > console.now


def test_bytes_that_came_before_are_safe() -> None:
    console = Console()
    console.tell("$11=0.02\nG21\n")
    assert console.rest() == ["ok", "ok"]


def test_the_ok_of_a_lost_line_never_comes() -> None:
    console = Console()
    console.tell("G10L2P1X5\n")
    console.wait(0.01)
    console.tell("G1X1F100\n")
    assert console.rest() == ["ok"]


# Build line and start-up lines.


def test_ii_1_the_build_line_loses_blanks_and_case() -> None:
    console = Console()
    console.tell("$I=my mill\n")
    console.rest()
    assert console.tell("$I\n")[0] == "[VER:1.1h.20190830:MYMILL]"


def test_ii_6_trap_a_start_up_line_is_executed_as_it_is_stored() -> None:
    console = Console()
    console.tell("$N0=G20\n")
    assert console.rest() == ["ok"]
    assert " G20 " in console.tell("$G\n")[0]
    assert console.tell("$N\n") == ["$N0=G20", "$N1=", "ok"]


def test_ii_3_start_up_lines_are_no_answers() -> None:
    console = Console()
    console.tell("$N0=G20G54\n")
    console.rest()
    console.tell("$N1=G91\n")
    console.rest()
    console.tell("\x18")
    assert console.rest() == [*BANNER, ">G20G54:ok", ">G91:ok"]


def test_a_start_up_line_that_has_become_wrong() -> None:
    console = Console(mist=True)
    console.machine.core.memory.startup[0] = "G1X1"
    console.tell("\x18")
    assert console.rest() == [*BANNER, ">G1X1:error:22"]


def test_start_up_lines_are_written_only_when_idle() -> None:
    console = Console(dollar={22: 1})
    assert console.tell("$N0=G21\n$N\n") == ["error:8", "$N0=", "$N1=", "ok"]


# Check mode, unlock, restore.


def test_ii_3_check_mode_off_is_a_reset() -> None:
    console = Console()
    assert console.tell("$C\n") == ["[MSG:Enabled]", "ok"]
    assert console.tell("G20\nG1X1\n$H\n") == ["ok", "error:22", "error:8"]
    assert console.tell("$C\n") == ["[MSG:Disabled]", "ok"]
    assert console.tell("G21\n") == [], "bytes in between are lost"
    said = console.timeline(1.0)
    assert [line for _, line in said] == BANNER
    assert said[0][0] == pytest.approx(0.03)
    assert " G21 " in console.tell("$G\n")[0]


def test_ii_3_unlock() -> None:
    console = Console(dollar={22: 1})
    assert console.tell("$X\n$X\n") == ["[MSG:Caution: Unlocked]", "ok", "ok"]
    assert console.state() == "Idle"


def test_check_mode_needs_idle() -> None:
    assert Console(dollar={22: 1}).tell("$C\n") == ["error:8"]


@pytest.mark.parametrize(
    ("what", "setting", "offset", "build"),
    [("$", "0.010", True, True), ("#", "0.500", False, True), ("*", "0.010", False, False)],
)
def test_ii_6_restore(what: str, setting: str, offset: bool, build: bool) -> None:
    console = Console()
    for text in ("$11=0.5\n", "G10L2P1X5\n", "$I=MINE\n"):
        console.tell(text)
        console.rest()
    console.tell(f"$RST={what}\n")
    assert console.rest() == ["[MSG:Restoring defaults]", "ok", *BANNER]
    assert console.settings()[11] == setting
    assert ("[G54:5.000,0.000,0.000]" in console.tell("$#\n")) is offset
    assert ("MINE" in console.tell("$I\n")[0]) is build


def test_in_alarm_settings_can_be_changed() -> None:
    console = Console(dollar={22: 1})
    assert console.tell("$#\n")[-1] == "ok"
    console.tell("$24=100\n")
    assert console.rest() == ["ok"]
