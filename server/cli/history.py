"""`millstream history`: look over what the daemon has written down.

Reads the database, not through the daemon, also while that runs. The one rule: looking changes nothing, not even the
version of the tables.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Annotated

import typer
from sqlite_utils import Database

from jobs import history, seals
from server.access import audit
from server.cli.common import CliError, ConfigFile, ExitCode, Json, safe, say, say_json
from server.cli.settings import configuration

group = typer.Typer(help="The history: verify.", no_args_is_help=True)

DatabaseFile = Annotated[
    Path | None, typer.Option("--database", help="Another database than the daemon's, e.g. one from a backup.")
]
SHOWN_FAULTS = 50
"""More faults than that have one cause."""


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(group, name="history")


@group.callback()
def _group() -> None:
    """The history: verify."""


@group.command()
def verify(ctx: typer.Context, config: ConfigFile = None, database: DatabaseFile = None, as_json: Json = False) -> None:
    """Follow the chain of hashes through the history and the sealed journals; 1 when something was changed."""
    path = configuration(ctx, config).server.database_path if database is None else database
    with _opened(path) as db:
        counted = seals.counts(db)
        found = [*history.faults(db), *seals.faults(db)]
        # A backup of an older daemon has none.
        counted |= audit.counts(db) if (audited := "audit" in db.table_names()) else {}
        in_audit = list(audit.faults(db)) if audited else []
    if as_json:
        listed = [{"event": fault.event, "what": fault.what} for fault in found]
        listed += [{"audit": fault.event, "what": fault.what} for fault in in_audit]
        say_json({"database": str(path), "ok": not listed, **counted, "faults": listed})
    else:
        lines = [f"{path}: {f'event {fault.event}: ' if fault.event else ''}{fault.what}" for fault in found]
        lines += [f"{path}: row {fault.event} of the audit: {fault.what}" for fault in in_audit]
        for line in lines[:SHOWN_FAULTS]:
            say(safe(line))
        if len(lines) > SHOWN_FAULTS:
            say(f"and {len(lines) - SHOWN_FAULTS} more")
        say(_summary(counted, len(lines)))
    if found or in_audit:
        raise typer.Exit(ExitCode.FAILED)


@contextmanager
def _opened(path: Path) -> Iterator[Database]:
    """The database as it is at this moment, for reading only. Raises CliError."""
    if not path.is_file():
        raise CliError(ExitCode.FAILED, f"{safe(path)}: there is no database. Has a daemon run with this data_dir?")
    try:
        with closing(Database(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True))) as db:
            if not {"history_anchor", "events"} <= set(db.table_names()):
                raise CliError(
                    ExitCode.FAILED,
                    f"{safe(path)}: not a database of this version; `millstream serve` brings an older one up to it.",
                )
            # One view of it all: a daemon goes on writing meanwhile.
            db.execute("begin")
            yield db
    except sqlite3.Error as error:
        raise CliError(ExitCode.FAILED, f"{safe(path)}: the database cannot be read: {safe(error)}") from error


def _summary(counted: dict[str, int], faults: int) -> str:
    removed = f"; {counted['removed']} older ones were removed by retention" if counted["removed"] else ""
    verdict = "all in order" if not faults else f"{faults} fault{'s' if faults > 1 else ''}"
    return (
        f"{counted['events']} events ({counted['first']} to {counted['last']}){removed}; "
        f"{counted['jobs']} jobs, {counted['sealed']} of them sealed; "
        f"{counted.get('audit', 0)} rows of the audit: {verdict}"
    )
