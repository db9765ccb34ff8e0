"""The controller as a whole: answers, states, resets, power (grbl II.2 to II.4)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.grbl.core import State
from sim.grbl.events import AlarmRaised, BannerSaid, LineAnswered, PowerLost
from sim.grbl.machine import VirtualGrbl
from sim.grbl.simsettings import SimSettings
from tests.harness.grblconsole import Console

BANNER = ["", "Grbl 1.1h ['$' for help]"]
LOCK = "[MSG:'$H'|'$X' to unlock]"


def running(console: Console) -> None:
    """In the middle of a long motion, with one line waiting for room."""
    for nth in range(17):
        console.tell(f"G1X{nth % 2 * 50 + 1}F600\n")
    console.wait(1.0)
    assert console.state() == "Run"


def test_ii_3_one_answer_for_each_line_in_order() -> None:
    console = Console()
    assert console.tell("G21\nG999\n\nG1X1\n$G\nM6\n") == [
        "ok",
        "error:20",
        "ok",
        "error:22",
        "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]",
        "ok",
        "error:20",
    ]


def test_ii_3_done_is_not_acknowledged() -> None:
    console = Console()
    assert console.tell("G1X10F600\n") == ["ok"]
    assert console.machine.executed[0].moves[0].ended_at is None
    assert console.wait(0.5) == []
    assert console.state() == "Run"
    console.rest()
    assert console.state() == "Idle"
    assert console.machine.executed[0].finished


def test_ii_2_reset_in_idle_is_a_banner_and_keeps_the_position() -> None:
    console = Console()
    console.tell("G1X10F6000\n")
    console.rest()
    assert console.tell(b"\x18") == []
    assert console.rest() == BANNER
    assert console.place() == (10.0, 0.0, 0.0)
    assert console.state() == "Idle"


def test_ii_3_reset_in_motion_alarm_late_ok_of_the_blocked_line_then_the_banner() -> None:
    console = Console()
    running(console)
    console.tell(b"\x18")
    said = [*console.timeline(2.0)]
    assert [line for _, line in said] == ["ok", *BANNER, LOCK]
    assert 0.45 < said[0][0] - (console.now - 2.0) < 0.55, "half a second after the alarm"


def test_ii_3_the_alarm_itself_comes_at_once() -> None:
    console = Console()
    running(console)
    assert console.tell(b"\x18") == ["ALARM:3"]
    assert console.wait(0.4) == []
    assert console.tell("?") == [], "the processor stands still"
    assert console.wait(1.0) == ["ok", *BANNER, LOCK], "and the question is forgotten"
    assert console.state() == "Alarm"


def test_ii_4_a_reset_forgets_ring_planner_and_parser_but_not_g54() -> None:
    console = Console()
    console.tell("G10L2P1X5\n")
    console.rest()
    console.tell("G91G20G92X1\nT3S500\nG43.1Z1\n")
    running(console)
    console.tell(b"\x90\x91\x91\x18G1X99\n")
    console.rest()
    assert console.tell("$X\n") == ["[MSG:Caution: Unlocked]", "ok"]
    said = console.tell("$G\n$#\n")
    assert said[0] == "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]"
    assert "[G54:5.000,0.000,0.000]" in said
    assert "[G92:0.000,0.000,0.000]" in said
    assert "[TLO:0.000]" in said
    console.tell("?")
    assert console.field("Ov") == "100,100,100"


def test_ii_2_reset_in_hold_0_is_no_alarm() -> None:
    console = Console()
    console.tell("G1X50F600\n")
    console.wait(1.0)
    console.tell("!")
    console.wait(1.0)
    assert console.state() == "Hold:0"
    console.tell(b"\x18")
    assert console.wait(1.0) == BANNER
    assert console.state() == "Idle"
    assert console.rest() == []


def test_ii_2_reset_while_still_decelerating_is_one() -> None:
    console = Console()
    console.tell("G1X50F6000\n")
    console.wait(0.5)
    console.tell("!")
    console.wait(0.1)
    assert console.state() == "Hold:1"
    assert console.tell(b"\x18") == ["ALARM:3"]


def test_a_second_reset_before_the_first_is_through_changes_nothing() -> None:
    console = Console()
    console.tell(b"\x18")
    assert console.tell(b"\x18") == []
    assert console.rest() == BANNER


def test_bytes_between_a_reset_and_its_banner_are_lost() -> None:
    console = Console()
    console.tell(b"\x18")
    console.tell("G21\n?")
    assert console.rest() == BANNER


def test_ii_4_in_alarm_every_line_of_g_code_is_error_9() -> None:
    console = Console()
    running(console)
    console.tell(b"\x18")
    console.rest()
    assert console.tell("G21\n\n$G\n") == ["error:9", "ok", "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]", "ok"]


def test_power_off_and_on() -> None:
    console = Console()
    running(console)
    machine = console.machine
    machine.power_off(console.now)
    assert console.tell("?G21\n") == []
    machine.power_on(console.now)
    assert console.tell("?") == []
    assert machine.next_timer() == console.now + 1.5
    assert console.wait(1.4) == []
    assert console.wait(0.2) == BANNER
    assert console.place() == (0.0, 0.0, 0.0)
    assert machine.true_position["X"] != -50.0, "the tool stands where it stood"
    kinds = set()
    while (event := machine.next_event()) is not None:
        kinds.add(type(event))
    assert {PowerLost, BannerSaid, LineAnswered} <= kinds


def test_ii_1_opening_the_port_resets_the_board_if_told_so() -> None:
    console = Console(reset_on_open=True)
    console.tell("G1X10F600\n")
    console.wait(0.2)
    console.machine.line_opened(console.now)
    assert console.rest() == BANNER
    other = Console()
    other.machine.line_opened(0.0)
    assert other.rest() == []


def test_ii_9_with_homing_it_is_locked_at_power_up() -> None:
    console = Console(dollar={22: 1})
    assert console.state() == "Alarm"
    assert console.tell("G1X1F100\n") == ["error:9"]
    console.machine.restart(console.now)
    assert console.rest() == [*BANNER, LOCK]
    assert Console(dollar={22: 1}, homing_lock=False).state() == "Idle"


def test_alarms_are_events() -> None:
    console = Console()
    running(console)
    console.tell(b"\x18")
    events = []
    while (event := console.machine.next_event()) is not None:
        events.append(event)
    assert AlarmRaised(3) in events


def test_the_executed_record_is_bounded_if_told_so() -> None:
    console = Console(instant=True, executed_limit=3)
    for nth in range(20):
        console.tell(f"G1X{nth}F100\n")
    assert console.machine.executed_count == 20
    assert 3 <= len(console.machine.executed) <= 6
    assert console.machine.executed[-1].text == "G1X19F100"


def test_lines_are_handed_over_before_their_ok() -> None:
    seen: list[tuple[int, str]] = []
    machine = VirtualGrbl(SimSettings(), on_line=lambda line: seen.append((line.id, line.text)))
    machine.receive_data(b"g1 x1 f100 (hm)\n\n$$\nG999\n$J=G91X1F100\nG21\n", 0.0)
    assert seen == [(1, "G1X1F100"), (5, "$J=G91X1F100")], "what was refused is not among them"


@given(st.lists(st.binary(max_size=40), max_size=20), st.booleans())
def test_any_bytes_raise_nothing(chunks: list[bytes], hal: bool) -> None:
    machine = VirtualGrbl(SimSettings(flavour="grblHAL" if hal else "1.1h", instant=True, eeprom_byte_s=0.0))
    for at, chunk in enumerate(chunks):
        machine.receive_data(chunk, float(at))
        machine.data_to_send(float(at))


_WORDS = st.sampled_from(
    ["G0X1", "G1X2F600", "G4P0.1", "M3S100", "$$", "?", "!", "~", "\x18", "$J=G91X1F100", "$X", "$C"]
)


@given(st.lists(st.tuples(_WORDS, st.floats(0, 0.5)), max_size=25))
def test_ii_3_never_more_answers_than_lines(script: list[tuple[str, float]]) -> None:
    console = Console()
    lines = answers = 0
    for text, seconds in script:
        realtime = len(text) == 1
        lines += not realtime
        said = console.tell(text + "\n" * (not realtime)) + console.wait(seconds)
        answers += sum(line == "ok" or line.startswith("error:") for line in said)
        assert answers <= lines
        assert console.machine.state in State


@given(st.lists(_WORDS, max_size=12))
def test_the_same_bytes_give_the_same_answers(script: list[str]) -> None:
    one, two = Console(), Console()
    for text in script:
        line = text + "\n" * (len(text) > 1)
        assert one.tell(line) == two.tell(line)
        assert one.wait(0.3) == two.wait(0.3)


@pytest.mark.parametrize("hal", [False, True])
def test_instant_motion_takes_no_time(hal: bool) -> None:
    console = Console(instant=True, flavour="grblHAL" if hal else "1.1h")
    assert console.tell("G1X100F1\nG2X0I-50\nG4P100\nG0Y5\n" * 50) == ["ok"] * 200
    assert console.place() == (0.0, 5.0, 0.0)
    assert all(line.finished for line in console.machine.executed)
    assert console.machine.dropped_bytes == 0
