"""Commands for the modes of a controller and for what is pressed at it while it works.

The one rule is that of machines.py: nothing here asks back.
"""

from typing import Annotated, Any

import typer

from server.cli.common import DEFAULT_URL, CliError, ExitCode, Json, Machine, Url, safe, say, say_json
from server.cli.daemon import Daemon, machine_path


def register(app: typer.Typer) -> None:
    """Add the commands."""
    for command in (override, coolant, sleep, door):
        app.command()(command)
    app.command("spindle-stop")(spindle_stop)
    app.command("check-mode")(check_mode)
    app.command("restore-defaults")(restore_defaults)


def override(
    ctx: typer.Context,
    feed: Annotated[int | None, typer.Option(min=10, max=200, help="Percent of the programmed feed.")] = None,
    rapid: Annotated[int | None, typer.Option(help="Percent of rapids: 25, 50 or 100.")] = None,
    spindle: Annotated[int | None, typer.Option(min=10, max=200, help="Percent of the programmed speed.")] = None,
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Change feed, rapids or spindle speed, at once, also while a job runs."""
    wanted = {key: value for key, value in {"feed": feed, "rapid": rapid, "spindle": spindle}.items() if value}
    if not wanted:
        raise CliError(ExitCode.USAGE, "Say --feed, --rapid or --spindle.")
    answer = _send(ctx, url, machine, "PATCH", "/overrides", wanted)
    _tell(answer, as_json, ", ".join(f"{kind} {percent} %" for kind, percent in answer["asked"].items()))


def coolant(
    ctx: typer.Context,
    flood: Annotated[bool | None, typer.Option("--flood/--no-flood", help="Flood on or off.")] = None,
    mist: Annotated[bool | None, typer.Option("--mist/--no-mist", help="Mist on or off.")] = None,
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Switch flood and mist, also while a job runs."""
    wanted = {key: value for key, value in {"flood": flood, "mist": mist}.items() if value is not None}
    if not wanted:
        raise CliError(ExitCode.USAGE, "Say --flood, --no-flood, --mist or --no-mist.")
    answer = _send(ctx, url, machine, "POST", "/coolant", wanted)
    shown = ", ".join(f"{kind} {'on' if answer[kind] else 'off'}" for kind in ("flood", "mist"))
    _tell(answer, as_json, shown)


def spindle_stop(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Stop the spindle of a machine that is held, or start it again."""
    _act(ctx, url, machine, "/spindle-stop", as_json)


def door(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Do what the opened safety door does: motion stops, spindle and coolant go off."""
    _act(ctx, url, machine, "/door", as_json)


def sleep(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Motors and spindle off; only a reset wakes the controller up, in alarm."""
    _act(ctx, url, machine, "/sleep", as_json)


def check_mode(
    ctx: typer.Context,
    mode: Annotated[str, typer.Argument(help="on or off.", metavar="MODE")],
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """The controller's own parser without motion. Switched off, the controller resets itself."""
    _act(ctx, url, machine, "/check-mode", as_json, {"on": _one_of(mode, "on", "off") == "on"})


def restore_defaults(
    ctx: typer.Context,
    what: Annotated[str, typer.Argument(help="settings, offsets or all.", metavar="WHAT")],
    confirm: Annotated[str, typer.Option(help="The machine's name, once more.")],
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Put back what the firmware delivers; a backup of everything is kept first."""
    body = {"what": _one_of(what, "settings", "offsets", "all"), "confirm": confirm}
    answer = _send(ctx, url, machine, "POST", "/restore", body)
    _tell(answer, as_json, f"{what} restored; backup {answer['backup']} has everything as it was")


def _one_of(word: str, *words: str) -> str:
    if word not in words:
        raise CliError(ExitCode.USAGE, f"{safe(word)} is none of {', '.join(words)}.")
    return word


def _send(
    ctx: typer.Context, url: str, machine: str | None, method: str, path: str, body: dict[str, Any] | None = None
) -> Any:
    with Daemon.of(ctx, url) as daemon:
        address = machine_path(daemon.only_machine(machine), path)
        return daemon.patch(address, body or {}) if method == "PATCH" else daemon.post(address, body)


def _act(
    ctx: typer.Context, url: str, machine: str | None, path: str, as_json: bool, body: dict[str, Any] | None = None
) -> None:
    answer = _send(ctx, url, machine, "POST", path, body)
    _tell(answer, as_json, answer["accepted"])


def _tell(answer: Any, as_json: bool, shown: str) -> None:
    if as_json:
        say_json(answer)
    else:
        say(safe(f"{answer['machine']}: {shown}"))
