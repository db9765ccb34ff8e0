"""Commands for machines: list them, hold, go on, stop, e-stop, home, jog, read the console, and find serial ports.

The one rule: nothing here asks back. A stop that waits for an answer to a question is no stop.
"""

from collections.abc import Mapping
from typing import Annotated, Any

import typer
from rich.table import Table
from serial.tools import list_ports

from server.cli.common import DEFAULT_URL, CliError, ExitCode, Json, Machine, Url, safe, say, say_json, terminal, warn
from server.cli.daemon import Daemon, machine_path

AXES = "xyzabc"


def register(app: typer.Typer) -> None:
    """Add the commands."""
    for command in (machines, console, ports, pause, resume, stop, estop, home, unlock, reset, jog):
        app.command()(command)


def position_text(state: Mapping[str, Any]) -> str:
    """`X12.500 Y0.000 Z5.000`, of the axes that are known."""
    work = state.get("position", {}).get("work", {})
    return " ".join(f"{axis.upper()}{work[axis]:.3f}" for axis in AXES if axis in work)


def machines(ctx: typer.Context, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """List the machines and what they are doing."""
    with Daemon.of(ctx, url) as daemon:
        found = daemon.get("/machines")
    if as_json:
        say_json(found)
        return
    table = Table("machine", "link", "status", "position", "job", "queue", "port", box=None)
    for one in found:
        job = one["active_job"]
        state = one["state"]
        row = (
            one["name"],
            one["link"],
            state["status"],
            position_text(state),
            job or "-",
            one["queue_length"],
            one["port"],
        )
        table.add_row(*(safe(cell) for cell in row))
    terminal().print(table)


def console(
    ctx: typer.Context,
    machine: Machine = None,
    limit: Annotated[int, typer.Option(min=1, max=1000, help="How many messages.")] = 50,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Print the last messages between the daemon and a machine."""
    with Daemon.of(ctx, url) as daemon:
        lines = daemon.get(machine_path(daemon.only_machine(machine), "/console"), limit=limit)
    if as_json:
        say_json(lines)
        return
    for line in lines:
        say(safe(f"{line['at']} {line['direction']} {line['text']}"))


def ports(as_json: Json = False) -> None:
    """List the serial ports of this computer."""
    found = [
        {"port": one.device, "description": one.description, "hardware": one.hwid}
        for one in sorted(list_ports.comports())
    ]
    if as_json:
        say_json(found)
    elif not found:
        say("No serial ports here. Is the cable plugged in, and are you in the group that may use it (dialout)?")
    for one in found if not as_json else ():
        say(safe(f"{one['port']}  {one['description']}  {one['hardware']}"))


def pause(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Hold a machine's job; on ElVinto at the end of the batch that is being executed."""
    _act(ctx, "pause", machine, url, as_json)


def resume(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Go on after a pause."""
    _act(ctx, "resume", machine, url, as_json)


def stop(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Cancel a machine's job at the end of what is being executed."""
    _act(ctx, "stop", machine, url, as_json)


def estop(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Emergency stop, at once; without --machine of every machine. Not a substitute for the button."""
    with Daemon.of(ctx, url) as daemon:
        names = [machine] if machine is not None else [one["name"] for one in daemon.get("/machines")]
        answers: list[Any] = []
        refused: dict[str, CliError] = {}
        # A machine that refuses must not keep the others from being stopped.
        for name in names:
            try:
                answers.append(daemon.post(machine_path(name, "/estop")))
            except CliError as refusal:
                refused[name] = refusal
    _report(answers, as_json)
    for name, error in refused.items():
        if as_json:
            say_json(error.problem)
        else:
            warn(f"{safe(name)}: {error.message}")
    if refused:
        raise typer.Exit(max(error.code for error in refused.values()))


def home(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Home the machine; it begins to move."""
    _act(ctx, "home", machine, url, as_json)


def unlock(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Clear an alarm. The position may be lost: home before the next job."""
    _act(ctx, "unlock", machine, url, as_json)


def reset(ctx: typer.Context, machine: Machine = None, url: Url = DEFAULT_URL, as_json: Json = False) -> None:
    """Reset the controller, at once; a Grbl also in the middle of a job, which is interrupted then."""
    _act(ctx, "reset", machine, url, as_json)


Way = Annotated[float | None, typer.Option(help="How far, mm.")]


def jog(
    ctx: typer.Context,
    x: Way = None,
    y: Way = None,
    z: Way = None,
    a: Annotated[float | None, typer.Option(help="How far, degrees.")] = None,
    b: Annotated[float | None, typer.Option(help="How far, degrees.")] = None,
    c: Annotated[float | None, typer.Option(help="How far, degrees.")] = None,
    feed: Annotated[float | None, typer.Option(min=0.001, help="mm/min.")] = None,
    cancel: Annotated[bool, typer.Option("--cancel", help="End the jog instead.")] = False,
    machine: Machine = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Move by a distance from where the machine stands, with --feed; or end that."""
    ways = {axis: way for axis, way in zip(AXES, (x, y, z, a, b, c), strict=True) if way}
    if cancel == bool(ways) or cancel == (feed is not None):
        raise CliError(ExitCode.USAGE, "Say how far (--x, --y, ...) and --feed, or --cancel alone.")
    with Daemon.of(ctx, url) as daemon:
        path = machine_path(daemon.only_machine(machine), "/jog")
        answer = daemon.delete(path) if cancel else daemon.post(path, {**ways, "feed": feed})
    _report([answer], as_json)


def _act(ctx: typer.Context, action: str, machine: str | None, url: str, as_json: bool) -> None:
    with Daemon.of(ctx, url) as daemon:
        answer = daemon.post(machine_path(daemon.only_machine(machine), f"/{action}"))
    _report([answer], as_json)


def _report(answers: list[Any], as_json: bool) -> None:
    for answer in answers:
        if as_json:
            say_json(answer)
        else:
            say(safe(f"{answer['machine']}: {answer['accepted']}"))
