"""Who has asked for what: a row for each request that changes something, in a chain of hashes as the history is.

Not the judgement which requests those are (api/audittrail.py). The functions run inside the database thread. The one
rule: it never holds anything up. A row is posted after the request was obeyed, nobody waits for it, what cannot be
written waits in a bounded number, and a row that is faulty itself is dropped and counted rather than stop the journal.
"""

import logging
import sqlite3
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields, replace
from itertools import count
from typing import Any

from sqlite_utils import Database

from jobs import history
from jobs.history import Anchor, Fault
from server.background.dbthread import Db
from server.clock import Clock, stamp

log = logging.getLogger(__name__)

MAX_PENDING = 1000
"""Rows that wait for a disk that cannot be written; of what comes then only the number is kept."""
SCANNED_ROWS = 2000
"""Looked through at once for a page: some milliseconds in the thread that writes the journal, too."""
PIECE_ROWS = 1000
"""Removed at once."""
MIN_PRUNED = 200
"""Removed at least, for each piece leaves an event in the history."""
MAX_TEXT_CHARS = 200
PRUNED = history.AUDIT_PRUNED
"""The event of the history that vouches for the anchor."""
BY_COMMAND_LINE = "command line"


@dataclass(frozen=True, slots=True)
class Entry:
    """One row. `via`: bearer, session, local (no tokens), nobody (a wrong token), mqtt or command line; `address` is
    empty on this computer's command line, and the broker's for MQTT; `target` is the id of a program, token or backup.
    `lost`: so many rows before this one could not be kept. Holds no secret and no body."""

    at: str
    via: str
    token: str | None
    name: str
    address: str
    method: str
    route: str
    machine: str | None = None
    job: int | None = None
    target: str | None = None
    status: int = 200
    code: str | None = None
    lost: int = 0


COLUMNS = tuple(field.name for field in fields(Entry))
_INSERT = f"insert into audit ({', '.join(COLUMNS)}, previous, hash) values ({', '.join('?' * (len(COLUMNS) + 2))})"  # noqa: S608


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which rows somebody wants to see; None: all of them. `since` and `until` are times (RFC 3339, UTC)."""

    token: str | None = None
    name: str | None = None
    machine: str | None = None
    job: int | None = None
    method: str | None = None
    status: int | None = None
    code: str | None = None
    since: str | None = None
    until: str | None = None

    def conditions(self) -> tuple[str, list[Any]]:
        """As SQL."""
        tests: list[str] = []
        values: list[Any] = []
        for field in fields(self):
            if (value := getattr(self, field.name)) is not None:
                tests.append({"since": "at >= ?", "until": "at < ?"}.get(field.name, f"{field.name} = ?"))
                values.append(value)
        return " and ".join(tests) or "1", values


# --- in the database thread -----------------------------------------------------------------------------------


def append(db: Database, entry: Entry) -> int:
    """Write a row; its number."""
    last = next(db.query("select hash from audit order by id desc limit 1"), None)
    previous = anchor(db).hash if last is None else str(last["hash"])
    values = astuple(entry)
    cursor = db.execute(_INSERT, [*values, previous, history.link(previous, *values)])
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def page(db: Database, wanted: Wanted, before: int | None, limit: int) -> tuple[list[dict[str, Any]], int | None]:
    """Rows with a lower number than `before`, the newest first, out of SCANNED_ROWS; and from where to go on, None at
    the old end."""
    end = _top(db) + 1
    top = end if before is None else min(before, end)  # else a far number would be looked through piece by piece
    tests, values = wanted.conditions()
    columns = f"id, {', '.join(COLUMNS)}, hash"
    rows = list(
        db.query(
            f"select {columns} from audit where id < ? and id >= ? and {tests} order by id desc limit ?",  # noqa: S608
            [top, top - SCANNED_ROWS, *values, limit],
        )
    )
    if len(rows) == limit:
        return rows, int(rows[-1]["id"])
    rest = top - SCANNED_ROWS
    return rows, rest if rest > anchor(db).up_to + 1 else None


def anchor(db: Database) -> Anchor:
    """Where the kept part begins."""
    row = next(db.query("select up_to, hash from audit_anchor"), None)
    return Anchor() if row is None else Anchor(row["up_to"], row["hash"])


def prune_some(db: Database, *, keep_rows: int, before: str | None, at: str) -> int:
    """Remove a piece of the old end: what is more than `keep_rows`, or older than `before`. How many rows went."""
    begin = anchor(db).up_to
    too_many = _top(db) - keep_rows
    rows = db.query("select id, at, hash from audit where id > ? order by id limit ?", [begin, PIECE_ROWS])
    last = None
    for row in rows:
        if row["id"] > too_many and (before is None or row["at"] >= before):
            break
        last = row
    if last is None or last["id"] - begin < MIN_PRUNED:
        return 0
    vouch = {"up_to": last["id"], "hash": last["hash"]}
    history.append(db, at=at, kind=PRUNED, data=vouch)
    db.execute(
        "insert or replace into audit_anchor (id, up_to, hash, at) values (1, ?, ?, ?)", [last["id"], last["hash"], at]
    )
    return db.execute("delete from audit where id <= ?", [last["id"]]).rowcount


def faults(db: Database) -> Iterator[Fault]:
    """Everything in the chain that is not as it was written, the oldest first."""
    begin = anchor(db)
    previous, expected = begin.hash, begin.up_to + 1
    for row in db.query("select * from audit order by id"):
        number = int(row["id"])
        if number != expected:
            yield Fault(min(number, expected), "rows are missing before it")
        elif row["previous"] != previous:
            yield Fault(number, "it does not follow from the row before: one of them was replaced")
        if row["hash"] != history.link(row["previous"], *(row[column] for column in COLUMNS)):
            yield Fault(number, "its content or its hash was changed")
        previous, expected = row["hash"], number + 1
    if not _vouched(db, begin):
        yield Fault(begin.up_to, "no event of the history tells of the removal of the rows up to this one")
    if _top(db) >= expected:
        yield Fault(expected, "it is missing, and those behind it")


def counts(db: Database) -> dict[str, int]:
    """How much there is to look over."""
    (rows,) = db.query("select count(*) as n from audit")
    return {"audit": rows["n"], "audit_removed": anchor(db).up_to}


def _vouched(db: Database, begin: Anchor) -> bool:
    if begin.up_to == 0:
        return True
    told = (history.said(row) for row in db.query("select data from events where type = ?", [PRUNED]))
    return {"up_to": begin.up_to, "hash": begin.hash} in told


def _top(db: Database) -> int:
    row = next(db.query("select seq from sqlite_sequence where name = 'audit'"), None)
    return 0 if row is None else int(row["seq"])


# --- on the loop ----------------------------------------------------------------------------------------------


class Audit:
    """The rows of the running daemon."""

    def __init__(self, db: Db, clock: Clock) -> None:
        self._db = db
        self._clock = clock
        self._numbers = count(1)
        self._pending: set[int] = set()
        self._lost = 0
        self.lost_in_all = 0
        """Rows that could not be kept since the daemon began."""

    def note(self, entry: Entry) -> None:
        """Keep a row, at the present time. Never waits, never raises."""
        if len(self._pending) >= MAX_PENDING:
            self._lose()
            return
        number = next(self._numbers)
        self._pending.add(number)
        entry = replace(entry, at=stamp(self._clock), lost=self._lost)
        self._lost = 0
        self._db.post(self._write, number, entry)

    async def find(self, wanted: Wanted, before: int | None, limit: int) -> list[dict[str, Any]]:
        """A page of rows, the newest first. Looks through the table piece by piece: the journal is written between."""
        found: list[dict[str, Any]] = []
        while len(found) < limit:
            rows, before = await self._db.read(page, wanted, before, limit - len(found))
            found += rows
            if before is None:
                break
        return found

    def _write(self, db: Database, number: int, entry: Entry) -> None:
        """In the database thread; again after a rollback, so it counts by name."""
        try:
            append(db, entry)
        except sqlite3.OperationalError:
            raise  # a full disk: it is tried again, as everything that was posted
        except Exception:
            log.exception("a row of the audit could not be written and is dropped")
            self._lose()
        self._pending.discard(number)

    def _lose(self) -> None:
        self._lost += 1
        self.lost_in_all += 1


def clean(text: object, limit: int = MAX_TEXT_CHARS) -> str:
    """Text of a request as it may stand in a row."""
    return str(text)[:limit].encode("utf-8", "replace").decode()
