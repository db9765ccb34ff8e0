"""Whole programs: nothing is lost within the window, and motion takes as long as on the firmware (gcode §5)."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.harness.grblconsole import Console, stream
from tests.harness.programs import corpus_files

ROUTER = {110: 8000, 111: 8000, 112: 2000, 120: 200, 121: 200, 122: 100, 100: 100, 101: 100, 102: 100, 32: 1}
"""The machine on which the unmodified firmware was measured."""


@pytest.mark.parametrize(
    ("name", "lines", "firmware_s"), [("gsender_mb31.nc", 700, 10.887), ("freecad_latch.nc", 1400, 36.789)]
)
def test_within_a_quarter_of_a_percent_of_the_firmware(name: str, lines: int, firmware_s: float) -> None:
    path = next((path for path in corpus_files() if path.name == name), None)
    assert path is not None, f"the corpus has no {name}"
    console = Console(dollar=ROUTER)
    program = [line.translate(None, b"?!~\r") + b"\n" for line in path.read_bytes().splitlines()[:lines]]
    assert set(stream(console, program)) <= {"ok", "[MSG:Pgm End]"}
    assert console.machine.dropped_bytes == 0
    ends = [move.ended_at for line in console.machine.executed for move in line.moves]
    assert ends[-1] == pytest.approx(firmware_s, rel=0.0025)


_coordinate = st.integers(-400, 400).map(lambda value: value / 20)
_lines = st.one_of(
    st.builds(lambda x, y, f: f"G1X{x}Y{y}F{f}", _coordinate, _coordinate, st.sampled_from((60, 600, 6000))),
    st.builds(lambda x, z: f"G0X{x}Z{z} (comment)", _coordinate, _coordinate),
    st.builds(lambda x, i: f"G2X{x}I{i}", _coordinate, _coordinate),
    st.sampled_from(("M3S100", "G4P0.2", "G91", "G90", "M8", "G20", "G21", "G999", "", "G92X1", "M5")),
)


@settings(deadline=None, max_examples=40)
@given(st.lists(_lines, max_size=30), st.sampled_from((80, 128)))
def test_within_the_window_nothing_is_lost_and_all_is_executed_in_order(lines: list[str], window: int) -> None:
    console = Console(speed_factor=5.0)
    said = stream(console, [f"{line}\n".encode() for line in lines], window=window)
    assert len(said) == len(lines)
    machine = console.machine
    assert (machine.dropped_bytes, machine.overflows) == (0, 0)
    assert machine.most_waiting_bytes <= window
    taken = [line.upper().replace(" (COMMENT)", "") for line, answer in zip(lines, said, strict=True) if answer == "ok"]
    assert [line.text for line in machine.executed] == [text for text in taken if text]
    begun = [move.began_at for line in machine.executed for move in line.moves]
    assert all(line.finished for line in machine.executed)
    assert begun == sorted(begun)  # type: ignore[type-var]


@settings(deadline=None, max_examples=40)
@given(st.lists(_lines, max_size=20))
def test_each_block_begins_where_the_one_before_ended(lines: list[str]) -> None:
    console = Console(instant=True)
    stream(console, [f"{line}\n".encode() for line in lines])
    moves = [move for line in console.machine.executed for move in line.moves]
    for before, after in pairwise(moves):
        assert math.dist(before.end, after.start) < 1e-9


@settings(deadline=None, max_examples=60)
@given(
    st.lists(_lines, max_size=12),
    st.lists(st.tuples(st.sampled_from(b"!~?\x90\x92\x97\x84\xa0"), st.floats(0, 2)), max_size=8),
)
def test_holds_and_overrides_change_when_not_where(lines: list[str], presses: list[tuple[int, float]]) -> None:
    plain, pressed = Console(instant=True), Console()
    program = [f"{line}\n".encode() for line in lines if len(line) < 30]
    data = b"".join(program)[:120]
    plain.tell(data)
    pressed.tell(data)
    for byte, seconds in presses:
        pressed.tell(bytes([byte]))
        pressed.wait(seconds)
    for _ in range(30):
        pressed.rest()
        if pressed.machine.state.value == "Idle" and not len(pressed.machine.core.ring):
            break
        pressed.tell("~")
    assert plain.machine.dropped_bytes == pressed.machine.dropped_bytes == 0
    assert pressed.place() == plain.place()
    assert [line.text for line in pressed.machine.executed] == [line.text for line in plain.machine.executed]
