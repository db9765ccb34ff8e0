"""A database in memory with the daemon's tables, and rows to put into it."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlite_utils import Database

from jobs import store
from jobs.schema import prepare

AT = "2026-03-01T09:00:00.000Z"


@contextmanager
def database() -> Iterator[Database]:
    """With all tables, empty; closed at the end."""
    db = Database(sqlite3.connect(":memory:"))
    prepare(db)
    try:
        yield db
    finally:
        db.close()


def job_fields(**changes: Any) -> dict[str, Any]:
    """What a new job is made of."""
    fields: dict[str, Any] = {
        "machine": "router",
        "program": "p",
        "program_name": "part.nc",
        "hold": False,
        "note": None,
        "forced": False,
        "start_line": 1,
        "end_line": 10,
        "lines": 10,
        "total_seconds": 60.0,
        "idempotency_key": None,
        "mode": "run",
        "on_error": None,
        "ignored_errors": None,
        "request_hash": "h",
        "rerun_of": None,
        "source_program": None,
        "hold_code": None,
        "hold_message": None,
    }
    return fields | changes


def add_job(db: Database, **changes: Any) -> int:
    """A queued job; its number."""
    return int(store.add_job(db, job_fields(**changes), at=AT)["id"])
