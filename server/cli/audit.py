"""`millstream audit`: who has asked the daemon for what.

Through the daemon, which wants an admin's token where it has tokens. The one rule: what was typed by somebody is shown
so that no terminal obeys it.
"""

from typing import Annotated, Any

import typer
from rich.table import Table

from server.cli.common import DEFAULT_URL, Json, Machine, Url, safe, say_json, terminal
from server.cli.daemon import Daemon

PAGE = 1000
COLUMNS = ("at", "name", "address", "method", "route", "machine", "job", "status", "code")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(audit)


def audit(
    ctx: typer.Context,
    url: Url = DEFAULT_URL,
    machine: Machine = None,
    token: Annotated[str | None, typer.Option(help="Only what was done with this token (its id).")] = None,
    name: Annotated[str | None, typer.Option(help="Only what was done under this name.")] = None,
    job: Annotated[int | None, typer.Option(min=1, help="Only what concerns this job.")] = None,
    code: Annotated[str | None, typer.Option(help="Only what was refused with this code.")] = None,
    since: Annotated[str | None, typer.Option(help="Not before this time (RFC 3339).")] = None,
    until: Annotated[str | None, typer.Option(help="Only before this time (RFC 3339).")] = None,
    limit: Annotated[int, typer.Option(min=1, max=100_000, help="How many at most, the newest first.")] = 50,
    as_json: Json = False,
) -> None:
    """Show who has asked for what, the newest first."""
    wanted = {
        "machine": machine,
        "token": token,
        "name": name,
        "job": job,
        "code": code,
        "since": since,
        "until": until,
    }
    rows: list[dict[str, Any]] = []
    with Daemon.of(ctx, url) as daemon:
        while len(rows) < limit:
            before = rows[-1]["id"] if rows else None
            page = daemon.get("/audit", **wanted, before=before, limit=min(PAGE, limit - len(rows)))
            rows += page
            if len(page) < PAGE:
                break
    if as_json:
        say_json(rows)
        return
    table = Table(*COLUMNS, box=None)
    for row in rows:
        table.add_row(*("-" if row[column] in (None, "") else safe(row[column]) for column in COLUMNS))
    terminal().print(table)
