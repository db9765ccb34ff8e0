"""`millstream control`: who moves a machine by hand, and taking it from them.

Through the daemon. The one rule: without an option it only looks.
"""

from typing import Annotated

import typer

from server.cli.common import DEFAULT_URL, CliError, ExitCode, Json, Machine, Url, safe, say, say_json
from server.cli.daemon import Daemon, machine_path


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(control)


def control(
    ctx: typer.Context,
    url: Url = DEFAULT_URL,
    machine: Machine = None,
    take: Annotated[bool, typer.Option("--take", help="Keep others from it for 30 seconds.")] = False,
    takeover: Annotated[bool, typer.Option("--takeover", help="Also from who has it.")] = False,
    release: Annotated[bool, typer.Option("--release", help="Give it back.")] = False,
    as_json: Json = False,
) -> None:
    """Show who moves the machine by hand, or take that over. Moving a machine that nobody has needs none of this."""
    if release and (take or takeover):
        raise CliError(ExitCode.USAGE, "--release and --take do not go together.")
    with Daemon.of(ctx, url) as daemon:
        path = machine_path(daemon.only_machine(machine), "/control")
        if release:
            daemon.delete(path)
        view = daemon.post(path, {"takeover": takeover}) if take or takeover else daemon.get(path)
    if as_json:
        say_json(view)
    elif (holder := view["holder"]) is None:
        say(safe(f"{view['machine']}: nobody moves it by hand"))
    else:
        you = " (you)" if view["yours"] else ""
        say(safe(f"{view['machine']}: {holder['name']} at {holder['client']}{you}, since {holder['since']}"))
