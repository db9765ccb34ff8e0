"""The plan of a job for a machine behind NC frames: the whole program is translated before the first frame goes out.

Runs in a worker. Not the translation (gcode/ncframe) and not which frames are behind (jobs/frames.py). The one rule: a
job begins at the first line, where the machine is known to stand, or goes on behind the very frame that was executed
last; anything else would move it from a place that nobody knows.
"""

from collections.abc import Iterator

from gcode.held import Held
from gcode.ncframe.stretches import first_error
from jobs.batch import BatchPlanner
from jobs.frames import Behind, FrameBlocks
from jobs.program import ProgramStore
from jobs.restart import CannotStartError
from jobs.store import Row
from jobs.upcoming import PlanError
from protocol.commands import Position
from server.programs.workpiece import Workpiece

FROM_THE_BEGINNING = (
    "frames are steps from where the machine stands, and it cannot say where that is. Bring the tool to where the "
    "program begins, say with G92 where that is, and run it from its first line"
)


def start(programs: ProgramStore, piece: Workpiece, row: Row, *, line: int, position: Position) -> BatchPlanner:
    """From the first line. Raises CannotStartError, PlanError for the first line that cannot be sent, OSError."""
    if line > 1:
        raise CannotStartError(f"A job cannot begin in the middle here: {FROM_THE_BEGINNING}.")
    assert piece.frames is not None
    lines = _lines(programs, row["program"], row["end_line"])
    if (error := first_error(lines, piece.profile, piece.frames, position)) is not None:
        raise PlanError(error.line, f"column {error.column}: {error.message}")
    return BatchPlanner.over(_blocks(programs, piece, row, position, Behind()), piece.limits)


def go_on(programs: ProgramStore, piece: Workpiece, row: Row, *, behind: Behind, began: Held | None) -> BatchPlanner:
    """What comes behind a place. `began`: where the machine stood before the first line. Raises OSError."""
    position = {} if began is None else began.position
    planner = BatchPlanner.over(_blocks(programs, piece, row, position, behind), piece.limits)
    planner.state  # noqa: B018 - follows what is behind here, in the worker
    return planner


def _blocks(programs: ProgramStore, piece: Workpiece, row: Row, position: Position, behind: Behind) -> FrameBlocks:
    assert piece.frames is not None
    lines = _lines(programs, row["program"], row["end_line"])
    return FrameBlocks(lines, piece.profile, piece.motion, piece.frames, position, behind)


def _lines(programs: ProgramStore, program: str, last: int) -> Iterator[tuple[int, bytes]]:
    """Opens the file when the first line is wanted."""
    yield from programs.lines(program, 1, last)
