"""Every refusal of a line of G-code, with Grbl's code (grbl II.8, II.10)."""

import pytest

from tests.harness.grblconsole import Console

CASES = [
    # Words.
    ("1X1", 1),
    ("X1.2.3", 1),
    ("#1=3", 1),
    ("G", 2),
    ("X", 2),
    ("G1X-", 2),
    ("G1X.", 2),
    ("F-100", 4),
    ("S-1", 4),
    ("T-1", 4),
    ("N-1", 4),
    ("G4P-1", 4),
    # Commands.
    ("G5", 20),
    ("G81X1Y1Z-1R1", 20),
    ("G41", 20),
    ("G43H1", 20),
    ("G33", 20),
    ("G61.1", 20),
    ("G90.1", 20),
    ("G28.2", 20),
    ("G38.6Z1", 20),
    ("G92.2", 20),
    ("M6", 20),
    ("T1M6", 20),
    ("M7", 20),
    ("M48", 20),
    ("M98P1", 20),
    ("A1", 20),
    ("E1", 20),
    ("O100", 20),
    ("G0G1X1", 24),
    ("G17G18", 21),
    ("G20G21", 21),
    ("G80G0X1", 21),
    ("M3M4", 21),
    ("M8M9", 21),
    ("M0M2", 21),
    ("G54G55", 21),
    ("G90G91", 21),
    ("G93G94", 21),
    ("G4P1G53G0X1", 21),
    ("G1.5X1", 23),
    ("G59.1", 23),
    ("G17.1", 23),
    ("M3.5", 23),
    ("G0G92X1", 24),
    ("G28X1G1X1", 24),
    ("G43.1Z1G0", 24),
    ("G0X1X2", 25),
    ("G4P1P2", 25),
    ("T256", 38),
    # What they mean together.
    ("G1X1", 22),
    ("G1", 22),
    ("G2X1I1", 22),
    ("G93G1X1", 22),
    ("G92", 26),
    ("G10L2P1", 26),
    ("G2F100I1", 26),
    ("G38.2F100", 26),
    ("N10000000G0X1", 27),
    ("G4", 28),
    ("G4X1", 28),
    ("G10X1", 28),
    ("G10X1P1", 20),
    ("G10X1P7", 29),
    ("G10L2P7X1", 29),
    ("G10L3P1X1", 20),
    ("G10L2P1X1R5", 20),
    ("G53G2X1I1F100", 30),
    ("G53G80X1", 30),
    ("G80X1", 31),
    ("G2Z1I1F100", 32),
    ("G18G2Y1I1F100", 32),
    ("G2X0Y0R5F100", 33),
    ("G2X10I1F100", 33),
    ("G38.2X0F100", 33),
    ("G2X10R4F100", 34),
    ("G2X10F100", 35),
    ("G2X10K5F100", 35),
    ("G0X1P5", 36),
    ("G1X1F100I5", 36),
    ("G21R1", 36),
    ("G4P0L1", 36),
    ("G43.1X1", 37),
    ("G43.1", 37),
    ("G43.1X1Z1", 37),
]


@pytest.mark.parametrize(("text", "code"), CASES)
def test_ii_8_refusals(text: str, code: int) -> None:
    console = Console()
    before = console.tell("$G\n")
    assert console.tell(text + "\n") == [f"error:{code}"]
    assert console.tell("$G\n") == before, "a refused line does nothing at all"
    assert console.machine.executed == []


@pytest.mark.parametrize(
    "text",
    [
        "M1",
        "G80",
        "G40",
        "G49",
        "G61",
        "G91.1",
        "T255",
        "N9999999",
        "G0",
        "G92.1",
        "G1F100",
        "G28.1",
        "S100",
        "G4P0",
        "M9",
        "",
    ],
)
def test_ii_10_what_is_accepted(text: str) -> None:
    assert Console(instant=True).tell(text + "\n") == ["ok"]


def test_g93_wants_f_in_every_feed_block() -> None:
    console = Console()
    assert console.tell("G93\nG1X1F10\nG1X2\nG0X3\nG94\nG1X4\n") == ["ok", "ok", "error:22", "ok", "ok", "error:22"]


def test_arcs_that_are_slightly_off_are_taken() -> None:
    console = Console(instant=True)
    assert console.tell("G2X10.004I5F600\nG2X20.03I5\n") == ["ok", "error:33"]
    assert console.tell("G2X10.2Y0I-500J0\nG2X9.5Y0I-500J0\n") == ["ok", "error:33"], (
        "a thousandth of the radius, 0.5 mm"
    )


def test_n_and_t_need_no_use() -> None:
    assert Console().tell("N10T1F1S1\n") == ["ok"]


def test_ii_4_after_an_error_the_lines_behind_it_are_executed() -> None:
    console = Console()
    assert console.tell("G1X10F600\nG1X20Q1\nG1X5\n") == ["ok", "error:20", "ok"]
    console.rest()
    assert console.at(5, 0, 0)
    assert [line.text for line in console.machine.executed] == ["G1X10F600", "G1X5"]


def test_g10_without_p_is_for_the_present_system() -> None:
    console = Console()
    for text in ("G55\n", "G10L2X3\n", "G10L20Y-4\n"):
        console.tell(text)
        console.rest()
    assert "[G55:3.000,4.000,0.000]" in console.tell("$#\n")
