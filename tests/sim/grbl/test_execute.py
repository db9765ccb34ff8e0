"""What accepted lines do, and what they wait for (grbl II.3, II.4, II.10)."""

import pytest

from sim.grbl.simsettings import Flavour
from tests.harness.grblconsole import Console


def modes(console: Console) -> str:
    return console.tell("$G\n")[0]


@pytest.mark.parametrize(
    "text",
    ["M3S500", "M8", "G4P0.01", "G55", "G92X0", "G43.1Z1", "G10L20P1X0", "G28.1", "M30", "M2", "M5", "G38.3Z-1"],
)
def test_ii_4_lines_that_wait_for_motion(text: str) -> None:
    console = Console()
    console.tell("M4S100\nG10L2P2X9\n")
    console.rest()
    console.tell("G1X10F600\n")
    assert console.tell(text + "\n") == [], "no ok before the motion is done"
    assert console.now == 0.0 or console.rest()[-1] == "ok"
    assert console.machine.executed[-2].finished


@pytest.mark.parametrize("text", ["G21", "G91", "G17", "M1", "G80", "M9", "T4", "F5", "G54", "G49", "G61"])
def test_lines_that_do_not(text: str) -> None:
    console = Console()
    console.tell("G1X10F600\n")
    assert console.tell(text + "\n") == ["ok"]


def test_s_waits_only_with_the_spindle_on_and_without_laser() -> None:
    console = Console()
    console.tell("G1X10F600\n")
    assert console.tell("S100\n") == ["ok"]
    console.rest()
    console.tell("M3S200\nG1X0\n")
    assert console.tell("S300\n") == []
    console = Console(dollar={32: 1})
    console.tell("M3S200\nG1X10F600\n")
    assert console.tell("S300\n") == ["ok"]


def test_ii_4_g4_is_a_sync_point() -> None:
    console = Console()
    console.tell("G1X10F600\n")
    assert console.tell("G4P0.01\n") == []
    assert console.rest() == ["ok"]
    assert console.at(10, 0, 0)


def test_g4_lasts_as_long_as_it_says() -> None:
    console = Console()
    console.tell("G4P2.5\n")
    assert console.timeline(10) == [(pytest.approx(2.5), "ok")]


def test_a_hold_stops_the_clock_of_a_dwell() -> None:
    console = Console()
    console.tell("G4P1\n")
    console.wait(0.5)
    console.tell("!")
    console.wait(10.0)
    assert console.state() == "Hold:0"
    console.tell("~")
    began = console.now
    assert console.timeline(5)[0] == (pytest.approx(began + 0.5), "ok")


def test_ii_3_m30_says_so_and_puts_most_modes_back() -> None:
    console = Console()
    console.tell("G18G91G55G93M4S500\nM8\n")
    console.rest()
    assert console.tell("M30\n") == ["[MSG:Pgm End]", "ok"]
    assert modes(console) == "[GC:G1 G54 G17 G21 G90 G94 M5 M9 T0 F0 S500]"


def test_ii_6_m0_is_in_the_modal_state_only_while_it_lasts() -> None:
    console = Console()
    console.tell("M0\n")
    assert console.tell("$G\n") == []
    assert "M0" not in console.tell("~")[1]


def test_work_offsets() -> None:
    console = Console()
    console.tell("G10L2P2X10Y20\n")
    console.rest()
    console.tell("G55G0X1Y1\n")
    console.rest()
    assert console.at(11, 21, 0)
    console.tell("G10L20P0X0\n")
    console.rest()
    assert "[G55:11.000,20.000,0.000]" in console.tell("$#\n")
    console.tell("G92X5\n")
    console.tell("G0X6\n")
    console.rest()
    assert console.at(12, 21, 0)
    console.tell("G92.1\nG53G0X0Y0\n")
    console.rest()
    assert console.at(0, 0, 0)


def test_tool_length() -> None:
    console = Console()
    console.tell("G43.1Z5\nG0Z0\n")
    console.rest()
    assert console.at(0, 0, 5)
    assert "[TLO:5.000]" in console.tell("$#\n")
    assert console.tell("G49G0X1\n") == ["error:24"]
    console.tell("G49\nG0Z0\n")
    console.rest()
    assert console.at(0, 0, 0)


def test_g28_and_g30() -> None:
    console = Console()
    console.tell("G0X10Y5Z2\nG28.1\n")
    console.rest()
    console.tell("G0X0Y0Z0\nG91G28Z3\n")
    console.rest()
    assert console.at(0, 0, 2)
    assert [move.end for move in console.machine.executed[-1].moves] == [(0, 0, 3), (0, 0, 2)]
    console.tell("G90G28\n")
    console.rest()
    assert console.at(10, 5, 2)
    assert "[G28:10.000,5.000,2.000]" in console.tell("$#\n")


def test_units_and_distances() -> None:
    console = Console()
    console.tell("G20G91G1X1F100\nX1\nG21X1\n")
    console.rest()
    assert console.at(51.8, 0, 0)
    assert " F2540 " in modes(console)


@pytest.mark.parametrize(
    ("text", "end", "middle"),
    [
        ("G17G2X20I10F6000", (20, 0, 0), (10, 10, 0)),
        ("G17G3X20I10F6000", (20, 0, 0), (10, -10, 0)),
        ("G17G2X20R10F6000", (20, 0, 0), (10, 10, 0)),
        ("G17G2X10Y10R10F6000", (10, 10, 0), None),
        ("G18G2X20Z0I10F6000", (20, 0, 0), (10, 0, -10)),
        ("G19G3Y20J10F6000", (0, 20, 0), (0, 10, -10)),
    ],
)
def test_arcs_go_the_right_way_round(
    text: str, end: tuple[float, ...], middle: tuple[float, float, float] | None
) -> None:
    console = Console()
    console.tell(text + "\n")
    console.rest()
    assert console.at(*end)
    if middle is not None:
        moves = console.machine.executed[0].moves
        assert min(sum((a - b) ** 2 for a, b in zip(move.end, middle, strict=True)) for move in moves) < 0.1


def test_negative_r_is_the_longer_way() -> None:
    console = Console()
    console.tell("G2X10Y10R10F6000\nG0X0Y0\nG2X10Y10R-10\n")
    console.rest()
    short, _, long = console.machine.executed
    assert len(long.moves) == pytest.approx(3 * len(short.moves), abs=3)


def test_a_full_circle_and_a_helix() -> None:
    console = Console(instant=True)
    console.tell("G2X0I10F600\n")
    assert len(console.machine.executed[0].moves) > 100
    console.tell("G3X0I10Z-5\n")
    assert console.at(0, 0, -5)


def test_modal_motion_goes_on() -> None:
    console = Console()
    console.tell("G1F600\nX5\nG80\n")
    assert console.tell("X6\n") == ["error:31"]
    console.rest()
    assert console.at(5, 0, 0)


def test_a_line_to_where_it_stands_is_no_block() -> None:
    console = Console(dollar={10: 3})
    console.tell("G1X0F100\n")
    assert console.field("Bf") == "15,128"
    assert console.machine.executed[0].moves == []


def test_ii_4_motion_starts_by_itself_only_when_nothing_more_is_to_be_read() -> None:
    console = Console()
    said = console.tell("G1X10F600\n$$\n")
    assert said[0] == said[-1] == "ok", "$$ right behind a motion is still seen as idle"
    assert console.tell("$$\n") == ["error:8"]


def test_check_mode_moves_nothing() -> None:
    console = Console()
    assert console.tell("$C\nG1X10F100\nG4P10\nM3S1\nM0\nM30\nG1X1\nT1M6\n")[:2] == ["[MSG:Enabled]", "ok"]
    assert console.state() == "Check"
    assert console.place() == (0.0, 0.0, 0.0)
    assert console.machine.executed[-1].moves == []


def test_ii_1_overflow_of_the_planner_blocks_the_main_loop_not_the_realtime_bytes() -> None:
    console = Console()
    for nth in range(16):
        console.tell(f"G1X{nth + 1}F60\n")
    assert console.tell("$G\n") == []
    assert console.state() == "Run"
    console.tell("!")
    console.wait(1.0)
    assert console.state() == "Hold:0"


@pytest.mark.parametrize(("flavour", "kept"), [("1.1h", "T0"), ("grblHAL", "T3")])
def test_a_tool_word_is_forgotten_by_grbl_with_the_next_block(flavour: Flavour, kept: str) -> None:
    console = Console(flavour=flavour)
    console.tell("T3\n")
    assert " T3 " in console.tell("$G\n")[0]
    console.tell("G21\n")
    assert f" {kept} " in console.tell("$G\n")[0]
