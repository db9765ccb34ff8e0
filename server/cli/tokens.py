"""`millstream token`: make, list and revoke access tokens.

Works on the daemon's database, not through the daemon: the first token must exist before it may listen on a network.
The one rule: a secret is printed once, when it is made, and never again.
"""

from typing import Annotated

import typer
from rich.table import Table

from server.auth import GRANTABLE
from server.cli.common import CliError, ConfigFile, ExitCode, Json, safe, say, say_json, terminal, warn
from server.cli.settings import configuration, database
from server.hub import utc_now
from server.tokens import TokenError, create_token, list_tokens, revoke_token

group = typer.Typer(help="Access tokens: create, list, revoke.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(group, name="token")


@group.command()
def create(
    ctx: typer.Context,
    name: Annotated[str, typer.Option(help="Whose it is, for people.")] = "",
    role: Annotated[str, typer.Option(help=f"One of {', '.join(GRANTABLE)}.")] = "admin",
    config: ConfigFile = None,
    as_json: Json = False,
) -> None:
    """Make a token and print its secret, this once."""
    with database(configuration(ctx, config)) as db:
        try:
            token, secret = create_token(db, name or f"{role} from the command line", role, now=utc_now())
        except TokenError as error:
            raise CliError(ExitCode.USAGE, safe(error)) from error
    if as_json:
        say_json({**token.view(), "token": secret})
        return
    warn(f"Token {token.id} ({safe(token.name)}, {token.role.word}). It is shown only now:")
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
    table = Table("id", "name", "role", "created", "last used", "revoked", box=None)
    for token in tokens:
        row = (
            token.id,
            token.name,
            token.role.word,
            token.created_at,
            token.last_used_at or "-",
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
    if token is None:
        raise CliError(ExitCode.FAILED, f"There is no token {safe(token_id)}; `millstream token list` shows them.")
    if as_json:
        say_json(token.view())
    else:
        say(f"Token {token.id} ({safe(token.name)}) is revoked.")
