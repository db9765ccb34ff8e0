"""Routes of programs: upload, list, source, check, toolpath, delete.

Not the store (`server/programs/service.py`). The one rule: the content of a program is never in memory as a whole.
"""

from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import FastAPI, Path, Query, Request
from starlette.responses import Response, StreamingResponse

from gcode.toolpath import MAX_LEVEL
from server.access.auth import Role
from server.api.models import PROGRAM_ID, CheckView, ProgramView, SourceView
from server.api.routing import Routes, json_response
from server.api.services import Services
from server.api.upload import MAX_NAME_CHARS, FileOfForm, gathered, is_multipart, program_name
from server.problems import ProblemError

ProgramId = Annotated[str, Path(pattern=r"^[0-9a-f]{64}$", description="The program's id", examples=[PROGRAM_ID])]

MAX_SOURCE_LINES = 10_000
"""Lines in one answer; a million-line program is read in pages."""
DEFAULT_SOURCE_LINES = 1000

UPLOAD_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The file itself, or a form with the part `file`; streamed to disk.",
        "content": {
            "application/octet-stream": {
                "schema": {"type": "string", "format": "binary"},
                "example": "G21 G90\\nG0 X0 Y0\\nM30\\n",
            },
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {"file": {"type": "string", "format": "binary"}},
                },
                "example": {"file": "part.nc"},
            },
        },
    }
}


def install(app: FastAPI, services: Services) -> None:
    """All routes under /programs."""
    _upload(app, services)
    _views(app, services)
    _contents(app, services)
    _drawing(app, services)
    _removal(app, services)


def _upload(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "programs")

    @routes.add(
        "POST",
        "/programs",
        role=Role.OPERATOR,
        summary="Upload a program",
        model=ProgramView,
        status=201,
        streamed=True,
        errors=("too_large", "programs_full", "disk_full", "not_a_program", "empty_program"),
        openapi_extra=UPLOAD_BODY,
    )
    async def upload_program(
        request: Request,
        name: Annotated[str | None, Query(max_length=MAX_NAME_CHARS, description="The file's name")] = None,
    ) -> Response:
        """`curl --data-binary @part.nc '…/programs?name=part.nc'`. The same content again gives the same id."""
        _refuse_too_large(request, services.config.server.max_upload_bytes)
        chunks: AsyncIterator[bytes] = request.stream()
        form_name = None
        if is_multipart(request):
            form = FileOfForm(request)
            await form.find()
            form_name = form.name
            chunks = form.chunks()
        program, _created = await services.programs.store(gathered(chunks), program_name(name, form_name))
        return json_response(program, 201, {"Location": f"/api/v1/programs/{program['id']}"})


def _refuse_too_large(request: Request, limit_bytes: int) -> None:
    """An upload that says it is too large is refused before it has been sent. The store counts all the same."""
    declared = request.headers.get("content-length", "")
    if declared.isdecimal() and int(declared) > limit_bytes:
        raise ProblemError(
            "too_large",
            f"The upload has {declared} bytes; server.max_upload_bytes allows {limit_bytes}.",
            limit_bytes=limit_bytes,
        )


def _views(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "programs")

    @routes.add(
        "GET", "/programs", role=Role.VIEWER, summary="List the programs, newest first", model=list[ProgramView]
    )
    async def list_programs() -> Response:
        return json_response(await services.programs.list())

    @routes.add(
        "GET",
        "/programs/{id}",
        role=Role.VIEWER,
        summary="Show a program",
        model=ProgramView,
        errors=("unknown_program",),
    )
    async def get_program(id: ProgramId) -> Response:
        return json_response(await services.programs.get(id))


def _contents(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "programs")

    @routes.add(
        "GET",
        "/programs/{id}/source",
        role=Role.VIEWER,
        summary="Show lines of a program",
        model=SourceView,
        errors=("unknown_program",),
    )
    async def get_source(
        id: ProgramId,
        first: Annotated[int, Query(alias="from", ge=1, le=2**53, description="First line")] = 1,
        last: Annotated[int | None, Query(alias="to", ge=1, le=2**53, description="Last line")] = None,
    ) -> Response:
        """At most 10,000 lines at a time; without `to` 1,000 of them."""
        end = first + DEFAULT_SOURCE_LINES - 1 if last is None else last
        if not first <= end < first + MAX_SOURCE_LINES:
            raise ProblemError("invalid_request", f"`to` must be from {first} to {first + MAX_SOURCE_LINES - 1}.")
        return json_response(await services.programs.source(id, first, end))

    @routes.add(
        "GET",
        "/programs/{id}/check",
        role=Role.VIEWER,
        summary="Check a program for a machine",
        model=CheckView,
        errors=("unknown_program", "unknown_machine", "process_ended"),
    )
    async def check_program(
        id: ProgramId,
        machine: Annotated[str | None, Query(max_length=64, description="The machine that is to run it")] = None,
        profile: Annotated[
            str | None, Query(max_length=64, description="Or only its kind", examples=["elvinto"])
        ] = None,
    ) -> Response:
        """The same as `millstream check --json`. Nothing moves."""
        if (machine is None) == (profile is None):
            raise ProblemError("invalid_request", "Name either `machine` or `profile`.")
        return json_response(await services.programs.check(id, machine=machine, profile=profile))


def _drawing(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "programs")
    packed = {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}, "example": "MSTP…"}}

    @routes.add(
        "GET",
        "/programs/{id}/toolpath",
        role=Role.VIEWER,
        summary="Show the path of a program, packed for drawing",
        content=packed,
        errors=("unknown_program", "unknown_machine", "no_preview", "disk_full", "process_ended"),
    )
    async def get_toolpath(
        request: Request,
        id: ProgramId,
        machine: Annotated[str | None, Query(max_length=64, description="The machine that is to run it")] = None,
        profile: Annotated[
            str | None, Query(max_length=64, description="Or only its kind", examples=["elvinto"])
        ] = None,
        level: Annotated[
            int, Query(ge=0, le=MAX_LEVEL, description="Of detail; 0 is everything, what is not there the coarsest")
        ] = 0,
    ) -> Response:
        """Binary, docs/toolpath.md. Without `machine` and `profile`, for the profile that all machines share.

        `If-None-Match` is answered with 304. The first request for a long program takes some seconds.
        """
        if machine is not None and profile is not None:
            raise ProblemError("invalid_request", "Name either `machine` or `profile`.")
        drawing = await services.programs.toolpath(id, machine=machine, profile=profile, level=level)
        headers = {"ETag": drawing.etag, "Cache-Control": "private, no-cache"}
        if _has_already(request, drawing.etag):
            return Response(status_code=304, headers=headers)
        length, chunks = await drawing.open()
        headers["Content-Length"] = str(length)
        return StreamingResponse(chunks, headers=headers, media_type="application/octet-stream")


def _has_already(request: Request, etag: str) -> bool:
    """RFC 9110 §13.1.2: weak comparison, a list, or any."""
    known = [tag.strip().removeprefix("W/") for tag in request.headers.get("if-none-match", "").split(",")]
    return etag in known or "*" in known


def _removal(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "programs")

    @routes.add(
        "DELETE",
        "/programs/{id}",
        role=Role.OPERATOR,
        summary="Delete a program",
        status=204,
        errors=("unknown_program", "program_in_use"),
    )
    async def delete_program(id: ProgramId) -> Response:
        """The history of its jobs stays."""
        await services.programs.delete(id)
        return Response(status_code=204)
