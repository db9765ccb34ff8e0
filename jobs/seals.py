"""Seals: when a job has ended, its row and its journal are taken into the chain of the history by one hash.

Rows of the journal change while a job runs, so they carry no hash of their own. Runs inside the db thread, in pieces:
the journal of a long job has a million rows, and a stream on another machine waits for none of it. The one rule: what
has been sealed is never changed again, only removed as a whole by retention.py, which says so in the history.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from sqlite_utils import Database

from jobs import history
from jobs.history import Fault
from jobs.job import ENDED

SEALED = "journal_sealed"
FORGOTTEN = "jobs_forgotten"
PIECE_ROWS = 1000
"""Some milliseconds."""

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


@dataclass(slots=True)
class Digest:
    """The hash of a job on its way through its journal: `rows` so far, the last of them under `seq`."""

    job: int
    rows: int = 0
    seq: int = 0
    hash: Any = field(default_factory=hashlib.sha256)

    def take(self, db: Database) -> bool:
        """The next piece; False behind the last one."""
        if self.seq == 0:
            self._add(next(db.query(ONE_JOB, [self.job])))
        piece = list(db.query(PIECE, [self.job, self.seq, PIECE_ROWS]))
        for row in piece:
            self._add(row)
        if piece:
            self.rows, self.seq = self.rows + len(piece), int(piece[-1]["seq"])
        return len(piece) == PIECE_ROWS

    def _add(self, row: Mapping[str, Any]) -> None:
        self.hash.update(json.dumps(list(row.values())).encode() + b"\n")

    def view(self) -> dict[str, Any]:
        """As it stands in the history."""
        return {"rows": self.rows, "sha256": self.hash.hexdigest()}


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
    """The jobs that are not as they were sealed, and those that were removed without a word."""
    gone = {
        job
        for row in db.query("select data from events where type = ?", [FORGOTTEN])
        for job in history.said(row).get("jobs", ())
    }
    for row in db.query("select id, job, data from events where type = ? order by id", [SEALED]):
        job = row["job"]
        if job in gone:  # its rows may be on their way out yet (retention.py)
            continue
        if next(db.query("select 1 from jobs where id = ?", [job]), None) is None:
            yield Fault(row["id"], f"job {job}, which it sealed, is missing")
            continue
        digest = Digest(job)
        while digest.take(db):
            pass
        told, found = history.said(row), digest.view()
        if told.get("rows") != found["rows"]:
            rows = f"{found['rows']} rows; {told.get('rows')} were sealed"
            yield Fault(row["id"], f"the journal of job {job} has {rows}")
        elif told != found:
            yield Fault(row["id"], f"job {job} or its journal was changed after its end")


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
