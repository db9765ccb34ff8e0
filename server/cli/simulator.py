"""`millstream sim`: a virtual machine on a pseudo-terminal or a TCP port, with faults to order.

The one rule: this only carries options to `sim.shell`; every machine's settings are checked where they are defined.
"""

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Mapping
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import urlencode

import typer

from server.cli.common import CliError, ExitCode, on_stop_signal, safe, say
from sim.options import SimOptions, grbl_options_from_query, lathe_options_from_query, options_from_query
from sim.shell import run

group = typer.Typer(help="Virtual machines, for trying things out without a workshop.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(group, name="sim")


@group.callback()
def sim() -> None:
    """Virtual machines, for trying things out without a workshop."""


Pty = Annotated[Path | None, typer.Option(help="Link to make to the pseudo-terminal, e.g. /tmp/mill.")]
Tcp = Annotated[str | None, typer.Option(help="HOST:PORT to listen on instead.")]
Speed = Annotated[float | None, typer.Option(min=0.001, help="How many times faster than life it moves.")]
Baud = Annotated[int | None, typer.Option(min=0, help="Pace of the wire; 0: it takes no time.")]
Loss = Annotated[float | None, typer.Option(min=0, max=1, help="Chance of a byte to be lost.")]
Flip = Annotated[float | None, typer.Option(min=0, max=1, help="Chance of a byte to have a bit flipped.")]
Duplicate = Annotated[float | None, typer.Option(min=0, max=1, help="Chance of a byte to come twice.")]
Noise = Annotated[float | None, typer.Option(min=0, max=1, help="Chance of a burst of noise with what is sent.")]
Delay = Annotated[float | None, typer.Option(min=0, max=1, help="Chance of a delay of what is sent.")]
Seed = Annotated[int, typer.Option(help="Of the faults: the same seed, the same faults.")]
Option = Annotated[
    list[str] | None,
    typer.Option("--option", "-o", help="KEY=VALUE, as in sim:?KEY=VALUE (docs/configuration.md)."),
]


@group.command()
def elvinto(
    pty: Pty = None,
    tcp: Tcp = None,
    speed: Speed = None,
    repeat: Annotated[str | None, typer.Option(help="Answer to a repeated ID: silent or reack.")] = None,
    baud: Baud = None,
    loss: Loss = None,
    flip: Flip = None,
    duplicate: Duplicate = None,
    noise: Noise = None,
    delay: Delay = None,
    seed: Seed = 0,
    record: Annotated[Path | None, typer.Option(help="File to which every executed block is appended.")] = None,
    option: Option = None,
) -> None:
    """An ElVinto v11 mill; runs until Ctrl-C. Without --pty and --tcp on a pseudo-terminal of any name."""
    named = {
        "speed_factor": speed,
        "repeat": repeat,
        "baud": baud,
        "loss": loss,
        "flip": flip,
        "duplicate": duplicate,
        "noise": noise,
        "delay": delay,
        "seed": seed,
    }
    options = _options(options_from_query, named, option or [])
    _serve(options, "virtual ElVinto mill", pty=pty, tcp=tcp, record=record)


@group.command()
def grbl(
    pty: Pty = None,
    tcp: Tcp = None,
    flavour: Annotated[str | None, typer.Option(help="1.1h or grblHAL.")] = None,
    speed: Speed = None,
    baud: Baud = None,
    loss: Loss = None,
    flip: Flip = None,
    duplicate: Duplicate = None,
    noise: Noise = None,
    delay: Delay = None,
    seed: Seed = 0,
    record: Annotated[Path | None, typer.Option(help="File to which every line that was taken is appended.")] = None,
    option: Option = None,
) -> None:
    """A Grbl controller; runs until Ctrl-C. Without --pty and --tcp on a pseudo-terminal of any name."""
    named = {
        "flavour": flavour,
        "speed_factor": speed,
        "baud": baud,
        "loss": loss,
        "flip": flip,
        "duplicate": duplicate,
        "noise": noise,
        "delay": delay,
        "seed": seed,
    }
    options = _options(grbl_options_from_query, named, option or [])
    _serve(options, "virtual Grbl controller", pty=pty, tcp=tcp, record=record)


@group.command()
def ncframe(
    pty: Pty = None,
    tcp: Tcp = None,
    check: Annotated[str | None, typer.Option(help="Check byte behind a frame: none, xor or crc8.")] = None,
    counter: Annotated[bool | None, typer.Option(help="ENQ is answered with the number of executed frames.")] = None,
    speed: Speed = None,
    baud: Baud = None,
    loss: Loss = None,
    flip: Flip = None,
    duplicate: Duplicate = None,
    noise: Noise = None,
    delay: Delay = None,
    seed: Seed = 0,
    record: Annotated[Path | None, typer.Option(help="File to which every executed frame is appended.")] = None,
    option: Option = None,
) -> None:
    """A lathe behind NC frames; runs until Ctrl-C. Without --pty and --tcp on a pseudo-terminal of any name."""
    named = {
        "check": check,
        "counter": counter,
        "speed_factor": speed,
        "baud": baud,
        "loss": loss,
        "flip": flip,
        "duplicate": duplicate,
        "noise": noise,
        "delay": delay,
        "seed": seed,
    }
    options = _options(lathe_options_from_query, named, option or [])
    _serve(options, "virtual lathe behind NC frames", pty=pty, tcp=tcp, record=record)


def _serve(options: SimOptions[Any], what: str, *, pty: Path | None, tcp: str | None, record: Path | None) -> None:
    if pty is not None and tcp is not None:
        raise CliError(ExitCode.USAGE, "--pty and --tcp exclude each other.")
    serving = run(
        options.settings,
        pty=pty,
        tcp=tcp,
        record=record,
        faults=options.faults,
        seed=options.seed,
        ready=lambda address: say(f"{what}: {address}"),
        baud=options.baud,
    )
    try:
        asyncio.run(_until_stopped(serving))
    except (OSError, ValueError) as error:
        raise CliError(ExitCode.FAILED, safe(error)) from error


async def _until_stopped(serving: Coroutine[None, None, None]) -> None:
    """However it is stopped, the link to the pseudo-terminal goes with it."""
    task = asyncio.create_task(serving)
    on_stop_signal(task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _options(read: Callable[[str], SimOptions[Any]], named: Mapping[str, object], pairs: list[str]) -> SimOptions[Any]:
    query = {key: value for key, value in named.items() if value is not None}
    for pair in pairs:
        key, sign, value = pair.partition("=")
        if not sign:
            raise CliError(ExitCode.USAGE, f"--option {safe(pair)}: KEY=VALUE is wanted.")
        query[key] = value
    try:
        return read(urlencode(query))
    except (ValueError, OSError) as error:
        raise CliError(ExitCode.USAGE, safe(error)) from error
