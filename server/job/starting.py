"""Gives a machine to a job: plans its program and begins, and takes up jobs of a daemon before this one.

Not the queue (job/service.py) and not the running (jobstream.py). The one rule: between the last look whether the
machine can take the job and the moment it has it, nothing is awaited.
"""

import asyncio
import logging
from collections.abc import Coroutine, Mapping
from functools import partial
from typing import Any

from sqlite_utils import Database

from gcode.held import Held
from jobs import journal, store
from jobs.cursor import Cursor
from jobs.delivery import Policy
from jobs.effects import SetStatus
from jobs.feed import Feed
from jobs.flight import Adopted
from jobs.frames import Behind
from jobs.holds import ASKED, JOB_ENDED, RESTARTED, Hold
from jobs.job import JobError, Status
from jobs.ledger import Ledger
from jobs.program import UnknownProgramError
from jobs.restart import CannotStartError
from jobs.runner import Runner
from jobs.store import Row
from jobs.upcoming import PlanError
from protocol.errors import LocalError
from server.background.dbthread import Db
from server.background.worker import Worker
from server.clock import Clock, stamp
from server.job.estimates import Estimates
from server.live.hub import Hub
from server.machine import jobmodes
from server.machine.controller import Controller
from server.machine.modes import STARTED_IN, began_in, held_by
from server.machine.views import job_view
from server.problems import ProblemError
from server.programs.frameplans import FROM_THE_BEGINNING
from server.programs.plans import NO_CLEARANCE, Plan, Planning
from server.programs.workpiece import Workpiece

log = logging.getLogger(__name__)

WAITED_FOR_S = 3.0
"""Whoever has queued a job is told how it began; where the program is read for longer, that it is `checking`."""
TOUCHED = ProblemError("wrong_state", "The machine was used by hand while the program was read.")
UNSTARTABLE = (UnknownProgramError, OSError, CannotStartError, PlanError)


class Background:
    """Tasks that nobody waits for; they end with the daemon."""

    def __init__(self) -> None:
        self._tasks: set[asyncio.Task[None]] = set()

    def begin(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """Have it done."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def finish(self, work: Coroutine[Any, Any, None]) -> None:
        """Have it done, and wait for it a moment: it goes on when whoever waits does not any more."""
        done, _ = await asyncio.wait([self.begin(work)], timeout=WAITED_FOR_S)
        for task in done:
            task.result()

    async def close(self) -> None:
        """Cancel what still goes on."""
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


class Starter:
    """See the head of this file."""

    def __init__(
        self,
        *,
        db: Db,
        hub: Hub,
        clock: Clock,
        planning: Planning,
        pieces: Mapping[str, Workpiece],
        worker: Worker,
        background: Background,
        estimates: Estimates,
    ) -> None:
        self.planning = planning
        self.pieces = pieces
        self.worker = worker
        self._db = db
        self._hub = hub
        self._clock = clock
        self._background = background
        self._estimates = estimates

    def check_line(self, machine: str, line: int) -> None:
        """Raises ProblemError where a job could not begin at this line, whatever its program."""
        piece = self.pieces[machine]
        if line > 1 and piece.frames is not None:
            raise ProblemError("invalid_request", f"A job of {machine} begins at line 1: {FROM_THE_BEGINNING}.")
        if line > 1 and piece.reentry is not None and piece.reentry.clearance is None:
            raise ProblemError("invalid_request", f"{NO_CLEARANCE} of {machine}.")

    async def start(self, controller: Controller, row: Row) -> bool:
        """Plan the program and begin. The machine is reserved for this job. False: it does not wait any more."""
        try:
            if not await self.leave_queue(row, Status.CHECKING):
                beginning = controller.stream.beginning
                if not (beginning.held or beginning.cancelled):
                    return False
                # Whoever pauses or stops in the moment in which a job is chosen wants no other to begin in its place.
                await self._db.run(store.hold_queue, controller.name, ASKED)
                return True
            touched = controller.manual.touched
            held = await held_by(controller)
            plan = await self.worker.run(
                self.planning.start,
                self.pieces[controller.name],
                row,
                line=row["start_line"],
                position=controller.program_position,
                absolute=controller.state.absolute,
                held=held,
            )
            refused = TOUCHED if controller.manual.touched != touched else await self._enter(controller, row)
        except UNSTARTABLE as error:
            code = "not_plannable" if isinstance(error, CannotStartError | PlanError) else "program_missing"
            await self.set_status(row, Status.FAILED, JobError(code, str(error)))
            await self._db.run(store.hold_queue, controller.name, JOB_ENDED)
            return True
        finally:
            wanted = controller.stream.beginning.release()
        if wanted and refused is None:
            await self._begin(controller, row, plan, held)
        elif wanted and refused is not None:
            await self._back_to_queue(controller, row, refused)
        else:
            # As behind every other end of a job: what waits behind it waits for somebody's word.
            self._db.post(store.hold_queue, controller.name, JOB_ENDED)
            await self.set_status(row, Status.CANCELLED)
            await jobmodes.leave(controller)
        return True

    async def _enter(self, controller: Controller, row: Row) -> ProblemError | None:
        """Put the machine into the job's mode; why it does not go."""
        try:
            await jobmodes.enter(controller, row, self._db, self._clock)
        except ProblemError as problem:
            return problem
        return None

    async def _back_to_queue(self, controller: Controller, row: Row, why: ProblemError) -> None:
        """Nothing was sent; somebody has to ask again."""
        log.info("%s: job %d goes back to the queue: %s", controller.name, row["id"], why)
        effect = SetStatus(Status(row["status"]), Status.QUEUED, row["line_done"])
        hold, at = Hold(why.code, why.detail), stamp(self._clock)

        def write(db: Database) -> None:
            store.set_status(db, row["id"], effect, at=at)
            store.hold_queue(db, controller.name, hold)

        await self._db.run(write)
        await self._announce(row)

    async def _begin(self, controller: Controller, row: Row, plan: Plan, held: Held | None) -> None:
        try:
            controller.check_can_start(checking=Policy.of(row).check)
            self._check_stands_there(controller, held)
        except ProblemError as problem:
            # It was torn down while the program was read.
            await self._back_to_queue(controller, row, problem)
            await jobmodes.leave(controller)
            return
        if held is not None:
            controller.stream.note(STARTED_IN, job=row["id"], **held.to_json())
        self.run_plan(controller, row, plan, before=Status.CHECKING, hold=controller.stream.beginning.held)

    def _check_stands_there(self, controller: Controller, held: Held | None) -> None:
        """Frames were worked out from one place. Raises ProblemError where the machine is not known to stand there."""
        if controller.hand is not None and held is not None and held.position != controller.program_position:
            raise ProblemError("wrong_state", f"{controller.name} does not stand any more where it was planned from.")

    def run_plan(
        self,
        controller: Controller,
        row: Row,
        plan: Plan,
        *,
        before: Status,
        hold: bool,
        next_seq: int = 1,
        seconds: float = 0.0,
    ) -> None:
        """Give the machine to the job. Nothing is awaited since the check that it may. `hold`: it stands still before
        its first line, until somebody lets it go on."""
        if controller.hand is not None:
            controller.hand.forget()
        runner = Runner(
            row["id"],
            controller.config.resume_within,
            Feed(plan.planner, next_seq),
            Ledger(
                cursor=Cursor.at(max(plan.line, row["start_line"]) - 1),
                position=dict(controller.program_position),
                seconds_done=seconds,
            ),
            announced=before,
            delivery=controller.config.dialect.delivery(),
            policy=Policy.of(row),
            has_changer=controller.config.has_changer,
        )
        if plan.prologue:
            controller.stream.note("prologue", job=row["id"], line=plan.line, blocks=list(plan.prologue))
        # A daemon that dies within the first second must not leave a job without a sign of life (elvinto §5.5).
        controller.stream.alive()
        controller.stream.begin(row, runner, runner.begin(hold=hold))
        self._background.begin(self._estimates.supply(controller, row, runner))

    async def set_status(self, row: Row, status: Status, error: JobError | None = None) -> None:
        """Of a job that no runner has."""
        effect = SetStatus(Status(row["status"]), status, row["line_done"], error=error)
        await self._db.run(store.set_status, row["id"], effect, at=stamp(self._clock))
        await self._announce(row)

    async def leave_queue(self, row: Row, status: Status) -> bool:
        """Of a job that waits: it is checked or cancelled now. False, and nothing changes, where it does not wait."""
        left = await self._db.run(store.leave_queue, row["id"], status, at=stamp(self._clock))
        if left:
            await self._announce(row)
        return left

    async def _announce(self, row: Row) -> None:
        now = await self._db.run(store.job, row["id"])
        assert now is not None
        self._hub.publish("job", row["machine"], job_view(now, self._clock))

    # --- the daemon has begun ---------------------------------------------------------------------------------

    async def adopt(self, controller: Controller) -> None:
        """Take up what a daemon before us left on this machine: before its port is opened."""
        controller.checking_for = await jobmodes.left_behind(controller, self._db)
        if controller.checking_for is not None:
            controller.on_ready = partial(self._clear_up, controller)
        row = await self._db.run(store.active_job, controller.name)
        if row is not None and row["status"] == Status.CHECKING:
            await self.set_status(row, Status.QUEUED)
            row = None
        if row is None:
            await self._db.run(store.hold_queue, controller.name, RESTARTED)
        else:
            await self._adopt(controller, row)

    def _clear_up(self, controller: Controller) -> None:
        self._background.begin(jobmodes.clear_up(controller, self._hub, self._db))

    async def _adopt(self, controller: Controller, row: Row) -> None:
        delivery = controller.config.dialect.delivery()
        past = await self._db.run(journal.past, row["id"], most_open=delivery.most_open)
        alive_at = await self._db.run(journal.alive_at, controller.name)
        status = Status(row["status"])
        opened = past.open
        runner = Runner(
            row["id"],
            controller.config.resume_within,
            Feed(next_seq=past.next_seq),
            Ledger(
                cursor=Cursor.at(row["line_done"]),
                position=past.position,
                seconds_done=past.seconds_done,
                executed=past.executed,
            ),
            delivery=delivery,
            policy=Policy.of(row),
            has_changer=controller.config.has_changer,
        )
        adopted = Adopted(
            status,
            open=opened,
            hold=bool(row["hold"]),
            tool=row["tool"],
            error=store.error_of(row),
            restarted=bool(row["restarted"]),
        )
        last_life_at = controller.stream.adopt_alive(alive_at)
        controller.stream.begin(row, runner, runner.adopt(adopted, last_life_at=last_life_at))
        self._background.begin(self._estimates.supply(controller, row, runner))
        controller.stream.note("daemon_started", open=[entry.wire_id for entry in opened], line_done=row["line_done"])
        if status is not Status.INTERRUPTED:
            behind = Behind(row["line_done"], past.part)
            if opened:
                batch = opened[-1].batch
                behind = Behind(batch.line_behind(len(batch.blocks) - 1), batch.part)
            self._background.begin(self._supply(controller, row, runner, behind))

    async def _supply(self, controller: Controller, row: Row, runner: Runner, behind: Behind) -> None:
        """What comes after the open rows. Reading a long program takes longer than settling their fate."""
        piece = self.pieces[controller.name]
        try:
            began = await began_in(self._db, row)
            planner = await self.worker.run(
                self.planning.go_on, piece, row, line=behind.line + 1, part=behind.part, began=began
            )
            runner.supply(planner)
        except (*UNSTARTABLE, LocalError) as error:
            runner.unreadable(str(error))
        controller.pump()
