"""What may go: ended jobs with their journals, the old end of the history, programs that no job names. In pieces.

Runs inside the db thread. Not when that is asked (server/store/retention.py), not the chain of hashes (history.py,
seals.py). The one rule: a job is removed only when it has ended and stands sealed in the history, and the history says
that it was removed before the first row of it is gone: a daemon that dies in between goes on where it was, and nobody
who verifies the history takes the rest for damage.
"""

from collections.abc import Iterable

from sqlite_utils import Database

from jobs import history, seals
from jobs.job import ENDED

PIECE_ROWS = 1000
"""Rows that are deleted at once: some milliseconds, in which no journal of a running job is written."""
PIECE_JOBS = 50
MIN_PRUNED = 200
"""The history is cut only when so many events go: each cut leaves an event itself."""

_SETTLED = f"status in ({', '.join(repr(str(status)) for status in sorted(ENDED))}) and sealed = 1"
_TOO_MANY = f"""
select id from jobs where machine = ? and {_SETTLED} and id < (
    select id from jobs where machine = ? and {_SETTLED} order by id desc limit 1 offset ?) order by id limit ?
"""  # noqa: S608 - constants
_TOO_OLD = f"select id from jobs where {_SETTLED} and ended_at < ? order by id limit ?"  # noqa: S608
_OLDEST = """
select events.id, events.at, jobs.id as kept from events
left join jobs on jobs.id = events.job and jobs.sealed < 2 order by events.id limit ?
"""
_UNUSED = """
select id from programs left join program_uploads on program_uploads.program = programs.id
where coalesce(program_uploads.at, programs.created_at) < ?
  and not exists (select 1 from jobs where jobs.program = programs.id or jobs.source_program = programs.id)
  and not exists (select 1 from expansions join jobs on jobs.program = expansions.expanded
                  where expansions.source = programs.id)
order by created_at limit ?
"""


def expired(db: Database, *, ended_before: str | None, keep: int) -> list[int]:
    """Some jobs that may go: those that ended before this time, and of each machine all but the newest `keep` (0: all
    may stay)."""
    if ended_before is not None:
        found = [int(row["id"]) for row in db.query(_TOO_OLD, [ended_before, PIECE_JOBS])]
        if found:
            return found
    if keep:
        for row in list(db.query("select distinct machine from jobs")):
            values = [row["machine"], row["machine"], keep - 1, PIECE_JOBS]
            found = [int(job["id"]) for job in db.query(_TOO_MANY, values)]
            if found:
                return found
    return []


def condemn(db: Database, jobs: Iterable[int], *, at: str) -> None:
    """Say in the history that these jobs are removed; `remove_some` then does it."""
    ids = sorted(jobs)
    for job in ids:
        db.execute("update jobs set sealed = 2 where id = ?", [job])
    if ids:
        history.append(db, at=at, kind=seals.FORGOTTEN, data={"jobs": ids})


def remove_some(db: Database) -> bool:
    """One piece of what is condemned; False when nothing is left of it."""
    row = next(db.query("select id from jobs where sealed = 2 order by id limit 1"), None)
    if row is None:
        return False
    gone = db.execute(
        "delete from batches where job = ? and seq in (select seq from batches where job = ? order by seq limit ?)",
        [row["id"], row["id"], PIECE_ROWS],
    ).rowcount
    if gone < PIECE_ROWS:
        db.execute("delete from jobs where id = ?", [row["id"]])
    return True


def prune_some(db: Database, *, before: str | None, at: str) -> int:
    """Remove a piece of the old end of the history: what lies before the first event of any job that is kept, and
    before this time where one is given. How many events went."""
    up_to, count = 0, 0
    for row in db.query(_OLDEST, [PIECE_ROWS]):
        if row["kept"] is not None or (before is not None and row["at"] >= before):
            break
        up_to, count = int(row["id"]), count + 1
    return 0 if count < MIN_PRUNED else history.prune(db, up_to, at=at)


def unused_programs(db: Database, *, created_before: str, limit: int = PIECE_JOBS) -> list[str]:
    """Programs that were uploaded before this time and that no job names, not even through its expansion."""
    return [str(row["id"]) for row in db.query(_UNUSED, [created_before, limit])]
