"""Batches: every block once, in order, within all bounds; and ends that can be told apart."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcode.clean import clean
from gcode.compact import Compactor
from gcode.held import Held
from gcode.interpreter import Interpreter, power_on
from gcode.lines import split_lines
from gcode.motion import Motion, Position
from gcode.planner import plan as seconds_of
from gcode.segments import DWELL, HOMING, Segments
from gcode.words import Block, decode_line, parse_block
from jobs.batch import BatchLimits, BatchPlanner, PlannedBatch
from jobs.upcoming import PlanError
from protocol.errors import LocalError
from tests.harness.effort import more
from tests.harness.programs import FITTING_FILES, corpus_files, elvinto, numbered, positions, program_lines, thorough

WIDE = BatchLimits(max_batch_seconds=1e9)
HERE = {"x": 0.0, "y": 0.0, "z": 5.0}


AT_ONCE = Motion(acceleration=dict.fromkeys("xyzabc", 1e12))
"""Without inertia a move takes its length by its feed."""


def planner(
    program: str, limits: BatchLimits = WIDE, *, motion: Motion | None = None, **options: object
) -> BatchPlanner:
    lines = numbered(program.replace("|", "\n"))
    return BatchPlanner(lines, elvinto(), motion or AT_ONCE, limits, **options)  # type: ignore[arg-type]


def machine(position: Position) -> Interpreter:
    """A machine that stands there, by the reference interpreter."""
    state = power_on(elvinto())
    state.locate(dict(position))
    return Interpreter(elvinto(), state)


def drain(source: BatchPlanner) -> list[PlannedBatch]:
    batches = []
    while batch := source.next():
        batches.append(batch)
    return batches


def plan(program: str, limits: BatchLimits = WIDE, **options: object) -> list[PlannedBatch]:
    return drain(planner(program, limits, **options))


def blocks(batches: list[PlannedBatch]) -> list[str]:
    return ["|".join(batch.blocks) for batch in batches]


def test_a_program_in_batches() -> None:
    batches = plan("%|O1 (part)|G21 G90|T1 M6|M3 S100|G0 X0 Y0|G1 Z-1 F300|X10 F300||M5|M30", position=HERE)
    assert blocks(batches) == ["G21G90", "T1M6", "M3S100|G0X0Y0|G1Z-1F300", "X10|M5", "M30"]
    assert [(batch.first_line, batch.last_line) for batch in batches] == [(3, 3), (4, 4), (5, 7), (8, 10), (11, 11)]
    assert [batch.barrier for batch in batches] == [False, True, False, False, True]
    assert [batch.ends_program for batch in batches] == [False, False, False, False, True]
    assert [batch.motion for batch in batches] == [False, True, True, True, False]
    assert batches[2].start == {"x": 0, "y": 0}
    assert batches[3].end == {"x": 10, "y": 0, "z": -1}
    assert batches[3].seconds == pytest.approx(2)


@pytest.mark.parametrize(
    "barrier",
    [
        "M30",
        "M99",
        "M6",
        "T5",
        "M0",
        "M1",
        "M2",
        "G27",
        "G28",
        "G29",
        "G92 X1",
        "W90",
        "M200",
        "M210",
        "G28 X1 (c)",
        "G55",
    ],
)
def test_barriers_travel_alone(barrier: str) -> None:
    batches = plan(f"G90 G0 X1|{barrier}|X2", position=HERE)
    assert [len(batch.blocks) for batch in batches] == [1, 1, 1]
    assert [batch.barrier for batch in batches] == [False, True, False]
    located = barrier.split(maxsplit=1)[0] in ("M6", "G27", "G28", "G29", "G92", "M200", "M210", "G55")
    assert batches[1].locate_after == located
    assert batches[1].ends_program == (barrier in ("M30", "M99", "M2"))


@pytest.mark.parametrize(("program", "tool"), [("T7 M6", 7), ("T3|M6", 3), ("M6", None), ("T3|T4", None)])
def test_tool_changes_say_which_tool(program: str, tool: int | None) -> None:
    last = plan(program)[-1]
    assert last.tool_change == ("M6" in program)
    assert last.tool == tool


def test_bounds() -> None:
    moves = "|".join(f"G1X{number}F6000" for number in range(100))
    by_blocks = plan(moves, BatchLimits(512, 10, 1e9), compact=False, position=HERE)
    assert {len(batch.blocks) for batch in by_blocks} == {10}
    by_bytes = plan(moves, BatchLimits(50, 1000, 1e9), compact=False, position=HERE)
    assert all(len("|".join(batch.blocks)) <= 50 for batch in by_bytes)
    assert len("|".join(by_bytes[3].blocks)) > 50 - len("|G1X99F6000")
    by_seconds = plan(moves, BatchLimits(5000, 1000, 0.105), position=HERE)
    assert {len(batch.blocks) for batch in by_seconds[1:-1]} <= {5}
    assert all(batch.seconds <= 0.105 for batch in by_seconds)


def test_a_long_move_travels_alone_with_what_prepares_it() -> None:
    batches = plan("G90|G1 X1 F60000|M3 S100|F60|X100|X101|M5", BatchLimits(max_batch_seconds=1.0), position=HERE)
    assert blocks(batches) == ["G90|G1X1F60000", "M3S100|F60|X100", "X101|M5"]
    assert [batch.seconds > 1.001 for batch in batches] == [False, True, False]


def test_a_move_of_unknown_length_travels_alone() -> None:
    batches = plan("G90 G0 X1|G0 Z5|X2 Y2|X3", position={"x": 0.0, "y": 0.0})
    assert blocks(batches) == ["G90G0X1", "Z5", "X2Y2|X3"]


def test_a_line_that_cannot_be_sent_is_named() -> None:
    with pytest.raises(PlanError, match=r"line 2: .* 21 bytes") as error:
        plan("G1 X1|G1 X1.234567890123 Y2.345|M30", BatchLimits(max_batch_bytes=20))
    assert error.value.line == 2
    with pytest.raises(PlanError, match="line 3: column 5"):
        plan("G1 X1||G1 X[1]")


def test_nothing_behind_a_gap_is_planned() -> None:
    source = planner("G0 X1|G0 X[2]|G0 X3")
    for _ in range(3):
        with pytest.raises(PlanError, match="line 2"):
            source.next()

    def torn() -> Iterator[tuple[int, bytes]]:
        yield 1, b"G0 X1"
        raise OSError("the disk is gone")

    source = BatchPlanner(torn(), elvinto(), Motion(), WIDE)
    for _ in range(3):
        with pytest.raises(OSError, match="gone"):
            source.next()


def test_block_delete_and_inches() -> None:
    assert blocks(plan("G0 X1|/G0 X2|G0 X3", compact=False)) == ["G0X1", "G0X2|G0X3"]
    assert blocks(plan("G0 X1|/G0 X[2]|G0 X3", compact=False, block_delete=True)) == ["G0X1", "G0X3"]
    (batch,) = plan("G20 G0 X1", convert_inches=True, position=HERE)
    assert batch.blocks == ("G21G0X25.4",)
    assert batch.end["x"] == 25.4


def test_skipping_into_inches() -> None:
    program = "G90 G1 X1 F9|G20 F10|X2|G21|X3"
    in_inches = [planner(program, convert_inches=True, skip_to=line).in_inches for line in (2, 3, 4, 5)]
    assert in_inches == [False, True, True, False]
    source = planner(program, convert_inches=True, skip_to=3)
    assert source.state.feed == 254
    assert blocks(drain(source))[0].startswith("X50.8")
    assert not planner(program, skip_to=3).in_inches


# --- ends that can be told apart after a crash (elvinto §5.4) ----------------------------------------------------


def test_a_batch_does_not_end_where_it_began() -> None:
    (first, second, third) = plan("G0 X10|Y10|X0|Y0", position=HERE)
    assert blocks([first, second, third]) == ["G0X10|Y10", "X0", "Y0"]
    ends = [first.start, first.end, second.end, third.end]
    assert all(one != two for one, two in pairwise(ends))
    assert all(one != two for one, two in zip(ends, ends[2:], strict=False))


def test_nor_where_the_one_before_began() -> None:
    batches = plan("G0 X10|X20|X10|X0|X5|X7", BatchLimits(max_batch_blocks=2, max_batch_seconds=1e9), position=HERE)
    starts = [batch.start for batch in batches]
    for before, start, batch in zip([{}, *starts], starts, batches, strict=False):
        assert batch.end != start
        assert batch.end != before


def test_a_circle_that_cannot_be_divided_is_sent_all_the_same() -> None:
    assert blocks(plan("G90|G2 X0 Y0 I5 F100", position=HERE)) == ["G90|G2X0Y0I5F100"]


def test_still_blocks_do_not_end_a_batch() -> None:
    batches = plan(
        "G0 X1|X2|M3 S1|F100|G1 X3|X4", BatchLimits(max_batch_blocks=4, max_batch_seconds=1e9), position=HERE
    )
    assert blocks(batches) == ["G0X1|X2", "M3S1|F100|G1X3|X4"]


# --- positions --------------------------------------------------------------------------------------------------


def test_relocate_after_a_barrier() -> None:
    source = planner("G90 G0 X1 F9|G28|G1 X1 F9|M30", position=HERE)
    assert source.next() is not None
    home = source.next()
    assert home is not None
    assert home.end == {"x": 0, "y": 0}
    source.relocate({"x": 0.0, "y": 0.0, "z": 80.0})
    after = source.next()
    assert after is not None
    assert after.start == {"x": 0, "y": 0, "z": 80}
    assert after.blocks == ("G1X1F9",)


def test_relocate_in_the_middle_is_refused() -> None:
    source = planner("G0 X1|X2|X3", BatchLimits(max_batch_blocks=1), position=HERE)
    source.next()
    with pytest.raises(LocalError):
        source.relocate({"x": 9.0})


def test_the_end_of_a_program_is_the_end() -> None:
    source = planner("(nothing)|%")
    assert source.next() is None
    assert source.next() is None


def test_compaction_after_a_skip_begins_from_nothing() -> None:
    program = "G90 G1 X1 Y1 F100|G1 X2 Y1 F100|G1 X3 Y1 F100"
    assert blocks(plan(program, position=HERE)) == ["G90G1X1Y1F100|X2|X3"]
    assert blocks(plan(program, position=HERE, skip_to=2)) == ["G1X2Y1F100|X3Y1"]


def test_lines_need_not_begin_at_one() -> None:
    lines = [(40, b"G91"), (41, b"G0 X1"), (42, b"X2"), (43, b"X3")]
    source = BatchPlanner(lines, elvinto(), Motion(), WIDE, skip_to=42)
    source.relocate(HERE)
    (batch,) = drain(source)
    assert (batch.first_line, batch.last_line, batch.end["x"]) == (42, 43, 5)


def test_lines_that_come_several_at_once_are_the_same_lines() -> None:
    program = b"G90 G0 X1\n\nX2\nM6 T2\nG1 X3 F100\nX4 (end)\nX5\nX6\nM30\n"
    lines = [*enumerate(program.splitlines(), 40)]
    runs = [(40, b"G90 G0 X1\n\nX2\n"), (43, b"M6 T2"), (44, b"G1 X3 F100\nX4 (end)\nX5\nX6\nM30\n")]
    for options in ({}, {"skip_to": 43}, {"skip_to": 46}):
        alike = [drain(BatchPlanner(given, elvinto(), Motion(), WIDE, **options)) for given in (lines, runs)]  # type: ignore[arg-type]
        assert alike[0] == alike[1]
        assert alike[0][-1].last_line == 48


# --- properties -------------------------------------------------------------------------------------------------

programs = st.lists(program_lines, max_size=30)
limits = st.builds(
    BatchLimits,
    max_batch_bytes=st.integers(40, 120),
    max_batch_blocks=st.integers(1, 8),
    max_batch_seconds=st.sampled_from((0.05, 1.0, 30.0)),
)


def _certain(block: Block, moved: Segments) -> bool:
    """Every axis that moved, or may have, was known before and is known after."""
    lost_start, lost_end = np.isnan(moved.start), np.isnan(moved.end)
    named = [moved.row(word.letter) for word in block.words if word.letter in moved.axes]
    return not (HOMING in moved.kind or (lost_start != lost_end).any() or lost_end[named].any())


@given(programs, limits, positions, st.booleans())
@thorough
def test_every_block_once_in_order_within_all_bounds(
    lines: list[str], bounds: BatchLimits, position: Position, compact: bool
) -> None:
    batches = plan("\n".join(lines), bounds, position=position, compact=compact)
    sent = [block for batch in batches for block in batch.blocks]
    read = [(line, parse_block(text)) for line, text in enumerate(lines, 1) if clean(parse_block(text))]
    if not compact:
        assert sent == [clean(block) for _, block in read]
    assert len(sent) == len(read)
    follower = machine(position)
    at = 0
    for batch in batches:
        here = read[at : at + len(batch.blocks)]
        at += len(batch.blocks)
        assert (batch.first_line, batch.last_line) == (here[0][0], here[-1][0])
        assert batch.start == follower.state.place()
        costs = []
        for line, block in here:
            follower.step(line, block)
            moved = follower.take()
            costs.append((float(seconds_of(moved, AT_ONCE).sum()), _certain(block, moved)))
            assert batch.motion or all(kind == DWELL for kind in moved.kind)
        assert batch.end == follower.state.place()
        timed = [cost for cost in costs if cost != (0.0, True)]
        assert all(certain for _, certain in timed) or len(timed) == 1
        assert len(timed) <= 1 or batch.seconds <= bounds.max_batch_seconds
        if all(certain for _, certain in costs):
            assert batch.seconds == pytest.approx(sum(seconds for seconds, _ in costs), rel=1e-3, abs=1e-3)
        assert len("|".join(batch.blocks)) <= bounds.max_batch_bytes
        assert len(batch.blocks) <= bounds.max_batch_blocks
        assert not batch.barrier or len(batch.blocks) == 1
        barrier_letters = {word.letter for _, block in here for word in block.words} & set("TW")
        assert batch.barrier or not barrier_letters


@given(programs, positions)
@thorough
def test_what_is_sent_is_the_same_motion(lines: list[str], position: Position) -> None:
    """Through all batches, with relocation to where the machine is: the machine ends where the program leads."""
    tool, program = machine(position), machine(position)
    source = planner("\n".join(lines), BatchLimits(max_batch_blocks=5), position=position)
    while batch := source.next():
        for block in batch.blocks:
            tool.step(1, parse_block(block))
        assert tool.state.place() == batch.end
    for line in lines:
        program.step(1, parse_block(line))
    assert (tool.state.place(), tool.state.modes()) == (program.state.place(), program.state.modes())


@given(programs, st.integers(1, 32), positions)
@thorough
def test_skipping_follows_the_program_as_sending_does(lines: list[str], skip_to: int, position: Position) -> None:
    text = "\n".join(lines)
    whole = plan(text, position=position, compact=False)
    source = planner(text, position=position, compact=False, skip_to=skip_to)
    before = machine(position)
    for line in lines[: skip_to - 1]:
        before.step(1, parse_block(line))
    assert (source.position, source.state.modes()) == (before.state.place(), before.state.modes())
    rest = drain(source)
    sent = [block for batch in whole for block in batch.blocks]
    sent_after = [block for batch in rest for block in batch.blocks]
    assert sent_after == sent[len(sent) - len(sent_after) :]
    assert not rest or rest[0].first_line >= skip_to
    assert not rest or rest[-1].end == whole[-1].end


@given(programs)
@thorough
def test_a_skip_sends_what_a_machine_in_that_state_needs(lines: list[str]) -> None:
    """After a skip nothing is left out that the machine has not been told since."""
    for skip_to in range(1, len(lines) + 1, 5):
        source = planner("\n".join(lines), skip_to=skip_to)
        fresh = Compactor(elvinto())
        for batch in drain(source):
            for text in batch.blocks:
                assert fresh.compact(parse_block(text)) == text


@pytest.mark.slow
@pytest.mark.parametrize("name", FITTING_FILES)
def test_a_fitting_program_is_planned_whole(name: str) -> None:
    (path,) = [path for path in corpus_files() if path.name == name]
    lines = list(split_lines([path.read_bytes()]))[: more(2_000)]
    blocks = sum(bool(parse_block(decode_line(raw)).words) for raw in lines)
    bounds = BatchLimits()
    source = BatchPlanner(enumerate(lines, 1), elvinto(), Motion(), bounds, position={})
    planned = 0
    previous = 0
    while batch := source.next():
        planned += len(batch.blocks)
        assert batch.first_line > previous
        previous = batch.last_line
        assert len("|".join(batch.blocks)) <= bounds.max_batch_bytes
        assert len(batch.blocks) <= bounds.max_batch_blocks
    assert planned == blocks


def test_a_long_stretch_without_a_block_is_read_piece_by_piece() -> None:
    lines = [(n, b"(a page of comments)") for n in range(1, 2101)] + [(2101, b"G1X1F100"), (2102, b"(the end)")]
    reader = BatchPlanner(lines, elvinto(), Motion(), BatchLimits(), position={"x": 0.0})
    pieces = []
    while (batch := reader.next(aside=True)) is None:
        assert reader.next(aside=True) is None, "nothing is read before somebody has the time"
        pieces.append(reader.reading)
        reader.read()
    assert pieces == [True] * 3, "two pieces, and that nothing comes behind them"
    assert (batch.first_line, batch.blocks) == (2101, ("G1X1F100",))
    assert reader.next() is None


def test_a_program_begins_in_the_modes_that_the_controller_says() -> None:
    """It was put into G91 by hand: the first move ends one further, not at 1."""
    for modal, absolute, end in ((("G91",), True, 4.0), (("G90",), False, 1.0), ((), True, 1.0)):
        (batch,) = plan("G1 X1 F60", held=Held(modal), position={"x": 3.0}, absolute=absolute)
        assert batch.end["x"] == end, modal
