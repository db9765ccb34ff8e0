"""Overrides and toggles (grbl II.2)."""

import pytest

from tests.harness.grblconsole import Console


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"\x91", "110,100,100"),
        (b"\x92\x92", "80,100,100"),
        (b"\x93\x94\x94", "99,100,100"),
        (b"\x91" * 20, "200,100,100"),
        (b"\x92" * 20, "10,100,100"),
        (b"\x91\x90", "100,100,100"),
        (b"\x96", "100,50,100"),
        (b"\x97\x95", "100,100,100"),
        (b"\x97\x98", "100,25,100"),
        (b"\x9a\x9c", "100,100,111"),
        (b"\x9b\x9d", "100,100,89"),
        (b"\x9a" * 20, "100,100,200"),
        (b"\x9b" * 20 + b"\x99", "100,100,100"),
    ],
)
def test_ii_2_percents(data: bytes, expected: str) -> None:
    console = Console()
    console.status()
    console.tell(data)
    assert console.field("Ov") == expected


def test_ii_2_an_unchanged_value_causes_no_new_field() -> None:
    console = Console()
    console.status()
    console.status()
    console.tell(b"\x90\x95\x99")
    assert console.field("Ov") is None
    console.tell(b"\x93")
    assert console.field("Ov") == "101,100,100"


def seconds(console: Console) -> float:
    began = console.now
    console.rest()
    return console.now - began


def test_the_feed_override_acts_on_feeds_in_flight() -> None:
    plain, slow = Console(), Console()
    for console in (plain, slow):
        console.tell("G1X60F600\n")
        console.wait(1.0)
    slow.tell(b"\x92" * 5)
    slow.wait(0.2)
    assert slow.field("FS") == "300,0"
    assert seconds(slow) > 1.9 * seconds(plain)
    assert slow.at(60, 0, 0)


def test_the_rapid_override_acts_on_rapids_only() -> None:
    console = Console()
    console.tell(b"\x97")
    console.tell("G0X100\n")
    console.wait(1.0)
    assert console.field("FS") == "1500,0"
    console.rest()
    console.tell("G1X0F600\n")
    console.wait(1.0)
    assert console.field("FS") == "600,0"


def test_ii_2_feed_overrides_not_on_rapids_nor_jogs() -> None:
    console = Console()
    console.tell(b"\x92" * 5)
    console.tell("G0X100\n")
    console.wait(1.0)
    assert console.field("FS") == "6000,0"
    console.rest()
    console.tell("$J=X0F600\n")
    console.wait(1.0)
    assert console.field("FS") == "600,0"


def test_no_override_beats_the_axes() -> None:
    console = Console()
    console.tell(b"\x91" * 10)
    console.tell("G1X100F5000\n")
    console.wait(1.0)
    assert console.field("FS") == "6000,0"


def test_the_spindle_override_acts_at_once() -> None:
    console = Console()
    console.tell("M3S500\n")
    console.tell(b"\x9a")
    assert console.field("FS") == "0,550"
    console.tell("S600\n")
    assert console.field("FS") == "0,660"
    console.tell(b"\x9a" * 9)
    assert console.field("FS") == "0,1000", "$30"


def test_ii_2_coolant_toggles_change_the_modal_state() -> None:
    console = Console(mist=True)
    console.tell(b"\xa0")
    assert " M8 " in console.tell("$G\n")[0]
    console.tell(b"\xa1")
    assert " M7 M8 " in console.tell("$G\n")[0]
    console.tell(b"\xa0\xa1")
    assert " M9 " in console.tell("$G\n")[0]


def test_ii_2_mist_only_if_built_in_and_nothing_in_alarm() -> None:
    console = Console(dollar={22: 1})
    console.tell(b"\xa0")
    assert " M9 " in console.tell("$G\n")[0]
    console.tell("$X\n")
    console.tell(b"\xa1")
    assert " M9 " in console.tell("$G\n")[0]


def test_ii_4_a_program_end_puts_them_back() -> None:
    console = Console()
    console.tell(b"\x91\x97\x9a")
    assert console.tell("M30\n") == ["[MSG:Pgm End]", "ok"]
    console.status()
    assert "Ov:100,100,100" in console.status()
