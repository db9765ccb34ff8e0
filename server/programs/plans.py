"""From a job's row to a planner: reads the program, follows what is left out, says again what that would have set.

Runs in a worker, for following a long program takes its time. The one rule: nothing here touches the loop, the
machine or the database.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

from gcode.check import CheckOptions
from gcode.held import Held
from gcode.interpreter import power_on
from gcode.ncframe.rules import FrameRules
from gcode.profile import Profile
from gcode.reentry import Reentry, Way
from gcode.segments import Segments
from gcode.state import State
from jobs.batch import BatchPlanner
from jobs.expansion import check_stored, check_stored_frames, motion_of
from jobs.frames import Behind
from jobs.program import ProgramStore
from jobs.reentry import Course, check_blocks, has_kept_its_modes, plan_at, with_plan
from jobs.restart import CannotStartError, Switches, first_block, prologue, with_prologue
from jobs.store import Row
from protocol.commands import Position
from server.programs import frameplans
from server.programs.workpiece import Workpiece

PREVIEW_BATCHES = 3
PREVIEW_BLOCKS = 40

NO_CLEARANCE = (
    "Where the machine may move freely is not known: say `clearance` in the request that takes a job up, or for good "
    "in [machine.reentry]"
)


@dataclass(frozen=True, slots=True)
class Plan:
    """A planner that stands before `line`, and the blocks that it sends first of all: those of `reentry`, edited or
    not, where the program is taken up by a plan."""

    planner: BatchPlanner
    line: int
    prologue: tuple[str, ...] = ()
    reentry: Reentry | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """How a program is taken up in the middle. `began`: what the controller held before its first line, None where that
    is not known. `blocks`: the plan as somebody has edited it. `operator_done`: what only people can do is done."""

    way: Way
    began: Held | None
    blocks: tuple[str, ...] | None = None
    operator_done: bool = False


class Planning:
    """Makes planners. Raises KeyError, OSError when the file is gone, CannotStartError, PlanError."""

    def __init__(self, programs: ProgramStore) -> None:
        self._programs = programs

    def start(
        self,
        piece: Workpiece,
        row: Row,
        *,
        line: int,
        position: Position,
        absolute: bool | None,
        held: Held | None = None,
        entry: Entry | None = None,
    ) -> Plan:
        """Begin at `line`, the machine standing at `position`. From the middle, the modal state is restored first.

        `held`: what the controller holds now, where it can be asked. `entry`: how it is taken up; None: as configured.
        """
        if piece.frames is not None:
            return Plan(frameplans.start(self._programs, piece, row, line=line, position=position), line)
        last, encoding = row["end_line"], piece.encoding
        if line > last:
            return Plan(self._planner(piece, ()), line)
        if line <= 1:
            lines = self._programs.runs(row["program"], 1, last)
            return Plan(_opened(self._planner(piece, lines, position=position, absolute=absolute, held=held)), 1)
        if piece.reentry is not None:
            return self._take_up(piece, row, line, held or Held(), entry or _as_configured(piece, row, held or Held()))
        switches = Switches(self._lines(row, 1, line - 1), encoding)
        scout = self._planner(piece, switches, absolute=None, skip_to=line)
        first = first_block(self._lines(row, line, last), encoding)
        state = scout.state
        if state.absolute is None:
            if absolute is False:
                raise CannotStartError(
                    "The lines before do not say G90 or G91, and the machine is in G91, perhaps by a command by hand. "
                    "Send G90 by hand if the coordinates of the program are absolute."
                )
            state.absolute = absolute
        blocks = prologue(state, switches, piece.profile, first, in_inches=scout.in_inches)
        rest = self._programs.runs(row["program"], line, last)
        whole = with_prologue(self._lines(row, 1, line - 1), line, blocks, rest)
        planner = self._planner(piece, whole, absolute=absolute, skip_to=line - 1)
        planner.relocate(position)
        return Plan(planner, line, tuple(blocks))

    def reentry(self, piece: Workpiece, row: Row, *, line: int, held: Held, entry: Entry) -> Reentry:
        """The plan to take the program up at `line`. Raises CannotStartError with its reason."""
        return plan_at(self._course(piece, row, line), entry.way, began=entry.began, now=held)

    def _course(self, piece: Workpiece, row: Row, line: int) -> Course:
        before, rest = partial(self._lines, row, 1, line - 1), partial(self._lines, row, line, row["end_line"])
        return Course(before, rest, line, piece.profile, piece.encoding)

    def _take_up(self, piece: Workpiece, row: Row, line: int, held: Held, entry: Entry) -> Plan:
        reentry = self.reentry(piece, row, line=line, held=held, entry=entry)
        by_people = [step.note for step in reentry.steps if not step.text]
        if by_people and not entry.operator_done:
            raise CannotStartError(
                f"Somebody has to see to this first: {'; '.join(by_people)}. Then say so: `operator_done` with "
                "recover, `force` with a new job."
            )
        if entry.blocks is not None:
            check_blocks(entry.blocks, piece.profile, held)
        blocks = reentry.blocks if entry.blocks is None else entry.blocks
        rest = self._programs.runs(row["program"], line + reentry.takes_over, row["end_line"])
        lines = with_plan(line, blocks, reentry.takes_over, rest)
        planner = self._planner(piece, lines, position=held.position, absolute=None, held=held)
        return Plan(_opened(planner), line, blocks, reentry)

    def keeps(self, piece: Workpiece, row: Row, *, line: int, began: Held | None, held: Held) -> bool:
        """Whether the controller holds what the lines before `line` have set, so that it was not reset since."""
        course = self._course(piece, row, line)
        return has_kept_its_modes(course, began=began, now=held, laser=piece.motion.laser)

    def go_on(self, piece: Workpiece, row: Row, *, line: int, began: Held | None = None, part: int = 0) -> BatchPlanner:
        """What comes from `line` on, for a machine that executed everything before it and kept its modal state.

        `began`: what it held before the first line, where it could be asked. `part`: how far the line is.
        """
        if piece.frames is not None:
            return frameplans.go_on(self._programs, piece, row, behind=Behind(line - 1, part), began=began)
        # Whether it began in G90 or G91 is in no journal; without the program saying so, nothing may be left out.
        lines = self._programs.runs(row["program"], 1, row["end_line"])
        return _opened(self._planner(piece, lines, absolute=None, skip_to=line, held=began))

    def _lines(self, row: Row, first: int, last: int) -> Iterator[tuple[int, bytes]]:
        """Opens the file when the first line is wanted, so that a plan that is given up holds nothing open."""
        yield from self._programs.lines(row["program"], first, last)

    def preview(self, plan: Plan) -> list[str]:
        """The first blocks that would go out. The planner is used up by it."""
        batches = (plan.planner.next() for _ in range(PREVIEW_BATCHES))
        blocks = (block for batch in batches if batch is not None for block in batch.blocks)
        return list(islice(blocks, PREVIEW_BLOCKS))

    def check(self, piece: Workpiece, program: str, tools: frozenset[int] | None = None) -> dict[str, Any]:
        """The report of the check before a run, as JSON. `tools`: those of the tool table, None: there is none."""
        options = CheckOptions(
            convert_inches=piece.convert_inches,
            max_block_bytes=piece.limits.longest_block_bytes,
            encoding=piece.encoding,
            baud=piece.baud,
            tools=tools,
        )
        if piece.frames is not None:
            report = check_stored_frames(self._programs, program, piece.profile, piece.motion, piece.frames, options)
            return report.to_json()
        return check_stored(self._programs, program, piece.profile, piece.motion, options).to_json()

    def motion_of(self, program: str, profile: Profile, frames: FrameRules | None = None) -> Iterator[Segments]:
        """What the program makes the axes do, to be drawn: as if it began at its zero, docs/toolpath.md."""
        return motion_of(self._programs, program, profile, state=_at_zero(profile), frames=frames)

    def _planner(
        self,
        piece: Workpiece,
        lines: Any,
        *,
        position: Position | None = None,
        absolute: bool | None = True,
        skip_to: int = 1,
        held: Held | None = None,
    ) -> BatchPlanner:
        return BatchPlanner(
            lines,
            piece.profile,
            piece.motion,
            piece.limits,
            compact=piece.compact,
            convert_inches=piece.convert_inches,
            encoding=piece.encoding,
            position=position,
            absolute=absolute,
            skip_to=skip_to,
            held=held,
            tools=piece.tools,
        )


def _as_configured(piece: Workpiece, row: Row, held: Held) -> Entry:
    """Of a new job that begins in the middle: in the modes of now, as it would from its first line; where the machine
    stood before that line, nobody knows. Raises CannotStartError."""
    assert piece.reentry is not None
    way = piece.reentry.way(laser=piece.motion.laser)
    if way is None:
        raise CannotStartError(f"{NO_CLEARANCE}.")
    return Entry(way, replace(held, position={}), operator_done=bool(row["forced"]))


def _at_zero(profile: Profile) -> State:
    """Just switched on, all axes at 0: from an unknown start nothing of a program in G91 could be drawn."""
    state = power_on(profile)
    state.position = [0.0] * len(state.axes)
    return state


def _opened(planner: BatchPlanner) -> BatchPlanner:
    """Follows the lines before the first, here in the worker: the loop must not wait for that, nor for the disk."""
    planner.state  # noqa: B018 - reads as far as the first line
    return planner
