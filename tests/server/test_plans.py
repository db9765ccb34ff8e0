"""From rows to planners: from the start, from the middle, after a crash."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from jobs.batch import PlannedBatch
from jobs.program import ProgramStore, UnknownProgramError
from jobs.restart import CannotStartError
from server.config import MachineConfig
from server.plans import PREVIEW_BLOCKS, Planning, Workpiece

TEXT = b"G90\nG1 X1 F600\nG1 X2\nG1 X3\nG1 X4\nM30\n"


@pytest.fixture
def store(tmp_path: Path) -> ProgramStore:
    return ProgramStore(tmp_path)


def row(store: ProgramStore, text: bytes = TEXT, **changes: Any) -> dict[str, Any]:
    with store.writer("part.nc") as writer:
        writer.write(text)
        info = writer.finish()
    return {"program": info.id, "start_line": 1, "end_line": info.lines} | changes


def piece(**elvinto: Any) -> Workpiece:
    return Workpiece.of(MachineConfig.model_validate({"name": "r", "port": "sim:", "elvinto": elvinto}))


def batches(planner: Any) -> Iterator[PlannedBatch]:
    while (batch := planner.next()) is not None:
        yield batch


def blocks(planner: Any) -> list[str]:
    return [block for batch in batches(planner) for block in batch.blocks]


def test_from_the_start_nothing_is_said_that_the_program_does_not_say(store: ProgramStore) -> None:
    plan = Planning(store).start(piece(), row(store), line=1, position={"x": 0.0}, absolute=True)
    assert plan.prologue == ()
    assert blocks(plan.planner) == ["G90", "G1X1F600", "X2", "X3", "X4", "M30"]


def test_only_up_to_the_last_line(store: ProgramStore) -> None:
    plan = Planning(store).start(piece(), row(store, end_line=3), line=1, position={}, absolute=True)
    assert blocks(plan.planner)[-1] == "X2"


def test_from_the_middle_with_what_was_left_out_said_first(store: ProgramStore) -> None:
    plan = Planning(store).start(piece(), row(store), line=4, position={"x": 9.0}, absolute=True)
    assert plan.prologue == ("G90", "G1", "F600")
    found = list(batches(plan.planner))
    assert [block for batch in found for block in batch.blocks] == ["G90", "G1", "F600", "X3", "X4", "M30"]
    assert (found[0].first_line, found[0].last_line) == (3, 5), "the line before stands for what is said first"
    assert found[0].start == {"x": 9.0}


def test_inches_are_converted_once(store: ProgramStore) -> None:
    inches = row(store, b"G20 G90\nG1 X1 F10\nG1 X2\nM30\n")
    plan = Planning(store).start(piece(convert_inches=True), inches, line=3, position={"x": 25.4}, absolute=True)
    sent = blocks(plan.planner)
    assert "F254" in sent
    assert any("X50.8" in block for block in sent)


def test_after_a_crash_the_machine_goes_on_without_a_prologue(store: ProgramStore) -> None:
    planner = Planning(store).go_on(piece(), row(store), line=4)
    planner.relocate({"x": 2.0})
    assert blocks(planner) == ["G1X3", "X4", "M30"]


def test_a_mode_that_nobody_wrote_down_leaves_nothing_out(store: ProgramStore) -> None:
    silent = row(store, b"G1 X1 F600\nG1 X1\nG1 X1 Y0\nG1 X1 Y1\n")
    planner = Planning(store).go_on(piece(), silent, line=3)
    planner.relocate({"x": 1.0, "y": 0.0})
    assert blocks(planner) == ["G1X1Y0", "X1Y1"], "in G91 every word of it moves"


def test_a_preview_is_bounded(store: ProgramStore) -> None:
    long = row(store, b"G90\n" + b"".join(b"G1 X%d F600\n" % i for i in range(5000)))
    planning = Planning(store)
    plan = planning.start(piece(), long, line=1, position={}, absolute=True)
    assert 0 < len(planning.preview(plan)) <= PREVIEW_BLOCKS


def test_a_program_that_is_gone(store: ProgramStore) -> None:
    gone = row(store) | {"program": "f" * 64}
    with pytest.raises(UnknownProgramError):
        Planning(store).start(piece(), gone, line=1, position={}, absolute=True)
    with pytest.raises(UnknownProgramError):
        Planning(store).go_on(piece(), gone, line=3)


def test_a_plan_that_is_given_up_holds_no_file_open(store: ProgramStore) -> None:
    planning = Planning(store)
    for line in (1, 3):
        planning.start(piece(), row(store), line=line, position={}, absolute=True)
    # An open file that nobody closes is a ResourceWarning, and warnings are errors here.


def test_the_check_knows_the_machine(store: ProgramStore) -> None:
    planning = Planning(store)
    inches = row(store, b"G20 G90\nG1 X1 F10\nM30\n")["program"]
    assert planning.check(piece(), inches)["errors"]
    assert not planning.check(piece(convert_inches=True), inches)["errors"]


def test_whether_coordinates_are_absolute_is_not_taken_from_a_machine_in_g91(store: ProgramStore) -> None:
    """Somebody said G91 by hand while the job was interrupted; a program that never says G90 must not go on in it."""
    silent = row(store, b"G1 X1 F600\nG1 X2\nG1 X3\nM30\n")
    with pytest.raises(CannotStartError, match="G91"):
        Planning(store).start(piece(), silent, line=3, position={"x": 2.0}, absolute=False)
    plan = Planning(store).start(piece(), silent, line=3, position={"x": 2.0}, absolute=True)
    assert plan.prologue == ("G90", "G1", "F600")


@pytest.mark.parametrize("text", [b"G91\nG1 X1 Y2 F600\nX1\nM30\n", b"G90\nG1 X1 Y2 F600\nX2\nM30\n"])
def test_a_drawing_begins_at_the_zero_of_the_program(store: ProgramStore, text: bytes) -> None:
    planning, profile = Planning(store), piece().profile
    (found,) = [part for part in planning.motion_of(row(store, text)["program"], profile) if len(part)]
    assert found.start[:2].T.tolist() == [[0.0, 0.0], [1.0, 2.0]]
    assert found.end[:2].T.tolist() == [[1.0, 2.0], [2.0, 2.0]]
    assert not found.start[2:].any()
