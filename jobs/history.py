"""The history: what happened, append-only, each row carrying the hash of the one before. Runs inside the db thread.

The one rule: rows are written by `append` alone and never touched again (triggers in the schema refuse it). A row
that was changed, taken out or slipped in breaks the chain, and `faults` says where. Retention takes rows away from the
old end alone, through `prune`, which leaves an anchor: the hash from which the kept part goes on.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sqlite_utils import Database

from protocol.errors import LocalError

GENESIS = "0" * 64
MAX_DATA_CHARS = 256 * 1024
"""A dump of the last frames is the largest thing written; a machine cannot make the database grow without bound."""
PRUNED = "history_pruned"
"""The event that vouches for the anchor."""
AUDIT_PRUNED = "audit_pruned"
"""The event that vouches for the anchor of the audit (server/access/audit.py). The newest one outlives the old end of
the history, or the audit could be cut off anywhere once it is gone."""
OF_TOOLS = "select * from events where (substr(type, 1, 2) = 'io' or substr(type, 1, 4) = 'tool')"
"""As the index of m014_tool_events has it, to the letter: else it is not used, and the writer waits for the reader."""
SET_ANCHOR = "insert or replace into history_anchor (id, up_to, hash, at) values (1, ?, ?, ?)"


@dataclass(frozen=True, slots=True)
class Anchor:
    """Where the kept part begins: the events up to `up_to` were removed, `hash` is that of the last of them."""

    up_to: int = 0
    hash: str = GENESIS


@dataclass(frozen=True, slots=True)
class Fault:
    """Something in the history that is not as it was written: at which event, and what."""

    event: int
    what: str


def append(
    db: Database, *, at: str, kind: str, data: Mapping[str, Any], machine: str | None = None, job: int | None = None
) -> int:
    """Write an event; its number."""
    last = next(db.query("select hash from events order by id desc limit 1"), None)
    previous = anchor(db).hash if last is None else str(last["hash"])
    text = json.dumps(data, sort_keys=True)
    if len(text) > MAX_DATA_CHARS:
        text = json.dumps({"cut": True, "text": text[: MAX_DATA_CHARS // 2]})
    own = link(previous, at, machine, job, kind, text)
    cursor = db.execute(
        "insert into events (at, machine, job, type, data, previous, hash) values (?, ?, ?, ?, ?, ?, ?)",
        [at, machine, job, kind, text, previous, own],
    )
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def of_job(db: Database, job: int, *, limit: int, after: int = 0) -> list[dict[str, Any]]:
    """The events of a job, oldest first."""
    rows = db.query("select * from events where job = ? and id > ? order by id limit ?", [job, after, limit])
    return [_view(row) for row in rows]


def of_tools(db: Database, machine: str, *, limit: int, after: int = 0) -> list[dict[str, Any]]:
    """The events of a machine's tool changer, with a job or without, oldest first."""
    rows = db.query(f"{OF_TOOLS} and machine = ? and id > ? order by id limit ?", [machine, after, limit])
    return [_view(row) for row in rows]


def newest(db: Database, job: int, kind: str) -> dict[str, Any] | None:
    """What the newest event of this kind says of a job; None where there is none, or it had to be cut."""
    query = "select data from events where job = ? and type = ? order by id desc limit 1"
    row = next(db.query(query, [job, kind]), None)
    data: dict[str, Any] = {} if row is None else json.loads(row["data"])
    return None if row is None or data.get("cut") else data


def latest_of(db: Database, job: int, *kinds: str) -> str | None:
    """Which of these kinds the newest event of a job has; None where it has none of them."""
    marks = ", ".join("?" * len(kinds))
    query = f"select type from events where job = ? and type in ({marks}) order by id desc limit 1"  # noqa: S608
    row = next(db.query(query, [job, *kinds]), None)
    return None if row is None else str(row["type"])


# --- the old end ----------------------------------------------------------------------------------------------


def anchor(db: Database) -> Anchor:
    """Where the kept part begins."""
    row = next(db.query("select up_to, hash from history_anchor"), None)
    return Anchor() if row is None else Anchor(row["up_to"], row["hash"])


def prune(db: Database, up_to: int, *, at: str) -> int:
    """Remove the events up to this number; how many. The rest can be verified as before. Raises LocalError where there
    is no such event.

    The anchor comes first: the triggers let go of what is before it, and of nothing else.
    """
    row = next(db.query("select hash from events where id = ?", [up_to]), None)
    if row is None:
        raise LocalError(f"there is no event {up_to} to prune the history up to")
    _say_again(db, AUDIT_PRUNED, up_to, at)
    append(db, at=at, kind=PRUNED, data={"up_to": up_to, "hash": row["hash"]})
    db.execute(SET_ANCHOR, [up_to, row["hash"], at])
    return db.execute("delete from events where id <= ?", [up_to]).rowcount


def _say_again(db: Database, kind: str, up_to: int, at: str) -> None:
    """The last event of this kind that goes is said once more, as it stands there: for what it says must be known as
    long as what it vouches for. Where there is a later one it does no harm."""
    query = "select data from events where id <= ? and type = ? order by id desc limit 1"
    row = next(db.query(query, [up_to, kind]), None)
    if row is not None:
        append(db, at=at, kind=kind, data=said(row))


# --- looking it over ------------------------------------------------------------------------------------------


def verify(db: Database) -> int | None:
    """The number of the first event that does not fit the chain; None when all is in order."""
    first = next(faults(db), None)
    return None if first is None else first.event


def faults(db: Database) -> Iterator[Fault]:
    """Everything in the chain that is not as it was written, the oldest first."""
    begin = anchor(db)
    previous, expected, vouched = begin.hash, begin.up_to + 1, begin.up_to == 0
    for row in db.query("select * from events order by id"):
        number = int(row["id"])
        if number != expected:
            yield Fault(min(number, expected), _gap(expected, number - 1))
        elif row["previous"] != previous:
            yield Fault(number, "it does not follow from the event before: one of them was replaced")
        if row["hash"] != link(row["previous"], *(row[key] for key in ("at", "machine", "job", "type", "data"))):
            yield Fault(number, "its content or its hash was changed")
        vouched = vouched or (row["type"] == PRUNED and said(row) == _vouch(begin))
        previous, expected = row["hash"], number + 1
    if not vouched:
        yield Fault(begin.up_to, "no event tells of the removal of the history up to this one")
    if (top := _top(db)) >= expected:
        # The numbers are never given again, so the last rows cannot vanish unseen.
        yield Fault(expected, _gap(expected, top))


def said(row: Mapping[str, Any]) -> dict[str, Any]:
    """The data of an event; empty where somebody has made something else of it."""
    try:
        data = json.loads(row["data"])
    except ValueError:
        return {}
    return data if isinstance(data, dict) else {}


def _vouch(begin: Anchor) -> dict[str, Any]:
    return {"up_to": begin.up_to, "hash": begin.hash}


def _top(db: Database) -> int:
    """The highest number that was ever given."""
    row = next(db.query("select seq from sqlite_sequence where name = 'events'"), None)
    return 0 if row is None else int(row["seq"])


def _gap(first: int, last: int) -> str:
    if last < first:
        return "it stands before where the history begins"
    return "it is missing" if first == last else f"the events {first} to {last} are missing"


def link(previous: str, *fields: object) -> str:
    """The hash of a row behind the one that has the hash `previous`; for other chains of this database, too."""
    return hashlib.sha256(json.dumps([previous, *fields]).encode()).hexdigest()


def _view(row: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("id", "at", "machine", "job", "type", "hash")
    return {key: row[key] for key in keys} | {"data": json.loads(row["data"])}
