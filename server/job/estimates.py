"""What a job needs so that it can say how long it will still take: its program's timeline, and the machine's past runs.

Not the estimate (jobs/pace.py). The one rule: no job waits for this, and none fails of it: until it is there, and
where it cannot be had, the job runs without an estimate.
"""

import logging
from collections import OrderedDict
from collections.abc import Mapping

from gcode.lines import pieces, split_lines
from gcode.measure import Sending, measure
from gcode.ncframe.motion import measure_frames
from gcode.timeline import Timeline
from jobs import store
from jobs.experience import RUNS_CONSIDERED, learn
from jobs.program import PIECE_BYTES, ProgramStore, UnknownProgramError
from jobs.runner import Runner
from jobs.store import Row
from server.background.dbthread import Db
from server.background.worker import Worker
from server.machine.machine import Machine
from server.programs.workpiece import Workpiece

log = logging.getLogger(__name__)

TIMELINES_KEPT = 16
"""Of the programs that ran last, 32 kB each: the same program again needs no second reading."""
TYPICAL_LINE_BYTES = 32
"""Whether a program is worth a process of its own need not be known better."""


class Estimates:
    """`worker` reads programs; one of its own, for a start does not wait for it."""

    def __init__(self, db: Db, programs: ProgramStore, pieces: Mapping[str, Workpiece], worker: Worker) -> None:
        self._db = db
        self._programs = programs
        self._pieces = pieces
        self._worker = worker
        self._timelines: OrderedDict[tuple[str, str], Timeline] = OrderedDict()

    async def supply(self, machine: Machine, row: Row, runner: Runner) -> None:
        """Have the job that `runner` runs know how long it will take."""
        try:
            runs = await self._db.run(store.runs, machine.name, limit=RUNS_CONSIDERED)
            timeline = await self._timeline(machine.name, row)
        except (UnknownProgramError, OSError) as error:
            log.info("%s: job %d has no estimate: %s", machine.name, row["id"], error)
            return
        if machine.stream.runner is runner:
            machine.stream.expect(timeline, learn(runs))

    async def _timeline(self, machine: str, row: Row) -> Timeline:
        key = row["program"], machine
        timeline = self._timelines.get(key)
        if timeline is None:
            worker = self._worker.for_bytes(row["lines"] * TYPICAL_LINE_BYTES)
            timeline = await worker.run(measured, self._programs, self._pieces[machine], row["program"], row["lines"])
            self._timelines[key] = timeline
            if len(self._timelines) > TIMELINES_KEPT:
                self._timelines.popitem(last=False)
        else:
            self._timelines.move_to_end(key)
        return timeline


def measured(programs: ProgramStore, piece: Workpiece, program: str, lines: int) -> Timeline:
    """In the worker: the whole program is read once."""
    chunks = programs.chunks(program)
    if piece.frames is not None:
        numbered = enumerate(split_lines(chunks), 1)
        return measure_frames(numbered, piece.profile, piece.motion, piece.frames, lines, turn_s=piece.turn_s)
    sending = Sending(piece.encoding, piece.convert_inches, piece.compact, piece.baud)
    return measure(pieces(chunks, PIECE_BYTES), piece.profile, piece.motion, lines, sending)
