"""What may go and what stays: by age, by number, in pieces, and the history can be verified at every moment."""

import pytest
from sqlite_utils import Database

from jobs import history, retention, seals, store
from jobs.effects import SetStatus
from jobs.job import Status
from jobs.seals import Digest
from tests.harness.rows import AT, add_job, database, job_fields

OLD, NEW, NOW = "2025-01-01T00:00:00.000Z", "2026-02-01T00:00:00.000Z", "2026-03-01T10:00:00.000Z"
FIELDS = (
    'job, seq, machine, wire_id, line_from, line_to, blocks, seconds, "end", status, attempts, inferred, planned_at'
)


def ended(db: Database, at: str = OLD, *, machine: str = "router", rows: int = 3, program: str = "p") -> int:
    """A sealed job with so many rows of journal, that ended at this time."""
    job = int(store.add_job(db, job_fields(machine=machine, program=program), at=at)["id"])
    for before, after in (
        (Status.QUEUED, Status.CHECKING),
        (Status.CHECKING, Status.RUNNING),
        (Status.RUNNING, Status.COMPLETED),
    ):
        store.set_status(db, job, SetStatus(before, after, 10), at=at)
    values = [[job, seq, machine, 100 + seq, seq, seq, 1, 0.5, "{}", "ok", 1, 0, at] for seq in range(1, rows + 1)]
    db.conn.executemany(f"insert into batches ({FIELDS}) values ({', '.join('?' * 13)})", values)
    digest = Digest(job)
    while not seals.seal(db, digest, at=at):
        pass
    return job


def left(db: Database) -> list[int]:
    return [row["id"] for row in db.query("select id from jobs order by id")]


def in_order(db: Database) -> bool:
    return [*history.faults(db), *seals.faults(db)] == []


def remove(db: Database, *, before: str | None = None, keep: int = 0) -> int:
    """As server/store/retention.py does it; in how many pieces."""
    pieces = 0
    while jobs := retention.expired(db, ended_before=before, keep=keep):
        retention.condemn(db, jobs, at=NOW)
        assert in_order(db)
        while retention.remove_some(db):
            pieces += 1
            assert in_order(db), "a daemon may die between any two pieces"
    return pieces


def test_by_age() -> None:
    with database() as db:
        jobs = [ended(db, at) for at in (OLD, NEW, OLD)]
        remove(db, before=NEW)
        assert left(db) == [jobs[1]]
        assert next(db.query("select count(*) as n from batches"))["n"] == 3


def test_by_number_for_each_machine() -> None:
    with database() as db:
        router = [ended(db) for _ in range(4)]
        lathe = [ended(db, machine="lathe") for _ in range(2)]
        remove(db, keep=2)
        assert left(db) == [*router[2:], *lathe]


def test_what_has_not_ended_or_is_not_sealed_stays() -> None:
    with database() as db:
        waiting, unsealed, gone = add_job(db), ended(db), ended(db)
        db.execute("update jobs set sealed = 0 where id = ?", [unsealed])
        remove(db, before=NOW, keep=1)
        assert left(db) == [waiting, unsealed]
        assert gone not in left(db)


def test_a_long_journal_goes_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "PIECE_ROWS", 4)
    with database() as db:
        ended(db, rows=9)
        assert remove(db, before=NEW) == 3
        assert left(db) == []
        assert next(db.query("select count(*) as n from batches"))["n"] == 0


def events(db: Database) -> list[int]:
    return [row["id"] for row in db.query("select id from events order by id")]


def cut(db: Database, before: str | None) -> int:
    gone = 0
    while piece := retention.prune_some(db, before=before, at=NOW):
        gone += piece
        assert in_order(db)
    return gone


def test_the_history_goes_up_to_the_first_event_of_a_job_that_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "MIN_PRUNED", 3)
    with database() as db:
        ended(db)
        kept_from = events(db)[-1] + 1
        ended(db, NEW)
        for _ in range(5):
            history.append(db, at=OLD, kind="connected", data={})
        remove(db, before=NEW)
        assert cut(db, NEW) == kept_from - 1
        assert events(db)[0] == kept_from
        assert cut(db, NEW) == 0


def test_the_history_goes_up_to_the_first_event_that_is_new_enough_and_in_pieces(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(retention, "PIECE_ROWS", 300)
    with database() as db:
        for number in range(1000):
            history.append(db, at=OLD if number < 900 else AT, kind="connected", data={"number": number})
        assert cut(db, NEW) == 900
        # So few are not worth an event that tells of it.
        assert retention.prune_some(db, before=NOW, at=NOW) == 0


def test_a_condemned_job_stands_in_the_way_of_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retention, "MIN_PRUNED", 3)
    with database() as db:
        retention.condemn(db, [ended(db)], at=NOW)
        assert cut(db, None) > 3
        assert in_order(db)


def test_programs_that_no_job_names() -> None:
    def program(id: str, at: str = OLD) -> dict[str, object]:
        return {
            "id": id, "name": id, "lines": 1, "bytes": 1, "sha256": id, "created_at": at, "source_program": None,
        }  # fmt: skip

    with database() as db:
        for id in ("used", "unused", "source", "again"):
            store.add_program(db, program(id))
        store.add_program(db, program("new", NOW))
        store.add_program(db, program("again", NOW))
        store.add_expansion(db, "source", program("expanded"), "1")
        ended(db, program="used")
        assert sorted(retention.unused_programs(db, created_before=NEW)) == ["expanded", "source", "unused"]
        ended(db, program="expanded")
        assert retention.unused_programs(db, created_before=NEW) == ["unused"], "the source is what people know it by"
        store.delete_program(db, "again")
        assert next(db.query("select count(*) as n from program_uploads"))["n"] == 0
