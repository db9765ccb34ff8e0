"""What all commands share: exit codes, the error that ends a command, options, and text that is safe to show.

Not a command. The one rule: what a machine, a file or a daemon says is shown through `safe`, so that it cannot steer
the terminal; and a user's mistake is a sentence, never a traceback.
"""

import asyncio
import json
import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from protocol.errors import MillstreamError

DEFAULT_URL = "http://127.0.0.1:8420"

PIPED_COLUMNS = 400
"""For tables that go into a pipe: no cell is to be cut for a screen that is not there."""


class ExitCode(IntEnum):
    """What scripts go by (api.md)."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    UNREACHABLE = 3
    BROKEN_OFF = 130
    """Ctrl-C, as shells have it: 128 + SIGINT."""


class CliError(MillstreamError):
    """Ends a command. `message` is for people, `problem` what `--json` prints instead."""

    def __init__(self, code: ExitCode, message: str, problem: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.problem = problem if problem is not None else {"code": code.name.lower(), "detail": message}


class BrokenOffError(CliError):
    """The user has pressed Ctrl-C; `message` says what goes on all the same."""

    def __init__(self, message: str = "") -> None:
        super().__init__(ExitCode.BROKEN_OFF, message)


Url = Annotated[
    str,
    typer.Option("--url", envvar="MILLSTREAM_URL", help="Address of the daemon. Its token: MILLSTREAM_TOKEN."),
]
Json = Annotated[bool, typer.Option("--json", help="Machine-readable output.")]
Machine = Annotated[
    str | None, typer.Option("--machine", "-m", help="Name of the machine; not needed where there is only one.")
]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        envvar="MILLSTREAM_CONFIG",
        help="Configuration; without it ./millstream.toml, if there is one.",
    ),
]
ProgramFile = Annotated[
    Path,
    typer.Argument(exists=True, dir_okay=False, readable=True, help="The program: a file of G-code.", metavar="FILE"),
]


def safe(text: object) -> str:
    """One line of text in which nothing is left that a terminal would obey."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in str(text))


def say(text: str) -> None:
    """A line for people or scripts, as it is."""
    typer.echo(text)


def say_json(data: object) -> None:
    """One JSON document, as one line."""
    typer.echo(json.dumps(data, ensure_ascii=False))


def warn(text: str) -> None:
    """A line on standard error. A log on a full disk is no reason to fail."""
    with suppress(OSError):
        typer.echo(text, err=True)


def terminal(*, stderr: bool = False) -> Console:
    """rich's console of this moment's standard output; what is written to it is never taken for markup."""
    console = Console(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not console.is_terminal:
        console.width = PIPED_COLUMNS
    return console


def on_stop_signal(stop: Callable[[], object]) -> None:
    """Have `stop` called on the running loop at Ctrl-C and SIGTERM."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop)
