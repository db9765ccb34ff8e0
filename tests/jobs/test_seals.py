"""Seals: what was sealed cannot be changed or vanish unseen, and a long journal is sealed in pieces."""

from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history, seals
from jobs.effects import SetStatus
from jobs.job import Status
from jobs.seals import Digest
from jobs.store import set_status
from tests.harness.rows import AT, add_job, database

LATER = "2026-03-01T10:00:00.000Z"
FIELDS = (
    'job, seq, machine, wire_id, line_from, line_to, blocks, seconds, "end", status, attempts, inferred, planned_at'
)

WHAT = "of the journal of job 1 was changed, removed or added"


def ended(db: Database, *, rows: int = 3, status: Status = Status.COMPLETED) -> int:
    """A job that was executed, with so many rows of journal."""
    job = add_job(db)
    for after in (Status.CHECKING, Status.RUNNING, status):
        before = Status(next(db.query("select status from jobs where id = ?", [job]))["status"])
        set_status(db, job, SetStatus(before, after, 10), at=AT)
    values: list[list[Any]] = [
        [job, seq, "router", 100 + seq, seq, seq, 1, 0.5, "{}", "ok", 1, 0, AT] for seq in range(1, rows + 1)
    ]
    db.conn.executemany(f"insert into batches ({FIELDS}) values ({', '.join('?' * 13)})", values)
    return job


def seal(db: Database, job: int) -> int:
    """Seal a job; in how many pieces."""
    digest, pieces = Digest(job), 1
    while not seals.seal(db, digest, at=LATER):
        pieces += 1
    return pieces


def found(db: Database) -> list[str]:
    return [fault.what for fault in seals.faults(db)]


def test_a_sealed_job_is_in_order_and_asked_for_no_more() -> None:
    with database() as db:
        job = ended(db)
        assert seals.unsealed(db, ended_before=AT) is None, "it has ended only now"
        assert seals.unsealed(db, ended_before=LATER) == job
        seal(db, job)
        assert seals.unsealed(db, ended_before=LATER) is None
        assert found(db) == []
        assert history.verify(db) is None
        assert seals.counts(db)["sealed"] == 1
        sealed = history.newest(db, job, seals.SEALED)
        assert sealed is not None
        assert sealed["rows"] == 3


@pytest.mark.parametrize("status", [Status.INTERRUPTED, Status.PAUSED])
def test_what_may_go_on_is_not_sealed(status: Status) -> None:
    with database() as db:
        ended(db, status=status)
        assert seals.unsealed(db, ended_before=LATER) is None


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("update batches set line_to = 99 where seq = 2", f"row 2 {WHAT}"),
        ("update batches set inferred = 1 where seq = 3", f"row 3 {WHAT}"),
        ("delete from batches where seq = 1", f"row 1 {WHAT}"),
        ("delete from batches where seq = 3", f"row 3 {WHAT}"),
        ("update batches set seq = 4 where seq = 3", f"row 3 {WHAT}; row 4 {WHAT}"),
        ("update batches set seq = 1000000000000 where seq = 3", f"row 3 {WHAT}; row 501 {WHAT}"),
        ("update batches set seq = -7 where seq = 1", f"row 1 {WHAT}"),
        ("update jobs set line_done = 3", "job 1 was changed after its end"),
        ("update jobs set status = 'failed'", "job 1 was changed after its end"),
        (
            "update jobs set lines = 9; update batches set machine = 'x' where seq = 1",
            f"job 1 was changed after its end; row 1 {WHAT}",
        ),
        ("delete from batches; delete from jobs", "job 1, which it sealed, is missing"),
    ],
)
def test_a_change_after_the_end_is_found(change: str, what: str) -> None:
    with database() as db:
        seal(db, ended(db))
        db.conn.executescript(change)
        assert found(db) == what.split("; ")
        assert history.verify(db) is None, "the history itself is in order"


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("delete from jobs where id = 2", "job 2, which it tells of, is missing"),
        ("insert", "no event tells that job 9 was made"),
        ("update jobs set id = 9 where id = 2", "no event tells that job 9 was made"),
        ("update jobs set sealed = 1 where id = 2", "job 2 is marked as sealed, and no event has its seal"),
    ],
)
def test_a_job_that_comes_or_goes_without_a_word_is_found(change: str, what: str) -> None:
    with database() as db:
        seal(db, ended(db))
        add_job(db)
        assert found(db) == []
        if change.startswith("insert"):
            columns = ", ".join(name for name in db.table("jobs").columns_dict if name not in ("id", "idempotency_key"))
            change = f"insert into jobs (id, {columns}) select 9, {columns} from jobs where id = 2"
        db.conn.execute("pragma foreign_keys = off")
        db.conn.execute(change)
        assert what in found(db)


def test_of_a_long_journal_some_rows_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seals, "MOST_MARKS", 4)
    with database() as db:
        seal(db, ended(db, rows=10))
        assert found(db) == []
        db.execute("update batches set attempts = 7 where seq = 5")
        db.execute("delete from batches where seq = 10")
        assert found(db) == [f"one of the rows 4 to 6 {WHAT}", f"one of the rows 10 to 12 {WHAT}"]


def test_a_change_that_the_marks_do_not_show_is_found_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seals, "MARK_CHARS", 0)
    with database() as db:
        seal(db, ended(db))
        db.execute("update batches set attempts = 7 where seq = 2")
        monkeypatch.setattr(seals, "_marks", lambda _text: [])
        assert found(db) == ["the journal of job 1 was changed after its end"]


def test_a_seal_that_somebody_has_emptied_is_a_fault_and_no_crash() -> None:
    with database() as db:
        seal(db, ended(db))
        db.execute("drop trigger events_no_update")
        for data in ("{}", "no JSON", '{"rows": "x", "marks": 7, "group_rows": -1}'):
            db.execute("update events set data = ? where type = ?", [data, seals.SEALED])
            assert found(db)[0] == "job 1 was changed after its end"


@pytest.mark.parametrize(("rows", "pieces"), [(0, 1), (3, 1), (4, 2), (9, 3)])
def test_in_pieces_it_is_the_same_seal(rows: int, pieces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with database() as db:
        job = ended(db, rows=rows)
        whole = Digest(job)
        while whole.take(db):
            pass
        monkeypatch.setattr(seals, "PIECE_ROWS", 4)
        assert seal(db, job) == pieces
        assert history.newest(db, job, seals.SEALED) == whole.view()
        assert found(db) == []
