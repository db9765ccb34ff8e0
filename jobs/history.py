"""The history: what happened, append-only, each row carrying the hash of the one before. Runs inside the db thread.

The one rule: rows are written by `append` alone and never touched again (triggers in the schema refuse it). A row
that was changed, taken out or slipped in breaks the chain, and `verify` says where.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from sqlite_utils import Database

GENESIS = "0" * 64
MAX_DATA_CHARS = 256 * 1024
"""A dump of the last frames is the largest thing written; a machine cannot make the database grow without bound."""


def append(
    db: Database, *, at: str, kind: str, data: Mapping[str, Any], machine: str | None = None, job: int | None = None
) -> int:
    """Write an event; its number."""
    last = next(db.query("select hash from events order by id desc limit 1"), None)
    previous = GENESIS if last is None else str(last["hash"])
    text = json.dumps(data, sort_keys=True)
    if len(text) > MAX_DATA_CHARS:
        text = json.dumps({"cut": True, "text": text[: MAX_DATA_CHARS // 2]})
    link = _link(previous, at, machine, job, kind, text)
    cursor = db.execute(
        "insert into events (at, machine, job, type, data, previous, hash) values (?, ?, ?, ?, ?, ?, ?)",
        [at, machine, job, kind, text, previous, link],
    )
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def of_job(db: Database, job: int, *, limit: int, after: int = 0) -> list[dict[str, Any]]:
    """The events of a job, oldest first."""
    rows = db.query("select * from events where job = ? and id > ? order by id limit ?", [job, after, limit])
    return [_view(row) for row in rows]


def newest(db: Database, job: int, kind: str) -> dict[str, Any] | None:
    """What the newest event of this kind says of a job; None where there is none, or it had to be cut."""
    query = "select data from events where job = ? and type = ? order by id desc limit 1"
    row = next(db.query(query, [job, kind]), None)
    data: dict[str, Any] = {} if row is None else json.loads(row["data"])
    return None if row is None or data.get("cut") else data


def verify(db: Database) -> int | None:
    """The number of the first event that does not fit the chain; None when all is in order."""
    previous, expected = GENESIS, 1
    for row in _all(db):
        link = _link(previous, row["at"], row["machine"], row["job"], row["type"], row["data"])
        if row["id"] != expected or row["previous"] != previous or row["hash"] != link:
            return int(row["id"])
        previous, expected = row["hash"], expected + 1
    return None


def _all(db: Database) -> Iterator[dict[str, Any]]:
    return db.query("select * from events order by id")


def _link(previous: str, *fields: object) -> str:
    return hashlib.sha256(json.dumps([previous, *fields]).encode()).hexdigest()


def _view(row: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("id", "at", "machine", "job", "type", "hash")
    return {key: row[key] for key in keys} | {"data": json.loads(row["data"])}
