"""Routes of jobs: the queue, one job, what to do with it, and its journal.

Not the rules of a job (`jobs/job.py`). The one rule: only an explicit POST here makes a machine move.
"""

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Annotated

from fastapi import FastAPI, Header, Path, Query, Request
from starlette.responses import Response

from server.access.auth import Role
from server.api.machines import find
from server.api.models import (
    BatchView,
    JobEventView,
    JobReportView,
    JobRequest,
    JobView,
    MoveRequest,
)
from server.api.recovermodels import RecoverRequest, RecoverView
from server.api.routing import Routes, json_response, still_there
from server.api.services import Jobs, Json, Services

JobId = Annotated[int, Path(ge=1, le=2**53, description="The job's id", examples=[17])]

DEFAULT_PAGE = 100
MAX_PAGE = 1000

NEEDS_IDLE = ("not_connected", "alarm_active", "machine_busy", "job_active")
"""A job that was held may begin at once."""
ACTIONS: tuple[tuple[str, str, Callable[[Jobs, int], Awaitable[Json]], tuple[str, ...]], ...] = (
    ("pause", "Pause after the batch in flight", lambda jobs, job_id: jobs.pause(job_id), ()),
    ("resume", "Go on, or release a job that was held", lambda jobs, job_id: jobs.resume(job_id), NEEDS_IDLE),
    ("cancel", "Cancel after the batch in flight", lambda jobs, job_id: jobs.cancel(job_id), ()),
)


def install(app: FastAPI, services: Services) -> None:
    """All routes under /jobs."""
    _create(app, services)
    _views(app, services)
    _actions(app, services)
    _places(app, services)
    _journal(app, services)


def _create(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "jobs")

    @routes.add(
        "POST",
        "/jobs",
        role=Role.OPERATOR,
        summary="Queue a job",
        model=JobView,
        status=201,
        errors=(
            "unknown_program",
            "unknown_machine",
            "preflight_failed",
            "preflight_warnings",
            "empty_program",
            "idempotency_conflict",
            "queue_full",
            "not_supported",
            "needs_force",
            "too_large",
            "disk_full",
            "process_ended",
        ),
    )
    async def create_job(
        request: Request,
        body: JobRequest,
        idempotency_key: Annotated[
            str | None, Header(min_length=1, max_length=255, description="Makes a repeat of this request harmless")
        ] = None,
    ) -> Response:
        """The program is checked first; what stands against it is in `report` of the 422. The machine starts to move
        as soon as it is free, unless `hold` is set. O-words, parameters and macros are expanded: `program` of the job
        is the plain program that is run, `source_program` the uploaded one, and `start_line` and `end_line` are lines
        of the plain one, asked for under its id. The answer waits for the check, which takes seconds for each million
        lines the first time: who goes away before it ends gets no job; who asks again joins the check."""
        find(services, body.machine)
        job = await services.jobs.create(
            body.program,
            body.machine,
            start_line=body.start_line,
            end_line=body.end_line,
            hold=body.hold,
            note=body.note,
            force=body.force,
            idempotency_key=idempotency_key,
            mode=body.mode,
            on_error=body.on_error,
            ignored_errors=body.ignored_errors,
            still_wanted=partial(still_there, request),
        )
        return json_response(job, 201, {"Location": f"/api/v1/jobs/{job['id']}"})


def _views(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "jobs")

    @routes.add("GET", "/jobs", role=Role.VIEWER, summary="List jobs, newest first", model=list[JobView])
    async def list_jobs(
        machine: Annotated[str | None, Query(max_length=64, description="Only of this machine")] = None,
        status: Annotated[
            str | None, Query(max_length=200, description="Only in these", examples=["queued,running"])
        ] = None,
        limit: Annotated[int, Query(ge=1, le=MAX_PAGE, description="How many at most")] = DEFAULT_PAGE,
        before: Annotated[
            int | None, Query(ge=1, le=2**53, description="Only jobs with a lower id: the next page")
        ] = None,
    ) -> Response:
        return json_response(await services.jobs.list(machine, status, limit, before))

    @routes.add("GET", "/jobs/{id}", role=Role.VIEWER, summary="Show a job", model=JobView, errors=("unknown_job",))
    async def get_job(id: JobId) -> Response:
        return json_response(await services.jobs.get(id))


def _actions(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "jobs")
    refusals = ("unknown_job", "wrong_state")
    for verb, summary, act, errors in ACTIONS:
        declare = routes.add(
            "POST",
            f"/jobs/{{id}}/{verb}",
            role=Role.OPERATOR,
            summary=summary,
            model=JobView,
            status=202,
            errors=(*refusals, *errors),
        )
        declare(_action(services, verb, act))

    @routes.add(
        "POST",
        "/jobs/{id}/rerun",
        role=Role.OPERATOR,
        summary="Queue the same job again",
        model=JobView,
        status=201,
        errors=(
            *refusals,
            "unknown_program",
            "unknown_machine",
            "preflight_failed",
            "preflight_warnings",
            "empty_program",
            "needs_force",
            "not_supported",
            "queue_full",
            "process_ended",
        ),
    )
    async def rerun_job(id: JobId) -> Response:
        job = await services.jobs.rerun(id)
        return json_response(job, 201, {"Location": f"/api/v1/jobs/{job['id']}"})


def _places(app: FastAPI, services: Services) -> None:
    """Where a job stands in the queue, and where in its program it goes on."""
    routes = Routes(app, "jobs")
    refusals = ("unknown_job", "wrong_state")

    @routes.add(
        "POST",
        "/jobs/{id}/move",
        role=Role.OPERATOR,
        summary="Change a job's place in the queue",
        model=JobView,
        errors=refusals,
    )
    async def move_job(id: JobId, body: MoveRequest) -> Response:
        return json_response(await services.jobs.move(id, body.position))

    @routes.add(
        "POST",
        "/jobs/{id}/recover",
        role=Role.OPERATOR,
        summary="Go on after an interruption",
        model=RecoverView,
        errors=(*refusals, "not_connected", "alarm_active", "machine_busy"),
    )
    async def recover_job(id: JobId, body: RecoverRequest | None = None) -> Response:
        """Without an action nothing happens: the answer is the plan, with the certain lines, the lines in doubt and the
        blocks that would go out, from the line of the body or from the first that is not certain. With an action the
        machine starts to move."""
        if body is None:
            return json_response(await services.jobs.recover(id))
        return json_response(await services.jobs.recover(id, body.action, body.line, body.wish()))


def _action(
    services: Services, verb: str, act: Callable[[Jobs, int], Awaitable[Json]]
) -> Callable[..., Awaitable[Response]]:
    async def endpoint(id: JobId) -> Response:
        return json_response(await act(services.jobs, id), 202)

    endpoint.__name__ = f"{verb}_job"
    return endpoint


After = Annotated[int, Query(ge=0, le=2**53, description="Only rows with a higher `seq` (batches) or `id` (events)")]


def _journal(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "jobs")

    @routes.add(
        "GET",
        "/jobs/{id}/batches",
        role=Role.VIEWER,
        summary="Show the journal of a job",
        model=list[BatchView],
        errors=("unknown_job",),
    )
    async def get_batches(id: JobId, after: After = 0) -> Response:
        """Which lines went out under which id of the wire, and what is known of them."""
        return json_response(await services.jobs.batches(id, after))

    @routes.add(
        "GET",
        "/jobs/{id}/events",
        role=Role.VIEWER,
        summary="Show what happened to a job",
        model=list[JobEventView],
        errors=("unknown_job",),
    )
    async def get_events(id: JobId, after: After = 0) -> Response:
        return json_response(await services.jobs.events(id, after))

    @routes.add(
        "GET",
        "/jobs/{id}/report",
        role=Role.VIEWER,
        summary="Show the report of a job",
        model=JobReportView,
        errors=("unknown_job",),
    )
    async def get_report(id: JobId) -> Response:
        return json_response(await services.jobs.report(id))
