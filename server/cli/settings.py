"""What commands that work on this computer itself (`serve`, `token`) need: the configuration and the database.

Client commands do not come here; they know an address and nothing else. The one rule: one data directory, one daemon;
two that wrote the same journal could send a batch twice.
"""

import fcntl
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer
from sqlite_utils import Database

from jobs.schema import prepare
from server.background.dbthread import refusal
from server.cli.common import CliError, ExitCode, safe
from server.cli.daemon import surroundings
from server.config.file import ConfigError, load
from server.config.model import Config
from server.store.restoring import INCOMPLETE

DEFAULT_CONFIG = Path("millstream.toml")


def configuration(ctx: typer.Context, path: Path | None) -> Config:
    """The configuration of `path`, or of ./millstream.toml, or the defaults. Raises CliError."""
    if path is None and DEFAULT_CONFIG.exists():
        path = DEFAULT_CONFIG
    try:
        return load(path, surroundings(ctx).environ)
    except ConfigError as error:
        raise CliError(ExitCode.USAGE, str(error)) from error


@contextmanager
def database(config: Config) -> Iterator[Database]:
    """The daemon's database, also while it runs. Raises CliError when it cannot be used."""
    path = config.server.database_path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        db = Database(path)
        try:
            prepare(db)
            yield db
        finally:
            db.close()
    except (OSError, sqlite3.Error) as error:
        raise CliError(ExitCode.FAILED, f"{path}: the database cannot be used: {safe(refusal(error))}") from error


@contextmanager
def sole_daemon(config: Config, *, restoring: bool = False) -> Iterator[None]:
    """Keeps other daemons away from the data directory. The lock goes with the process, however that ends.

    Raises CliError when somebody has it, or a restore was broken off there; only another one may go on then.
    """
    folder = config.server.data_dir
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / "lock").open("a", encoding="ascii")
    except OSError as error:
        raise CliError(ExitCode.FAILED, f"{folder}: cannot be written: {error.strerror}") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            advice = "Stop it, or give this one a server.data_dir of its own."
            raise CliError(ExitCode.FAILED, f"{folder}: another millstream daemon works here. {advice}") from error
        if (folder / INCOMPLETE).exists() and not restoring:
            advice = "Run it again: millstream restore FILE --force"
            raise CliError(ExitCode.FAILED, f"{folder}: a restore was broken off in the middle. {advice}")
        if not restoring:
            _check_not_lost(config)
        yield


def _check_not_lost(config: Config) -> None:
    """SQLite takes an empty file for a new database, and a power loss can leave one behind: the daemon would begin anew
    without a word, with tokens and jobs gone. Programs get there only through a database. Raises CliError."""
    path, programs = config.server.database_path, config.server.programs_dir
    if (not path.exists() or path.stat().st_size == 0) and any(programs.glob("*.nc")):
        advice = f"Restore a backup (millstream restore FILE --force), or move {programs} away to begin anew."
        raise CliError(ExitCode.FAILED, f"{path}: the database is gone, and there are programs of it. {advice}")
