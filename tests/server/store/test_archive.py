"""Archives: consistent beside a daemon that writes, whole or not there, and nothing in them is believed unchecked."""

import json
import sqlite3
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlite_utils import Database

from jobs import history, store
from jobs.program import ProgramStore
from jobs.schema import prepare
from server.store import archive
from server.store.archive import ArchiveError, Manifest, extract, opened
from tests.harness.rows import AT

PARTS = ("G90\nG1 X1\n", "G90\nG1 X2\n" * 2000)


class Data:
    """A data directory with two programs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.database = folder / "millstream.db"
        self.store = ProgramStore(folder / "programs")
        with closing(Database(self.database)) as db:
            prepare(db)
            db.execute("pragma synchronous = off")
            self.ids = [self.upload(db, text) for text in PARTS]
            history.append(db, at=AT, kind="status", data={})
            db.conn.commit()

    def upload(self, db: Database, text: str) -> str:
        with self.store.writer("part.nc") as writer:
            writer.write(text.encode())
            info = writer.finish()
        fields = ("id", "name", "lines", "bytes", "sha256")
        row = {key: getattr(info, key) for key in fields} | {"created_at": AT, "source_program": None}
        store.add_program(db, row)
        return info.id

    def backup(self, target: Path, between: Callable[[], None] = lambda: None) -> Manifest:
        return archive.write(
            target,
            database=self.database,
            programs=self.folder / "programs",
            config=None,
            version="1.2.3",
            created_at=AT,
            between=between,
        )


@pytest.fixture
def data(tmp_path: Path) -> Data:
    return Data(tmp_path / "data")


def rewritten(path: Path, change: Callable[[dict[str, bytes]], None]) -> Path:
    """The same archive after somebody has been at it."""
    with zipfile.ZipFile(path) as source:
        files = {name: source.read(name) for name in source.namelist()}
    change(files)
    with zipfile.ZipFile(path, "w") as target:
        for name, content in files.items():
            target.writestr(name, content)
    return path


def test_there_and_back(data: Data, tmp_path: Path) -> None:
    manifest = data.backup(tmp_path / "b.zip")
    assert manifest.programs == 2
    assert extract(tmp_path / "b.zip", tmp_path / "out") == manifest
    for path in (data.folder / "programs").iterdir():
        assert (tmp_path / "out" / "programs" / path.name).read_bytes() == path.read_bytes()
    with closing(Database(tmp_path / "out" / "millstream.db")) as db:
        assert history.verify(db) is None
        assert {row["id"] for row in db.query("select id from programs")} == set(data.ids)


def test_it_is_for_its_owner_alone_and_leaves_nothing_beside_it(data: Data, tmp_path: Path) -> None:
    (tmp_path / "backups").mkdir()
    data.backup(tmp_path / "backups" / "b.zip")
    assert (tmp_path / "backups" / "b.zip").stat().st_mode & 0o777 == 0o600
    assert [path.name for path in (tmp_path / "backups").iterdir()] == ["b.zip"]


def test_a_backup_that_breaks_off_leaves_the_old_one(data: Data, tmp_path: Path) -> None:
    target = tmp_path / "b.zip"
    target.write_text("the old one")

    def fail() -> None:
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        data.backup(target, between=fail)
    assert target.read_text() == "the old one"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.zip", "data"]


def test_what_is_written_meanwhile_is_in_it_wholly_or_not_at_all(data: Data, tmp_path: Path) -> None:
    with closing(Database(data.database)) as daemon:
        daemon.execute("begin immediate")
        daemon.execute("insert into machines (name) values ('half')")
        data.backup(tmp_path / "b.zip", between=lambda: data.upload(daemon, "G90\nG1 X3\n") and None)
        daemon.conn.commit()
    manifest = extract(tmp_path / "b.zip", tmp_path / "out")
    assert manifest.programs == 2
    with closing(sqlite3.connect(tmp_path / "out" / "millstream.db")) as db:
        assert db.execute("select count(*) from machines").fetchone() == (0,)


def test_a_program_that_is_deleted_meanwhile_is_not_in_it(data: Data, tmp_path: Path) -> None:
    gone = data.ids[0]

    def delete() -> None:
        if gone in data.store:
            with closing(Database(data.database)) as daemon:
                store.delete_program(daemon, gone)
                daemon.conn.commit()
            data.store.delete(gone)

    manifest = data.backup(tmp_path / "b.zip", between=delete)
    assert (manifest.programs, manifest.missing) == (1, ())
    extract(tmp_path / "b.zip", tmp_path / "out")
    with closing(Database(tmp_path / "out" / "millstream.db")) as db:
        assert store.program(db, gone) is None


def test_a_program_whose_file_is_gone_is_named(data: Data, tmp_path: Path) -> None:
    data.store.delete(data.ids[0])
    manifest = data.backup(tmp_path / "b.zip")
    assert (manifest.programs, manifest.missing) == (1, (data.ids[0],))


def _flip(files: dict[str, bytes]) -> None:
    name = next(name for name in files if name.endswith(".nc"))
    files[name] = files[name].replace(b"X", b"Y", 1)


def _grow(files: dict[str, bytes]) -> None:
    files["millstream.db"] += b"x"


def _lose(files: dict[str, bytes]) -> None:
    del files[next(name for name in files if name.endswith(".nc"))]


def _add(files: dict[str, bytes]) -> None:
    files["programs/" + "a" * 64 + ".nc"] = b"G1"


def _escape(files: dict[str, bytes]) -> None:
    manifest = json.loads(files["manifest.json"])
    manifest["files"].append({"name": "../evil", "bytes": 1, "sha256": "x"})
    files["manifest.json"] = json.dumps(manifest).encode()
    files["../evil"] = b"x"


def _newer(files: dict[str, bytes]) -> None:
    files["manifest.json"] = files["manifest.json"].replace(b'"format": 1', b'"format": 2')


def _spoil(files: dict[str, bytes]) -> None:
    files["manifest.json"] = b"[]"


def _bare(files: dict[str, bytes]) -> None:
    del files["manifest.json"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_flip, "is damaged"),
        (_grow, "not as long"),
        (_lose, "not those of its manifest"),
        (_add, "not those of its manifest"),
        (_escape, "'../evil' has no place"),
        (_newer, "newer version"),
        (_spoil, "no backup of millstream"),
        (_bare, "no backup of millstream"),
    ],
)
def test_an_archive_that_somebody_has_been_at_is_refused(
    data: Data, tmp_path: Path, change: Callable[[dict[str, bytes]], None], told: str
) -> None:
    data.backup(tmp_path / "b.zip")
    with pytest.raises(ArchiveError, match=told):
        extract(rewritten(tmp_path / "b.zip", change), tmp_path / "out")
    assert not (tmp_path / "evil").exists()


def test_a_file_that_was_cut_short_or_is_none_is_refused(data: Data, tmp_path: Path) -> None:
    data.backup(tmp_path / "b.zip")
    content = (tmp_path / "b.zip").read_bytes()
    for number, wrong in enumerate((content[: len(content) // 2], b"", b"a letter", content[:100] + content[150:])):
        (tmp_path / "b.zip").write_bytes(wrong)
        with pytest.raises(ArchiveError):
            extract(tmp_path / "b.zip", tmp_path / f"out{number}")


def test_every_byte_of_a_program_is_vouched_for(data: Data, tmp_path: Path) -> None:
    data.backup(tmp_path / "b.zip")
    with opened(tmp_path / "b.zip") as (_, manifest):
        names = {one.name for one in manifest.files}
    assert names == {"millstream.db", *(f"programs/{id}{suffix}" for id in data.ids for suffix in (".nc", ".idx"))}


@given(st.data())
@settings(max_examples=40, deadline=None)
def test_no_byte_can_be_changed_unseen(once: tuple[bytes, dict[str, bytes]], data: st.DataObject) -> None:
    """Either the archive is refused, or what comes out of it is what went in."""
    content, inside = once
    place = data.draw(st.integers(0, len(content) - 1))
    value = data.draw(st.integers(1, 255))
    with TemporaryDirectory() as folder:
        path, out = Path(folder) / "b.zip", Path(folder) / "out"
        path.write_bytes(content[:place] + bytes([content[place] ^ value]) + content[place + 1 :])
        try:
            extract(path, out)
        except ArchiveError:
            return
        assert {name: (out / name).read_bytes() for name in inside} == inside


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, dict[str, bytes]]:
    """An archive and what is in it."""
    folder = tmp_path_factory.mktemp("once")
    Data(folder / "data").backup(folder / "b.zip")
    manifest = extract(folder / "b.zip", folder / "out")
    return (folder / "b.zip").read_bytes(), {
        one.name: (folder / "out" / one.name).read_bytes() for one in manifest.files
    }
