"""What can be wrong around the daemon: disk, clock, database, versions, the address that it listens on.

Not the machines (doctor/ports.py, doctor/ask.py). The one rule: looking changes nothing: no directory is made, no
table brought up to date, and a daemon that runs is not disturbed.
"""

import ctypes
import ctypes.util
import fcntl
import os
import platform
import shutil
import socket
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from sqlite_utils import Database

from jobs.schema import migrations, unknown_migrations
from server import healthcheck
from server.access.auth import is_loopback
from server.clock import rfc3339, utc_now
from server.config.model import Config
from server.doctor.findings import Finding, error, info, ok, warning

FREE_AT_LEAST_BYTES = 100 * 1024**2
"""Below it the next upload or a week of history fills the disk, and the stream stands still."""
FREE_WANTED_BYTES = 1024**3
INODES_WANTED = 1000
NETWORK_FILESYSTEMS = frozenset({"nfs", "nfs4", "cifs", "smb3", "9p", "fuse.sshfs", "drvfs"})
"""SQLite's write-ahead log needs shared memory and locks that these do not keep."""
MIB = 1024**2
WAL_LARGE_BYTES = 64 * MIB
"""Checkpoints keep it at some MiB; a reader that never ends lets it grow."""
FIRST_YEAR = 2025
"""The program is younger than that: a clock before it has lost its battery."""
AHEAD_S = 2.0
JUMP_S = 0.05
WATCHED_S = 0.25
PACKAGES = ("pyserial", "fastapi", "uvicorn", "sqlite-utils", "numpy", "uvloop")
STA_UNSYNC = 0x40


def system(config: Config) -> Iterator[Finding]:
    """Everything that concerns this computer and the daemon as a whole."""
    yield _versions()
    yield from _folder(config.server.data_dir)
    yield from _disk(config.server.data_dir)
    yield from clock()
    yield from _database(config.server.database_path)
    yield from _address(config)


def daemon_runs(config: Config) -> bool:
    """Whether somebody has the lock of the data directory."""
    try:
        with (config.server.data_dir / "lock").open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


# --- versions, disk -------------------------------------------------------------------------------------------


def _versions() -> Finding:
    found = {"millstream": version("millstream"), "python": platform.python_version(), "sqlite": sqlite3.sqlite_version}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    told = ", ".join(f"{name} {number}" for name, number in found.items())
    return ok("versions", f"{told}; {platform.system()} {platform.release()} {platform.machine()}", **found)


def _folder(folder: Path) -> Iterator[Finding]:
    if not folder.exists():
        above = next(parent for parent in folder.absolute().parents if parent.exists())
        if os.access(above, os.W_OK | os.X_OK):
            yield info("data_dir", f"{folder} is not there yet; the first start makes it.")
        else:
            yield error("data_dir", f"{folder} is not there and cannot be made in {above}.", "Set server.data_dir.")
        return
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        owner = folder.stat().st_uid
        yield error(
            "data_dir",
            f"{folder} cannot be written: it belongs to user {owner}, this is user {os.getuid()}.",
            f"sudo chown -R {os.getuid()} {folder}, or run the doctor as the user of the daemon.",
        )
    if (kind := filesystem(folder)) in NETWORK_FILESYSTEMS:
        yield error(
            "data_dir", f"{folder} lies on a network file system ({kind}).", "Set server.data_dir to a local disk."
        )


def filesystem(folder: Path, mounts: Path = Path("/proc/self/mounts")) -> str:
    """The kind of file system that a directory lies on; empty where the system does not tell."""
    try:
        lines = mounts.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    path, best, kind = str(folder.resolve()), "", ""
    for line in lines:
        fields = line.split(" ")
        point = fields[1].replace("\\040", " ") if len(fields) > 2 else ""
        inside = path == point or path.startswith(point.rstrip("/") + "/")
        if point and inside and len(point) >= len(best):
            best, kind = point, fields[2]
    return kind


def _disk(folder: Path) -> Iterator[Finding]:
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    free = shutil.disk_usage(there).free
    told = f"{free // MIB} MiB are free for {folder}"
    advice = "Free some space, or delete programs that nobody needs."
    if free < FREE_AT_LEAST_BYTES:
        yield error("disk", f"Only {told}.", advice, free_bytes=free)
    elif free < FREE_WANTED_BYTES:
        yield warning("disk", f"Only {told}.", advice, free_bytes=free)
    else:
        yield ok("disk", f"{told}.", free_bytes=free)
    nodes = os.statvfs(there)
    if nodes.f_files and nodes.f_favail < INODES_WANTED:
        yield warning("disk", f"Only {nodes.f_favail} files can still be made.", "Remove files that nobody needs.")


# --- the clock ------------------------------------------------------------------------------------------------


class _Timex(ctypes.Structure):
    """The head of Linux's struct timex; the rest is room."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        *((name, ctypes.c_long) for name in ("offset", "freq", "maxerror", "esterror")),
        ("status", ctypes.c_int),
        ("room", ctypes.c_char * 512),
    )


def clock() -> Iterator[Finding]:
    """Whether time stamps can be believed."""
    now = time.time()
    if time.gmtime(now).tm_year < FIRST_YEAR:
        yield error("clock", f"The clock says {time.gmtime(now).tm_year}.", "Set it: sudo timedatectl set-ntp true")
        return
    if (by_s := _jumped(WATCHED_S)) > JUMP_S:
        yield warning("clock", f"The clock was set by {by_s:.2f} s just now.", "Time stamps may be out of order.")
    if (synchronised := _synchronised()) is None:
        yield info("clock", "Whether the clock is synchronised cannot be told here.")
    elif synchronised:
        yield ok("clock", "The clock is synchronised.")
    else:
        yield warning(
            "clock", "The clock is not synchronised.", "sudo timedatectl set-ntp true, or a clock of its own."
        )


def _jumped(watched_s: float) -> float:
    """By how much the wall clock and the steady one came apart while somebody watched, in s."""
    before = time.time() - time.monotonic()
    time.sleep(watched_s)
    return abs(time.time() - time.monotonic() - before)


def _synchronised() -> bool | None:
    """What the kernel says of the clock; None where it says nothing."""
    try:
        adjtimex = ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True).adjtimex
    except (OSError, AttributeError):
        return None
    state = _Timex()
    return None if adjtimex(ctypes.byref(state)) < 0 else not state.status & STA_UNSYNC


# --- the database ---------------------------------------------------------------------------------------------


def _database(path: Path) -> Iterator[Finding]:
    if not path.exists():
        yield info("database", "There is no database yet; the first start makes it.")
        return
    try:
        with closing(Database(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True))) as db:
            yield from _looked_into(db, path)
    except sqlite3.Error as fault:
        yield error("database", f"{path}: {fault}.", "Restore a backup: `millstream restore FILE --force`.")


def _looked_into(db: Database, path: Path) -> Iterator[Finding]:
    faults = [row[0] for row in db.execute("pragma quick_check(5)").fetchall() if row[0] != "ok"]
    if faults:
        told = "; ".join(faults)[:300]
        yield error("database", f"{path} is damaged: {told}.", "Restore a backup: `millstream restore FILE --force`.")
        return
    if unknown := unknown_migrations(db):
        told = f"{path} was made by a newer version ({', '.join(unknown)})."
        yield error("database", told, "Install that version, or restore a backup of this one.")
        return
    size = path.stat().st_size
    waiting = len(migrations.pending(db))
    pending = f", {waiting} changes of its tables wait for the next start" if waiting else ""
    yield ok("database", f"{path}: in order, {size / MIB:.1f} MiB{pending}.", bytes=size)
    wal = path.with_name(path.name + "-wal")
    if wal.exists() and wal.stat().st_size > WAL_LARGE_BYTES:
        told = f"{wal} has grown to {wal.stat().st_size // MIB} MiB."
        yield warning("database", told, "Something keeps reading the database: end it, or restart the daemon.")
    yield from _ahead(db)


def _ahead(db: Database) -> Iterator[Finding]:
    """A newest event from the future: the clock was set back since."""
    row = (
        next(db.query("select at from events order by id desc limit 1"), None) if "events" in db.table_names() else None
    )
    if row is None:
        return
    ahead_s = datetime.fromisoformat(row["at"]).timestamp() - time.time()
    if ahead_s > AHEAD_S:
        yield warning(
            "clock",
            f"The newest event in the history is {ahead_s:.0f} s in the future: the clock was set back.",
            "Set it right. Nothing is lost; new time stamps stand before old ones until then.",
        )


# --- the address ----------------------------------------------------------------------------------------------


def _address(config: Config) -> Iterator[Finding]:
    host, port = config.server.host, config.server.port
    ends = _ends_of_tokens(config.server.database_path)
    now = rfc3339(utc_now())
    if ends and all(end is not None and end <= now for end in ends):
        yield warning("tokens", "All tokens have expired: nobody can do anything over HTTP.", "millstream token create")
    if daemon_runs(config):
        yield _running(config)
        return
    yield info("daemon", "No daemon runs with this data_dir.", running=False)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        with socket.create_server((host.strip("[]"), port), family=family):
            yield ok("address", f"{host}:{port} is free.")
    except OSError as fault:
        reason = os.strerror(fault.errno) if fault.errno else str(fault)
        yield error("address", f"{host}:{port}: {reason}.", "Set server.host and server.port, or end what is there.")
    if not is_loopback(host) and not ends:
        yield error(
            "tokens",
            f"server.host is {host}, and there is no token: the daemon will not start.",
            "millstream token create",
        )


def _running(config: Config) -> Finding:
    """The daemon that has the data directory: does it answer, and is it of this version?"""
    if config.server.port == 0:
        return ok("daemon", "A daemon runs with this data_dir, on a port that the system chose.", running=True)
    url = healthcheck.reach(config.server.host, config.server.port)
    try:
        said = healthcheck.answer(url)
    except (OSError, ValueError) as fault:
        told = f"A daemon runs with this data_dir, but {url} does not answer: {fault}."
        return error(
            "daemon", told, "Does it use another configuration? Else restart it, and keep its log.", running=True
        )
    ours, its = version("millstream"), str(said.get("version", "unknown"))
    if ours != its:
        told = f"The daemon that runs is version {its}, this is {ours}."
        return warning("daemon", told, "Restart it when no job runs.", running=True, version=its)
    return ok("daemon", f"A daemon runs with this data_dir, and answers at {url}.", running=True, version=its)


def _ends_of_tokens(path: Path) -> list[str | None]:
    """When the tokens that are not revoked end by themselves."""
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as db:
            return [row[0] for row in db.execute("select expires_at from tokens where revoked_at is null")]
    except sqlite3.Error:
        return []
