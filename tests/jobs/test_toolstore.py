"""What is kept of a machine's tools: as it was saved last, for each machine by itself."""

import sqlite3
from pathlib import Path

from sqlite_utils import Database

from jobs.schema import prepare
from jobs.toolstore import KeptTools, load, save


def test_a_new_machine_has_nothing_in_its_spindle_and_the_last_word_counts(tmp_path: Path) -> None:
    db = Database(sqlite3.connect(tmp_path / "m.db"))
    prepare(db)
    assert load(db, "router") == KeptTools(0, None, None)
    for kept in (KeptTools(3, "T3 P1\n", None), KeptTools(None, None, -1000), KeptTools(0, "", 0)):
        save(db, "router", kept)
        assert load(db, "router") == kept
    assert load(db, "mill") == KeptTools()
    db.close()
