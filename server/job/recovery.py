"""After `interrupted`: the plan (what is certain, what is in doubt, what would be sent), and going on.

Not the finding out (the engine), not the running, and not how a plan of a controller that forgets is made
(takingup.py). The one rule: `continue` is offered only where everything up to a line is proven, the machine kept its
memory and stands where that line ends; `from_line` is the operator's own word.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from jobs import journal, store
from jobs.delivery import Policy
from jobs.job import Status
from jobs.journal import Past
from jobs.program import UnknownProgramError
from jobs.restart import CannotStartError
from jobs.store import Row
from jobs.upcoming import PlanError
from protocol.commands import Position
from server.background.dbthread import Db
from server.config.reentry import AS_CONFIGURED, ReentryWish
from server.job.starting import Starter
from server.job.takingup import TakingUp
from server.machine.controller import Controller
from server.machine.modes import began_in
from server.problems import ProblemError
from server.programs.plans import Plan


class Recovery:
    """Plans and goes on; `starter` makes the planners and gives the machine to the job."""

    def __init__(self, db: Db, starter: Starter) -> None:
        self._db = db
        self._starter = starter
        self._taking_up = TakingUp(db, starter)

    async def go_on(
        self, controller: Controller, row: Row, action: str, line: int | None, wish: ReentryWish = AS_CONFIGURED
    ) -> None:
        """Raises ProblemError, and nothing is changed."""
        with controller.stream.beginning.going_on(row["id"]):
            await self._go_on(controller, row, action, line, wish)

    async def _go_on(self, controller: Controller, row: Row, action: str, line: int | None, wish: ReentryWish) -> None:
        touched = controller.manual.touched
        past = await self._past(controller, row)
        if action == "continue":
            await self._check_continue(controller, row, past.position)
            line = row["line_done"] + 1
        else:
            line = self._line(controller, row, line, wish)
        # Behind the last line there is one thing left to do for `continue`: to say that the job is complete.
        last = row["end_line"] + (action == "continue")
        if line is None or not row["start_line"] <= line <= last:
            raise ProblemError(
                "invalid_request", f"Say a line from {row['start_line']} to {row['end_line']} to go on from."
            )
        self._check_machine(controller, row)
        if action == "continue":
            plan = await self._continue(controller, row, line, past.part)
        else:
            self._taking_up.check_homed(controller, row, wish)
            plan = await self._start(controller, row, line, wish)
        # Reading the program took a while: the machine may have changed.
        self._check_machine(controller, row)
        if controller.stream.beginning.cancelled or controller.manual.touched != touched:
            # The way to the work begins where it stood, and leaves out what it held.
            raise ProblemError(
                "wrong_state",
                f"{controller.name} was stopped, reset or used by hand while the program was read. Ask again.",
            )
        if action == "continue":
            against = self._against(controller, row, past.position)
            if against is not None:
                raise _no_continue(row, against)
        else:
            self._taking_up.check_homed(controller, row, wish)
        self._run(controller, row, plan, past, action)

    def _run(self, controller: Controller, row: Row, plan: Plan, past: Past, action: str) -> None:
        runner = controller.stream.runner
        assert runner is not None
        controller.stream.react(runner.forget())
        controller.stream.note("recover", job=row["id"], action=action, line=plan.line)
        hold = controller.stream.beginning.held  # somebody paused it while the program was read
        self._db.post(store.set_hold, row["id"], hold)
        self._starter.run_plan(
            controller,
            {**row, "hold": hold},
            plan,
            before=Status.INTERRUPTED,
            hold=hold,
            next_seq=past.next_seq,
            seconds=past.seconds_done,
        )

    async def _past(self, controller: Controller, row: Row) -> Past:
        most_open = controller.config.dialect.delivery().most_open
        return await self._db.run(journal.past, row["id"], most_open=most_open)

    def _line(self, controller: Controller, row: Row, line: int | None, wish: ReentryWish) -> int | None:
        """The line that a request means. Raises ProblemError for what this machine's protocol does not know."""
        if self._taking_up.plans_for(controller):
            return next_line(row) if line is None else line
        if replace(wish, force=False) != AS_CONFIGURED:
            raise ProblemError(
                "invalid_request",
                f"{controller.name} goes on from where it stands: it takes a line and nothing else. Leave out "
                "clearance, plunge_feed, spindle_wait, blocks and operator_done.",
            )
        return line

    async def _check_continue(self, controller: Controller, row: Row, expected: Position) -> None:
        against = self._against(controller, row, expected) or await self._taking_up.against(controller, row)
        if against is not None:
            raise _no_continue(row, against)

    async def plan(
        self, controller: Controller, row: Row, line: int | None = None, wish: ReentryWish = AS_CONFIGURED
    ) -> dict[str, Any]:
        """What is certain, what is in doubt, and what would be sent first; by default behind the certain lines."""
        past = await self._past(controller, row)
        expected = past.position
        against = self._against(controller, row, expected) or await self._taking_up.against(controller, row)
        wanted = self._line(controller, row, line, wish) or row["line_done"] + 1
        if line is not None and not row["start_line"] <= line <= row["end_line"]:
            raise ProblemError("invalid_request", f"Say a line from {row['start_line']} to {row['end_line']}.")
        shown, blocks, why = await self._preview(controller, row, wanted, wish, past.part)
        if line is None and not self._taking_up.plans_for(controller):
            # There it is the same plan: going on behind what is certain.
            against = against or why
        reason = store.error_of(row)
        return {
            "job": row["id"],
            "certain_line": row["line_done"],
            "line_from": None if reason is None else reason.line_from,
            "line_to": None if reason is None else reason.line_to,
            "reason": None if reason is None else reason.view(),
            "restarted": bool(row["restarted"]),
            "position_expected": dict(expected),
            "position": dict(controller.program_position),
            "can_continue": against is None,
            "why_not": against,
            "next_line": wanted,
            "blocks": blocks,
            "line_why_not": why,
            **shown,
        }

    async def _preview(
        self, controller: Controller, row: Row, line: int, wish: ReentryWish, part: int
    ) -> tuple[dict[str, Any], list[str], str | None]:
        """Of going on from a line: what belongs to its plan, the first blocks, and why it cannot be done."""
        starter, plan, why = self._starter, None, None
        blocks: list[str] = []
        try:
            if self._goes_on_only(controller) and line == row["line_done"] + 1:
                plan = await self._continue(controller, row, line, part)
                blocks = await starter.worker.run(starter.planning.preview, plan)
            elif line <= row["end_line"]:
                plan = await self._start(controller, row, line, self._taking_up.as_a_trial(wish))
                blocks = await starter.worker.run(starter.planning.preview, plan)
        except (ProblemError, PlanError) as error:
            why = str(error)
        return self._taking_up.view(controller, row, wish, line, plan), blocks, why

    def _goes_on_only(self, controller: Controller) -> bool:
        """Whether a job can go on behind what is certain, and be taken up nowhere else (ncframe)."""
        return self._starter.pieces[controller.name].frames is not None

    async def _continue(self, controller: Controller, row: Row, line: int, part: int) -> Plan:
        """Behind what is certain, on a machine that has kept its memory. Raises ProblemError."""
        if self._goes_on_only(controller):
            return await self._behind_the_last_frame(controller, row, line, part)
        if not self._taking_up.plans_for(controller):
            return await self._start(controller, row, line)
        starter = self._starter
        piece, began = starter.pieces[controller.name], await began_in(self._db, row)
        planner = await starter.worker.run(starter.planning.go_on, piece, row, line=line, began=began)
        planner.relocate(controller.program_position)
        return Plan(planner, line)

    async def _behind_the_last_frame(self, controller: Controller, row: Row, line: int, part: int) -> Plan:
        """Of a machine that cannot say where it stands: what the program leads to is held against what is known."""
        starter = self._starter
        piece, began = starter.pieces[controller.name], await began_in(self._db, row)
        try:
            planner = await starter.worker.run(starter.planning.go_on, piece, row, line=line, part=part, began=began)
        except (UnknownProgramError, OSError) as error:
            raise ProblemError("unknown_program", f"The program of job {row['id']} cannot be read: {error}") from error
        tolerance_mm = controller.config.dialect.position_tolerance
        why = _moved(planner.position, controller.program_position, tolerance_mm) if planner.position else UNKNOWN_PLACE
        if why is not None:
            raise _no_continue(row, why)
        return Plan(planner, line)

    async def _start(self, controller: Controller, row: Row, line: int, wish: ReentryWish = AS_CONFIGURED) -> Plan:
        starter = self._starter
        try:
            held, entry = await self._taking_up.prepare(controller, row, line, wish)
            return await starter.worker.run(
                starter.planning.start,
                starter.pieces[controller.name],
                row,
                line=line,
                position=controller.program_position,
                absolute=controller.state.absolute,
                held=held,
                entry=entry,
            )
        except CannotStartError as error:
            extra = {} if error.reason is None else {"reason": error.reason}
            raise ProblemError("wrong_state", f"Line {line}: {error}", **extra) from error
        except PlanError as error:
            raise ProblemError("wrong_state", f"Line {line}: {error}") from error
        except (UnknownProgramError, OSError) as error:
            raise ProblemError("unknown_program", f"The program of job {row['id']} cannot be read: {error}") from error

    def _check_machine(self, controller: Controller, row: Row) -> None:
        if controller.stream.active_job is None:
            raise ProblemError("wrong_state", f"Job {row['id']} has ended meanwhile: there is nothing to go on with.")
        if controller.stream.active_job != row["id"]:
            raise ProblemError("job_active", f"{controller.name} is used by job {controller.stream.active_job}.")
        if Policy.of(row).check:
            raise ProblemError("wrong_state", f"Job {row['id']} is a check: cancel it and run the check again.")
        controller.check_by_hand()
        if controller.manual.busy:
            raise ProblemError("machine_busy", f"{controller.name} executes a command by hand.")
        if controller.verbs.hold is not None and controller.state.status != "idle":
            status = controller.state.status
            raise ProblemError("wrong_state", f"{controller.name} is in the state {status}; a job goes on in idle.")
        if controller.state.pendant:
            raise ProblemError("machine_busy", f"A pendant owns {controller.name} (MPG).")
        controller.check_tools()

    def _against(self, controller: Controller, row: Row, expected: Position) -> str | None:
        """Why the job cannot simply go on after its certain line."""
        error = store.error_of(row)
        runner = controller.stream.runner
        home, from_a_line = "Home it", "recover from a line"
        if self._goes_on_only(controller):
            home, from_a_line = "Bring it to where the job began", "cancel the job and run it again"
        if row["restarted"]:
            return f"The machine restarted, so its position is unknown. {home}, then {from_a_line}."
        if error is not None and error.line_from is not None:
            return f"Lines {error.line_from} to {error.line_to} are in doubt. Look at the part, then {from_a_line}."
        if runner is not None and runner.flights:
            return "What became of the last batch is not settled yet. Wait for the machine to be connected."
        tolerance_mm = controller.config.dialect.position_tolerance
        return _moved(expected, controller.program_position, tolerance_mm)


UNKNOWN_PLACE = "The machine has not said where it stands."


def next_line(row: Row) -> int:
    """The first line in doubt, or the one behind the certain ones: what is certain is never done again by itself."""
    error = store.error_of(row)
    doubt = 0 if error is None else error.line_from or 0
    behind: int = row["line_done"] + 1
    return max(doubt, behind)


def _no_continue(row: Row, against: str) -> ProblemError:
    return ProblemError("wrong_state", f"Job {row['id']} cannot continue by itself. {against}")


def _moved(expected: Position, now: Mapping[str, float], tolerance_mm: float) -> str | None:
    for axis, value in sorted(expected.items()):
        if axis not in now:
            return UNKNOWN_PLACE
        if abs(now[axis] - value) > tolerance_mm:
            return (
                f"The machine was moved: {axis} is {now[axis]:g} and should be {value:g}. "
                "Bring it back, or recover from a line."
            )
    return None
