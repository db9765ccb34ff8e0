"""The rows of jobs and programs. Functions that run inside the db thread; not the journal, not the history.

The one rule: every change of a status goes through `set_status`, which checks it against the table of job.py and
writes it into the history in the same transaction.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from sqlite_utils import Database

from jobs import history, holds
from jobs.effects import SetStatus
from jobs.experience import Run
from jobs.holds import Hold
from jobs.job import ACTIVE, ENDED, JobError, Status, check_transition

Row = Mapping[str, Any]
FIELDS_OF_A_NEW_JOB = (
    "machine",
    "program",
    "program_name",
    "hold",
    "note",
    "forced",
    "start_line",
    "end_line",
    "lines",
    "total_seconds",
    "idempotency_key",
    "request_hash",
    "rerun_of",
    "source_program",
    "mode",
    "on_error",
    "ignored_errors",
    "hold_code",
    "hold_message",
)
FIELDS_OF_A_PROGRAM = ("id", "name", "lines", "bytes", "sha256", "created_at", "source_program")


def _marks(values: Iterable[object]) -> str:
    return ", ".join("?" for _ in values)


# --- programs -------------------------------------------------------------------------------------------------


def add_program(db: Database, row: Mapping[str, Any]) -> tuple[Row, bool]:
    """Remember a program. The same content again changes nothing: the row as it is, and whether it is new."""
    known = program(db, row["id"])
    if known is not None:
        db.execute("insert or replace into program_uploads values (?, ?)", [row["id"], row["created_at"]])
        return known, False
    db.execute(
        f"insert into programs ({', '.join(FIELDS_OF_A_PROGRAM)}) values ({_marks(FIELDS_OF_A_PROGRAM)})",  # noqa: S608
        [row[key] for key in FIELDS_OF_A_PROGRAM],
    )
    return dict(row), True


def program(db: Database, id: str) -> Row | None:
    """One program, or None."""
    return next(db.query("select * from programs where id = ?", [id]), None)


def program_ids(db: Database) -> set[str]:
    """Of all programs."""
    return {str(row["id"]) for row in db.query("select id from programs")}


def programs(db: Database, *, limit: int) -> list[Row]:
    """The newest first."""
    return list(db.query("select * from programs order by created_at desc, id limit ?", [limit]))


def delete_program(db: Database, id: str) -> int | None:
    """Forget it; or the number of a job that has not ended and needs it, and nothing is changed.

    A job of an expanded program needs the uploaded one too: its lines name those of it.
    """
    ended = list(ENDED)
    query = f"""select id from jobs where (program = ? or source_program = ?) and status not in ({_marks(ended)})
                limit 1"""  # noqa: S608
    needed = next(db.query(query, [id, id, *ended]), None)
    if needed is not None:
        return int(needed["id"])
    db.execute("delete from programs where id = ?", [id])
    db.execute("delete from program_uploads where program = ?", [id])
    db.execute("delete from expansions where source = ? or expanded = ?", [id, id])
    return None


def add_expansion(db: Database, source: str, row: Mapping[str, Any], version: str) -> tuple[Row, bool] | None:
    """Remember what was made of `source`; the program's row and whether it is new, None when `source` is gone."""
    if program(db, source) is None:
        return None
    added = add_program(db, row)
    db.execute("insert or replace into expansions values (?, ?, ?)", [source, row["id"], version])
    return added


def expansion(db: Database, source: str, version: str) -> Row | None:
    """The program that this version made of `source`, or None."""
    query = """select programs.* from programs join expansions on programs.id = expansions.expanded
               where expansions.source = ? and expansions.version = ?"""
    return next(db.query(query, [source, version]), None)


# --- jobs -----------------------------------------------------------------------------------------------------


def create_job(db: Database, fields: Mapping[str, Any], *, at: str, queue_limit: int) -> Row | None:
    """A new job, or the one that was made under the same Idempotency-Key; None when the queue is full."""
    key = fields["idempotency_key"]
    known = None if key is None else job_by_key(db, key)
    if known is not None:
        return known
    if queue_lengths(db).get(fields["machine"], 0) >= queue_limit:
        return None
    return add_job(db, fields, at=at)


def add_job(db: Database, fields: Mapping[str, Any], *, at: str) -> Row:
    """A new job at the end of its machine's queue."""
    top = next(db.query("select coalesce(max(rank), 0) as top from jobs where machine = ?", [fields["machine"]]))
    columns = ("status", "rank", "line_done", "restarted", "created_at", *FIELDS_OF_A_NEW_JOB)
    values = [Status.QUEUED, top["top"] + 1, fields["start_line"] - 1, 0, at]
    values += [fields.get(name) for name in FIELDS_OF_A_NEW_JOB]
    cursor = db.execute(f"insert into jobs ({', '.join(columns)}) values ({_marks(columns)})", values)  # noqa: S608
    assert cursor.lastrowid is not None
    data = {"program": fields["program"], "name": fields["program_name"], "hold": bool(fields["hold"])}
    data |= {"hold_code": fields.get("hold_code")} if fields["hold"] else {}
    history.append(db, at=at, machine=fields["machine"], job=cursor.lastrowid, kind="created", data=data)
    row = job(db, cursor.lastrowid)
    assert row is not None
    return row


def job(db: Database, id: int) -> Row | None:
    """One job, or None."""
    return next(db.query("select * from jobs where id = ?", [id]), None)


def job_by_key(db: Database, idempotency_key: str) -> Row | None:
    """The job that was made under this Idempotency-Key."""
    return next(db.query("select * from jobs where idempotency_key = ?", [idempotency_key]), None)


def jobs(db: Database, *, machine: str | None, statuses: tuple[str, ...], limit: int, before: int | None) -> list[Row]:
    """The newest first; `before` is the id to go on from."""
    where, values = ["1"], list[object]()
    if machine is not None:
        where.append("machine = ?")
        values.append(machine)
    if statuses:
        where.append(f"status in ({_marks(statuses)})")
        values.extend(statuses)
    if before is not None:
        where.append("id < ?")
        values.append(before)
    query = f"select * from jobs where {' and '.join(where)} order by id desc limit ?"  # noqa: S608
    return list(db.query(query, [*values, limit]))


def active_job(db: Database, machine: str) -> Row | None:
    """The job that has, or had when the daemon died, this machine."""
    active = list(ACTIVE)
    query = f"select * from jobs where machine = ? and status in ({_marks(active)}) order by id limit 1"  # noqa: S608
    return next(db.query(query, [machine, *active]), None)


def last_check(db: Database, machine: str) -> Row | None:
    """The newest job of this machine that is, or was, a check by the controller itself."""
    return next(
        db.query("select * from jobs where machine = ? and mode = 'check' order by id desc limit 1", [machine]), None
    )


def queue(db: Database, machine: str) -> list[Row]:
    """The jobs that wait for this machine, in order."""
    return list(db.query("select * from jobs where machine = ? and status = 'queued' order by rank", [machine]))


def queue_lengths(db: Database) -> dict[str, int]:
    """How many jobs wait, by machine."""
    rows = db.query("select machine, count(*) as n from jobs where status = 'queued' group by machine")
    return {row["machine"]: row["n"] for row in rows}


def counts(db: Database) -> dict[str, int]:
    """How many jobs there are, by status."""
    return {row["status"]: row["n"] for row in db.query("select status, count(*) as n from jobs group by status")}


def move(db: Database, id: int, place: int) -> bool:
    """Put a queued job at `place` (0 is the head) of its machine's queue; False when it does not wait any more."""
    row = job(db, id)
    if row is None or row["status"] != Status.QUEUED:
        return False
    ids = [other["id"] for other in queue(db, row["machine"]) if other["id"] != id]
    ids.insert(max(0, place), id)
    # Whole numbers anew: halving ranks would run out of bits some day.
    for rank, other in enumerate(ids, 1):
        db.execute("update jobs set rank = ? where id = ?", [rank, other])
    return True


def leave_queue(db: Database, id: int, after: Status, *, at: str) -> bool:
    """A job that waits begins to be checked, or is cancelled. False, and nothing is changed, where it does not wait any
    more, or is to begin and was put on hold: looking and doing are one transaction, for both may be asked at once."""
    row = job(db, id)
    if row is None or row["status"] != Status.QUEUED or (after is Status.CHECKING and row["hold"]):
        return False
    set_status(db, id, SetStatus(Status.QUEUED, after, row["line_done"]), at=at)
    return True


def hold_waiting(db: Database, id: int, hold: bool) -> bool:
    """Whether a job that waits is on hold; False, and nothing is changed, where it does not wait any more."""
    why = (holds.ASKED.code, holds.ASKED.message) if hold else (None, None)
    query = "update jobs set hold = ?, hold_code = ?, hold_message = ? where id = ? and status = 'queued'"
    return db.execute(query, [hold, *why, id]).rowcount == 1


def set_hold(db: Database, id: int, hold: bool) -> None:
    """Whether the job is to stand still."""
    db.execute("update jobs set hold = ? where id = ?", [hold, id])


def hold_queue(db: Database, machine: str, why: Hold) -> int:
    """Nothing in this queue may start by itself any more; how many jobs that concerned."""
    query = """update jobs set hold = 1, hold_code = ?, hold_message = ?
               where machine = ? and status = 'queued' and hold = 0"""
    return db.execute(query, [why.code, why.message, machine]).rowcount


def set_status(db: Database, id: int, effect: SetStatus, *, at: str) -> None:
    """Change a job's status, error and tool. Raises LocalError for a change that the table does not know."""
    row = job(db, id)
    assert row is not None
    before = Status(row["status"])
    if before is not effect.after:
        check_transition(before, effect.after)
    error = effect.error or JobError("", "")
    query = """
        update jobs set status = ?, line_done = ?, tool = ?, restarted = ?, error_code = ?, error_message = ?,
               error_line_from = ?, error_line_to = ?, started_at = coalesce(started_at, ?), ended_at = ?
        where id = ?
    """
    started = at if effect.after is Status.RUNNING else None
    ended = at if effect.after in ENDED else None
    values = [effect.after, effect.line_done, effect.tool, effect.restarted, error.code or None, error.message or None]
    db.execute(query, [*values, error.line_from, error.line_to, started, ended, id])
    data = {"from": before, "to": effect.after, "line_done": effect.line_done, "tool": effect.tool}
    data |= {"error": None if effect.error is None else effect.error.view()}
    history.append(db, at=at, machine=row["machine"], job=id, kind="status", data=data)


def set_pace(db: Database, id: int, planned_s: float, moving_s: float) -> None:
    """What a job has executed so far: the planned seconds of it, and what it really took."""
    db.execute("update jobs set planned_seconds = ?, moving_seconds = ? where id = ?", [planned_s, moving_s, id])


def runs(db: Database, machine: str, *, limit: int) -> list[Run]:
    """How the last jobs that this machine completed compare with their plans, the newest first."""
    query = """
        select planned_seconds, moving_seconds from jobs
        where machine = ? and status = 'completed' and planned_seconds > 0 and moving_seconds > 0
        order by id desc limit ?
    """
    return [Run(row["planned_seconds"], row["moving_seconds"]) for row in db.query(query, [machine, limit])]


def error_of(row: Row) -> JobError | None:
    """The error that stands in a row."""
    if row["error_code"] is None:
        return None
    return JobError(row["error_code"], row["error_message"] or "", row["error_line_from"], row["error_line_to"])
