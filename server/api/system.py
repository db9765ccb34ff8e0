"""Routes of the daemon itself: liveness, metrics, its own documentation, and the pages of `web/`.

Not the dashboard's logic (`web/`), nor how its files are packed (webfiles.py). The one rule: only files of `web/` are
served, found by listing it, never by joining a path from a request.
"""

from collections.abc import Callable
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import FastAPI, Path, Request
from starlette.responses import Response

from server.access.auth import Role
from server.api.models import Health
from server.api.routing import Routes, json_response
from server.api.services import Services
from server.api.webfiles import answer, web_file
from server.background.childworker import ChildEndedError
from server.metrics import MEDIA_TYPE as METRICS_MEDIA_TYPE
from server.metrics import Refused, exposition
from server.problems import ProblemError


def install(app: FastAPI, services: Services, describe: Callable[[], str]) -> None:
    """The routes outside the machines. `describe` makes the OpenAPI document as text, which takes long."""
    _watching(app, services)
    _documentation(app, services, describe)
    _pages(app)


def _watching(app: FastAPI, services: Services) -> None:
    routes = Routes(app, "daemon", prefix="")

    @routes.add("GET", "/healthz", role=Role.PUBLIC, summary="Is the daemon alive", model=Health)
    async def healthz() -> Response:
        return json_response({"status": "ok", "version": version("millstream")})

    @routes.add(
        "GET",
        "/metrics",
        role=Role.VIEWER,
        summary="Counters for Prometheus",
        content={
            "text/plain": {"schema": {"type": "string"}, "example": 'millstream_connected{machine="router"} 1.0\n'}
        },
    )
    async def metrics() -> Response:
        counts = await services.jobs.counts()
        text = exposition(services.machines, services.hub, counts, services.outbound, _refused(app, services))
        return Response(text, media_type=METRICS_MEDIA_TYPE)


def _refused(app: FastAPI, services: Services) -> Refused:
    tokens = {
        "unauthorized": services.tokens.attempts.guessed,
        "token_expired": services.tokens.expired,
        "too_many_attempts": services.tokens.attempts.refused,
    }
    sockets = {limit: app.state.sockets.refused[limit] for limit in ("sockets", "sockets_per_address")}
    return Refused(tokens, sockets, services.audit.lost_in_all)


def _documentation(app: FastAPI, services: Services, describe: Callable[[], str]) -> None:
    routes = Routes(app, "daemon")
    content = {"application/json": {"schema": {"type": "object"}, "example": {"openapi": "3.1.0"}}}

    text = ""

    @routes.add(
        "GET",
        "/openapi.json",
        role=Role.PUBLIC,
        summary="This description of the API",
        content=content,
        errors=("process_ended",),
    )
    async def openapi_json() -> Response:
        """Made when it is asked for the first time: that takes a second or two."""
        nonlocal text
        try:
            text = text or await services.describer.run(describe)
        except ChildEndedError as error:
            raise ProblemError(
                "process_ended", f"The description was not made: {error}. Ask again; memory may be short."
            ) from error
        return Response(text, media_type="application/json")


def _pages(app: FastAPI) -> None:
    routes = Routes(app, "pages", prefix="")
    content: dict[str, Any] = {"text/html": {"schema": {"type": "string"}, "example": "<!doctype html>"}}

    @routes.add("GET", "/", role=Role.PUBLIC, summary="The dashboard", content=content)
    async def index(request: Request) -> Response:
        return await page(request, "index.html")

    @routes.add("GET", "/docs", role=Role.PUBLIC, summary="The documentation of the API, to read", content=content)
    async def docs(request: Request) -> Response:
        return await page(request, "docs.html")

    any_content = {"*/*": {"schema": {"type": "string", "format": "binary"}, "example": "export {}"}}

    @routes.add(
        "GET",
        "/web/{path:path}",
        role=Role.PUBLIC,
        summary="Scripts, styles and pictures of the pages",
        content=any_content,
        errors=("not_found",),
    )
    async def file(
        request: Request, path: Annotated[str, Path(max_length=255, description="File", examples=["app.js"])]
    ) -> Response:
        return await page(request, path)


async def page(request: Request, path: str) -> Response:
    """A file of `web/`, or 304 when the browser has it already. Raises ProblemError."""
    file = await web_file(path)
    if file is None:
        raise ProblemError("not_found", f"There is no page {path[:100]!r}.")
    return answer(file, request.headers)
