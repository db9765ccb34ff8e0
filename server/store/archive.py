"""Backups of the daemon's data as one file: the database, the programs, the configuration, a manifest with hashes.

Not the backups of what a controller has stored (jobs/backups.py); those lie in the database and come along. A ZIP, so
that any computer can look into it. The one rule: an archive is consistent although the daemon goes on writing, and
nothing is believed of one that its manifest does not vouch for.
"""

import hashlib
import json
import os
import re
import secrets
import sqlite3
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from protocol.errors import MillstreamError

FORMAT = 1
"""Of the manifest; a later one is refused."""
MANIFEST = "manifest.json"
DATABASE = "millstream.db"
PROGRAMS = "programs"
CONFIG = "millstream.toml"
"""For people: what the machines were called. It is never put back by itself."""
CHUNK_BYTES = 1 << 18
COMPRESSION_LEVEL = 1
"""G-code shrinks to a fifth at the fastest level; the others cost minutes for some percent more."""
ATTEMPTS = 3
"""A program that is deleted between the copy of the database and its own is none of the archive's: begin again."""
MANIFEST_BYTES_MOST = 64 * 1024**2
_NAME = re.compile(rf"{re.escape(DATABASE)}|{re.escape(CONFIG)}|{PROGRAMS}/[0-9a-f]{{64}}\.[a-z0-9.]{{1,16}}")
"""Every name that an archive can have; none of them leads out of a folder."""
PROGRAM_SUFFIXES = (".nc", ".idx")
"""What a program needs (jobs/program.py); drawings and the like are made again."""


class ArchiveError(MillstreamError):
    """An archive cannot be made or used; the message says why."""


@dataclass(frozen=True, slots=True)
class Content:
    """One file in an archive."""

    name: str
    bytes: int
    sha256: str


@dataclass(frozen=True, slots=True)
class Manifest:
    """What is in an archive. `missing`: programs whose files were gone when it was made."""

    version: str
    created_at: str
    files: tuple[Content, ...]
    missing: tuple[str, ...] = ()

    def text(self) -> str:
        """As it stands in the archive."""
        files = [{"name": one.name, "bytes": one.bytes, "sha256": one.sha256} for one in self.files]
        told = {"format": FORMAT, "version": self.version, "created_at": self.created_at, "files": files}
        return json.dumps(told | {"missing": list(self.missing)}, indent=1)

    @classmethod
    def read(cls, text: bytes) -> "Manifest":
        """From that. Raises ArchiveError."""
        try:
            told: Mapping[str, Any] = json.loads(text)
            number = told["format"]
            files = tuple(Content(str(one["name"]), int(one["bytes"]), str(one["sha256"])) for one in told["files"])
            found = cls(str(told["version"]), str(told["created_at"]), files, tuple(map(str, told["missing"])))
        except (ValueError, KeyError, TypeError) as error:
            raise ArchiveError(f"{MANIFEST} cannot be read: it is no backup of millstream") from error
        if number != FORMAT:
            raise ArchiveError(f"it was made by a newer version, {found.version}; install that one")
        return found

    @property
    def programs(self) -> int:
        """How many programs are in it."""
        return sum(one.name.endswith(".nc") for one in self.files)


# --- making one -----------------------------------------------------------------------------------------------


def write(
    target: Path,
    *,
    database: Path,
    programs: Path,
    config: Path | None,
    version: str,
    created_at: str,
    between: Callable[[], None] = lambda: None,
) -> Manifest:
    """Make an archive at `target`, which is complete and durable when it is there. `between` is called between the
    copies of database and programs, for tests.

    Raises ArchiveError, OSError, sqlite3.Error.
    """
    part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    copy = part.with_suffix(".db")
    try:
        wanted, missing = _consistent(database, copy, programs, between)
        # For the owner's eyes: there are hashes of tokens in it, and whatever the programs are worth.
        with os.fdopen(os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600), "w+b") as file:
            files = [(DATABASE, copy), *((f"{PROGRAMS}/{path.name}", path) for path in wanted)]
            if config is not None:
                files.append((CONFIG, config))
            manifest = _pack(file, files, version, created_at, missing)
            file.flush()
            os.fsync(file.fileno())
        part.replace(target)
        sync_folder(target.parent)
    finally:
        part.unlink(missing_ok=True)
        copy.unlink(missing_ok=True)
    return manifest


def _consistent(
    database: Path, copy: Path, programs: Path, between: Callable[[], None]
) -> tuple[list[Path], tuple[str, ...]]:
    """A copy of the database, and the files of every program in it. Uploaded meanwhile: not in the copy, not wanted."""
    for _ in range(ATTEMPTS):
        copy_database(database, copy)
        between()
        wanted, missing = _files_of(copy, programs)
        if not missing:
            break
    return wanted, missing


def copy_database(database: Path, copy: Path) -> None:
    """The database as it is at one moment, while others write to it. Raises sqlite3.Error."""
    copy.unlink(missing_ok=True)
    copy.touch(mode=0o600)
    with (
        closing(sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)) as source,
        closing(sqlite3.connect(copy)) as into,
    ):
        source.backup(into)
        # One file, without a log beside it.
        into.execute("pragma journal_mode = delete")


def _files_of(copy: Path, programs: Path) -> tuple[list[Path], tuple[str, ...]]:
    with closing(sqlite3.connect(copy)) as db:
        ids = [row[0] for row in db.execute("select id from programs order by id")]
    wanted, missing = [], []
    for id in ids:
        files = [programs / f"{id}{suffix}" for suffix in PROGRAM_SUFFIXES]
        if all(path.is_file() for path in files):
            wanted += files
        else:
            missing.append(id)
    return wanted, tuple(missing)


def _pack(
    file: IO[bytes], files: list[tuple[str, Path]], version: str, created_at: str, missing: tuple[str, ...]
) -> Manifest:
    contents = []
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=COMPRESSION_LEVEL) as archive:
        for name, path in files:
            with path.open("rb") as source, archive.open(name, "w", force_zip64=True) as into:
                contents.append(_copied(name, source, into))
        manifest = Manifest(version, created_at, tuple(contents), missing)
        archive.writestr(MANIFEST, manifest.text())
    return manifest


def _copied(name: str, source: IO[bytes], into: IO[bytes]) -> Content:
    """What went from one file to the other."""
    count, digest = 0, hashlib.sha256()
    while chunk := source.read(CHUNK_BYTES):
        into.write(chunk)
        digest.update(chunk)
        count += len(chunk)
    return Content(name, count, digest.hexdigest())


# --- reading one ----------------------------------------------------------------------------------------------


@contextmanager
def opened(path: Path) -> Iterator[tuple[zipfile.ZipFile, Manifest]]:
    """An archive and its manifest; nothing but the manifest has been looked at. Raises ArchiveError, OSError."""
    try:
        with zipfile.ZipFile(path) as archive:
            if MANIFEST not in archive.namelist():
                raise ArchiveError(f"there is no {MANIFEST} in it: it is no backup of millstream")
            if archive.getinfo(MANIFEST).file_size > MANIFEST_BYTES_MOST:
                raise ArchiveError(f"{MANIFEST} is too large: it is no backup of millstream")
            yield archive, _checked(archive, Manifest.read(archive.read(MANIFEST)))
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as error:
        raise ArchiveError(f"it is damaged, or no ZIP archive: {error}") from error


def _checked(archive: zipfile.ZipFile, manifest: Manifest) -> Manifest:
    """The manifest, if its names are those in the archive and lead nowhere else. Raises ArchiveError."""
    told, found = sorted(one.name for one in manifest.files), sorted(set(archive.namelist()) - {MANIFEST})
    if strange := [name for name in {*told, *found} if not _NAME.fullmatch(name)]:
        raise ArchiveError(f"{strange[0]!r} has no place in a backup")
    if told != found or len(archive.namelist()) != len(found) + 1:
        raise ArchiveError("its files are not those of its manifest")
    if any(info.header_offset < 0 for info in archive.infolist()):
        raise ArchiveError("it is damaged: pieces of it are missing")
    if DATABASE not in told:
        raise ArchiveError(f"there is no {DATABASE} in it")
    return manifest


def extract(path: Path, into: Path) -> Manifest:
    """Write the files of an archive into an empty folder, each held against the manifest.

    Raises ArchiveError, OSError.
    """
    with opened(path) as (archive, manifest):
        (into / PROGRAMS).mkdir(parents=True)
        for one in manifest.files:
            if archive.getinfo(one.name).file_size != one.bytes:
                raise ArchiveError(f"{one.name} is not as long as the manifest says")
            with archive.open(one.name) as source, (into / one.name).open("xb") as target:
                copied = _copied(one.name, source, target)
                target.flush()
                os.fsync(target.fileno())
            if copied != one:
                raise ArchiveError(f"{one.name} is damaged: its hash is not that of the manifest")
        for folder in (into / PROGRAMS, into):
            sync_folder(folder)
    return manifest


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable."""
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
