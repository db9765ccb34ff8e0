"""frameplans.py: where a job on a lathe begins, where it goes on, what is refused before anything is sent."""

from pathlib import Path
from typing import Any

import pytest

from gcode.held import Held
from jobs.program import ProgramStore
from jobs.restart import CannotStartError
from jobs.upcoming import PlanError
from server.config.model import MachineConfig
from server.programs.plans import Planning
from server.programs.workpiece import Workpiece

PIECE = Workpiece.of(MachineConfig(name="lathe", port="/dev/ttyUSB0", protocol="ncframe"))
TEXT = b"G90\nG1 X1 F100\nG3 X5 I2\nG1 Z-1 M8 M3\nG1 Z-2\nM30\nQ9\n"
HERE = {"x": 0.0, "z": 0.0}


def stored(folder: Path, text: bytes = TEXT) -> tuple[Planning, dict[str, Any]]:
    programs = ProgramStore(folder)
    with programs.writer("part.nc") as writer:
        writer.write(text)
        info = writer.finish()
    return Planning(programs), {"program": info.id, "end_line": info.lines}


def texts(planner: Any) -> list[str]:
    found: list[str] = []
    while (batch := planner.next()) is not None:
        found += batch.blocks
        if batch.ends_program:
            break
    return found


def start(planning: Planning, row: dict[str, Any], **changes: Any) -> Any:
    return planning.start(PIECE, row, **({"line": 1, "position": HERE, "absolute": None} | changes)).planner


def test_from_the_first_line_to_the_end_and_not_a_line_further(tmp_path: Path) -> None:
    found = texts(start(*stored(tmp_path)))
    assert found[0] == "G1 X1000 F100"
    assert found[-1] == "M30"


def test_the_whole_program_is_worked_out_before_anything_is_sent(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match="line 3"):
        start(*stored(tmp_path, b"G1 X1 F100\nX2\nX9999\nM30\n"))


def test_from_the_place_where_the_machine_stands(tmp_path: Path) -> None:
    planning, row = stored(tmp_path)
    assert texts(start(planning, row, position={"x": 0.5, "z": 0.0}))[0] == "G1 X500 F100"
    with pytest.raises(PlanError, match="not known"):
        start(planning, row, position={})


def test_not_from_the_middle(tmp_path: Path) -> None:
    with pytest.raises(CannotStartError, match="G92"):
        start(*stored(tmp_path), line=3)


def test_behind_a_part_of_a_line(tmp_path: Path) -> None:
    planning, row = stored(tmp_path)
    whole = texts(start(planning, row))
    began = Held((), None, HERE)
    at = whole.index("M3") if "M3" in whole else next(n for n, text in enumerate(whole) if "M3" in text)
    planner = planning.go_on(PIECE, row, line=4, part=2, began=began)
    rest = texts(planner)
    assert len(rest) == len(whole) - at
    assert "M3" in rest[0]
    assert "M8" not in " ".join(rest)


def test_a_program_with_loops_is_checked_as_what_it_stands_for(tmp_path: Path) -> None:
    text = b"G91\no1 repeat [3]\nG1 Z[0-1] F100\no1 endrepeat\nG1 Z%s\nM30\n"
    planning, row = stored(tmp_path, text % b"-1")
    report = planning.check(PIECE, row["program"])
    assert (report["errors"], report["expanded_lines"]) == ([], 6)
    planning, row = stored(tmp_path, text % b"[0-9999]")
    (error,) = planning.check(PIECE, row["program"])["errors"]
    assert (error["line"], error["code"]) == (5, "frame_range")
    planning, row = stored(tmp_path, text % b"-1; Z[0-1]")
    assert "block_behind_semicolon" in {error["code"] for error in planning.check(PIECE, row["program"])["errors"]}
