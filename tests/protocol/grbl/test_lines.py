"""What of a line matters to the stream (grbl II.1, II.4), and which lines certainly make a block."""

import pytest

from protocol.errors import LocalError, MessageTooLongError
from protocol.grbl.blocks import BlockCounter
from protocol.grbl.lines import read_line, words_of


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


@pytest.mark.parametrize(
    ("text", "move"),
    [
        ("X1", True),
        ("G1X-1.5Y.2F500", True),
        ("G02X1I5J-1", True),
        ("G1 X1", False),  # read in full
        ("G1", False),
        ("F500", False),
        ("G4X1", False),
        ("G10X1", False),
        ("G1M3X1", False),
        ("X1S500", False),
    ],
)
def test_plain_moves_are_told_at_first_sight(text: str, move: bool) -> None:
    line = read_line(text, 79)
    assert line.move is move
    assert line.words == words_of(text.replace(" ", ""))
    if move:  # read in full it is the same
        full = read_line(text[:-1] + " " + text[-1:], 79)
        found = (full.words, full.alone, full.syncs, full.inert, full.dwell_s, full.tool)
        assert found == (line.words, line.alone, line.syncs, line.inert, line.dwell_s, line.tool)


def counter(*modal: str) -> BlockCounter:
    blocks = BlockCounter()
    for axis in range(3):
        blocks.learn_steps(axis, 100.0)
    blocks.learn_steps(3, 100.0)  # a rotary axis is not counted on
    blocks.learn_modal(modal)
    return blocks


class TestBlocks:
    def run(self, blocks: BlockCounter, *lines: str) -> list[bool]:
        return [blocks.certain(read_line(line, 79)) for line in lines]

    def test_a_first_word_may_be_where_the_axis_stands(self) -> None:
        assert self.run(counter("G0", "G90", "G21"), "X1", "X2", "X2", "X2.01", "X2.1", "Y1", "Y1X3") == [
            False, True, False, False, True, False, True
        ]  # fmt: skip

    def test_relative(self) -> None:
        assert self.run(counter("G1", "G91", "G21"), "X1", "X0", "X0.001", "G90X5", "X6") == [
            True, False, False, False, True
        ]  # fmt: skip

    def test_inches(self) -> None:
        assert self.run(counter("G1", "G90", "G20"), "X0", "X0.0005", "X0.0015", "G21", "X1") == [
            False, False, True, False, True
        ]  # fmt: skip

    def test_unknown_modes_or_steps(self) -> None:
        assert self.run(counter("G1", "G90"), "X1", "X2") == [False, False]
        assert self.run(counter("G1", "G21"), "X1", "X2") == [False, False]
        assert self.run(counter("G80", "G90", "G21"), "X1", "X2", "G1X3", "X4") == [False, False, False, True]
        assert self.run(counter("G1", "G90", "G21"), "A1", "A2") == [False, False]

    @pytest.mark.parametrize("between", ["G92X0", "G54", "G28", "G53G0X5", "G38.2X9F10", "G10L20P1X0", "G43.1Z1", "$H"])
    def test_what_moves_the_origin_or_the_machine_elsewhere(self, between: str) -> None:
        assert self.run(counter("G1", "G90", "G21"), "X1", "X2", between, "G1X3") == [False, True, False, False]

    @pytest.mark.parametrize("between", ["G80", "G81X1Z1R1F1", "G38.2X9F10"])
    def test_what_ends_the_motion_mode(self, between: str) -> None:
        assert self.run(counter("G1", "G90", "G21"), between, "X1", "X2") == [False, False, False]

    @pytest.mark.parametrize("between", ["M30", "M2", "#1=3"])
    def test_what_ends_all_that_is_known(self, between: str) -> None:
        assert self.run(counter("G1", "G90", "G21"), between, "G1X1", "X2") == [False, False, False]

    def test_a_dwell_makes_none_and_keeps_the_mode(self) -> None:
        assert self.run(counter("G1", "G90", "G21"), "G4P1", "X1", "X2") == [False, False, True]
