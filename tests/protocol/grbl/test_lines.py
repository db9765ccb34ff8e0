"""What of a line matters to the stream (grbl II.1, II.4), and which lines certainly make a block."""

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import LocalError, MessageTooLongError
from protocol.grbl.blocks import BlockCounter
from protocol.grbl.lines import read_line, read_lines, words_of


@pytest.mark.parametrize("text", ["G1X1?", "G1!", "~", "G1\nX1", "G1\r", "(„)", "\x18", "G1\xa0", "", "  ", "\x9e"])
def test_lines_that_press_a_key_or_are_two_lines_are_never_sent(text: str) -> None:
    with pytest.raises(LocalError):
        read_line(text, 79)


def test_length_counts_without_blanks() -> None:
    assert read_line("G1 " + "X" * 77, 79).text
    with pytest.raises(MessageTooLongError, match="80 characters"):
        read_line("G1" + "X" * 78, 79)


@pytest.mark.parametrize(
    "text", ["G10L2P1X0", "g10 l20 p1 x0", "G28.1", "G30.1", "$110=500", "$I=mill", "$N0=G21", "$RST=*", "$$", "$H"]
)
def test_what_writes_the_eeprom_travels_alone(text: str) -> None:
    assert read_line(text, 79).alone


@pytest.mark.parametrize("text", ["$J=G91X1F100", "$G", "G28", "G1X1", "G92X0", "M3S1000"])
def test_what_does_not(text: str) -> None:
    assert not read_line(text, 79).alone


@pytest.mark.parametrize("text", ["G4P0.01", "M0", "M2", "M30", "G38.2Z-5F10", "G1G4P1"])
def test_sync_points(text: str) -> None:
    assert read_line(text, 79).syncs


@pytest.mark.parametrize("text", ["M3S1000", "M1", "G1X1", "G28", "$G", "#1=3"])
def test_no_sync_points(text: str) -> None:
    assert not read_line(text, 79).syncs


@pytest.mark.parametrize(
    ("text", "inert"),
    [
        ("G21G90", True),
        ("M3S1000", True),
        ("F500", True),
        ("T1", True),
        ("G54", True),
        ("X1", False),
        ("G28", False),
        ("G1", False),
        ("T1M6", False),
        ("#1=3", False),
        ("G4P1", False),
    ],
)
def test_lines_that_move_nothing(text: str, inert: bool) -> None:
    assert read_line(text, 79).inert is inert


def test_dwell_and_tool() -> None:
    assert read_line("G4P2.5", 79).dwell_s == 2.5
    assert read_line("G82P2.5", 79).dwell_s == 0
    assert read_line("T7M6", 79).tool == 7


def test_words() -> None:
    assert words_of("G1X-.5Y2.") == [("G", 1.0), ("X", -0.5), ("Y", 2.0)]
    assert words_of("$H") is None
    assert words_of("G1X") is None


MOVES = st.from_regex(r"(G0?[0-3])?(X-?[0-9]{1,3}(\.[0-9]{0,3})?)(Y[0-9]{1,2})?(F[0-9]{1,4})?", fullmatch=True)
OTHERS = st.sampled_from(
    ("G1", "F500", "G4P1", "G10L2P1X0", "G1M3X1", "X1S500", "$J=X1F1", "G28", "G91", "T1M6", "M30")
)


@given(st.lists(MOVES | OTHERS, max_size=8))
def test_lines_read_together_are_what_each_is_alone(texts: list[str]) -> None:
    assert read_lines(texts, 79) == tuple(read_line(text, 79) for text in texts)


@pytest.mark.parametrize("text", ["X1\nX2", "X1\n", "X1?", "X1!", "", "x1\x18", "X1\u00ff"])
def test_no_line_among_others_is_two_or_presses_a_key(text: str) -> None:
    with pytest.raises(LocalError):
        read_lines(["X1", text, "X3"], 79)
    with pytest.raises(LocalError):
        read_lines([text], 79)


def test_a_line_that_is_too_long_among_others() -> None:
    with pytest.raises(MessageTooLongError):
        read_lines(["X1", "X" + "1" * 79], 79)


@pytest.mark.parametrize(
    ("text", "steady"),
    [
        ("X1", True),
        ("G1X-1.5Y.2F500", True),
        ("N10G90G21G1X1S500", True),
        ("M8", True),
        ("G4P1", True),
        ("G92X0", False),
        ("G54", False),
        ("G28", False),
        ("G53G0X5", False),
        ("G38.2X9F10", False),
        ("G10L20P1X0", False),
        ("G43.1Z1", False),
        ("G81X1Z1R1F1", False),
        ("M30", False),
        ("M6", False),
        ("#1=3", False),
        ("$H", False),
    ],
)
def test_what_goes_as_far_as_it_was_planned_to(text: str, steady: bool) -> None:
    assert read_line(text, 79).steady is steady


def counter(*steps_per_mm: float) -> BlockCounter:
    blocks = BlockCounter()
    for axis, steps in enumerate(steps_per_mm):
        blocks.learn_steps(axis, steps)
    return blocks


def test_a_line_must_go_two_steps_of_the_coarsest_linear_axis() -> None:
    assert counter(100.0, 400.0, 200.0).least_mm == pytest.approx(0.02)
    assert counter(100.0, 400.0, 200.0, 1.0).least_mm == pytest.approx(0.02), "a rotary axis is not counted on"


def test_a_word_may_have_been_rounded() -> None:
    assert counter(5000.0, 5000.0, 5000.0).least_mm == pytest.approx(0.002)


@pytest.mark.parametrize("known", [(), (100.0,), (100.0, 100.0), (100.0, 0.0, 100.0), (100.0, -1.0, 100.0)])
def test_without_the_steps_of_every_linear_axis_nothing_is_certain(known: tuple[float, ...]) -> None:
    assert counter(*known).least_mm == inf
