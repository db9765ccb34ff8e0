"""`millstream token`: make, list and revoke access tokens.

Works on the daemon's database, not through the daemon: the first token must exist before it may listen on a network.
The one rule: a secret is printed once, when it is made, and never again.
"""

import getpass
from functools import partial
from typing import Annotated

import typer
from rich.table import Table
from sqlite_utils import Database

from server.access.audit import BY_COMMAND_LINE, Entry, append, clean
from server.access.auth import GRANTABLE
from server.access.tokens import TokenError, create_token, list_tokens, revoke_token
from server.background.dbthread import in_transaction
from server.cli.common import CliError, ConfigFile, ExitCode, Json, safe, say, say_json, terminal, warn
from server.cli.settings import configuration, database
from server.clock import rfc3339, utc_now

group = typer.Typer(help="Access tokens: create, list, revoke.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(group, name="token")


@group.command()
def create(
    ctx: typer.Context,
    name: Annotated[str, typer.Option(help="Whose it is, for people.")] = "",
    role: Annotated[str, typer.Option(help=f"One of {', '.join(GRANTABLE)}.")] = "admin",
    expires: Annotated[str | None, typer.Option(help="After how long it ends, e.g. 90d, 12h; never without.")] = None,
    config: ConfigFile = None,
    as_json: Json = False,
) -> None:
    """Make a token and print its secret, this once."""
    with database(configuration(ctx, config)) as db:
        try:
            token, secret = create_token(db, name or f"{role} from the command line", role, expires, now=utc_now())
        except TokenError as error:
            raise CliError(ExitCode.USAGE, safe(error)) from error
        _note(db, "create", token.id)
    if as_json:
        say_json({**token.view(), "token": secret})
        return
    ends = "" if token.expires_at is None else f", until {token.expires_at}"
    warn(f"Token {token.id} ({safe(token.name)}, {token.role.word}{ends}). It is shown only now:")
    say(secret)
    warn("From now on every command and browser needs a token, on this computer too: export MILLSTREAM_TOKEN=...")


@group.command("list")
def list_(ctx: typer.Context, config: ConfigFile = None, as_json: Json = False) -> None:
    """List the tokens, without their secrets."""
    with database(configuration(ctx, config)) as db:
        tokens = list_tokens(db)
    if as_json:
        say_json([token.view() for token in tokens])
        return
    table = Table("id", "name", "role", "created", "last used", "expires", "revoked", box=None)
    now = utc_now()
    for token in tokens:
        row = (
            token.id,
            token.name,
            token.role.word,
            token.created_at,
            token.last_used_at or "-",
            f"{token.expires_at or 'never'}{' (expired)' if token.has_expired(now) else ''}",
            token.revoked_at or "-",
        )
        table.add_row(*map(safe, row))
    terminal().print(table)


@group.command()
def revoke(
    ctx: typer.Context,
    token_id: Annotated[str, typer.Argument(metavar="ID", help="As `millstream token list` shows it.")],
    config: ConfigFile = None,
    as_json: Json = False,
) -> None:
    """Make a token worthless, for ever."""
    with database(configuration(ctx, config)) as db:
        token = revoke_token(db, token_id, now=utc_now())
        if token is not None:
            _note(db, "revoke", token.id)
    if token is None:
        raise CliError(ExitCode.FAILED, f"There is no token {safe(token_id)}; `millstream token list` shows them.")
    if as_json:
        say_json(token.view())
    else:
        say(f"Token {token.id} ({safe(token.name)}) is revoked.")


def _note(db: Database, verb: str, token_id: str) -> None:
    """Into the audit, under the name of who is logged in on this computer."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # a container without users
        user = "unknown"
    entry = Entry(
        at=rfc3339(utc_now()),
        via=BY_COMMAND_LINE,
        token=None,
        name=clean(user),
        address="",
        method="COMMAND",
        route=f"token {verb}",
        target=token_id,
        status=200,
    )
    in_transaction(db, partial(append, entry=entry))
