"""Commands for what a controller is and has stored: firmware, modal state, settings and their backups, offsets, blocks.

Not the configuration of the daemon (settings.py). The one rule: what was written is printed, also when it ended
half-way; and nothing is written that was not named.
"""

from collections.abc import Mapping
from typing import Annotated, Any

import typer
from rich.table import Table

from server.cli.common import (
    DEFAULT_URL,
    CliError,
    ExitCode,
    Json,
    Machine,
    Url,
    safe,
    say,
    say_json,
    terminal,
    warn,
)
from server.cli.daemon import Daemon, machine_path, told_setting

AXES = "xyzabcuvw"
Coordinate = Annotated[float | None, typer.Option(help="Coordinate in mm (degrees for a, b, c).")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    settings = typer.Typer(help="The settings of a controller, and their backups.", no_args_is_help=True)
    settings.command("list")(list_settings)
    settings.command("set")(set_settings)
    settings.command("backups")(backups)
    settings.command("compare")(compare)
    settings.command("restore")(restore)
    app.add_typer(settings, name="settings")
    for command in (offsets, modal, firmware):
        app.command()(command)
    app.command("startup-blocks")(startup_blocks)


# --- settings -------------------------------------------------------------------------------------------------


def list_settings(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """List the settings of a controller."""
    with Daemon.of(ctx, url) as daemon:
        found = daemon.get(machine_path(daemon.only_machine(machine), "/settings"))
    if as_json:
        say_json(found)
        return
    table = Table("setting", "value", "unit", "name", "meaning", box=None)
    for one in found["settings"]:
        row = (f"${one['number']}", one["value"], one["unit"] or "", one["name"] or "", one["meaning"] or "")
        table.add_row(*map(safe, row))
    terminal().print(table)


def set_settings(
    ctx: typer.Context,
    words: Annotated[list[str], typer.Argument(help="110 600, or 110=600 22=1 ...", metavar="VALUES")],
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Write settings, each read back; a backup is kept first."""
    values = assignments(words)
    with Daemon.of(ctx, url) as daemon:
        done = daemon.patch(machine_path(daemon.only_machine(machine), "/settings"), {"values": values})
    _tell(done, as_json)


def assignments(words: list[str]) -> dict[str, str]:
    """`110 600`, or `110=600` as often as one likes; a `$` in front does no harm. Raises CliError."""
    pairs = [word.partition("=")[::2] for word in words]
    if not any("=" in word for word in words):
        pairs = [(words[0], " ".join(words[1:]))]
    values = {number.strip().removeprefix("$"): value.strip() for number, value in pairs}
    for number, value in values.items():
        if not number.isdecimal() or not value:
            raise CliError(
                ExitCode.USAGE, f"{safe(number)}={safe(value)}: a setting is written as 110=600, or 110 600."
            )
    return values


def backups(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """List the backups of the settings, the newest first."""
    with Daemon.of(ctx, url) as daemon:
        found = daemon.get(machine_path(daemon.only_machine(machine), "/settings/backups"))
    if as_json:
        say_json(found)
        return
    table = Table("backup", "made at", "before a", "by", "firmware", "settings", box=None)
    for one in found:
        row = (one[key] for key in ("id", "at", "why", "made_by", "firmware", "settings"))
        table.add_row(*map(safe, row))
    terminal().print(table)


BackupId = Annotated[int, typer.Argument(min=1, help="The number of a backup.", metavar="ID")]


def compare(
    ctx: typer.Context, id: BackupId, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False
) -> None:
    """Show in what the present settings differ from a backup; 1 when they cannot be compared."""
    with Daemon.of(ctx, url) as daemon:
        found = daemon.get(machine_path(daemon.only_machine(machine), f"/settings/backups/{id}"))
    if as_json:
        say_json(found)
    elif found["differences"] is None:
        raise CliError(ExitCode.FAILED, f"Backup {id} has {found['settings']} settings. {safe(found['not_compared'])}")
    elif not found["differences"]:
        say(f"The settings are those of backup {id}.")
    else:
        _print_differences(found["differences"], "now")
    if found["differences"] is None:
        raise typer.Exit(ExitCode.FAILED)


def restore(
    ctx: typer.Context, id: BackupId, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False
) -> None:
    """Write the settings of a backup where they differ; the present ones are kept first."""
    with Daemon.of(ctx, url) as daemon:
        done = daemon.post(machine_path(daemon.only_machine(machine), f"/settings/backups/{id}/restore"))
    _tell(done, as_json)
    if done["left_out"] and not as_json:
        warn(f"The controller has no {', '.join(f'${number}' for number in done['left_out'])}.")


def _tell(done: Any, as_json: bool) -> None:
    if as_json:
        say_json(done)
        return
    for one in done["results"]:
        say(told_setting(one))
    for one in done["also_changed"]:
        say(safe(f"${one['number']} {one['name'] or ''}: {one['before']} -> {one['value']} (by the controller itself)"))
    if done["backup"] is None:
        say("Nothing was to be written.")
    else:
        say(f"Backup {done['backup']} has everything as it was.")


def _print_differences(differences: list[Any], now: str) -> None:
    table = Table("setting", "name", "in the backup", now, "unit", box=None)
    for one in differences:
        row = (f"${one['number']}", one["name"] or "", one["before"] or "-", one["value"] or "-", one["unit"] or "")
        table.add_row(*map(safe, row))
    terminal().print(table)


# --- what else it has -----------------------------------------------------------------------------------------


def offsets(
    ctx: typer.Context,
    system: Annotated[str | None, typer.Option(help="Set this one: G54 ... G59.3, active, G28, G30.")] = None,
    absolute: Annotated[bool, typer.Option("--absolute", help="The origin in machine coordinates.")] = False,
    x: Coordinate = None,
    y: Coordinate = None,
    z: Coordinate = None,
    a: Coordinate = None,
    b: Coordinate = None,
    c: Coordinate = None,
    clear: Annotated[str | None, typer.Option(help="Clear G92 or TLO.")] = None,
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Show the offsets of a controller, or set one: the coordinates that the present place is to have."""
    axes = {name: at for name, at in {"x": x, "y": y, "z": z, "a": a, "b": b, "c": c}.items() if at is not None}
    if (system is None and (axes or absolute)) or (system is not None and clear is not None):
        raise CliError(
            ExitCode.USAGE, "Say --system with coordinates, or --clear with G92 or TLO, or nothing to see all."
        )
    with Daemon.of(ctx, url) as daemon:
        path = machine_path(daemon.only_machine(machine), "/offsets")
        if system is not None:
            found = daemon.patch(path, {"system": system, "mode": "absolute" if absolute else "here", **axes})
        elif clear is not None:
            found = daemon.delete(f"{path}/{clear.upper()}")
        else:
            found = daemon.get(path)
    if as_json:
        say_json(found)
        return
    for name, at in found["offsets"].items():
        say(safe(f"{name:6} {_place(at)}"))
    if (probe := found["probe"]) is not None:
        say(safe(f"PRB    {_place(probe['position'])}{'' if probe['succeeded'] else ' (no contact)'}"))


def _place(axes: Mapping[str, float]) -> str:
    return " ".join(f"{axis.upper()}{axes[axis]:.3f}" for axis in AXES if axis in axes)


def modal(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Show the modal groups of a controller."""
    with Daemon.of(ctx, url) as daemon:
        found = daemon.get(machine_path(daemon.only_machine(machine), "/modal"))
    if as_json:
        say_json(found)
        return
    for group, words in found["groups"].items():
        shown = words if isinstance(words, str) else " ".join(words)
        if shown:
            say(safe(f"{group:20} {shown}"))


def firmware(
    ctx: typer.Context,
    info: Annotated[str | None, typer.Option(help="Write this info text first.")] = None,
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Show what a controller is: version, build options, buffers."""
    with Daemon.of(ctx, url) as daemon:
        path = machine_path(daemon.only_machine(machine), "/firmware")
        found = daemon.get(path) if info is None else daemon.put(f"{path}/info", {"info": info})
    if as_json:
        say_json(found)
        return
    say(safe(f"{found['flavour']} {found['version']} {found['build']} {found['info']}".strip()))
    say(safe(f"planner {found['planner_blocks']} blocks, receive buffer {found['rx_bytes']} bytes"))
    say(safe(f"axes {' '.join(found['axes'])}"))
    for option in found["options"]:
        say(safe(f"{option['code']:8} {option['meaning'] or '(unknown)'}"))
    for fact, value in found["facts"].items():
        say(safe(f"{fact}: {value}"))
    for warning in found["warnings"]:
        warn(safe(warning))


def startup_blocks(
    ctx: typer.Context,
    blocks: Annotated[
        list[str] | None, typer.Option("--set", help="Store these, in order; the rest is emptied. May be repeated.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Also blocks that move or start something.")] = False,
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Show the blocks that a controller executes after every reset, or store them: it EXECUTES them then."""
    with Daemon.of(ctx, url) as daemon:
        path = machine_path(daemon.only_machine(machine), "/startup-blocks")
        found = daemon.get(path) if not blocks else daemon.put(path, {"blocks": blocks, "force": force})
    if as_json:
        say_json(found)
        return
    for index, block in enumerate(found["blocks"]):
        say(safe(f"N{index} {block}".rstrip()))
    for warning in found["warnings"]:
        warn(safe(warning))
