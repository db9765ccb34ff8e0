"""The history: appended to, never changed, and whoever changes it all the same is found out."""

import sqlite3
from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history
from protocol.errors import LocalError
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
        ("delete from events where id = 3", 3),
        ("delete from events where id = 1", 1),
        ("delete from events where id = 5", 5),
        ("delete from events", 1),
        ("update events set previous = 'x' where id = 2", 2),
        ("update events set data = 'no JSON', type = 'history_pruned' where id = 2", 2),
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


def broken(db: Database, *changes: str) -> list[tuple[int, str]]:
    """What is found after these changes, made behind the triggers' backs."""
    for verb in ("update", "delete"):
        db.execute(f"drop trigger events_no_{verb}")
    for change in changes:
        db.execute(change)
    return [(fault.event, fault.what) for fault in history.faults(db)]


def test_every_fault_is_named_and_no_sound_row_is_blamed() -> None:
    with database() as db:
        filled(db, 9)
        found = broken(
            db,
            "update events set data = '{}' where id = 2",
            "delete from events where id in (4, 5)",
            "delete from events where id = 9",
        )
        assert found == [
            (2, "its content or its hash was changed"),
            (4, "the events 4 to 5 are missing"),
            (9, "it is missing"),
        ]


def test_a_row_with_a_hash_that_fits_is_found_by_its_neighbour() -> None:
    with database() as db:
        filled(db)
        forged = history.link(history.of_job(db, 1, limit=9)[1]["hash"], AT, "router", 1, "status", "{}")
        found = broken(db, f"update events set data = '{{}}', hash = '{forged}' where id = 3")
        assert found == [(4, "it does not follow from the event before: one of them was replaced")]


def test_a_pruned_history_can_be_verified_and_goes_on() -> None:
    with database() as db:
        filled(db)
        assert history.prune(db, 3, at=AT) == 3
        assert history.verify(db) is None
        assert history.anchor(db).up_to == 3
        filled(db)
        assert history.prune(db, 7, at=AT) == 4
        assert history.verify(db) is None
        assert next(db.query("select count(*) as n from events"))["n"] == 5


def test_all_that_is_there_can_be_pruned_but_the_word_of_it() -> None:
    with database() as db:
        filled(db)
        assert history.prune(db, 5, at=AT) == 5
        assert [row["type"] for row in db.query("select type from events")] == [history.PRUNED]
        assert history.verify(db) is None


def test_only_what_lies_before_the_anchor_can_be_deleted() -> None:
    with database() as db:
        filled(db)
        history.prune(db, 3, at=AT)
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            db.execute("delete from events where id = 4")
        with pytest.raises(LocalError, match="no event 2"):
            history.prune(db, 2, at=AT)


def test_an_anchor_that_no_event_vouches_for_is_found() -> None:
    """Whoever moves the anchor by hand may delete rows, but not in secret."""
    with database() as db:
        filled(db)
        cut = history.of_job(db, 1, limit=9)[2]
        db.execute(history.SET_ANCHOR, [cut["id"], cut["hash"], AT])
        db.execute("delete from events where id <= 3")
        assert [fault.event for fault in history.faults(db)] == [3]


def test_events_of_a_tool_changer_are_found_without_reading_all_of_the_history() -> None:
    with database() as db:
        filled(db)
        for machine, kind, job in (("router", "io", None), ("mill", "io", 1), ("router", "tool_changed", 1)):
            history.append(db, at=AT, kind=kind, data={"kind": kind}, machine=machine, job=job)
        events = history.of_tools(db, "router", limit=9)
        assert [event["type"] for event in events] == ["io", "tool_changed"]
        assert [event["type"] for event in history.of_tools(db, "router", limit=9, after=events[0]["id"])] == [
            "tool_changed"
        ]
        plan = db.query(f"explain query plan {history.OF_TOOLS} and machine = ? and id > ?", ["router", 0])
        assert "events_of_tools" in next(plan)["detail"]
