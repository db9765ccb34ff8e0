"""The parts of the engine by themselves: window, lane, proofs of execution, polls, what is asked."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.commands import (
    CheckMode,
    ClearAlarm,
    GrblCommand,
    Home,
    Jog,
    ReadFirmware,
    ReadModal,
    ReadOffsets,
    ReadSettings,
    ReadStartupBlocks,
    Restore,
    Sleep,
    WriteInfo,
    WriteSetting,
    WriteStartupBlock,
)
from protocol.errors import LocalError
from protocol.events import (
    CommandDone,
    CommandFailed,
    FirmwareRead,
    Homed,
    ModalRead,
    OffsetsRead,
    ProbeReported,
    SettingsRead,
    StartupBlocksRead,
)
from protocol.grbl import asking
from protocol.grbl.codec import parse_line
from protocol.grbl.errands import SEGMENTS_AHEAD, Errand, Executed
from protocol.grbl.lane import MAX_WAITING, Lane
from protocol.grbl.lines import read_line
from protocol.grbl.polling import REPEAT_S, Poll
from protocol.grbl.window import Window


def errand(*texts: str) -> Errand:
    return Errand(tuple(read_line(text, 79) for text in texts), token=1)


class TestWindow:
    def test_bytes_are_counted_with_their_line_end(self) -> None:
        window = Window(10)
        assert window.fill(errand("G1X1"), 1)
        assert window.used_bytes == 5
        assert window.takes(read_line("G1X2", 79))
        assert not window.takes(read_line("G1X22", 79))

    def test_what_travels_alone_waits_for_an_empty_buffer_and_keeps_it(self) -> None:
        window = Window()
        assert window.fill(errand("G1X1"), 1)
        assert not window.takes(read_line("G10L2P1X0", 79))
        assert window.answer() is not None
        assert window.fill(errand("G10L2P1X0"), 1)
        assert not window.takes(read_line("G1X1", 79))

    def test_line_by_line(self) -> None:
        window = Window(one_by_one=True)
        assert window.fill(errand("G1X1"), 1)
        assert not window.takes(read_line("G1X2", 79))

    def test_no_answer_without_a_line(self) -> None:
        assert Window().answer() is None

    @given(st.lists(st.integers(1, 79) | st.none(), max_size=60), st.integers(80, 200))
    def test_the_ring_never_overflows(self, steps: list[int | None], capacity: int) -> None:
        """A ring that takes whole lines out, one an answer: what is in it never exceeds what it has."""
        window = Window(capacity)
        ring: list[int] = []
        for step in steps:
            if step is None:
                assert (window.answer() is None) == (not ring)
                ring = ring[1:]
            elif window.takes(line := read_line("X" * step, 79)):
                assert window.fill(errand(line.text), 1) == (line,)
                ring.append(step + 1)
            assert sum(ring) == window.used_bytes <= capacity


class TestLane:
    def test_a_question_waits_once(self) -> None:
        lane = Lane()
        for byte in (b"?", b"!", b"?"):
            lane.put(byte)
        assert lane.take() == (b"?!", [])
        assert lane.take() == (b"", [])

    def test_a_reset_drops_what_stands_before_it_and_every_token_is_told(self) -> None:
        lane = Lane()
        lane.put(b"\x91", 1)
        lane.put(b"\x18", 2)
        assert lane.take() == (b"\x18", [1, 2])

    def test_it_is_bounded(self) -> None:
        lane = Lane()
        for _ in range(1000):
            lane.put(b"\x91")
        assert len(lane.take()[0]) == MAX_WAITING


def acknowledged(executed: Executed, work: Errand, **proof: Any) -> list[Errand]:
    """As the engine does it."""
    work.answered += 1
    return executed.acknowledged(work, **proof)


class TestExecuted:
    def test_acknowledged_is_not_done(self) -> None:
        executed, work = Executed(), errand("X1", "X2")
        assert acknowledged(executed, work, inert=False, certain=True) == []
        assert work.done == 0

    def test_an_inert_line_is_done_when_all_before_it_is(self) -> None:
        executed, work = Executed(), errand("G21", "X1", "G90")
        acknowledged(executed, work, inert=True, certain=False)
        assert work.done == 1
        acknowledged(executed, work, inert=False, certain=True)
        acknowledged(executed, work, inert=True, certain=False)
        assert work.done == 1
        assert executed.at_rest(2) == [work]
        assert work.done == 3
        assert executed.empty

    def test_the_planner_holds_the_last_blocks_and_segments(self) -> None:
        executed, work = Executed(), errand(*["X1"] * 40)
        for _ in range(40):
            acknowledged(executed, work, inert=False, certain=True)
        executed.in_planner(15)
        assert work.done == 40 - 15 - SEGMENTS_AHEAD
        executed.in_planner(0)
        assert work.done == 40 - SEGMENTS_AHEAD

    @pytest.mark.parametrize("short", [None, 0, 20])
    def test_lines_that_are_counted_together_count_the_same(self, short: int | None) -> None:
        """Each of 40 lines with its own answer, or some at once; one of them may be too short for a block."""
        reach_mm = tuple(0.001 if at == short else 1.0 for at in range(40))
        one, several = Executed(), Executed()
        first, second = (Errand(errand(*["X1"] * 41).lines, reach_mm=(*reach_mm, 1.0)) for _ in range(2))
        for number, reach in enumerate(reach_mm, 1):
            acknowledged(one, first, inert=False, certain=reach >= 0.01)
            second.answered += 1
            if number % 7 == 0 or number == 40:
                several.planned(second, 0.01)
            one.behind(15)
            if second.counted == number:
                several.behind(15)
                assert (one.count, one.blocks, first.done) == (several.count, several.blocks, second.done)
        assert first.done == 40 - 15 - SEGMENTS_AHEAD - (short is not None and short > 0)
        assert one.at_rest(38) == several.at_rest(38) == []
        assert first.done == second.done == 38
        for executed, work in ((one, first), (several, second)):
            acknowledged(executed, work, inert=False, certain=True)
            assert executed.at_rest(41) == [work]

    def test_lines_that_may_have_made_no_block_prove_nothing(self) -> None:
        executed, work = Executed(), errand(*["X1"] * 60)
        acknowledged(executed, work, inert=False, certain=True)
        for _ in range(59):
            acknowledged(executed, work, inert=False, certain=False)
        executed.in_planner(1)
        assert work.done == 0

    def test_where_the_controller_may_stand_elsewhere_three_blocks_prove_nothing(self) -> None:
        executed, work = Executed(), errand(*["X1"] * 60)
        executed.displaced()
        for _ in range(30):
            acknowledged(executed, work, inert=False, certain=True, planner=15)
        assert work.done == 30 - 15 - SEGMENTS_AHEAD
        executed.displaced()
        for _ in range(3):
            acknowledged(executed, work, inert=False, certain=True, planner=15)
        assert work.done == 30 - 15 - SEGMENTS_AHEAD
        acknowledged(executed, work, inert=False, certain=True, planner=15)
        assert work.done == 30 - 15 - SEGMENTS_AHEAD + 1


class TestPoll:
    def test_only_a_question_of_its_own_proves_a_mark(self) -> None:
        poll = Poll()
        poll.sent(0.0, 5)
        assert poll.answered(0.1, 0.2) == 5
        assert poll.answered(0.2, 0.2) is None  # unasked
        poll.sent(0.3, None)
        poll.sent(0.3 + REPEAT_S, 7)  # the answer may be to the first
        assert poll.answered(1.4, 0.2) is None


ROWS = {
    "$I": ["[VER:1.1h.20190830:MILL]", "[OPT:V,15,128]", "[AXS:3:XYZ]", "[NEWOPT:TC,SED]", "[BOARD:Uno]", "[HLP:$$]"],
    "$#": ["[G54:1.000,2.000,3.000]", "[TLO:1.500]", "[PRB:0.000,0.000,-1.000:1]"],
    "$$": ["$110=500.000", "$13=0"],
    "$N": ["$N1=G90", "$N0=G21"],
    "$G": ["[GC:G0 G54 S0]"],
}


def answered(command: GrblCommand | ClearAlarm, *rows: str) -> tuple[tuple[str, ...], list[object]]:
    asked = asking.request(command)
    for row in rows:
        message = parse_line(row.encode())
        asked.hear(message)  # type: ignore[arg-type]
    return asked.lines, list(asking.results(asked, "grbl", ()))


class TestAsking:
    @pytest.mark.parametrize(
        ("command", "lines"),
        [
            (ClearAlarm(1), ("$X",)),
            (Home(1), ("$H",)),
            (Home(1, ("x", "z")), ("$HX", "$HZ")),
            (Sleep(1), ("$SLP",)),
            (CheckMode(1, on=True), ("$C",)),
            (Restore(1, "settings"), ("$RST=$",)),
            (Restore(1, "offsets"), ("$RST=#",)),
            (Restore(1, "all"), ("$RST=*",)),
            (WriteInfo(1, "my mill"), ("$I=my mill",)),
            (WriteStartupBlock(1, 0, "G21"), ("$N0=G21",)),
            (WriteSetting(1, 110, "500"), ("$110=500", "$$")),
            (ReadFirmware(1), ("$I", "$")),
            (ReadModal(1), ("$G",)),
            (ReadOffsets(1), ("$#",)),
            (ReadSettings(1), ("$$",)),
            (ReadStartupBlocks(1), ("$N",)),
            (Jog(1, {"x": 1.0, "z": -0.5}, 600), ("$J=G91G21X1.000Z-0.500F600.0",)),
            (Jog(1, {"y": 2.0}, 600, absolute=True), ("$J=G90G21Y2.000F600.0",)),
        ],
    )
    def test_the_lines_of_a_command(self, command: GrblCommand, lines: tuple[str, ...]) -> None:
        assert asking.request(command).lines == lines

    def test_an_info_text_of_more_than_80_characters_is_refused(self) -> None:
        with pytest.raises(LocalError, match="81 characters"):
            asking.request(WriteInfo(1, "x" * 81))

    def test_firmware(self) -> None:
        event, done = answered(ReadFirmware(1), *ROWS["$I"], "[MSG:x]")[1]
        assert event == FirmwareRead(
            1, "grbl", "1.1h", "20190830", "MILL", "V", 15, 128, ("x", "y", "z"),
            {"NEWOPT": "TC,SED", "HLP": "$$", "BOARD": "Uno"},
        )  # fmt: skip
        assert done == CommandDone(1)

    def test_offsets(self) -> None:
        event = answered(ReadOffsets(1), *ROWS["$#"], "[MSG:x]")[1][0]
        assert event == OffsetsRead(
            1,
            {"G54": {"x": 1.0, "y": 2.0, "z": 3.0}, "TLO": {"z": 1.5}},
            ProbeReported({"x": 0.0, "y": 0.0, "z": -1.0}, True),
        )

    def test_settings_modal_startup_blocks_homed(self) -> None:
        assert answered(ReadSettings(1), *ROWS["$$"])[1][0] == SettingsRead(1, {110: "500.000", 13: "0"})
        assert answered(ReadModal(1), *ROWS["$G"])[1][0] == ModalRead(1, ("G0", "G54", "S0"))
        assert answered(ReadStartupBlocks(1), *ROWS["$N"])[1][0] == StartupBlocksRead(1, ("G21", "G90"))
        assert answered(Home(1, ("x",)))[1] == [Homed(("x",)), CommandDone(1)]

    def test_an_answer_without_its_rows_is_none(self) -> None:
        assert answered(ReadSettings(1))[1] == [
            CommandFailed(1, None, "the controller answered without what was asked for; try again")
        ]
        assert list(asking.results(asking.modal_question(), "grbl", ())) == []

    @pytest.mark.parametrize(
        ("number", "value", "fault"),
        [(110, "500", None), (110, "501", "500.000"), (111, "1", "nothing"), (13, "no", "reads back as 0")],
    )
    def test_a_setting_is_read_back(self, number: int, value: str, fault: str | None) -> None:
        last = answered(WriteSetting(1, number, value), *ROWS["$$"])[1][-1]
        if fault is None:
            assert last == CommandDone(1)
        else:
            assert isinstance(last, CommandFailed)
            assert fault in last.message

    def test_check_mode_that_went_the_other_way(self) -> None:
        assert isinstance(answered(CheckMode(1, on=True), "[MSG:Disabled]")[1][-1], CommandFailed)
        assert answered(CheckMode(1, on=True), "[MSG:Enabled]")[1] == [CommandDone(1)]
        assert answered(CheckMode(1, on=False), "[MSG:Disabled]")[1] == [CommandDone(1)]

    def test_a_babbler_does_not_fill_the_memory(self) -> None:
        asked = asking.request(ReadSettings(1))
        message = parse_line(b"$1=1")
        for _ in range(asking.MAX_HEARD + 10):
            asked.hear(message)  # type: ignore[arg-type]
        assert len(asked.heard) == asking.MAX_HEARD
