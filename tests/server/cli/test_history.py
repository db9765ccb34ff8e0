"""history verify: on the database of a daemon, read only; what was changed is named and gives 1."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from sqlite_utils import Database

from jobs import history
from jobs.schema import migrations, prepare
from tests.harness.rows import AT
from tests.server.cli.conftest import Outcome, Run


@pytest.fixture
def verify(millstream: Run, tmp_path: Path) -> Run:
    """On a database with five events in it."""
    environ = {"MILLSTREAM_SERVER__DATA_DIR": str(tmp_path / "data")}
    (tmp_path / "data").mkdir()
    with closing(Database(tmp_path / "data" / "millstream.db")) as db:
        prepare(db)
        for number in range(5):
            history.append(db, at=AT, kind="status", data={"n": number})
        db.conn.commit()

    def command(*argv: object) -> Outcome:
        return millstream("history", "verify", *argv, environ=environ)

    return command


def changed(folder: Path, change: str) -> None:
    with closing(sqlite3.connect(folder / "data" / "millstream.db")) as db:
        db.executescript(f"drop trigger events_no_update; drop trigger events_no_delete; {change}; commit")


def test_all_in_order(verify: Run) -> None:
    outcome = verify()
    assert outcome.code == 0
    assert outcome.out == "5 events (1 to 5); 0 jobs, 0 of them sealed; 0 rows of the audit: all in order\n"
    assert json.loads(verify("--json").out)["ok"] is True


def test_what_was_changed_is_named(verify: Run, tmp_path: Path) -> None:
    changed(tmp_path, "begin; update events set data = '{}' where id = 2; delete from events where id = 5")
    outcome = verify()
    assert outcome.code == 1
    assert "event 2: its content or its hash was changed" in outcome.out
    assert "event 5: it is missing" in outcome.out
    assert outcome.out.endswith("2 faults\n")
    told = json.loads(verify("--json").out)
    assert [fault["event"] for fault in told["faults"]] == [2, 5]


def test_many_faults_are_not_all_listed(verify: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.cli.history.SHOWN_FAULTS", 2)
    changed(tmp_path, "begin; update events set data = '{}'")
    outcome = verify()
    assert "and 3 more" in outcome.out


def test_it_changes_nothing(verify: Run, tmp_path: Path) -> None:
    before = (tmp_path / "data" / "millstream.db").read_bytes()
    verify()
    assert (tmp_path / "data" / "millstream.db").read_bytes() == before


def test_without_a_database_it_says_so(millstream: Run, tmp_path: Path) -> None:
    outcome = millstream("history", "verify", environ={"MILLSTREAM_SERVER__DATA_DIR": str(tmp_path / "none")})
    assert outcome.code == 1
    assert "there is no database" in outcome.err
    assert not (tmp_path / "none").exists()


def test_another_database_and_one_of_before(verify: Run, tmp_path: Path) -> None:
    with closing(Database(tmp_path / "old.db")) as db:
        migrations.apply(db, stop_before="m013_history_anchor")
    outcome = verify("--database", tmp_path / "old.db")
    assert outcome.code == 1
    assert "not a database of this version" in outcome.err
    (tmp_path / "letter.db").write_bytes(b"this is no database, this is a letter\n" * 100)
    outcome = verify("--database", tmp_path / "letter.db")
    assert outcome.code == 1
    assert "cannot be read" in outcome.err
