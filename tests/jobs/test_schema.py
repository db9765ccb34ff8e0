"""The tables: they come about in any database, twice does no harm, and the connection is set up for power cuts."""

import sqlite3
from pathlib import Path

import pytest
from sqlite_utils import Database

from jobs.schema import NewerDatabaseError, migrations, prepare


def test_all_tables_and_twice_does_no_harm(tmp_path: Path) -> None:
    db = Database(sqlite3.connect(tmp_path / "m.db"))
    prepare(db)
    prepare(db)
    assert {"programs", "jobs", "batches", "events", "tokens", "machines"} <= set(db.table_names())
    assert migrations.pending(db) == []
    db.close()


def test_what_is_reported_durable_survives_a_power_cut(tmp_path: Path) -> None:
    db = Database(sqlite3.connect(tmp_path / "m.db"))
    prepare(db)
    assert next(db.query("pragma journal_mode"))["journal_mode"] == "wal"
    full = 2
    assert next(db.query("pragma synchronous"))["synchronous"] == full
    db.close()


def test_a_database_of_before_keeps_its_jobs(tmp_path: Path) -> None:
    db = Database(sqlite3.connect(tmp_path / "m.db"))
    migrations.apply(db, stop_before="m008_pace")
    values = "'router', 'p', 'part.nc', 'completed', 1, 0, 0, 1, 9, 9, 9, 0, '2026-03-01T09:00:00.000Z'"
    names = (
        "machine, program, program_name, status, rank, hold, forced, start_line, end_line, lines, line_done, restarted"
    )
    db.execute(f"insert into jobs ({names}, created_at) values ({values})")
    prepare(db)
    (row,) = db.query("select * from jobs")
    assert (row["machine"], row["planned_seconds"], row["moving_seconds"]) == ("router", None, None)
    db.close()


def test_a_database_of_a_newer_version_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    db = Database(sqlite3.connect(tmp_path / "m.db"))
    migrations.apply(db, stop_before="m004_events")
    db.execute("update _sqlite_migrations set name = 'm999_future' where name = 'm003_batches'")
    with pytest.raises(NewerDatabaseError, match=r"newer version of millstream \(m999_future\)"):
        prepare(db)
    assert "events" not in db.table_names()
    db.close()
