"""The rows of jobs and programs."""

from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history, store
from jobs.effects import SetStatus
from jobs.experience import Run
from jobs.holds import JOB_ENDED
from jobs.job import JobError, Status
from protocol.errors import LocalError
from tests.harness.rows import AT, add_job, database, job_fields


def set_status(db: Database, id: int, after: Status, **changes: Any) -> None:
    row = store.job(db, id)
    assert row is not None
    store.set_status(db, id, SetStatus(Status(row["status"]), after, 0, **changes), at=AT)


def program(**changes: Any) -> dict[str, Any]:
    row = {"id": "p", "name": "part.nc", "lines": 10, "bytes": 99, "sha256": "p", "created_at": AT}
    return row | {"source_program": None} | changes


def test_the_same_program_again_changes_nothing() -> None:
    with database() as db:
        assert store.add_program(db, program()) == (program(), True)
        kept, created = store.add_program(db, program(name="other.nc"))
        assert (kept["name"], created) == ("part.nc", False)
        assert [row["id"] for row in store.programs(db, limit=5)] == ["p"]


def test_a_program_that_a_job_needs_is_not_deleted() -> None:
    with database() as db:
        store.add_program(db, program())
        id = add_job(db)
        assert store.delete_program(db, "p") == id
        assert store.program(db, "p") is not None
        set_status(db, id, Status.CANCELLED)
        assert store.delete_program(db, "p") is None
        assert store.program(db, "p") is None


def test_a_new_job_waits_at_the_end_of_its_queue() -> None:
    with database() as db:
        ids = [add_job(db), add_job(db), add_job(db, machine="lathe")]
        assert [row["id"] for row in store.queue(db, "router")] == ids[:2]
        assert store.queue_lengths(db) == {"router": 2, "lathe": 1}
        row = store.job(db, ids[0])
        assert row is not None
        assert (row["status"], row["line_done"], row["hold"]) == ("queued", 0, 0)
        (created,) = history.of_job(db, ids[0], limit=5)
        assert created["type"] == "created"


def test_lines_before_the_start_count_as_done() -> None:
    with database() as db:
        row = store.job(db, add_job(db, start_line=5))
        assert row is not None
        assert row["line_done"] == 4


def test_the_same_key_gives_the_same_job_and_a_full_queue_none() -> None:
    with database() as db:
        first = store.create_job(db, job_fields(idempotency_key="k"), at=AT, queue_limit=1)
        again = store.create_job(db, job_fields(idempotency_key="k"), at=AT, queue_limit=1)
        assert first is not None
        assert again is not None
        assert first["id"] == again["id"]
        assert store.create_job(db, job_fields(), at=AT, queue_limit=1) is None
        assert store.create_job(db, job_fields(machine="lathe"), at=AT, queue_limit=1) is not None
        assert store.job_by_key(db, "nobody's") is None


@pytest.mark.parametrize(("place", "order"), [(0, [3, 1, 2]), (1, [1, 3, 2]), (2, [1, 2, 3]), (99, [1, 2, 3])])
def test_moving_in_the_queue(place: int, order: list[int]) -> None:
    with database() as db:
        for _ in range(3):
            add_job(db)
        assert store.move(db, 3, place)
        assert [row["id"] for row in store.queue(db, "router")] == order


def test_what_does_not_wait_cannot_be_moved() -> None:
    with database() as db:
        id = add_job(db)
        set_status(db, id, Status.CANCELLED)
        assert not store.move(db, id, 0)
        assert not store.move(db, 77, 0)


def test_listing_with_filters_the_newest_first() -> None:
    with database() as db:
        ids = [add_job(db) for _ in range(4)] + [add_job(db, machine="lathe")]
        set_status(db, ids[1], Status.CANCELLED)

        def found(**changes: Any) -> list[int]:
            wanted: dict[str, Any] = {"machine": None, "statuses": (), "limit": 10, "before": None}
            return [row["id"] for row in store.jobs(db, **(wanted | changes))]

        assert found() == ids[::-1]
        assert found(machine="lathe") == [5]
        assert found(statuses=("cancelled",)) == [2]
        assert found(statuses=("cancelled", "queued"), machine="router", limit=2, before=4) == [3, 2]
        assert store.counts(db) == {"queued": 4, "cancelled": 1}


def test_a_status_is_written_with_its_error_and_its_history() -> None:
    with database() as db:
        id = add_job(db)
        set_status(db, id, Status.CHECKING)
        set_status(db, id, Status.RUNNING)
        row = store.active_job(db, "router")
        assert row is not None
        assert (row["started_at"], row["ended_at"], store.error_of(row)) == (AT, None, None)
        error = JobError("alarm", "end switch", 3, 4)
        set_status(db, id, Status.FAILED, error=error)
        row = store.job(db, id)
        assert row is not None
        assert (row["ended_at"], store.error_of(row)) == (AT, error)
        assert store.active_job(db, "router") is None
        changes = [event["data"]["to"] for event in history.of_job(db, id, limit=9) if event["type"] == "status"]
        assert changes == ["checking", "running", "failed"]
        assert history.verify(db) is None


def test_a_change_that_the_table_does_not_know_raises_and_more_news_of_the_same_status_do_not() -> None:
    with database() as db:
        id = add_job(db)
        with pytest.raises(LocalError, match="from queued to completed"):
            set_status(db, id, Status.COMPLETED)
        set_status(db, id, Status.CHECKING)
        set_status(db, id, Status.CHECKING)


def test_a_queue_is_put_on_hold() -> None:
    with database() as db:
        ids = [add_job(db), add_job(db, hold=True), add_job(db, machine="lathe")]
        assert store.hold_queue(db, "router", JOB_ENDED) == 1
        assert [row["hold"] for row in store.queue(db, "router")] == [1, 1]
        store.set_hold(db, ids[0], False)
        assert [row["hold"] for row in store.queue(db, "router")] == [0, 1]
        assert [row["hold"] for row in store.queue(db, "lathe")] == [0]


def test_the_runs_of_a_machine_are_its_completed_jobs_newest_first() -> None:
    with database() as db:
        paces = [(100.0, 120.0), (50.0, 40.0), (7.0, 9.0), (0.0, 1.0), None]
        for pace in paces:
            id = add_job(db)
            if pace is not None:
                store.set_pace(db, id, *pace)
            for after in (Status.CHECKING, Status.RUNNING, Status.FAILED if pace == (7.0, 9.0) else Status.COMPLETED):
                set_status(db, id, after)
        other = add_job(db, machine="lathe")
        store.set_pace(db, other, 1.0, 2.0)
        assert store.runs(db, "router", limit=9) == [Run(50.0, 40.0), Run(100.0, 120.0)]
        assert store.runs(db, "router", limit=1) == [Run(50.0, 40.0)]
        assert store.runs(db, "lathe", limit=9) == [], "it has not ended"
        plan = " ".join(
            str(row)
            for row in db.query(
                "explain query plan select * from jobs where machine = 'm' and status = 'completed' order by id desc"
            )
        )
        assert "jobs_completed" in plan
        assert "TEMP B-TREE" not in plan
