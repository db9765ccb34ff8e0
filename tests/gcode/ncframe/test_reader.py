"""Lines to frames as blocks of a job: stops alone, times, places, skipping, and lines that cannot be sent."""

import tracemalloc
from collections.abc import Iterator
from math import isnan

import pytest

from gcode.motion import Motion
from gcode.ncframe.reader import LINES_AT_ONCE, FrameBlock, FrameReader, TranslationError
from gcode.ncframe.rules import FrameRules
from tests.harness.frameprograms import LATHE, ORIGIN, frames

PROGRAM = "G0 X10 Z5|G1 X8 F120 M3 S9|M0|Z-4|T2 M6|G2 X12 Z-8 R4|M30"
MOTION = Motion(max_rate={"x": 600.0, "z": 600.0}, acceleration={"x": 1e6, "z": 1e6})


def lines(program: str) -> Iterator[tuple[int, bytes]]:
    return enumerate(program.encode().split(b"|"), 1)


def reader(program: str, *, skip_to: int = 1, **rules: object) -> FrameReader:
    return FrameReader(lines(program), LATHE, MOTION, FrameRules(**rules), ORIGIN, skip_to=skip_to)  # type: ignore[arg-type]


def drained(made: FrameReader, most_lines: int = 100) -> list[list[FrameBlock]]:
    groups = []
    while not made.ended:
        found, _ = made.more(most_lines)
        if found:
            groups.append(found)
    assert made.more(most_lines) == ([], 0)
    return groups


def test_it_gives_the_frames_of_the_translation_and_every_stop_alone() -> None:
    groups = drained(reader(PROGRAM))
    assert [block.text for group in groups for block in group] == frames(PROGRAM)
    stops = [group for group in groups if group[0].barrier]
    assert [[block.text for block in group] for group in stops] == [["M0"], ["M6 T2"], ["M30"]]
    assert stops[1][0].tool == 2
    assert [group[0].barrier and group[0].barrier.ends_program for group in stops] == [False, False, True]


def test_nothing_behind_a_stop_is_read_before_it_is_asked_for() -> None:
    taken = []

    def watched() -> Iterator[tuple[int, bytes]]:
        for number, raw in lines(PROGRAM):
            taken.append(number)
            yield number, raw

    made = FrameReader(watched(), LATHE, MOTION, FrameRules(), ORIGIN)
    found, count = made.more(100)
    assert (len(found), count, taken) == (2, 3, [1, 2, 3])
    assert made.more(100)[0][0].text == "M0"
    assert taken == [1, 2, 3]


@pytest.mark.parametrize("most_lines", [1, 2, 1000])
def test_how_many_lines_at_a_time_changes_nothing(most_lines: int) -> None:
    program = "|".join(f"G1 X{n % 7} Z{n % 5} F100" for n in range(600))
    texts = [block.text for group in drained(reader(program), most_lines) for block in group]
    assert texts == frames(program)


def test_no_more_lines_are_read_at_once_than_a_pause_can_wait_for() -> None:
    assert reader("|".join(["G0 X1", "X2"] * 600)).more(10_000)[1] == LINES_AT_ONCE


def test_every_motion_is_planned_from_rest_to_rest() -> None:
    blocks = [block for group in drained(reader("G0 X10|G1 X20 F120|Z10|G2 X20 Z10 K-5|M8")) for block in group]
    # 10 mm at 600 mm/min; 10 mm at 120; the two halves of a circle of 31.4 mm.
    assert [block.seconds for block in blocks] == pytest.approx([1.0, 5.0, 5.0, 7.85, 7.85, 0.0], abs=0.1)
    assert [block.moves for block in blocks] == [True] * 5 + [False]
    assert all(block.cost_s == block.seconds for block in blocks)


def test_a_dwell_takes_its_time_and_moves_nothing() -> None:
    block = reader("G4 P1.5").more(1)[0][0]
    assert (block.text, block.seconds, block.moves) == ("G4 X1500", 1.5, False)


def test_places_are_those_behind_each_frame() -> None:
    made = reader("G0 X10|G50 X0|X1;Z3|M0|X5")
    first = made.more(10)[0]
    assert [block.end for block in first] == [(10.0, 0.0), (11.0, 0.0), (11.0, 3.0)]
    assert made.place == (11.0, 3.0)


def test_the_machine_is_relocated_behind_a_stop() -> None:
    made = reader("G0 X10 Z10|M0|X20 Z20")
    made.more(10)
    with pytest.raises(ValueError, match="relocated"):
        made.relocate({"x": 0.0, "z": 0.0})
    made.more(10)
    made.relocate({"x": 15.0, "z": 12.0})
    assert made.place == (15.0, 12.0)
    assert made.more(10)[0][0].text == "G0 X5000 Z8000"


def test_it_cannot_be_relocated_while_moves_wait_for_their_corners() -> None:
    made = reader("G42 G1 X10 Z0 F9|Z-5|M0|Z-9|G40|G0 X20", tool_radius_mm=0.4)
    made.more(2)
    assert not made.settled
    with pytest.raises(ValueError, match="corner"):
        made.relocate({"x": 0.0, "z": 0.0})
    texts = [[block.text for block in group] for group in drained(made)]
    assert ["M0"] in texts


def test_lines_before_the_start_are_followed_and_not_sent() -> None:
    made = reader("G91 G1 X10 F50 S3 T1|X10|X5|X1 Z2", skip_to=3)
    made.relocate({"x": 20.0, "z": 0.0})
    assert [block.text for block in made.more(10)[0]] == ["G1 X5000 F50 S3", "X1000 Z2000"]
    assert made.place == (26.0, 2.0)


def test_a_line_that_cannot_be_sent_raises_behind_all_that_can() -> None:
    made = reader("G0 X1|X2|X9999999|X3")
    assert [block.line for block in made.more(10)[0]] == [1, 2]
    for _ in range(2):
        with pytest.raises(TranslationError, match="line 3: column 1: X9999997000 does not fit") as raised:
            made.more(10)
        assert raised.value.line == 3
    assert not made.ended


def test_a_line_with_an_error_sends_nothing_of_itself() -> None:
    made = reader("G0 X1;X2;Y5")
    with pytest.raises(TranslationError, match="line 1"):
        made.more(10)


def test_an_unknown_place_is_told_as_such() -> None:
    made = FrameReader(lines("G91 G0 X1"), LATHE, Motion(), FrameRules())
    assert all(map(isnan, made.place))
    assert made.more(1)[0][0].text == "G0 X1000"
    assert not made.in_inches


def test_block_delete_and_encodings() -> None:
    raw = "G0 X1|/X2|X3 (до упора)".encode("cp1251").split(b"|")
    made = FrameReader(enumerate(raw, 1), LATHE, MOTION, FrameRules(block_delete=True, encoding="cp1251"), ORIGIN)
    assert [block.text for block in made.more(9)[0]] == ["G0 X1000", "X2000"]


def test_memory_does_not_grow_with_the_program() -> None:
    def peak(count: int) -> int:
        program = ((n, b"G1 X%d Z%d F100" % (n % 7, n % 5)) for n in range(1, count))
        made = FrameReader(program, LATHE, MOTION, FrameRules(), ORIGIN)
        tracemalloc.start()
        while not made.ended:
            made.more(LINES_AT_ONCE)
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return used

    peak(600)
    assert peak(2_000) < 1.4 * peak(600)
