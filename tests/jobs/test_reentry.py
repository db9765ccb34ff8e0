"""Taking a program up on a controller that has forgotten: the plan from what was held then and now, and its lines."""

import pytest

from gcode.held import Held
from gcode.profile import load_profile
from gcode.reentry import Reentry, Way
from jobs.reentry import (
    MAX_BLOCKS,
    MODES_ASSUMED,
    SHIFT_ASSUMED,
    Course,
    check_blocks,
    has_kept_its_modes,
    plan_at,
    with_plan,
)
from jobs.restart import CannotStartError
from tests.harness.programs import numbered

GRBL = load_profile("grbl-1.1")
WAY = Way(20.0, 150.0, 2.0)
AT_RESET = ("G0", "G54", "G17", "G21", "G90", "G94", "M5", "M9", "T0", "F0", "S0")
ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
PROGRAM = "G90\nG0 X1 Y2 Z5\nM3 S900\nG1 Z-1 F300\nG1 X5\nG1 X9\nM30\n"


def offsets(**changed: dict[str, float]) -> dict[str, dict[str, float]]:
    return dict.fromkeys(("G54", "G55", "G28", "G30", "G92"), ZERO) | {"TLO": {"z": 0.0}} | changed


NOW = Held(AT_RESET, offsets(), {"x": 3.0, "y": 3.0, "z": -1.0})


def plan(program: str, line: int, began: Held | None, now: Held = NOW, way: Way = WAY) -> Reentry:
    lines = list(numbered(program))
    course = Course(lambda: lines[: line - 1], lambda: lines[line - 1 :], line, GRBL, "utf-8")
    return plan_at(course, way, began=began, now=now)


def test_the_plan_brings_back_what_the_lines_before_had_set() -> None:
    made = plan(PROGRAM, 6, NOW)
    assert made.warnings == ("The lines before name no tool: the one that the program began with must be in it.",)
    assert made.blocks[-8:] == ("G0 Z20", "G0 X5 Y2", "M3 S900", "G4 P2", "M9", "G1 Z-1 F150", "F300", "G1")


def test_modes_that_were_set_by_hand_before_the_job_hold_again() -> None:
    """G55, a shift and a tool length: the controller has forgotten them, and the program never says them."""
    began = Held(("G0", "G55", "G90"), offsets(G92={"x": 5.0, "y": 0.0, "z": 0.0}, TLO={"z": 2.0}), ZERO)
    blocks = plan(PROGRAM, 6, began).blocks
    assert "G55" in blocks
    assert "G43.1 Z2" in blocks
    # The shift is said where the machine stands: until then the ways are in coordinates without it.
    assert blocks.index("G0 X10 Y2") < blocks.index("G92 X5")


def test_an_incremental_program_goes_on_from_where_the_job_began() -> None:
    program = "G91\nG1 X10 F100\nG1 X10\nG1 X10\n"
    began = Held(AT_RESET, offsets(), {"x": 7.0, "y": 8.0, "z": 9.0})
    assert plan(program, 4, began).place == {"x": 27.0, "y": 8.0, "z": 9.0}
    with pytest.raises(CannotStartError) as refused:
        plan(program, 4, Held(AT_RESET, offsets()))
    assert refused.value.reason == "position_unknown"


def test_a_machine_that_stands_high_enough_is_not_lifted() -> None:
    """It stands at 60 of the controller's own coordinates, which is 35 in those that hold before the line."""
    systems = offsets(G55={"x": 0.0, "y": 0.0, "z": 25.0})
    now = Held(AT_RESET, systems, {"x": 0.0, "y": 0.0, "z": 60.0})
    began = Held(("G90", "G55"), systems, {})
    purposes = [step.purpose for step in plan(PROGRAM, 6, began, now).steps]
    assert "lift" not in purposes
    low = Held(AT_RESET, systems, {"x": 0.0, "y": 0.0, "z": 44.0})
    assert "lift" in [step.purpose for step in plan(PROGRAM, 6, began, low).steps]


def test_what_the_plan_rests_on_without_proof_is_said() -> None:
    assert MODES_ASSUMED in plan(PROGRAM, 6, None).warnings
    assert SHIFT_ASSUMED in plan(PROGRAM, 6, Held(AT_RESET)).warnings
    moved = Held(AT_RESET, offsets(G54={"x": 1.0, "y": 0.0, "z": 0.0}))
    (warning, _) = plan(PROGRAM, 6, moved).warnings
    assert warning == "G54 is X0 Y0 Z0 now and was X1 Y0 Z0 in the job: its zero was set anew."
    blind = plan(PROGRAM, 6, NOW, Held(AT_RESET, None, ZERO))
    assert any("Where the machine stands is not known" in warning for warning in blind.warnings)


def test_a_program_that_sets_its_own_zero_is_not_blamed_for_it() -> None:
    program = "G10 L2 P1 X1\n" + PROGRAM
    kept = Held(AT_RESET, offsets(G54={"x": 1.0, "y": 0.0, "z": 0.0}))
    assert not [warning for warning in plan(program, 7, NOW, kept).warnings if "anew" in warning]
    moved = Held(AT_RESET, offsets(G54={"x": 2.0, "y": 0.0, "z": 0.0}))
    assert any("G54 is X2 Y0 Z0 now and was X1 Y0 Z0" in warning for warning in plan(program, 7, NOW, moved).warnings)


def test_until_the_plan_is_done_the_line_is_not() -> None:
    rest = [(6, b"X2"), (7, b"X3"), (8, b"X4")]
    assert list(with_plan(6, ["G90", "G0 X1"], 0, rest)) == [(5, b"G90"), (5, b"G0 X1"), *rest]
    # What the plan has said of the rest is done with its last block, and is not said again.
    assert list(with_plan(6, ["G90", "G2 X2 R5"], 2, rest[2:])) == [(5, b"G90"), (7, b"G2 X2 R5"), (8, b"X4")]


@pytest.mark.parametrize(
    ("block", "why"),
    [
        ("M30", "it would end the job"),
        ("M2", "it would end the job"),
        ("G41 D1", "does not exist on Grbl 1.1"),
        ("A5", "no A words"),
        ("(nothing)", "nothing in it to send"),
        ("", "nothing in it to send"),
        ("G0 X1 !", "!"),
        ("G1 X" + "0" * 90, "takes 79"),
        ("G2 X5", "Block 2"),
        ("T300", "T is from 0 to 255"),
        ("G0 X1\nM30", "Block 2"),
    ],
)
def test_an_edited_plan_is_held_against_the_controller_block_by_block(block: str, why: str) -> None:
    with pytest.raises(CannotStartError, match="Block 2") as refused:
        check_blocks(["G90", block], GRBL, NOW)
    assert why in str(refused.value)


def test_an_edited_plan_that_is_none_is_refused_and_a_good_one_is_not() -> None:
    for blocks in ([], ["G90"] * (MAX_BLOCKS + 1)):
        with pytest.raises(CannotStartError, match="edited plan has"):
            check_blocks(blocks, GRBL, NOW)
    check_blocks(plan(PROGRAM, 6, NOW).blocks, GRBL, NOW)
    check_blocks(["g90", "M5 (off)", "G0 X1 Y1"], GRBL, Held())


def kept(
    modal: str, program: str = PROGRAM, line: int = 6, began: Held | None = NOW, **changed: dict[str, float]
) -> bool:
    lines = list(numbered(program))
    course = Course(lambda: lines[: line - 1], lambda: lines[line - 1 :], line, GRBL, "utf-8")
    return has_kept_its_modes(course, began=began, now=Held(tuple(modal.split()), offsets(**changed)), laser=False)


def test_a_controller_that_was_reset_does_not_hold_what_the_lines_have_set() -> None:
    """Behind line 5 of the program: G1, M3 S900, F300. `$G` says whole numbers."""
    assert kept("G1 G54 G17 G21 G90 G94 M3 M9 T0 F300 S900")
    assert kept("G1 G54 G17 G21 G90 G94 M3 M9 T0 F299 S900")
    for word in ("G0", "G55", "G18", "G20", "G91", "G93", "M5", "M8", "F1", "S0"):
        assert not kept(f"G1 G54 G17 G21 G90 G94 M3 M9 T0 F300 S900 {word}"), word
    assert not kept("G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0")
    assert not kept("G1 G54 G17 G21 G90 G94 M3 M9 T0 F300 S900", G92={"x": 1.0, "y": 0.0, "z": 0.0})
    assert not kept("")
    assert not kept("G1 G54 G17 G21 G90 G94 M3 M9 T0 F300 S900", began=None)


def test_a_grblhal_that_names_no_diameter_mode_is_not_told_one() -> None:
    """It refuses G8 unless it is built for a lathe."""
    hal = load_profile("grblhal")
    lines = list(numbered(PROGRAM))
    course = Course(lambda: lines[:5], lambda: lines[5:], 6, hal, "utf-8")
    for modal, said in ((AT_RESET, False), ((*AT_RESET, "G8"), True), ((), True)):
        now = Held(modal, offsets(), NOW.position)
        assert ("G8" in plan_at(course, WAY, began=NOW, now=now).blocks) == said, modal
    assert "A" not in "".join(plan_at(course, WAY, began=NOW, now=NOW).blocks), "it has three axes, and named three"
