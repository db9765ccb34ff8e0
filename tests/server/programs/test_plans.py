"""From rows to planners: from the start, from the middle, after a crash."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gcode.held import Held
from gcode.reentry import Way
from jobs.batch import PlannedBatch
from jobs.program import ProgramStore, UnknownProgramError
from jobs.restart import CannotStartError
from server.config.model import MachineConfig
from server.programs.plans import PREVIEW_BLOCKS, Entry, Planning
from server.programs.workpiece import Workpiece

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


# --- a controller that forgets, and says what it holds ------------------------------------------------------------

HELD = Held(("G0", "G54", "G17", "G21", "G90", "G94", "M5", "M9", "T0", "F0", "S0"), {}, {"x": 9.0, "y": 0.0, "z": 1.0})
MILLED = b"G90 T2\nG0 X1 Y1 Z5\nG1 Z-1 F600\nG2 X5 R9\nX9 R9\nX11 R9\nM30\n"


def grbl(**reentry: Any) -> Workpiece:
    machine = {"name": "g", "port": "sim:", "protocol": "grbl", "reentry": reentry}
    return Workpiece.of(MachineConfig.model_validate(machine))


def taken_up(store: ProgramStore, line: int, entry: Entry | None = None, **changes: Any) -> Any:
    job = row(store, MILLED, **{"forced": 0} | changes)
    piece = grbl(clearance=30.0, plunge_feed=80.0)
    return Planning(store).start(piece, job, line=line, position={}, absolute=None, held=HELD, entry=entry)


def test_grbl_takes_a_program_up_by_a_plan(store: ProgramStore) -> None:
    plan = taken_up(store, 5, forced=1)
    assert plan.reentry is not None
    assert plan.prologue == plan.reentry.blocks
    assert {"G0 Z30", "T2", "G0 X5 Y1", "G1 Z-1 F80"} <= set(plan.prologue)
    found = list(batches(plan.planner))
    sent = [block for batch in found for block in batch.blocks]
    # Line 5 goes on with an arc by its words only: the plan says it, and the rest begins behind it.
    assert sent[-3:] == ["G2X9R9", "X11R9", "M30"]
    lines = [batch.line_of(number) for batch in found for number in range(len(batch.blocks))]
    assert lines[-3:] == [5, 6, 7]
    assert set(lines[:-3]) == {4}, "until the plan is done, line 5 is not"


def test_what_only_people_can_do_is_done_before(store: ProgramStore) -> None:
    with pytest.raises(CannotStartError, match=r"make sure that tool 2 is in the spindle.*operator_done"):
        taken_up(store, 5)
    way = Way(10.0, 50.0)
    assert taken_up(store, 5, Entry(way, HELD, operator_done=True)).line == 5


def test_a_plan_that_somebody_has_edited_is_sent_instead_of_ours(store: ProgramStore) -> None:
    edited = ("G90", "G0 Z40", "G0 X5 Y1", "G1 Z-1 F10", "G2 X9 R9")
    plan = taken_up(store, 5, Entry(Way(10.0, 50.0), HELD, edited, operator_done=True))
    assert plan.prologue == edited
    assert blocks(plan.planner) == ["G90", "G0Z40", "X5Y1", "G1Z-1F10", "G2X9R9", "X11R9", "M30"]
    with pytest.raises(CannotStartError, match="Block 1 of the edited plan, 'M2'"):
        taken_up(store, 5, Entry(Way(10.0, 50.0), HELD, ("M2",), operator_done=True))


def test_where_the_machine_may_move_freely_is_not_guessed(store: ProgramStore) -> None:
    job = row(store, MILLED, forced=1)
    with pytest.raises(CannotStartError, match=r"\[machine.reentry\]"):
        Planning(store).start(grbl(), job, line=5, position={}, absolute=None, held=HELD)


def test_what_cannot_be_taken_up_has_a_reason(store: ProgramStore) -> None:
    job = row(store, b"G91\nG1 X1 F60\nG1 X1\n", forced=1)
    with pytest.raises(CannotStartError, match="Start at a line") as refused:
        Planning(store).start(grbl(clearance=5.0), job, line=3, position={}, absolute=None, held=HELD)
    assert refused.value.reason == "position_unknown"


def test_from_the_start_grbl_needs_no_plan_and_begins_in_the_modes_that_it_has(store: ProgramStore) -> None:
    held = replace(HELD, modal=("G1", "G91"))
    job = row(store, b"X1 F600\nX1\n")
    plan = Planning(store).start(grbl(), job, line=1, position={"x": 5.0}, absolute=None, held=held)
    *_, last = batches(plan.planner)  # a row holds a second
    assert (plan.prologue, plan.reentry, last.end["x"]) == ((), None, 7.0)


def test_a_program_in_inches_is_taken_up_in_inches_or_converted_with_its_plan(store: ProgramStore) -> None:
    inches = row(store, b"G20 G90\nG0 X1 Y1 Z1\nG1 Z-1 F10\nG1 X2\nG1 X3\n", forced=1)
    entry = Entry(Way(50.8, 254.0), HELD, operator_done=True)
    for convert, over, last in ((False, "G0 X2 Y1", "G1X3"), (True, "X50.8Y25.4", "X76.2")):
        machine = {"name": "g", "port": "sim:", "protocol": "grbl", "grbl": {"convert_inches": convert}}
        piece = Workpiece.of(MachineConfig.model_validate(machine))
        plan = Planning(store).start(piece, inches, line=5, position={}, absolute=None, held=HELD, entry=entry)
        assert "G20" in plan.prologue
        sent = blocks(plan.planner)
        assert over.replace(" ", "").removeprefix("G0") in " ".join(sent)
        assert sent[-1].endswith(last.removeprefix("G1"))
