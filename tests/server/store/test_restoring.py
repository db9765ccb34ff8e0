"""Restores: verified before anything is touched, the old kept aside, and nothing of a backup moves a machine."""

import os
import zipfile
from collections.abc import Callable
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlite_utils import Database

from jobs import history, journal, store, toolstore
from jobs.effects import SetStatus
from jobs.job import Status
from jobs.schema import prepare
from jobs.toolstore import KeptTools
from server.access.endedtokens import remove_ended
from server.access.tokens import create_token, list_live_tokens, list_tokens, revoke_token
from server.cli.common import CliError
from server.cli.settings import sole_daemon
from server.clock import rfc3339
from server.config.model import Config
from server.store import restoring
from server.store.archive import ArchiveError
from server.store.restoring import in_the_way, restore
from tests.harness.rows import AT, add_job
from tests.jobs.test_journal import entry
from tests.server.store.test_archive import Data

NOW = datetime(2026, 4, 1, 12, 30, tzinfo=UTC)
LATER = rfc3339(NOW + timedelta(days=31))


@pytest.fixture
def data(tmp_path: Path) -> Data:
    return Data(tmp_path / "data")


@pytest.fixture
def target(tmp_path: Path) -> Path:
    folder = tmp_path / "target"
    folder.mkdir()
    (folder / "lock").touch()
    return folder


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def rows(folder: Path, query: str) -> list[tuple[object, ...]]:
    with closing(Database(folder / "millstream.db")) as db:
        return list(db.execute(query).fetchall())


def test_into_an_empty_folder(data: Data, target: Path, tmp_path: Path) -> None:
    data.backup(tmp_path / "b.zip")
    assert in_the_way(target) == []
    done = restore(tmp_path / "b.zip", target, now=NOW)
    assert (done.aside, done.held) == (None, 0)
    assert sorted(path.name for path in target.iterdir()) == ["lock", "millstream.db", "programs"]
    assert sorted(names(target / "programs")) == sorted(names(data.folder / "programs"))
    with closing(Database(target / "millstream.db")) as db:
        assert history.verify(db) is None
        (last,) = db.query("select type, data from events order by id desc limit 1")
    assert last["type"] == restoring.RESTORED
    assert AT in last["data"]


def test_what_was_there_is_kept_aside(data: Data, target: Path, tmp_path: Path) -> None:
    data.backup(tmp_path / "b.zip")
    for name in ("millstream.db", "millstream.db-wal", "notes.txt"):
        (target / name).write_text(f"the old {name}")
    assert in_the_way(target) == ["millstream.db", "millstream.db-wal", "notes.txt"]
    done = restore(tmp_path / "b.zip", target, now=NOW)
    assert done.aside == target / "before-restore-20260401T123000Z"
    # SQLite may put its shared memory beside a log that it looks into.
    kept = {name for name in names(done.aside) if not name.endswith("-shm")}
    assert kept == {"millstream.db", "millstream.db-wal", "notes.txt"}
    assert (done.aside / "notes.txt").read_text() == "the old notes.txt"
    assert not (target / "millstream.db-wal").exists()
    assert in_the_way(target) == ["millstream.db", "programs"], "what lies aside stays there"


def test_a_backup_that_is_no_good_touches_nothing(data: Data, target: Path, tmp_path: Path) -> None:
    data.backup(tmp_path / "b.zip")
    (target / "millstream.db").write_text("the old one")
    content = (tmp_path / "b.zip").read_bytes()
    (tmp_path / "b.zip").write_bytes(content[:200] + b"\x00" * 50 + content[250:])
    with pytest.raises(ArchiveError):
        restore(tmp_path / "b.zip", target, now=NOW)
    assert sorted(names(target)) == ["lock", "millstream.db"]
    assert (target / "millstream.db").read_text() == "the old one"


def test_a_backup_of_a_newer_version_is_refused(data: Data, target: Path, tmp_path: Path) -> None:
    with closing(Database(data.database)) as db:
        db.execute("update _sqlite_migrations set name = 'm999_future' where name = 'm012_parts'")
        db.conn.commit()
    data.backup(tmp_path / "b.zip")
    with pytest.raises(ArchiveError, match=r"newer version, 1\.2\.3 \(m999_future"):
        restore(tmp_path / "b.zip", target, now=NOW)
    assert sorted(names(target)) == ["lock"]


def test_a_damaged_database_is_refused_although_its_hash_fits(data: Data, target: Path, tmp_path: Path) -> None:
    def spoil() -> None:
        (copy,) = tmp_path.glob(".b.zip.*.db")
        content = bytearray(copy.read_bytes())
        content[-4096:-3000] = b"\xff" * 1096
        copy.write_bytes(content)

    data.backup(tmp_path / "b.zip", between=spoil)
    with pytest.raises(ArchiveError, match="its database is damaged"):
        restore(tmp_path / "b.zip", target, now=NOW)


def begun(db: Database, *statuses: Status) -> int:
    job = add_job(db)
    before = Status.QUEUED
    for after in statuses:
        store.set_status(db, job, SetStatus(before, after, 4), at=AT)
        before = after
    return job


def test_nothing_of_a_backup_moves_a_machine(data: Data, target: Path, tmp_path: Path) -> None:
    """What waited is held; what ran is over with its lines in doubt, and its open rows will never be sent again."""
    with closing(Database(data.database)) as db:
        running = begun(db, Status.CHECKING, Status.RUNNING)
        journal.journal(db, "router", entry(running, 1, 70, 5), AT)
        interrupted = begun(db, Status.CHECKING, Status.RUNNING, Status.INTERRUPTED)
        checking = begun(db, Status.CHECKING)
        waiting = begun(db)
        done = begun(db, Status.CHECKING, Status.RUNNING, Status.COMPLETED)
        db.conn.commit()
    data.backup(tmp_path / "b.zip")
    assert restore(tmp_path / "b.zip", target, now=NOW).held == 2
    found = rows(target, "select id, status, hold, error_code, error_line_from, error_line_to from jobs order by id")
    assert found == [
        (running, "failed", 0, "in_doubt", 5, 6),
        (interrupted, "cancelled", 0, "cancelled_in_doubt", None, None),
        (checking, "queued", 1, None, None, None),
        (waiting, "queued", 1, None, None, None),
        (done, "completed", 0, None, None, None),
    ]
    assert rows(target, "select status from batches") == [("doubtful",)]
    with closing(Database(target / "millstream.db")) as db:
        assert history.verify(db) is None


def test_the_tool_in_the_spindle_is_not_believed(data: Data, target: Path, tmp_path: Path) -> None:
    with closing(Database(data.database)) as db:
        toolstore.save(db, "router", KeptTools(3, "T3 P3 D6\n", 1))
        db.conn.commit()
    data.backup(tmp_path / "b.zip")
    restore(tmp_path / "b.zip", target, now=NOW)
    with closing(Database(target / "millstream.db")) as db:
        assert toolstore.load(db, "router") == KeptTools(None, "T3 P3 D6\n", 1)


def test_a_token_that_was_revoked_since_stays_so(data: Data, target: Path, tmp_path: Path) -> None:
    with closing(Database(data.database)) as db:
        token, _ = create_token(db, "lost phone", "admin", now=NOW)
        kept, _ = create_token(db, "screen", "viewer", now=NOW)
        data.backup(tmp_path / "b.zip")
        revoke_token(db, token.id, now=NOW)
    (data.folder / "lock").touch()
    restore(tmp_path / "b.zip", data.folder, now=NOW)
    with closing(Database(data.database)) as db:
        assert {one.id: one.revoked_at is not None for one in list_tokens(db)} == {token.id: True, kept.id: False}


def test_a_token_whose_row_is_gone_is_not_brought_back(data: Data, target: Path, tmp_path: Path) -> None:
    with closing(Database(data.database)) as db:
        gone, _ = create_token(db, "lost phone", "admin", now=NOW)
        kept, _ = create_token(db, "screen", "viewer", now=NOW)
        data.backup(tmp_path / "old.zip")
        revoke_token(db, gone.id, now=NOW)
        remove_ended(db, before=LATER)
        assert [one.id for one in list_tokens(db)] == [kept.id]
    (data.folder / "lock").touch()
    for hours in range(2):  # what is put in its place remembers it, too
        assert restore(tmp_path / "old.zip", data.folder, now=NOW + timedelta(hours=hours)).revoked == 1
        assert good(data.database) == [kept.id]
        with closing(Database(data.database)) as db:
            remove_ended(db, before=LATER)
    # Where nothing of them is known all tokens of a backup are good: another computer.
    assert restore(tmp_path / "old.zip", target, now=NOW).revoked == 0
    assert sorted(good(target / "millstream.db")) == sorted([gone.id, kept.id])


def test_a_newer_backup_than_all_that_is_forgotten_is_believed(data: Data, target: Path, tmp_path: Path) -> None:
    with closing(Database(data.database)) as db:
        there, _ = create_token(db, "another computer's", "admin", now=NOW)
    data.backup(tmp_path / "b.zip")
    before_the_backup = datetime.fromisoformat(AT) - timedelta(seconds=1)
    with closing(Database(target / "millstream.db")) as db:
        prepare(db)
        own, _ = create_token(db, "guest", "viewer", now=before_the_backup)
        revoke_token(db, own.id, now=before_the_backup)
        remove_ended(db, before=LATER)
    assert restore(tmp_path / "b.zip", target, now=NOW).revoked == 0
    assert good(target / "millstream.db") == [there.id]


def good(database: Path) -> list[str]:
    with closing(Database(database)) as db:
        return [token.id for token in list_live_tokens(db)]


class PowerCutError(Exception):
    """The process is gone here."""


@pytest.mark.parametrize("cut_at", range(1, 7))
def test_a_restore_that_was_broken_off_anywhere_loses_nothing(
    data: Data, target: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cut_at: int
) -> None:
    """Wherever the power goes: either nothing has happened, or no daemon starts until the restore was run again."""
    data.backup(tmp_path / "b.zip")
    (target / "millstream.db").write_text("the old one")
    config = Config.model_validate({"server": {"data_dir": str(target)}})
    steps = 0

    def counted(real: Callable[..., Any]) -> Callable[..., Any]:
        def step(*arguments: Any, **named: Any) -> Any:
            nonlocal steps
            steps += 1
            if steps == cut_at:
                raise PowerCutError
            return real(*arguments, **named)

        return step

    with monkeypatch.context() as patched:
        # Making the mark, the folder for the old data, three renames, taking the mark away.
        patched.setattr(restoring, "_mark", counted(restoring._mark))
        patched.setattr(restoring, "_make_aside", counted(restoring._make_aside))
        patched.setattr(Path, "rename", counted(Path.rename))
        patched.setattr(restoring, "_unmark", counted(restoring._unmark))
        with pytest.raises(PowerCutError):
            restore(tmp_path / "b.zip", target, now=NOW)
    if cut_at == 1:
        assert (target / "millstream.db").read_text() == "the old one"
    else:
        with pytest.raises(CliError, match="broken off"), sole_daemon(config):
            pass
    with sole_daemon(config, restoring=True):
        restore(tmp_path / "b.zip", target, now=datetime(2026, 4, 1, 12, 31, tzinfo=UTC))
    kept = [path.read_text() for path in target.glob("before-restore-*/millstream.db") if path.stat().st_size < 100]
    assert kept == ["the old one"]
    with sole_daemon(config):
        assert rows(target, "select count(*) from programs") == [(2,)]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_restored_by_root_it_still_is_the_daemons_own(data: Data, target: Path, tmp_path: Path) -> None:
    data.backup(tmp_path / "b.zip")
    (target / "old").touch()
    os.chown(target, 12345, 54321)
    done = restore(tmp_path / "b.zip", target, now=NOW)
    assert done.aside is not None
    for path in (target / "lock", target / "millstream.db", *(target / "programs").iterdir(), done.aside):
        assert (path.stat().st_uid, path.stat().st_gid) == (12345, 54321), path


def test_the_configuration_of_a_backup_is_not_put_back(data: Data, target: Path, tmp_path: Path) -> None:
    (tmp_path / "millstream.toml").write_text("[server]\n")
    from server.store import archive

    archive.write(
        tmp_path / "b.zip",
        database=data.database,
        programs=data.folder / "programs",
        config=tmp_path / "millstream.toml",
        version="1",
        created_at=AT,
    )
    with zipfile.ZipFile(tmp_path / "b.zip") as file:
        assert file.read("millstream.toml") == b"[server]\n"
    restore(tmp_path / "b.zip", target, now=NOW)
    assert not (target / "millstream.toml").exists()
