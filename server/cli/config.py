"""`millstream config`: what the daemon would work with, and where each value comes from.

Not the reading (server/config/file.py). The one rule: secrets are masked, so that the output can be shown to others.
"""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from server.cli.common import CliError, ConfigFile, ExitCode, Json, safe, say, say_json, terminal
from server.cli.daemon import surroundings
from server.cli.settings import DEFAULT_CONFIG
from server.config.file import ConfigError
from server.config.sources import DEFAULT, settings

group = typer.Typer(help="The configuration: show.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(group, name="config")


@group.callback()
def _group() -> None:
    """The configuration: show."""


@group.command()
def show(
    ctx: typer.Context,
    config: ConfigFile = None,
    changed: Annotated[bool, typer.Option("--changed", help="Only what is not the default.")] = False,
    as_json: Json = False,
) -> None:
    """Print each value and where it comes from: the default, a line of the file, or a variable."""
    path = config or (DEFAULT_CONFIG if DEFAULT_CONFIG.exists() else None)
    try:
        found = settings(path, surroundings(ctx).environ)
    except ConfigError as error:
        raise CliError(ExitCode.USAGE, str(error)) from error
    shown = [one for one in found if not (changed and one.source == DEFAULT)]
    if as_json:
        listed = [{"key": one.key, "value": _plain(one.value), "source": one.source} for one in shown]
        say_json({"config": None if path is None else str(path), "settings": listed})
        return
    say(f"configuration: {'none, the defaults' if path is None else safe(path)}")
    table = Table("key", "value", "source", box=None)
    for one in shown:
        table.add_row(safe(one.key), safe(_text(one.value)), safe(one.source))
    terminal().print(table)


def _text(value: Any) -> str:
    """As TOML would have it."""
    return "(none)" if value is None else json.dumps(_plain(value), ensure_ascii=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return {str(key): _plain(each) for key, each in value.items()} if isinstance(value, dict) else value
