"""The surroundings of the daemon: a full disk, a clock that is off, a damaged database, an address that is taken."""

import shutil
import socket
import time
from collections import namedtuple
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest
from sqlite_utils import Database

from jobs import history
from jobs.schema import migrations, prepare
from server.cli.settings import sole_daemon
from server.config.model import Config
from server.doctor import system as doctorsystem
from server.doctor.findings import Finding, Level
from server.doctor.system import MIB, clock, daemon_runs, filesystem, system

Usage = namedtuple("Usage", "total used free")


@pytest.fixture(autouse=True)
def _nobody_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem, "WATCHED_S", 0.0)


def config(folder: Path, **server: object) -> Config:
    return Config.model_validate({"server": {"data_dir": str(folder), "port": 0, **server}})


def found(of: Config, check: str) -> list[Finding]:
    return [finding for finding in system(of) if finding.check == check]


def level(of: Config, check: str) -> Level:
    (finding,) = found(of, check)
    return finding.level


@pytest.fixture(scope="module")
def once_filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with a history."""
    path = tmp_path_factory.mktemp("filled") / "millstream.db"
    with closing(Database(path)) as db:
        prepare(db)
        for number in range(200):
            history.append(db, at="2026-03-01T09:00:00.000Z", kind="status", data={"n": number, "x": "y" * 200})
        db.conn.commit()
        db.execute("pragma wal_checkpoint(truncate)")
    return path


@pytest.fixture
def filled(once_filled: Path, tmp_path: Path) -> Path:
    """One of this test's own."""
    return Path(shutil.copy(once_filled, tmp_path))


def test_a_computer_that_is_in_order(tmp_path: Path, filled: Path) -> None:
    assert [one for one in system(config(tmp_path)) if one.level is Level.ERROR] == []
    (versions,) = found(config(tmp_path), "versions")
    assert {"millstream", "python", "sqlite", "fastapi"} <= set(versions.data)


def test_looking_makes_nothing(tmp_path: Path) -> None:
    assert level(config(tmp_path / "new"), "database") is Level.INFO
    assert level(config(tmp_path / "new"), "data_dir") is Level.INFO
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("free", "wanted"), [(50 * MIB, Level.ERROR), (500 * MIB, Level.WARNING), (5000 * MIB, Level.OK)]
)
def test_room_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int, wanted: Level) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: Usage(10**12, 0, free))
    assert level(config(tmp_path), "disk") is wanted


def test_the_kind_of_file_system(tmp_path: Path) -> None:
    mounts = tmp_path / "mounts"
    (tmp_path / "nas" / "deep").mkdir(parents=True)
    mounts.write_text(f"/dev/sda1 / ext4 rw 0 0\nnas:/x {tmp_path}/nas nfs4 rw 0 0\n")
    assert filesystem(tmp_path / "nas" / "deep", mounts) == "nfs4"
    assert filesystem(tmp_path, mounts) == "ext4"
    assert filesystem(tmp_path, tmp_path / "none") == ""


def test_a_network_file_system_is_no_place_for_the_database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem, "filesystem", lambda _folder: "nfs4")
    assert level(config(tmp_path), "data_dir") is Level.ERROR


def test_a_database_that_is_damaged(tmp_path: Path, filled: Path) -> None:
    assert level(config(tmp_path), "database") is Level.OK
    content = bytearray(filled.read_bytes())
    content[8192:9000] = b"\xff" * 808
    filled.write_bytes(content)
    (finding,) = found(config(tmp_path), "database")
    assert finding.level is Level.ERROR
    assert "millstream restore" in finding.advice


def test_a_file_that_is_no_database(tmp_path: Path) -> None:
    (tmp_path / "millstream.db").write_bytes(b"this is no database, this is a letter\n" * 100)
    assert level(config(tmp_path), "database") is Level.ERROR


def test_a_database_of_a_newer_version_and_of_an_older_one(tmp_path: Path) -> None:
    path = tmp_path / "millstream.db"
    with closing(Database(path)) as db:
        migrations.apply(db, stop_before="m012_parts")
    (finding,) = found(config(tmp_path), "database")
    assert finding.level is Level.OK
    assert "wait for the next start" in finding.message
    with closing(Database(path)) as db:
        prepare(db)
        db.execute("update _sqlite_migrations set name = 'm999_future' where name = 'm012_parts'")
        db.conn.commit()
    (finding,) = found(config(tmp_path), "database")
    assert finding.level is Level.ERROR
    assert "m999_future" in finding.message


def test_a_clock_that_was_set_back_shows_in_the_history(tmp_path: Path, filled: Path) -> None:
    with closing(Database(filled)) as db:
        history.append(db, at="2222-03-01T09:00:00.000Z", kind="status", data={})
        db.conn.commit()
    assert any("in the future" in finding.message for finding in found(config(tmp_path), "clock"))


def test_a_clock_without_a_battery(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem, "time", SimpleNamespace(time=lambda: 0.0, gmtime=time.gmtime))
    (finding,) = clock()
    assert finding.level is Level.ERROR
    assert "1970" in finding.message


def test_a_clock_that_jumps_while_somebody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = iter((1.8e9, 1.8e9, 1.8e9 + 7.0))
    steady = SimpleNamespace(time=lambda: next(wall), gmtime=time.gmtime, monotonic=lambda: 5.0, sleep=lambda _s: None)
    monkeypatch.setattr(doctorsystem, "time", steady)
    assert any("set by 7.00 s" in finding.message for finding in clock())


@pytest.mark.parametrize(("state", "wanted"), [(True, Level.OK), (False, Level.WARNING), (None, Level.INFO)])
def test_whether_the_clock_is_synchronised(monkeypatch: pytest.MonkeyPatch, state: bool | None, wanted: Level) -> None:
    monkeypatch.setattr(doctorsystem, "_synchronised", lambda: state)
    (finding,) = clock()
    assert finding.level is wanted


def test_a_daemon_that_runs_is_seen_and_not_disturbed(tmp_path: Path) -> None:
    assert not daemon_runs(config(tmp_path))
    with sole_daemon(config(tmp_path)):
        assert daemon_runs(config(tmp_path))
        assert daemon_runs(config(tmp_path))
        assert level(config(tmp_path), "daemon") is Level.OK
    assert not daemon_runs(config(tmp_path))


def test_an_address_that_is_taken(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert level(config(tmp_path, port=taken.getsockname()[1]), "address") is Level.ERROR
    assert level(config(tmp_path), "address") is Level.OK


def test_a_network_without_a_token(tmp_path: Path) -> None:
    (finding,) = found(config(tmp_path, host="0.0.0.0"), "tokens")
    assert finding.level is Level.ERROR
    with closing(Database(tmp_path / "millstream.db")) as db:
        prepare(db)
        db.execute("insert into tokens values ('1', 'n', 'admin', 'h', 'now', null, null, null)")
        db.conn.commit()
    assert found(config(tmp_path, host="0.0.0.0"), "tokens") == []
    with closing(Database(tmp_path / "millstream.db")) as db:
        db.execute("update tokens set expires_at = '2026-01-01T00:00:00.000Z'")
        db.conn.commit()
    for host in ("0.0.0.0", "127.0.0.1"):
        (finding,) = found(config(tmp_path, host=host), "tokens")
        assert finding.level is Level.WARNING
        assert "expired" in finding.message


def test_the_daemon_that_runs_is_asked_for_its_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(said: object) -> None:
        def told(url: str) -> object:
            assert url == "http://127.0.0.1:8420/healthz"
            if isinstance(said, Exception):
                raise said
            return said

        monkeypatch.setattr(doctorsystem.healthcheck, "answer", told)

    here = config(tmp_path, host="0.0.0.0", port=8420)
    with sole_daemon(here):
        answer({"version": doctorsystem.version("millstream")})
        assert level(here, "daemon") is Level.OK
        answer({"version": "0.0.1"})
        assert level(here, "daemon") is Level.WARNING
        answer(OSError("refused"))
        assert level(here, "daemon") is Level.ERROR


def test_a_data_directory_of_somebody_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem.os, "access", lambda *_: False)
    (finding,) = found(config(tmp_path), "data_dir")
    assert "sudo chown" in finding.advice
    (finding,) = found(config(tmp_path / "new"), "data_dir")
    assert finding.level is Level.ERROR


def test_a_disk_without_room_for_more_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = SimpleNamespace(f_files=10**6, f_favail=7, f_bavail=10**9, f_blocks=10**9, f_bfree=10**9, f_frsize=4096)
    monkeypatch.setattr(doctorsystem.os, "statvfs", lambda _path: nodes)
    assert any("7 files" in finding.message for finding in found(config(tmp_path), "disk"))


def test_a_log_that_has_grown(tmp_path: Path, filled: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctorsystem, "WAL_LARGE_BYTES", -1)
    filled.with_name("millstream.db-wal").touch()
    assert any("has grown" in finding.message for finding in found(config(tmp_path), "database"))
