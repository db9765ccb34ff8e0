"""What a process and a database hold: a kibibyte is one, and a row is counted with its indexes."""

import sqlite3
from contextlib import closing

import pytest

from bench.soakmemory import malloc_kb, payload, resident_mb


def test_what_is_kept_is_counted_and_what_is_given_back_is_not() -> None:
    before = malloc_kb()
    if before == 0.0:
        pytest.skip("this C library does not tell")
    kept = [bytes(1024) for _ in range(1000)]
    held = malloc_kb() - before
    assert 1000 <= held < 1200
    del kept
    assert malloc_kb() - before < 100


def test_a_process_has_some_memory() -> None:
    assert 1 < resident_mb() < 100_000


def test_a_table_has_the_bytes_of_its_rows_and_indexes() -> None:
    with closing(sqlite3.connect(":memory:")) as db:
        db.execute("create table a (name text unique)")
        db.execute("create table b (number integer)")
        empty = payload(db)
        if not empty:
            pytest.skip("this SQLite does not tell")
        db.execute("insert into a values (?)", ["x" * 1000])
        assert 2000 < payload(db)["a"] < 2100
        assert payload(db).get("b", 0) == empty.get("b", 0) == 0
