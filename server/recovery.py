"""After `interrupted`: the plan (what is certain, what is in doubt, what would be sent), and going on.

Not the finding out (the engine) and not the running. The one rule: `continue` is offered only where everything up to
a line is proven, the machine kept its memory and stands where that line ends; `from_line` is the operator's own word.
"""

from collections.abc import Mapping
from typing import Any

from jobs import journal, store
from jobs.job import Status
from jobs.program import UnknownProgramError
from jobs.restart import CannotStartError
from jobs.store import Row
from jobs.upcoming import PlanError
from protocol.commands import Position
from server.controller import Controller
from server.dbthread import Db
from server.plans import Plan
from server.problems import ProblemError
from server.starting import Starter


class Recovery:
    """Plans and goes on; `starter` makes the planners and gives the machine to the job."""

    def __init__(self, db: Db, starter: Starter) -> None:
        self._db = db
        self._starter = starter

    async def go_on(self, controller: Controller, row: Row, action: str, line: int | None) -> None:
        """Raises ProblemError, and nothing is changed."""
        past = await self._db.run(journal.past, row["id"])
        if action == "continue":
            self._check_continue(controller, row, past.position)
            line = row["line_done"] + 1
        # Behind the last line there is one thing left to do for `continue`: to say that the job is complete.
        last = row["end_line"] + (action == "continue")
        if line is None or not row["start_line"] <= line <= last:
            raise ProblemError(
                "invalid_request", f"Say a line from {row['start_line']} to {row['end_line']} to go on from."
            )
        self._check_machine(controller, row["id"])
        plan = await self._start(controller, row, line)
        # Reading the program took a while: the machine may have changed.
        self._check_machine(controller, row["id"])
        if action == "continue":
            self._check_continue(controller, row, past.position)
        runner = controller.stream.runner
        assert runner is not None
        controller.stream.react(runner.forget())
        controller.stream.note("recover", job=row["id"], action=action, line=plan.line)
        self._db.post(store.set_hold, row["id"], False)
        self._starter.run_plan(
            controller,
            {**row, "hold": 0},
            plan,
            before=Status.INTERRUPTED,
            next_seq=past.next_seq,
            seconds=past.seconds_done,
        )

    def _check_continue(self, controller: Controller, row: Row, expected: Position) -> None:
        against = self._against(controller, row, expected)
        if against is not None:
            raise ProblemError("wrong_state", f"Job {row['id']} cannot continue by itself. {against}")

    async def plan(self, controller: Controller, row: Row) -> dict[str, Any]:
        """What is certain, what is in doubt, and what `continue` would send first."""
        past = await self._db.run(journal.past, row["id"])
        expected = past.position
        against = self._against(controller, row, expected)
        line, why = row["line_done"] + 1, None
        blocks: list[str] = []
        try:
            if line <= row["end_line"]:
                plan = await self._start(controller, row, line)
                blocks = await self._starter.worker.run(self._starter.planning.preview, plan)
        except (ProblemError, PlanError) as error:
            why = str(error)
        reason = store.error_of(row)
        return {
            "job": row["id"],
            "certain_line": row["line_done"],
            "line_from": None if reason is None else reason.line_from,
            "line_to": None if reason is None else reason.line_to,
            "reason": None if reason is None else reason.view(),
            "restarted": bool(row["restarted"]),
            "position_expected": dict(expected),
            "position": dict(controller.state.position),
            "can_continue": against is None and why is None,
            "why_not": against or why,
            "next_line": line,
            "blocks": blocks,
        }

    async def _start(self, controller: Controller, row: Row, line: int) -> Plan:
        state = controller.state
        starter = self._starter
        try:
            return await starter.worker.run(
                starter.planning.start,
                starter.pieces[controller.name],
                row,
                line=line,
                position=state.position,
                absolute=state.absolute,
            )
        except (CannotStartError, PlanError) as error:
            raise ProblemError("wrong_state", f"Line {line}: {error}") from error
        except (UnknownProgramError, OSError) as error:
            raise ProblemError("unknown_program", f"The program of job {row['id']} cannot be read: {error}") from error

    def _check_machine(self, controller: Controller, job_id: int) -> None:
        if controller.stream.active_job != job_id:
            raise ProblemError("job_active", f"{controller.name} is used by job {controller.stream.active_job}.")
        controller.check_by_hand()
        if controller.manual.busy:
            raise ProblemError("machine_busy", f"{controller.name} executes a command by hand.")

    def _against(self, controller: Controller, row: Row, expected: Position) -> str | None:
        """Why the job cannot simply go on after its certain line."""
        error = store.error_of(row)
        runner = controller.stream.runner
        if row["restarted"]:
            return "The machine restarted, so its position is unknown. Home it, then recover from a line."
        if error is not None and error.line_from is not None:
            return (
                f"Lines {error.line_from} to {error.line_to} are in doubt. Look at the part, then recover from a line."
            )
        if runner is not None and runner.flights:
            return "What became of the last batch is not settled yet. Wait for the machine to be connected."
        tolerance_mm = controller.config.dialect.position_tolerance
        return _moved(expected, controller.state.position, tolerance_mm)


def _moved(expected: Position, now: Mapping[str, float], tolerance_mm: float) -> str | None:
    for axis, value in sorted(expected.items()):
        if axis not in now:
            return "The machine has not said where it stands."
        if abs(now[axis] - value) > tolerance_mm:
            return (
                f"The machine was moved: {axis} is {now[axis]:g} and should be {value:g}. "
                "Bring it back, or recover from a line."
            )
    return None
