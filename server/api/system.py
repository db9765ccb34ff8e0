"""Routes of the daemon itself: liveness, metrics, its own documentation, and the pages of `web/`.

Not the dashboard's logic (`web/`). The one rule: only files of `web/` are served, found by listing it, never by
joining a path from a request.
"""

import mimetypes
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import Annotated, Any

from fastapi import FastAPI, Path, Request
from starlette.responses import Response

from server.api.models import Health
from server.api.routing import Routes, json_response
from server.api.services import Services
from server.auth import Role
from server.metrics import MEDIA_TYPE as METRICS_MEDIA_TYPE
from server.metrics import exposition
from server.problems import ProblemError

MEDIA_TYPES = {
    ".js": "text/javascript",
    ".json": "application/json",
    ".mjs": "text/javascript",
    ".svg": "image/svg+xml",
    ".wasm": "application/wasm",
}
"""What `mimetypes` reads from the system differs between systems; scripts are refused under another type."""


def install(app: FastAPI, services: Services, describe: Callable[[], str]) -> None:
    """The routes outside the machines. `describe` gives the OpenAPI document as text."""
    _watching(app, services)
    _documentation(app, describe)
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
        errors=("disk_full",),
        content={
            "text/plain": {"schema": {"type": "string"}, "example": 'millstream_connected{machine="router"} 1.0\n'}
        },
    )
    async def metrics() -> Response:
        counts = await services.jobs.counts()
        text = exposition(services.machines, services.hub, counts)
        return Response(text, media_type=METRICS_MEDIA_TYPE)


def _documentation(app: FastAPI, describe: Callable[[], str]) -> None:
    routes = Routes(app, "daemon")
    content = {"application/json": {"schema": {"type": "object"}, "example": {"openapi": "3.1.0"}}}

    @routes.add("GET", "/openapi.json", role=Role.PUBLIC, summary="This description of the API", content=content)
    async def openapi_json() -> Response:
        return Response(describe(), media_type="application/json")


def _pages(app: FastAPI) -> None:
    routes = Routes(app, "pages", prefix="")
    content: dict[str, Any] = {"text/html": {"schema": {"type": "string"}, "example": "<!doctype html>"}}

    @routes.add("GET", "/", role=Role.PUBLIC, summary="The dashboard", content=content)
    async def index(request: Request) -> Response:
        return page(request, "index.html")

    @routes.add("GET", "/docs", role=Role.PUBLIC, summary="The documentation of the API, to read", content=content)
    async def docs(request: Request) -> Response:
        return page(request, "docs.html")

    any_content = {"*/*": {"schema": {"type": "string", "format": "binary"}, "example": "export {}"}}

    @routes.add(
        "GET",
        "/web/{path:path}",
        role=Role.PUBLIC,
        summary="Scripts, styles and pictures of the pages",
        content=any_content,
        errors=("not_found",),
    )
    async def web_file(
        request: Request, path: Annotated[str, Path(max_length=255, description="File", examples=["app.js"])]
    ) -> Response:
        return page(request, path)


def page(request: Request, path: str) -> Response:
    """A file of `web/`, or 304 when the browser has it already. Raises ProblemError."""
    file = web_files().get(path)
    if file is None:
        raise ProblemError("not_found", f"There is no page {path[:100]!r}.")
    content = file.read_bytes()  # a few KiB from the page cache: not worth a thread
    etag = f'"{sha256(content).hexdigest()[:32]}"'
    headers = {"ETag": etag, "Cache-Control": "no-cache"}
    if request.headers.get("if-none-match") == etag:
        return Response(status_code=304, headers=headers)
    media_type = MEDIA_TYPES.get(file.suffix) or mimetypes.guess_type(file.name)[0] or "application/octet-stream"
    return Response(content, headers=headers, media_type=media_type)


@cache
def web_files() -> dict[str, FilePath]:
    """The files of the pages by the path under which they are served: inside the wheel, else in the repository.

    Type declarations are for people who work on the pages.
    """
    here = FilePath(__file__).resolve().parents[1]
    root = next((root for root in (here / "web", here.parent / "web") if (root / "index.html").is_file()), None)
    if root is None:
        return {}
    files = (file for file in sorted(root.rglob("*")) if file.is_file() and file.suffix != ".ts")
    return {file.relative_to(root).as_posix(): file for file in files}
