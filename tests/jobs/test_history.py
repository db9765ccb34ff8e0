"""The history: appended to, never changed, and whoever changes it all the same is found out."""

import sqlite3
from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history
from tests.harness.rows import AT, database


def filled(db: Database, count: int = 5) -> None:
    for number in range(count):
        history.append(db, at=AT, kind="status", data={"n": number, "text": "Ü"}, machine="router", job=1)


def test_events_of_a_job_in_order_with_their_data() -> None:
    with database() as db:
        filled(db)
        history.append(db, at=AT, kind="other", data={}, job=2)
        events = history.of_job(db, 1, limit=3)
        assert [event["data"]["n"] for event in events] == [0, 1, 2]
        assert events[0]["type"] == "status"
        assert [event["data"]["n"] for event in history.of_job(db, 1, limit=10, after=events[-1]["id"])] == [3, 4]
        assert history.verify(db) is None


def test_the_newest_of_a_kind() -> None:
    with database() as db:
        filled(db)
        assert history.newest(db, 1, "status") == {"n": 4, "text": "Ü"}
        assert history.newest(db, 1, "other") is None
        assert history.newest(db, 2, "status") is None
        history.append(db, at=AT, kind="status", data={"text": "x" * history.MAX_DATA_CHARS}, job=1)
        assert history.newest(db, 1, "status") is None, "half of it is not what it says"


@pytest.mark.parametrize("change", ["update events set data = '{}' where id = 3", "delete from events where id = 3"])
def test_the_database_itself_refuses_changes(change: str) -> None:
    with database() as db:
        filled(db)
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            db.execute(change)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ("update events set data = '{}' where id = 3", 3),
        ("update events set at = '2020' where id = 1", 1),
        ("update events set hash = 'x' where id = 5", 5),
        ("delete from events where id = 3", 4),
        ("delete from events where id = 1", 2),
    ],
)
def test_a_change_behind_its_back_is_found(change: str, found: int) -> None:
    with database() as db:
        filled(db)
        for verb in ("update", "delete"):
            db.execute(f"drop trigger events_no_{verb}")
        db.execute(change)
        assert history.verify(db) == found


def test_what_a_machine_says_does_not_grow_the_database_without_bound() -> None:
    with database() as db:
        data: dict[str, Any] = {"frames": ["x" * 1000] * 10_000}
        history.append(db, at=AT, kind="frames", data=data, job=1)
        (event,) = history.of_job(db, 1, limit=1)
        assert event["data"]["cut"] is True
        assert len(event["data"]["text"]) <= history.MAX_DATA_CHARS
        assert history.verify(db) is None
