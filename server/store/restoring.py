"""Puts a backup in the place of the daemon's data: verified first, the old data kept aside, never under a daemon.

Not the archive itself (archive.py). The one rule: until everything of the backup is on the disk and has been looked
over, nothing of the old data is touched; and while the two are being exchanged a mark says so, which no daemon starts
over.
"""

import os
import shutil
import sqlite3
from contextlib import closing
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from sqlite_utils import Database

from jobs import history, holds, store
from jobs.effects import SetStatus
from jobs.job import ACTIVE, JobError, Status
from jobs.schema import prepare, unknown_migrations
from server.clock import rfc3339
from server.store import archive
from server.store.archive import ArchiveError, Manifest, sync_folder

INCOMPLETE = "restore-incomplete"
"""The mark in the data directory: old and new are mixed."""
NEW, OLD = "restore-new", "before-restore-"
KEPT_NAMES = ("lock", INCOMPLETE, NEW)
"""What stays where it is: the lock is the process's own."""
RESTORED = "restored"
"""The event in the history."""


@dataclass(frozen=True, slots=True)
class Restored:
    """What was done. `aside`: where the old data lies, if there was any; `held`: jobs that wait for somebody's word;
    `revoked`: tokens that are good in the backup, and now no more."""

    manifest: Manifest
    aside: Path | None
    held: int
    revoked: int


@dataclass(frozen=True, slots=True)
class _Replaced:
    """What the data that is replaced knows of tokens: when each was revoked (None: it was not), and up to when revoked
    ones may have been forgotten (server/access/endedtokens.py). Nothing, where it cannot be read."""

    tokens: dict[str, str | None] = field(default_factory=dict)
    forgotten_until: str | None = None

    def revoked_at(self, token: str, manifest: Manifest, now: str) -> str | None:
        """When a token that was good as the backup was made was revoked since; None: it was not."""
        if token in self.tokens:
            return self.tokens[token]
        forgotten = self.forgotten_until is not None and manifest.created_at <= self.forgotten_until
        return now if forgotten else None


def in_the_way(folder: Path) -> list[str]:
    """What of a data directory a restore would replace."""
    if not folder.is_dir():
        return []
    return sorted(path.name for path in folder.iterdir() if _is_data(path.name))


def restore(backup: Path, folder: Path, *, now: datetime) -> Restored:
    """Put the data of `backup` into `folder`, whose lock the caller has.

    Raises ArchiveError, OSError, sqlite3.Error.
    """
    owner = folder.stat()
    new = folder / NEW
    shutil.rmtree(new, ignore_errors=True)
    new.mkdir(mode=0o700)
    try:
        manifest = archive.extract(backup, new)
        (new / archive.CONFIG).unlink(missing_ok=True)
        replaced = _replaced(folder / archive.DATABASE)
        held, revoked = _look_over(new / archive.DATABASE, manifest, rfc3339(now), replaced)
        _give_to(new, owner)
        aside = _exchange(folder, new, now)
        _give_to(folder / "lock", owner)
    finally:
        shutil.rmtree(new, ignore_errors=True)
    return Restored(manifest, aside, held, revoked)


def _replaced(database: Path) -> _Replaced:
    """Also of a version before this one, which forgot none."""
    tokens: dict[str, str | None] = {}
    try:
        with closing(sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)) as db:
            tokens = dict(db.execute("select id, revoked_at from tokens").fetchall())
            row = db.execute("select revoked_until from tokens_forgotten").fetchone()
    except sqlite3.Error:
        row = None
    return _Replaced(tokens, None if row is None else row[0])


def _look_over(database: Path, manifest: Manifest, now: str, replaced: _Replaced) -> tuple[int, int]:
    """Is it sound, and one of ours? Then nothing of its queue starts by itself; how many jobs that concerns, and how
    many tokens."""
    with closing(Database(sqlite3.connect(database))) as db:
        if (damage := _damage(db)) is not None:
            raise ArchiveError(f"its database is damaged: {damage}")
        if unknown := unknown_migrations(db):
            names = ", ".join(unknown)
            raise ArchiveError(f"it was made by a newer version, {manifest.version} ({names}); install that one")
        prepare(db)
        with db.conn:
            held = _lay_down(db, manifest, now)
            revoked = _revoke(db, manifest, now, replaced)
        db.execute("pragma wal_checkpoint(truncate)")
        # prepare has made it one with a log beside it; what is moved has to be one file.
        db.execute("pragma journal_mode = delete")
    return held, revoked


def _revoke(db: Database, manifest: Manifest, now: str, replaced: _Replaced) -> int:
    """Who was revoked since the backup was made stays so."""
    good = [row["id"] for row in db.query("select id from tokens where revoked_at is null")]
    revoked = {id: at for id in good if (at := replaced.revoked_at(id, manifest, now)) is not None}
    for id, at in revoked.items():
        db.execute("update tokens set revoked_at = ? where id = ?", [at, id])
    if replaced.forgotten_until is not None:  # an older backup may be restored after this one
        db.execute(
            """insert into tokens_forgotten (id, revoked_until) values (1, ?)
               on conflict (id) do update set revoked_until = max(revoked_until, excluded.revoked_until)""",
            [replaced.forgotten_until],
        )
    return len(revoked)


def _damage(db: Database) -> str | None:
    try:
        found = [str(row[0]) for row in db.execute("pragma integrity_check(1)").fetchall()]
    except sqlite3.DatabaseError as error:  # damaged beyond looking
        return str(error)
    return None if found == ["ok"] else found[0]


def _lay_down(db: Database, manifest: Manifest, at: str) -> int:
    """Nothing of the backup moves a machine: what waited is held, and what ran then is over, for nobody knows what the
    machine has done since. Its open rows must never be sent again."""
    why = f"the data of {manifest.created_at} was restored: what the machine did after that is not known"
    ended = []
    for row in list(db.query("select * from jobs")):
        before = Status(row["status"])
        if before not in ACTIVE:
            continue
        if before is Status.CHECKING:  # nothing was sent
            store.set_status(db, row["id"], SetStatus(before, Status.QUEUED, row["line_done"]), at=at)
            continue
        first, last = _open_lines(db, row["id"])
        db.execute("update batches set status = 'doubtful' where job = ? and status = 'planned'", [row["id"]])
        cancelled = before is Status.INTERRUPTED
        after = Status.CANCELLED if cancelled else Status.FAILED
        error = JobError("cancelled_in_doubt" if cancelled else "in_doubt", why, first, last)
        store.set_status(db, row["id"], SetStatus(before, after, row["line_done"], error=error), at=at)
        ended.append(row["id"])
    # Which tool is in the spindle is asked for anew: a wrong one would be believed.
    db.execute("update tool_changers set tool_known = 0")
    machines = [row["machine"] for row in db.query("select distinct machine from jobs where status = 'queued'")]
    held = sum(store.hold_queue(db, machine, holds.RESTORED) for machine in machines)
    data = {"version": manifest.version, "created_at": manifest.created_at, "held": held, "ended": ended}
    history.append(db, at=at, kind=RESTORED, data=data)
    return held


def _open_lines(db: Database, job: int) -> tuple[int | None, int | None]:
    """First and last line of the batches that were with the machine."""
    query = "select min(line_from) as first, max(line_to) as last from batches where job = ? and status = 'planned'"
    (row,) = db.query(query, [job])
    return row["first"], row["last"]


def _give_to(new: Path, owner: os.stat_result) -> None:
    """Restored by root, it still is the daemon's own."""
    if os.geteuid() != 0:
        return
    for path in (new, *new.rglob("*")) if new.exists() else ():
        os.chown(path, owner.st_uid, owner.st_gid)


def _exchange(folder: Path, new: Path, now: datetime) -> Path | None:
    """Old data aside, new data in its place; within one folder, which may be a mounted volume."""
    old = [folder / name for name in in_the_way(folder)]
    _mark(folder)
    aside = _make_aside(folder, now) if old else None
    for path in old:
        assert aside is not None
        path.rename(aside / path.name)
    for path in sorted(new.iterdir()):
        path.rename(folder / path.name)
    if aside is not None:
        sync_folder(aside)
    _unmark(folder)
    return aside


def _mark(folder: Path) -> None:
    """Durable before anything is moved: no daemon starts from here on."""
    text = "A restore was broken off here. Run it again: millstream restore FILE --force\n"
    (folder / INCOMPLETE).write_text(text, encoding="ascii")
    sync_folder(folder)


def _unmark(folder: Path) -> None:
    """When everything is in its place, durably."""
    sync_folder(folder)
    (folder / INCOMPLETE).unlink()
    sync_folder(folder)


def _make_aside(folder: Path, now: datetime) -> Path:
    aside = folder / f"{OLD}{now:%Y%m%dT%H%M%SZ}"
    aside.mkdir(mode=0o700)
    _give_to(aside, folder.stat())
    return aside


def _is_data(name: str) -> bool:
    return name not in KEPT_NAMES and not name.startswith(OLD)
