"""Seals: when a job has ended, its row and its journal are taken into the chain of the history by one hash.

Rows of the journal change while a job runs, so they carry no hash of their own. Runs inside the db thread, in pieces:
the journal of a long job has a million rows, and a stream on another machine waits for none of it. The one rule: what
has been sealed is never changed again, only removed as a whole by retention.py, which says so in the history.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any

from sqlite_utils import Database

from jobs import history
from jobs.history import Fault
from jobs.job import ENDED

CREATED = "created"
SEALED = "journal_sealed"
FORGOTTEN = "jobs_forgotten"
PIECE_ROWS = 250
"""Some milliseconds."""
MOST_MARKS = 500
"""A journal of up to so many rows is marked row by row, a longer one in groups: 2 KB of history for each job."""
BEFORE_ALL = -(1 << 63)
"""Of the numbers that SQLite knows: a row that was slipped in below 1 is seen, too."""
MARK_CHARS = 4
"""Of a hash in hexadecimal: the marks only say where; whether anything differs the whole hash says."""
NO_ROWS = hashlib.sha256().hexdigest()[:MARK_CHARS]
JOB_MARK_CHARS = 16

# These were hashed: a list that was released is never edited; what has to change gets a kind of seal of its own.
JOB_FIELDS = (
    "id, machine, program, program_name, source_program, status, start_line, end_line, lines, line_done, mode, forced, "
    "error_code, error_message, error_line_from, error_line_to, rerun_of, created_at, started_at, ended_at"
)
ROW_FIELDS = (
    'seq, machine, wire_id, line_from, line_to, part, blocks, seconds, "end", status, attempts, inferred, planned_at, '
    "sent_at, received_at, ok_at"
)
ONE_JOB = f"select {JOB_FIELDS} from jobs where id = ?"  # noqa: S608
PIECE = f"select {ROW_FIELDS} from batches where job = ? and seq > ? order by seq limit ?"  # noqa: S608

# Retention keeps the events of each job that it keeps, and says in the history which it does not.
VANISHED = """
select id, job from events made where type = ? and not exists (select 1 from jobs where id = made.job)
and not exists (select 1 from events where job = made.job and type = ?) order by id
"""
SLIPPED_IN = """
select id from jobs where sealed < 2 and not exists (select 1 from events where job = jobs.id and type = ?) order by id
"""
UNTOLD = """
select id from jobs where sealed = 1 and not exists (select 1 from events where job = jobs.id and type = ?) order by id
"""


@dataclass(slots=True)
class Digest:
    """The hash of a job on its way through its journal: `rows` so far, the last of them under `seq`. `marks` are short
    hashes of `group_rows` rows each: of what differs they say where. 0: as many rows as make MOST_MARKS."""

    job: int
    group_rows: int = 0
    rows: int = 0
    seq: int | None = None
    hash: Any = field(default_factory=hashlib.sha256)
    marks: list[str] = field(default_factory=list[str])
    job_mark: str = ""
    _group: Any = field(default_factory=hashlib.sha256)

    def take(self, db: Database) -> bool:
        """The next piece; False behind the last one."""
        if self.seq is None:
            self.seq = BEFORE_ALL
            self._begin(db)
        piece = list(db.query(PIECE, [self.job, self.seq, PIECE_ROWS]))
        for row in piece:
            self._add(row)
        return len(piece) == PIECE_ROWS

    def _begin(self, db: Database) -> None:
        (last,) = db.query("select coalesce(max(seq), 0) as seq from batches where job = ?", [self.job])
        self.group_rows = self.group_rows or max(1, math.ceil(last["seq"] / MOST_MARKS))
        text = _text(next(db.query(ONE_JOB, [self.job])))
        self.hash.update(text)
        self.job_mark = hashlib.sha256(text).hexdigest()[:JOB_MARK_CHARS]

    def _add(self, row: Mapping[str, Any]) -> None:
        text = _text(row)
        self.hash.update(text)
        self.rows, self.seq = self.rows + 1, int(row["seq"])
        # Whatever number somebody has given to a row, there are no more marks than that.
        while len(self.marks) < min((self.seq - 1) // self.group_rows, MOST_MARKS):
            self._end_group()
        self._group.update(text)

    def _end_group(self) -> None:
        self.marks.append(self._group.hexdigest()[:MARK_CHARS])
        self._group = hashlib.sha256()

    def view(self) -> dict[str, Any]:
        """As it stands in the history. Behind the last row."""
        last = self._group.hexdigest()[:MARK_CHARS]
        marks = "".join([*self.marks, last] if self.rows else [])
        told = {"rows": self.rows, "sha256": self.hash.hexdigest()}
        return told | {"job": self.job_mark, "group_rows": self.group_rows, "marks": marks}


def _text(row: Mapping[str, Any]) -> bytes:
    return json.dumps(list(row.values())).encode() + b"\n"


def unsealed(db: Database, *, ended_before: str) -> int | None:
    """The oldest job that ended before this time and has no seal."""
    ended = ", ".join(f"'{status}'" for status in sorted(ENDED))
    query = f"select id from jobs where sealed = 0 and status in ({ended}) and ended_at < ? order by id limit 1"  # noqa: S608
    row = next(db.query(query, [ended_before]), None)
    return None if row is None else int(row["id"])


def seal(db: Database, digest: Digest, *, at: str) -> bool:
    """One piece of work on a job's seal; True when that stands in the history, or the job is gone."""
    row = next(db.query("select machine from jobs where id = ?", [digest.job]), None)
    if row is None:
        return True
    if digest.take(db):
        return False
    history.append(db, at=at, kind=SEALED, data=digest.view(), machine=row["machine"], job=digest.job)
    db.execute("update jobs set sealed = 1 where id = ?", [digest.job])
    return True


def faults(db: Database) -> Iterator[Fault]:
    """The jobs that are not as they were sealed, and those that came or went without a word."""
    gone = _gone(db)
    for row in db.query(VANISHED, [CREATED, SEALED]):
        if row["job"] not in gone:
            yield Fault(row["id"], f"job {row['job']}, which it tells of, is missing")
    for row in db.query(SLIPPED_IN, [CREATED]):
        yield Fault(0, f"no event tells that job {row['id']} was made")
    for row in db.query(UNTOLD, [SEALED]):
        yield Fault(0, f"job {row['id']} is marked as sealed, and no event has its seal")
    yield from _broken(db, gone)


def _gone(db: Database) -> set[int]:
    """The jobs of which the history says that they were removed."""
    return {
        job
        for row in db.query("select data from events where type = ?", [FORGOTTEN])
        for job in history.said(row).get("jobs", ())
    }


def _broken(db: Database, gone: set[int]) -> Iterator[Fault]:
    for row in db.query("select id, job, data from events where type = ? order by id", [SEALED]):
        job = row["job"]
        if job in gone:  # its rows may be on their way out yet (retention.py)
            continue
        if next(db.query("select 1 from jobs where id = ?", [job]), None) is None:
            yield Fault(row["id"], f"job {job}, which it sealed, is missing")
            continue
        told = history.said(row)
        digest = Digest(job, group_rows=_count(told.get("group_rows")))
        while digest.take(db):
            pass
        if (found := digest.view()) != told:
            yield from (Fault(row["id"], what) for what in _differences(job, told, found))


def _differences(job: int, told: Mapping[str, Any], found: Mapping[str, Any]) -> Iterator[str]:
    """What of a job and its journal is not as it was sealed."""
    if told.get("job") != found["job"]:
        yield f"job {job} was changed after its end"
    size, before, after = found["group_rows"], _marks(told.get("marks")), _marks(found["marks"])
    for group, (one, other) in enumerate(zip_longest(before, after, fillvalue=NO_ROWS)):
        if one != other:
            first, last = group * size + 1, (group + 1) * size
            rows = f"row {first}" if size == 1 else f"one of the rows {first} to {last}"
            yield f"{rows} of the journal of job {job} was changed, removed or added"
    if told.get("job") == found["job"] and before == after:
        yield f"the journal of job {job} was changed after its end"  # or a mark has two meanings


def _marks(text: object) -> list[str]:
    return [text[at : at + MARK_CHARS] for at in range(0, len(text), MARK_CHARS)] if isinstance(text, str) else []


def _count(value: object) -> int:
    return value if isinstance(value, int) and value > 0 else 0


def counts(db: Database) -> dict[str, int]:
    """How much there is to look over."""
    (events,) = db.query("select count(*) as n, coalesce(min(id), 0) as low, coalesce(max(id), 0) as high from events")
    (jobs,) = db.query("select count(*) as n, coalesce(sum(sealed = 1), 0) as sealed from jobs")
    return {
        "events": events["n"],
        "first": events["low"],
        "last": events["high"],
        "removed": history.anchor(db).up_to,
        "jobs": jobs["n"],
        "sealed": jobs["sealed"],
    }
