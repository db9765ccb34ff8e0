"""`millstream backup` and `millstream restore`: everything that the daemon keeps, as one file, and back.

Work on the data directory, not through the daemon. The one rule: a backup disturbs nobody; a restore asks before it
replaces anything, and never works under a daemon that runs.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from server.cli.common import CliError, ConfigFile, ExitCode, Json, safe, say, say_json, warn
from server.cli.settings import DEFAULT_CONFIG, configuration, sole_daemon
from server.clock import rfc3339, utc_now
from server.store import archive
from server.store.archive import ArchiveError
from server.store.restoring import in_the_way, restore

MIB = 1024**2

Target = Annotated[Path, typer.Argument(metavar="FILE", help="The archive that is to be made, e.g. millstream.zip.")]
Source = Annotated[Path, typer.Argument(metavar="FILE", help="An archive of `millstream backup`.", exists=True)]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(backup)
    app.command("restore")(restore_)


def backup(
    ctx: typer.Context,
    file: Target,
    config: ConfigFile = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE where there is one.")] = False,
    as_json: Json = False,
) -> None:
    """Keep database and programs in one archive, also while the daemon runs."""
    settings = configuration(ctx, config)
    database = settings.server.database_path
    if not database.is_file():
        raise CliError(ExitCode.FAILED, f"{safe(database)}: there is no database. Has a daemon run with this data_dir?")
    if file.exists() and not force:
        raise CliError(ExitCode.FAILED, f"{safe(file)} is there already; --force replaces it.")
    source = config or (DEFAULT_CONFIG if DEFAULT_CONFIG.exists() else None)
    with _told(file):
        manifest = archive.write(
            file,
            database=database,
            programs=settings.server.programs_dir,
            config=source,
            version=version("millstream"),
            created_at=rfc3339(utc_now()),
        )
    size = file.stat().st_size
    if as_json:
        say_json({"file": str(file), "bytes": size, "programs": manifest.programs, "missing": list(manifest.missing)})
    else:
        say(f"{safe(file)}: {manifest.programs} programs and the database, {size / MIB:.1f} MiB")
    for id in manifest.missing:
        warn(f"The file of program {safe(id)} is gone; it is not in the archive.")


def restore_(
    ctx: typer.Context,
    file: Source,
    config: ConfigFile = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there; it is kept aside.")] = False,
    as_json: Json = False,
) -> None:
    """Put the data of an archive in the place of the daemon's, after it has been verified."""
    settings = configuration(ctx, config)
    folder = settings.server.data_dir
    with sole_daemon(settings, restoring=True):
        found = in_the_way(folder)
        if found and not force:
            raise CliError(
                ExitCode.FAILED,
                f"{safe(folder)} is not empty ({safe(', '.join(found[:5]))}). --force replaces it and keeps it aside.",
            )
        with _told(file):
            done = restore(file, folder, now=utc_now())
    aside = None if done.aside is None else str(done.aside)
    if as_json:
        view = {"created_at": done.manifest.created_at, "programs": done.manifest.programs, "held": done.held}
        view["revoked_tokens"] = done.revoked
        say_json({"data_dir": str(folder), "aside": aside, **view})
        return
    say(f"{safe(folder)}: the data of {safe(done.manifest.created_at)}, {done.manifest.programs} programs")
    if aside is not None:
        say(f"What was there lies in {safe(aside)}.")
    if done.held:
        say(f"{done.held} jobs that were waiting are on hold: nothing starts by itself.")
    if done.revoked:
        say(f"{done.revoked} tokens of the backup were revoked since, and stay so.")


@contextmanager
def _told(file: Path) -> Iterator[None]:
    """What can go wrong, as a sentence."""
    try:
        yield
    except ArchiveError as error:
        raise CliError(ExitCode.FAILED, f"{safe(file)}: {safe(error)}") from error
    except OSError as error:
        raise CliError(ExitCode.FAILED, f"{safe(error.filename or file)}: {error.strerror or error}") from error
    except sqlite3.Error as error:
        raise CliError(ExitCode.FAILED, f"{safe(file)}: the database cannot be copied: {safe(error)}") from error
