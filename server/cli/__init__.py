"""The command `millstream`: puts the commands together and turns their errors into messages and exit codes.

Each group of commands has a file of its own. The one rule: whatever goes wrong ends here as one message on standard
error (with `--json`: one object on standard output) and one of the exit codes of api.md.
"""

import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Annotated

import typer

from server.cli import (
    audit,
    backup,
    config,
    control,
    demo,
    doctor,
    history,
    jobs,
    machines,
    offline,
    recover,
    serve,
    simulator,
    stored,
    switches,
    telemetry,
    tokens,
    watch,
)
from server.cli.common import CliError, say, say_json, warn
from server.cli.daemon import Surroundings

GROUPS = (
    serve,
    demo,
    doctor,
    config,
    offline,
    jobs,
    recover,
    machines,
    control,
    watch,
    tokens,
    history,
    audit,
    backup,
    simulator,
    stored,
    switches,
    telemetry,
)


def build() -> typer.Typer:
    """The whole command line."""
    app = typer.Typer(
        name="millstream",
        help="Streams G-code to CNC controllers: every line executed exactly once, or the doubt named.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    app.callback()(_options)
    for group in GROUPS:
        group.register(app)
    return app


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"millstream {version('millstream')}")
        raise typer.Exit


def _options(
    _version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Streams G-code to CNC controllers: every line executed exactly once, or the doubt named."""


def run(argv: Sequence[str], around: Surroundings) -> int:
    """Run one command; its exit code."""
    try:
        build()(args=list(argv), obj=around, prog_name="millstream")
    except SystemExit as ended:
        return int(ended.code or 0)
    except CliError as error:
        if "--json" in argv:
            say_json(error.problem)
        elif error.message:
            warn(error.message)
        return int(error.code)
    return 0


def main() -> None:
    """The entry point."""
    sys.exit(run(sys.argv[1:], Surroundings()))
