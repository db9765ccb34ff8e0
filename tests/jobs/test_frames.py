"""jobs/frames.py: every place in a program is one that a job can go on from, and nothing comes twice."""

from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode.motion import Motion
from gcode.ncframe.rules import FrameRules
from gcode.profile import load_profile
from jobs.batch import BatchLimits, BatchPlanner, PlannedBatch
from jobs.frames import Behind, FrameBlocks
from jobs.stretch import Upcoming
from jobs.upcoming import PlanError
from protocol.errors import LocalError

PROFILE = load_profile("ncframe-lathe")
LIMITS = BatchLimits(max_batch_bytes=2000, max_batch_blocks=4, max_batch_seconds=5.0, position_tolerance_mm=None)
PART = b"""G21 G90
M8 M3 S3 (two frames)
F100
G1 X2.0004 Z-1.0003 F240
F120; X2.5; M0 X3; F100
G91 X0.0004 Z-0.6667
G3 I-2 K0
G90 G42 D1 G1 X4 Z-4
X4 Z-9; M9
X6 Z-9 G40
T2
T3 M6 X7
X8 M0; X9
M30
"""
RULES = FrameRules(tools={1: 0.2})
HERE = {"x": 0.0, "z": 0.0}


def blocks(text: bytes = PART, behind: Behind = Behind(), position: dict[str, float] | None = None) -> FrameBlocks:  # noqa: B008
    lines = list(enumerate(text.split(b"\n"), 1))
    return FrameBlocks(lines, PROFILE, Motion(), RULES, HERE if position is None else position, behind)


def all_of(reader: FrameBlocks, at_once: int = 256) -> list[Upcoming]:
    found: list[Upcoming] = []
    while not reader.ended:
        found += given_out(reader, at_once)
    return found


def given_out(reader: FrameBlocks, at_once: int) -> list[Upcoming]:
    more = reader.more(at_once)
    assert not more.texts or more.alone is None, "a stop comes alone"
    return [*map(more.one, range(len(more.texts))), *([] if more.alone is None else [more.alone])]


def place_behind(one: Upcoming) -> Behind:
    return Behind(one.line - 1, one.part) if one.part else Behind(one.line)


def does(items: Iterable[Upcoming]) -> list[tuple[int, frozenset[str], tuple[float, ...]]]:
    """What frames do, without the modes that they say."""
    return [
        (one.line, frozenset(word for word in one.text.split() if word[0] in "MXZR"), one.end)
        for one in items
        if set("MXZR") & {word[0] for word in one.text.split()}
    ]


WHOLE = all_of(blocks())
LINE_5 = [("F120", 1), ("X500", 2), ("X500", 3), ("M0", 4), ("F100", 0)]
"""Text, and the part behind it: only what does something counts."""


def test_a_line_that_goes_on_says_how_far_it_is() -> None:
    assert [(one.text, one.part) for one in WHOLE if one.line == 5] == LINE_5
    assert all(one.part == 0 for one in WHOLE if one.line in (4, 6, 11))
    assert WHOLE[-1].part == 0


def test_only_m0_pauses() -> None:
    assert [one.text.split()[0] for one in WHOLE if one.barrier is not None and one.barrier.pauses] == ["M0", "M0"]


@pytest.mark.parametrize("at", range(len(WHOLE)))
def test_behind_every_frame_comes_the_rest_and_nothing_else(at: int) -> None:
    reader = blocks(behind=place_behind(WHOLE[at]))
    reader.skip()
    rest = all_of(reader)
    assert does(rest) == does(WHOLE[at + 1 :])
    assert not {one.text for one in rest if one.line < WHOLE[at].line}


@pytest.mark.parametrize("at", range(len(WHOLE)))
def test_the_first_frame_behind_a_place_says_the_modes(at: int) -> None:
    """Somebody may have moved by hand since: every later frame counts on them."""
    modes: dict[str, str] = {}
    for one in WHOLE[: at + 1]:
        modes |= {w[0]: w for w in one.text.split() if w[0] in "FS" or w in ("G0", "G1", "G2", "G3")}
    rest = all_of(blocks(behind=place_behind(WHOLE[at])))
    if rest:
        said = {word[0]: word for word in rest[0].text.split()}
        assert modes.keys() <= said.keys()


def test_where_it_stands_is_held_against_the_machines_account() -> None:
    at = next(number for number, one in enumerate(WHOLE) if one.line == 6)
    x, z = WHOLE[at].end
    reader = blocks(behind=place_behind(WHOLE[at]))
    reader.relocate({"x": x, "z": z})
    assert reader.place == (x, z)
    with pytest.raises(LocalError, match="have changed since"):
        blocks(behind=place_behind(WHOLE[at])).relocate({"x": x, "z": z + 0.01})
    other = FrameBlocks(list(enumerate(PART.split(b"\n"), 1)), PROFILE, Motion(), FrameRules(0.01), HERE, Behind(4))
    with pytest.raises(LocalError):
        other.relocate({"x": 2.0, "z": -1.5})


def test_everything_is_behind() -> None:
    reader = blocks(behind=Behind(99))
    reader.skip()
    assert reader.ended
    assert given_out(reader, 10) == []


def test_a_line_that_cannot_be_sent_comes_behind_all_that_can() -> None:
    reader = blocks(b"G1 X1 F100\nX2\nX3 Q7\nX4\n")
    found: list[str] = []
    while len(found) < 2:
        found += [one.text for one in given_out(reader, 1)]
    with pytest.raises(PlanError, match="line 3"):
        reader.more(1)
    assert not reader.ended


def test_an_error_in_what_is_behind_is_told_when_blocks_are_asked_for() -> None:
    reader = blocks(b"G1 X1 Q7\nX2 F100\n", behind=Behind(1))
    reader.skip()
    with pytest.raises(PlanError, match="line 1"):
        reader.more(1)


def planned(behind: Behind = Behind(), limits: BatchLimits = LIMITS) -> list[PlannedBatch]:  # noqa: B008
    planner = BatchPlanner.over(blocks(behind=behind), limits)
    found: list[PlannedBatch] = []
    while (batch := planner.next(aside=True)) is not None or planner.reading:
        if batch is None:
            planner.read()
        else:
            found.append(batch)
    return found


def test_every_frame_is_in_exactly_one_batch_and_stops_travel_alone() -> None:
    batches = planned()
    assert [text for batch in batches for text in batch.blocks] == [one.text for one in WHOLE]
    assert [batch.blocks for batch in batches if batch.barrier] == [(one.text,) for one in WHOLE if one.barrier]
    assert [batch.pauses for batch in batches if batch.barrier].count(True) == 2
    for before, after in pairwise(batches):
        assert before.end == after.start


@settings(max_examples=40, deadline=None)
@given(number=st.integers(0, 100), blocks_done=st.integers(1, 4))
def test_a_batch_that_is_cut_loses_nothing(number: int, blocks_done: int) -> None:
    batches = [batch for batch in planned() if len(batch.blocks) > 1]
    batch = batches[number % len(batches)]
    done = 1 + (blocks_done - 1) % (len(batch.blocks) - 1)
    first, rest = batch.cut(done, {"x": 1.0})
    assert first.blocks + rest.blocks == batch.blocks
    assert (first.end, rest.start, rest.end) == ({"x": 1.0}, {"x": 1.0}, batch.end)
    assert first.seconds + rest.seconds == pytest.approx(batch.seconds)
    assert [first.line_of(block) for block in range(done)] == [batch.line_of(block) for block in range(done)]
    assert rest.line_of(0) == batch.line_of(done) == rest.first_line
    behind = first.line_behind(done - 1)
    assert behind == first.last_line - bool(first.part)
    again = all_of(blocks(behind=Behind(behind, first.part)))
    texts = [text for one in planned() for text in one.blocks]
    assert len(again) >= len(texts) - texts.index(rest.blocks[0]) - 3
