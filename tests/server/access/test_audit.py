"""Who has asked for what: the chain, its old end, pages, and what happens while nothing can be written."""

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history
from jobs.schema import prepare
from server.access import audit
from server.access.audit import MAX_PENDING, Audit, Entry, Wanted, append, counts, faults, page, prune_some
from server.access.auditing import remove_expired
from server.clock import WallClock
from server.config.audit import AuditConfig
from tests.harness.fakeworkshop import MemoryDatabase
from tests.harness.simloop import run_simulated

AT = "2026-03-01T09:30:00.250Z"
ENTRY = Entry(AT, "bearer", "t1", "screen", "10.0.0.1", "POST", "/api/v1/machines/{m}/home", "router", status=202)


def database(rows: int = 0) -> Database:
    db = Database(sqlite3.connect(":memory:"))
    prepare(db)
    for number in range(1, rows + 1):
        append(db, replace(ENTRY, job=number, machine="router" if number % 2 else "lathe"))
    db.conn.commit()
    return db


def test_rows_hang_on_one_another() -> None:
    db = database(5)
    assert list(faults(db)) == []
    assert counts(db) == {"audit": 5, "audit_removed": 0}
    first, second = list(db.query("select previous, hash from audit limit 2"))
    assert (first["previous"], second["previous"]) == (history.GENESIS, first["hash"])


@pytest.mark.parametrize("statement", ["update audit set name = 'x'", "delete from audit where id = 3"])
def test_nobody_changes_a_row(statement: str) -> None:
    with pytest.raises(sqlite3.IntegrityError, match="append-only"):
        database(5).execute(statement)


@pytest.mark.parametrize(
    ("change", "row", "what"),
    [
        ("update audit set address = '10.0.0.2' where id = 3", 3, "content"),
        ("delete from audit where id = 3", 3, "missing"),
        ("delete from audit where id = 5", 5, "missing"),
        ("delete from audit where id = 1", 1, "missing"),
        ("insert or replace into audit_anchor values (1, 3, 'x', 'y'); delete from audit where id < 4", 3, "history"),
    ],
)
def test_what_was_changed_behind_our_back_is_found(change: str, row: int, what: str) -> None:
    db = database(5)
    db.conn.executescript(f"drop trigger audit_no_update; drop trigger audit_no_delete; {change}")
    found = list(faults(db))
    assert any(fault.event == row and what in fault.what for fault in found), found


def test_pages_newest_first_with_filters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "SCANNED_ROWS", 4)
    db = database(10)

    def numbers(wanted: Wanted, before: int | None = None, limit: int = 3) -> tuple[list[int], int | None]:
        rows, rest = page(db, wanted, before, limit)
        return [row["id"] for row in rows], rest

    assert numbers(Wanted()) == ([10, 9, 8], 8)
    assert numbers(Wanted(), before=2) == ([1], None)
    assert numbers(Wanted(), before=2**53) == numbers(Wanted()), "what is far beyond the end is the end"
    assert numbers(Wanted(machine="lathe")) == ([10, 8], 7)
    assert numbers(Wanted(job=1)) == ([], 7)
    assert numbers(Wanted(until=AT)) == ([], 7)
    assert numbers(Wanted(since=AT, status=202, code=None), limit=1) == ([10], 10)
    assert page(database(), Wanted(), None, 5) == ([], None)


def test_a_filter_finds_its_rows_through_all_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "SCANNED_ROWS", 4)

    async def main() -> None:
        memory = MemoryDatabase()
        keeper: Any = Audit(memory, WallClock())  # type: ignore[arg-type]
        for number in range(1, 21):
            keeper.note(replace(ENTRY, job=number, at=""))
        assert [row["job"] for row in await keeper.find(Wanted(job=1), None, 10)] == [1]
        rows = await keeper.find(Wanted(), None, 100)
        assert [row["job"] for row in rows] == list(range(20, 0, -1))
        assert rows[0]["at"].endswith("Z"), "the time is the keeper's"
        memory.close()

    run_simulated(main())


def test_the_old_end_goes_and_the_rest_can_be_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "MIN_PRUNED", 2)
    monkeypatch.setattr(audit, "PIECE_ROWS", 3)
    db = database(10)
    assert prune_some(db, keep_rows=5, before=None, at=AT) == 3
    assert prune_some(db, keep_rows=5, before=None, at=AT) == 2
    assert prune_some(db, keep_rows=5, before=None, at=AT) == 0
    assert (list(faults(db)), counts(db)) == ([], {"audit": 5, "audit_removed": 5})
    assert page(db, Wanted(), 6, 5) == ([], None)
    append(db, ENTRY)
    assert (list(faults(db)), list(history.faults(db))) == ([], [])
    assert prune_some(db, keep_rows=100, before="2027", at=AT) == 3, "by age"


def pruned_with_the_history(times: int = 1) -> Database:
    """The audit's old end is gone, and behind that the old end of the history, where it was told."""
    db = database(10)
    prune_some(db, keep_rows=5, before=None, at=AT)
    for _ in range(times):
        last = history.append(db, at=AT, kind="other", data={})
        history.prune(db, last, at=AT)
    return db


@pytest.mark.parametrize("times", [1, 2, 3])
def test_the_word_of_a_removal_outlives_the_old_end_of_the_history(monkeypatch: pytest.MonkeyPatch, times: int) -> None:
    monkeypatch.setattr(audit, "MIN_PRUNED", 2)
    db = pruned_with_the_history(times)
    assert (list(faults(db)), list(history.faults(db))) == ([], [])
    prune_some(db, keep_rows=2, before=None, at=AT)
    assert list(faults(db)) == []


def test_an_anchor_that_was_moved_is_found_with_a_pruned_history_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "MIN_PRUNED", 2)
    db = pruned_with_the_history()
    (cut,) = db.query("select id, hash from audit where id = 8")
    db.execute("insert or replace into audit_anchor values (1, ?, ?, ?)", [cut["id"], cut["hash"], AT])
    db.execute("delete from audit where id <= 8")
    assert [fault.event for fault in faults(db)] == [8]


def test_retention_in_the_running_daemon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "PIECE_ROWS", 300)

    async def main() -> None:
        memory = MemoryDatabase()
        for _ in range(1700):
            append(memory.db, ENTRY)
        removed = await remove_expired(AuditConfig(keep_rows=1000), memory, WallClock())  # type: ignore[arg-type]
        assert removed == 600, "what is left is not worth an event of the history"
        assert await remove_expired(AuditConfig(keep_days=1), memory, WallClock()) == 1100  # type: ignore[arg-type]
        memory.close()

    run_simulated(main())


class StuckDatabase(MemoryDatabase):
    """Takes what is posted and does nothing about it until it is let go."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

    def post(self, fn: Callable[..., Any], *args: Any, then: Callable[[], None] | None = None) -> None:
        self.waiting.append((fn, args))

    def go(self) -> None:
        waiting, self.waiting = self.waiting, []
        for fn, args in waiting:
            fn(self.db, *args)


def test_while_nothing_can_be_written_a_bounded_number_waits_and_the_rest_is_counted() -> None:
    stuck = StuckDatabase()
    keeper = Audit(stuck, WallClock())  # type: ignore[arg-type]
    for _ in range(MAX_PENDING + 7):
        keeper.note(ENTRY)
    assert len(stuck.waiting) == MAX_PENDING
    stuck.go()
    keeper.note(ENTRY)
    stuck.go()
    rows = [row["lost"] for row in stuck.db.query("select lost from audit order by id")]
    assert rows == [0] * MAX_PENDING + [7]
    stuck.close()


def test_a_faulty_row_is_dropped_and_a_full_disk_is_not() -> None:
    stuck = StuckDatabase()
    keeper = Audit(stuck, WallClock())  # type: ignore[arg-type]
    keeper.note(replace(ENTRY, name="\ud800"))
    stuck.go()  # raises nothing: it would stand in the way of the journal for ever
    keeper.note(ENTRY)
    stuck.db.execute("drop table audit")
    with pytest.raises(sqlite3.OperationalError):
        stuck.go()
    stuck.close()


def test_text_of_a_request_is_bounded_and_can_be_stored() -> None:
    assert audit.clean("\ud800" * 1000) == "?" * 200
