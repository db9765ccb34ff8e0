"""The route of the audit: who has asked for what, for admins, page by page, also as a table for a spreadsheet.

Not the table (server/access/audit.py). The one rule: what somebody has typed is text in every program that opens the
answer: a cell that a spreadsheet would take for a formula begins with an apostrophe.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from fastapi import FastAPI, Query
from pydantic import BeforeValidator
from starlette.responses import Response

from server.access.audit import COLUMNS, Wanted
from server.access.auth import Role
from server.api.accessmodels import AuditView
from server.api.routing import Routes, json_response
from server.api.services import Services
from server.clock import rfc3339


def _written(value: object) -> object:
    """pydantic would take a bare number, too, for seconds since 1970."""
    try:
        float(str(value))
    except ValueError:
        return value
    raise ValueError("a time is written like 2026-03-01T09:00:00Z")


Moment = Annotated[datetime, BeforeValidator(_written)]

DEFAULT_PAGE = 100
MAX_PAGE = 1000
MAX_CHARS = 80
FORMULA = tuple("=+-@＝＋－＠")
"""With these a cell begins that Excel, LibreOffice and Google Sheets compute, blanks before it or not; with the wide
ones those that are set to Chinese or Japanese."""
CONTROL = ("\t", "\r", "\n")
"""Nor does a cell begin with these: what reads the table again may drop them."""
CSV_HEADERS = {"Content-Disposition": 'attachment; filename="audit.csv"'}
CSV_COLUMNS = ("id", *COLUMNS)
AS_TABLE = {
    "responses": {
        "200": {"content": {"text/csv": {"schema": {"type": "string"}, "example": ",".join(CSV_COLUMNS) + "\r\n"}}}
    }
}


def install(app: FastAPI, services: Services) -> None:
    """The route /audit."""
    routes = Routes(app, "access")

    @routes.add(
        "GET",
        "/audit",
        role=Role.ADMIN,
        summary="Who has asked for what, newest first",
        model=list[AuditView],
        openapi_extra=AS_TABLE,
    )
    async def get_audit(
        token: Annotated[str | None, Query(max_length=MAX_CHARS, description="Only of this token (its id)")] = None,
        name: Annotated[str | None, Query(max_length=MAX_CHARS, description="Only of this name")] = None,
        machine: Annotated[str | None, Query(max_length=64, description="Only of this machine")] = None,
        job: Annotated[int | None, Query(ge=1, le=2**53, description="Only of this job")] = None,
        method: Annotated[
            str | None, Query(max_length=10, description="POST, PATCH, PUT, DELETE, WS, MQTT or COMMAND")
        ] = None,
        status: Annotated[int | None, Query(ge=100, le=599, description="Only with this status")] = None,
        code: Annotated[str | None, Query(max_length=MAX_CHARS, description="Only with this code")] = None,
        since: Annotated[Moment | None, Query(description="Not before this time")] = None,
        until: Annotated[Moment | None, Query(description="Only before this time")] = None,
        limit: Annotated[int, Query(ge=1, le=MAX_PAGE, description="How many at most")] = DEFAULT_PAGE,
        before: Annotated[
            int | None, Query(ge=1, le=2**53, description="Only rows with a lower id: the next page")
        ] = None,
        format: Annotated[  # noqa: A002 - its name in the address
            Literal["json", "csv"], Query(description="csv: a table for a spreadsheet")
        ] = "json",
    ) -> Response:
        """Each request and message that changes something, also those that were refused, and what was done with tokens
        on the command line. Rows carry the hash of the one before; `millstream history verify` looks them over."""
        wanted = Wanted(
            token=token,
            name=name,
            machine=machine,
            job=job,
            method=method,
            status=status,
            code=code,
            since=_utc(since),
            until=_utc(until),
        )
        rows = await services.audit.find(wanted, before, limit)
        if format == "csv":
            return Response(as_csv(rows), 200, CSV_HEADERS, "text/csv; charset=utf-8")
        return json_response(rows)


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """RFC 4180, with a row of names first."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(CSV_COLUMNS)
    writer.writerows([[_cell(row[column]) for column in CSV_COLUMNS] for row in rows])
    return text.getvalue()


def _cell(value: object) -> object:
    if isinstance(value, str):
        shown = "".join(char if char.isprintable() else " " for char in value)
        return f"'{shown}" if shown.lstrip().startswith(FORMULA) or value.startswith(CONTROL) else shown
    return value


def _utc(at: datetime | None) -> str | None:
    """A time without a zone is UTC."""
    if at is None:
        return None
    return rfc3339(at.replace(tzinfo=UTC) if at.tzinfo is None else at.astimezone(UTC))
