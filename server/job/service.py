"""The queue and the history for the API: makes jobs, starts them, hands wishes on to the machine that has them.

Not the beginning (starting.py), the running (jobstream.py, jobs/runner.py) or the recovery (recovery.py). The one
rule: a job starts because somebody asked for it. One that waits without `hold` follows the one before it when that
was completed; whenever something else happens, the whole queue is put on hold, visibly.
"""

import asyncio
import hashlib
import json
import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from typing import Any

from jobs import history, journal, store
from jobs.delivery import Policy
from jobs.holds import JOB_ENDED, Hold, hold_view
from jobs.job import ENDED, Status
from jobs.store import Row
from protocol.commands import OnError
from server.background.dbthread import Db
from server.clock import Clock, stamp
from server.config.reentry import AS_CONFIGURED, ReentryWish
from server.job import newjob
from server.job.recovery import Recovery
from server.job.starting import Background, Starter
from server.live.hub import Hub
from server.machine import jobmodes
from server.machine.controller import Controller
from server.machine.views import job_view
from server.problems import ProblemError
from server.programs.service import ProgramService

log = logging.getLogger(__name__)

Views = list[dict[str, Any]]

BATCHES_LISTED = 10_000
EVENTS_LISTED = 10_000
"""Most rows of one answer, oldest first; `after` brings the next ones."""


class JobService:
    """See the head of this file."""

    def __init__(
        self,
        machines: Mapping[str, Controller],
        *,
        db: Db,
        hub: Hub,
        clock: Clock,
        programs: ProgramService,
        starter: Starter,
        background: Background,
        queue_limit: int,
    ) -> None:
        self.machines = machines
        self.db = db
        self.clock = clock
        self._hub = hub
        self._programs = programs
        self._queue_limit = queue_limit
        self._starter = starter
        self._background = background
        self._recovery = Recovery(db, starter)
        self._lengths: dict[str, int] = {}
        self._choosing = {name: asyncio.Lock() for name in machines}
        for name, machine in machines.items():
            machine.queue_length = partial(self._length, name)
            machine.stream.on_status = partial(self._on_status, name)

    # --- asking -----------------------------------------------------------------------------------------------

    async def list(self, machine: str | None, status: str | None, limit: int, before: int | None) -> Views:
        """Jobs, the newest first."""
        statuses = () if status is None else tuple(part.strip() for part in status.split(",") if part.strip())
        unknown = [part for part in statuses if part not in list(Status)]
        if unknown:
            raise ProblemError(
                "invalid_request", f"{unknown[0]!r} is no status of a job; there are: {', '.join(Status)}."
            )
        rows = await self.db.read(store.jobs, machine=machine, statuses=statuses, limit=limit, before=before)
        return [self._view(row) for row in rows]

    async def get(self, job_id: int) -> dict[str, Any]:
        """One job. Raises ProblemError."""
        return self._view(await self._shown(job_id))

    async def batches(self, job_id: int, after: int = 0) -> Views:
        """The journal of a job, the rows with a `seq` above `after`. Raises ProblemError."""
        await self._shown(job_id)
        return await self.db.read(journal.rows_of, job_id, limit=BATCHES_LISTED, after=after)

    async def events(self, job_id: int, after: int = 0) -> Views:
        """The history of a job, the events with an `id` above `after`. Raises ProblemError."""
        await self._shown(job_id)
        return await self.db.read(history.of_job, job_id, limit=EVENTS_LISTED, after=after)

    async def report(self, job_id: int) -> dict[str, Any]:
        """The job as a whole. Raises ProblemError."""
        row = await self._shown(job_id)
        return {"job": self._view(row), **await self.db.read(journal.totals, job_id)}

    async def counts(self) -> dict[str, int]:
        """How many jobs there are, by status."""
        return await self.db.read(store.counts)

    async def row(self, job_id: int) -> Row:
        """The job as it is, to decide upon. Raises ProblemError, also while nothing can be written."""
        return _found(await self.db.run(store.job, job_id), job_id)

    async def _shown(self, job_id: int) -> Row:
        """The job for people to look at, on a full disk, too. Raises ProblemError."""
        return _found(await self.db.read(store.job, job_id), job_id)

    def _length(self, machine: str) -> int:
        return self._lengths.get(machine, 0)

    def machine(self, name: str) -> Controller:
        """Raises ProblemError."""
        machine = self.machines.get(name)
        if machine is None:
            raise ProblemError("unknown_machine", f"There is no machine {name!r} in the configuration.")
        return machine

    def _view(self, row: Row) -> dict[str, Any]:
        machine = self.machines.get(row["machine"])
        if machine is not None and (live := machine.stream.view()) is not None and live["id"] == row["id"]:
            return live
        view = job_view(row, self.clock)
        if machine is not None and machine.stream.beginning.reserved == row["id"]:
            view["cancelling"] = machine.stream.beginning.cancelled
        return view

    async def recover(
        self, job_id: int, action: str | None = None, line: int | None = None, wish: ReentryWish = AS_CONFIGURED
    ) -> dict[str, Any]:
        """After `interrupted`: without an action the plan, else the job as it goes on. Raises ProblemError."""
        row = await self.row(job_id)
        if row["status"] != Status.INTERRUPTED:
            raise ProblemError("wrong_state", f"Job {job_id} is {row['status']}; only an interrupted job is recovered.")
        controller = self.machine(row["machine"])
        if action is None:
            return await self._recovery.plan(controller, row, line, wish)
        await self._recovery.go_on(controller, row, action, line, wish)
        return await self.get(job_id)

    # --- making -----------------------------------------------------------------------------------------------

    async def create(
        self,
        program_id: str,
        machine: str,
        *,
        start_line: int | None = None,
        end_line: int | None = None,
        hold: bool = False,
        note: str | None = None,
        force: bool = False,
        idempotency_key: str | None = None,
        rerun_of: int | None = None,
        source_program: str | None = None,
        mode: str = "run",
        on_error: OnError | None = None,
        ignored_errors: Sequence[int] | None = None,
        still_wanted: Callable[[], Awaitable[None]] | None = None,
    ) -> dict[str, Any]:
        """Queue a run of a program; it starts now if it can and nothing stands before it. Raises ProblemError.

        `still_wanted` raises where nobody waits for the answer any more: then no job is made.
        """
        controller = self.machine(machine)
        halts = controller.stream.beginning.halts
        modes = jobmodes.columns(controller, mode, on_error, ignored_errors)
        request = [program_id, machine, start_line, end_line, hold, note, force, *modes.values()]
        request_hash = hashlib.sha256(json.dumps(request).encode()).hexdigest()
        if idempotency_key is not None:
            known = await self.db.run(store.job_by_key, idempotency_key)
            if known is not None:
                return self._view(newjob.same_request(known, request_hash))
        with self._programs.needed(program_id, source_program):
            checked = await newjob.checked(self._programs, program_id, machine, mode, force=force)
            if still_wanted is not None:
                await still_wanted()
            first, last = newjob.lines_of(checked, start_line, end_line)
            self._starter.check_line(machine, first)
            fields = {
                "machine": machine,
                **newjob.of_program(checked),
                "source_program": source_program or checked.source,
                **newjob.held(controller, asked=hold),
                "note": note,
                "forced": force,
                "start_line": first,
                "end_line": last,
                "idempotency_key": idempotency_key,
                "request_hash": request_hash,
                "rerun_of": rerun_of,
                **modes,
            }
            made = await self.db.run(store.create_job, fields, at=stamp(self.clock), queue_limit=self._queue_limit)
        if made is None:
            raise ProblemError("queue_full", f"{self._queue_limit} jobs wait for {machine} (server.queue_limit).")
        row = newjob.same_request(made, request_hash)
        if checked.stored:
            controller.stream.note("check_writes", job=row["id"], lines=checked.stored)
        self._hub.publish("job", machine, self._view(row))
        await self._background.finish(self.start_next(machine, halts))
        return {**await self.get(row["id"]), "warnings": await jobmodes.warnings(self.db, row)}

    async def rerun(self, job_id: int) -> dict[str, Any]:
        """The same once more, as a new job. Raises ProblemError."""
        row = await self.row(job_id)
        return await self.create(
            row["program"],
            row["machine"],
            start_line=row["start_line"],
            end_line=row["end_line"],
            note=row["note"],
            force=bool(row["forced"]),
            rerun_of=job_id,
            source_program=row["source_program"],
            mode=row["mode"],
            on_error=row["on_error"],
            ignored_errors=sorted(Policy.of(row).ignored_errors),
        )

    # --- the queue --------------------------------------------------------------------------------------------

    async def move(self, job_id: int, position: int) -> dict[str, Any]:
        """Put a waiting job at a place of its queue, 1 is next. Raises ProblemError."""
        row = await self.row(job_id)
        if not await self.db.run(store.move, job_id, position - 1):
            raise ProblemError("wrong_state", f"Job {job_id} does not wait in the queue any more.")
        await self.announce_queue(row["machine"])
        return await self.get(job_id)

    async def queue(self, machine: str) -> Views:
        """What waits for this machine, in order."""
        rows = await self.db.read(store.queue, machine)
        return [
            {
                "id": row["id"],
                "program_name": row["program_name"],
                "hold": bool(row["hold"]),
                "hold_reason": hold_view(row),
            }
            for row in rows
        ]

    async def announce_queue(self, machine: str) -> None:
        """Tell everybody how the queue stands."""
        jobs = await self.queue(machine)
        self._lengths[machine] = len(jobs)
        self._hub.publish("queue", machine, {"jobs": jobs})

    def _on_status(self, machine: str, status: Status) -> None:
        """A job has changed. One that was completed makes way for the next; after any other end the queue holds, and
        where a pause was demanded in its last blocks: whoever pauses wants the machine to stand still."""
        runner = self.machines[machine].stream.runner
        if status is Status.COMPLETED and not (runner is not None and runner.holding):
            halts = self.machines[machine].stream.beginning.halts
            self._background.begin(self._after(machine, partial(self.start_next, halts=halts)))
        elif status in ENDED:
            # Posted at once: a wish that comes after this end (let the next one go) must not be overtaken by it.
            self.db.post(store.hold_queue, machine, JOB_ENDED)
            self._background.begin(self._after(machine, self.announce_queue))

    async def _after(self, machine: str, then: Callable[[str], Awaitable[None]]) -> None:
        await jobmodes.leave(self.machines[machine])
        await then(machine)

    # --- wishes -----------------------------------------------------------------------------------------------

    async def pause(self, job_id: int) -> dict[str, Any]:
        """Pause, or put on hold while it waits. Raises ProblemError."""
        if (controller := self._has_machine(job_id)) is not None:
            controller.pause()
            return await self.get(job_id)
        row = await self._waiting(job_id, "be paused")
        if not await self.db.run(store.hold_waiting, job_id, True):
            return await self.pause(job_id)  # it has begun in this moment
        await self.announce_queue(row["machine"])
        return await self.get(job_id)

    async def resume(self, job_id: int) -> dict[str, Any]:
        """Go on after a pause; or let a job that is on hold go, at once if it is next. Raises ProblemError."""
        if (controller := self._has_machine(job_id)) is not None:
            controller.resume()
            return await self.get(job_id)
        halts = {name: machine.stream.beginning.halts for name, machine in self.machines.items()}
        row = await self._waiting(job_id, "be resumed")
        controller = self.machine(row["machine"])
        if not controller.stream.moving:
            controller.check_can_start()
        await self.db.run(store.hold_waiting, job_id, False)
        await self._background.finish(self.start_next(row["machine"], halts[row["machine"]]))
        return await self.get(job_id)

    async def cancel(self, job_id: int) -> dict[str, Any]:
        """End it, after the batch in flight. Raises ProblemError."""
        if (controller := self._has_machine(job_id)) is not None:
            controller.stop()
            return await self.get(job_id)
        row = await self._waiting(job_id, "be cancelled")
        if not await self._starter.leave_queue(row, Status.CANCELLED):
            return await self.cancel(job_id)  # it has begun in this moment
        await self.announce_queue(row["machine"])
        return await self.get(job_id)

    def _has_machine(self, job_id: int) -> Controller | None:
        """The machine that this job has."""
        return next((machine for machine in self.machines.values() if machine.stream.active_job == job_id), None)

    async def _waiting(self, job_id: int, verb: str) -> Row:
        row = await self.row(job_id)
        if row["status"] != Status.QUEUED:
            raise ProblemError("wrong_state", f"Job {job_id} is {row['status']} and cannot {verb}.")
        return row

    # --- starting ---------------------------------------------------------------------------------------------

    async def start_next(self, machine: str, halts: int) -> None:
        """Start the first job of the queue that is not on hold, if the machine can take it. `halts`: those that there
        were when somebody, or the end of the job before, asked for it."""
        taken = False
        while not taken:
            async with self._choosing[machine]:
                row = await self._choose(self.machines[machine], halts)
            taken = row is None or await self._starter.start(self.machines[machine], row)
        await self.announce_queue(machine)

    async def _choose(self, controller: Controller, halts: int) -> Row | None:
        """The job that may begin; the machine is reserved for it."""
        rows = await self.db.run(store.queue, controller.name)
        row = next((row for row in rows if not row["hold"]), None)
        if row is None or controller.stream.moving:
            return None
        try:
            if controller.stream.beginning.halts != halts:
                raise ProblemError("wrong_state", "A stop or a pause was demanded meanwhile.")
            controller.check_can_start()
        except ProblemError as problem:
            log.info("%s: job %d is put on hold: %s", controller.name, row["id"], problem)
            await self.db.run(store.hold_queue, controller.name, Hold(problem.code, problem.detail))
            return None
        controller.stream.beginning.reserve(row["id"])
        return row

    async def adopt(self) -> None:
        """Take up what a daemon before us left: before any port is opened."""
        for name, controller in self.machines.items():
            await self._starter.adopt(controller)
            await self.announce_queue(name)

    async def close(self) -> None:
        """The daemon ends: what still goes on beside it does not."""
        await self._background.close()


def _found(row: Row | None, job_id: int) -> Row:
    if row is None:
        raise ProblemError("unknown_job", f"There is no job {job_id}.")
    return row
