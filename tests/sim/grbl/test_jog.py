"""Jogging (grbl II.7)."""

import pytest

from tests.harness.grblconsole import Console


def test_modes_of_the_program_are_not_touched() -> None:
    console = Console()
    before = console.tell("$G\n")
    assert console.tell("$J=G20G91X1F100\n") == ["ok"]
    assert console.state() == "Jog"
    console.rest()
    assert console.at(25.4, 0, 0)
    assert console.tell("$G\n") == before
    console.tell("G10L2P1X5\n")
    console.rest()
    console.tell("$J=G53X1F6000\n")
    console.rest()
    assert console.at(1, 0, 0)
    console.tell("$J=X1F6000\n")
    console.rest()
    assert console.at(6, 0, 0)


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("$J=X1\n", "error:22"),
        ("$J=G1X1F100\n", "error:16"),
        ("$J=G55X1F100\n", "error:16"),
        ("$J=M3X1F100\n", "error:16"),
        ("$J=G2X1F100\n", "error:16"),
        ("$J=G28X1F100\n", "error:16"),
        ("$J=X1Q2F100\n", "error:20"),
        ("$J=X1S2F100\n", "error:36"),
        ("$JX1F100\n", "error:3"),
        ("$J=N5X1F100\n", "ok"),
    ],
)
def test_ii_3_syntax(text: str, answer: str) -> None:
    assert Console().tell(text) == [answer]


def test_a_jog_without_an_axis_goes_to_machine_zero() -> None:
    console = Console()
    console.tell("G0X3Y-2\n")
    console.rest()
    assert console.tell("$J=F6000\n") == ["ok"]
    assert console.state() == "Jog"
    console.rest()
    assert console.at(0, 0, 0)


def test_ii_3_axis_conflicts_may_give_another_code() -> None:
    assert Console().tell("$J=G0G1X1F100\n") == ["error:24"]


def test_error_15_beyond_the_travel_is_no_alarm() -> None:
    console = Console(dollar={20: 1, 22: 1}, homing_lock=False)
    assert console.tell("$J=X1F100\n$J=X-201F100\n$J=X-1F1000\n") == ["error:15", "error:15", "ok"]
    console.rest()
    assert console.state() == "Idle"


def test_jogs_queue_and_each_gets_an_ok_when_planned() -> None:
    console = Console()
    assert console.tell("$J=G91X5F6000\n" * 8) == ["ok"] * 8
    console.rest()
    assert console.at(40, 0, 0)


def test_error_9_for_g_code_in_a_jog_and_error_8_for_settings() -> None:
    console = Console()
    console.tell("$J=G91X50F600\n")
    assert console.tell("G21\n$I\n$G\n")[:2] == ["error:9", "error:8"]
    assert console.tell("$$\n")[-1] == "ok"


def test_error_8_for_a_jog_in_a_run() -> None:
    console = Console()
    console.tell("G1X50F600\n")
    assert console.tell("$J=G91X1F100\n") == ["error:8"]


@pytest.mark.parametrize("byte", [b"\x85", b"!"])
def test_ii_7_a_cancel_brakes_and_purges(byte: bytes) -> None:
    console = Console()
    console.tell("$J=G91X50F6000\n" * 3)
    console.wait(0.3)
    console.tell(byte)
    assert console.state() == "Jog", "until it stands"
    console.rest()
    assert console.state() == "Idle"
    assert console.place()[0] < 30
    console.tell("G91G0X1\n")
    place = console.place()[0]
    console.rest()
    assert console.place()[0] == pytest.approx(place + 1, abs=0.01), "the parser knows where it stands"


def test_ii_2_jog_cancel_acts_in_jog_only() -> None:
    console = Console()
    console.tell("G1X50F6000\n")
    console.wait(0.2)
    console.tell(b"\x85")
    assert console.state() == "Run"
    console.rest()
    assert console.at(50, 0, 0)


def test_ii_7_trap_unacknowledged_jogs_in_the_ring_run_afterwards() -> None:
    console = Console()
    said = console.tell("$J=G91X2F600\n" * 22)
    assert said == ["ok"] * 15
    said += console.wait(0.5) + console.tell(b"\x85") + console.wait(0.5)
    assert console.state() == "Jog", "the Jog state has come back"
    said += console.rest()
    assert said == ["ok"] * 22
    assert console.at(44, 0, 0), "the line that waited for room goes where it was to go before the cancel"


def test_ii_7_cancelled_again_it_is_over() -> None:
    console = Console()
    console.tell("$J=G91X2F600\n" * 18)
    for _ in range(10):
        console.wait(0.2)
        if console.state() == "Idle":
            break
        console.tell(b"\x85")
    assert console.rest() == []
    assert console.state() == "Idle"


def test_reset_in_a_jog_is_an_alarm() -> None:
    console = Console()
    console.tell("$J=G91X50F600\n")
    assert console.tell(b"\x18") == ["ALARM:3"]


def test_jogs_are_written_down_with_their_motion() -> None:
    console = Console()
    console.tell("$J=G91X5F600\n")
    console.rest()
    (line,) = console.machine.executed
    assert [move.kind for move in line.moves] == ["jog"]
    assert line.finished
