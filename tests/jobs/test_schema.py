"""The tables: they come about in any database, twice does no harm, and the connection is set up for power cuts."""

import sqlite3
from pathlib import Path

from sqlite_utils import Database

from jobs.schema import migrations, prepare


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
