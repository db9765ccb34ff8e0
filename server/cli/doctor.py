"""`millstream doctor`: what is not in order on this computer, with the daemon, with each machine; and what to do.

Not the looking (server/doctor/doctor.py). The one rule: everything that is found is told, also where the configuration
itself is what is wrong; an error among it is exit code 1.
"""

import json
from collections.abc import Iterator
from typing import Annotated, Any, cast

import typer

from server.cli.common import CliError, ConfigFile, ExitCode, Json, safe, say, say_json
from server.cli.daemon import surroundings
from server.cli.settings import DEFAULT_CONFIG
from server.config.file import ConfigError, load
from server.config.model import PROTOCOLS, Config
from server.doctor.ask import ProtocolName
from server.doctor.doctor import Doctor, config_faults
from server.doctor.findings import Finding, Level

MARKS = {Level.OK: "ok     ", Level.INFO: "note   ", Level.WARNING: "warning", Level.ERROR: "ERROR  "}

Port = Annotated[
    str | None, typer.Option("--port", help="Look at this port alone, e.g. /dev/ttyUSB0, and find out what is there.")
]
Baud = Annotated[int, typer.Option("--baud", min=300, help="With --port: bit/s.")]
Protocol = Annotated[
    str | None, typer.Option("--protocol", help="With --port: ask in this protocol alone, elvinto, grbl or ncframe.")
]
AllowReset = Annotated[
    bool, typer.Option("--allow-reset", help="Open serial ports and ask, though that restarts an Arduino (DTR).")
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(doctor)


def doctor(
    ctx: typer.Context,
    config: ConfigFile = None,
    port: Port = None,
    baud: Baud = 115200,
    protocol: Protocol = None,
    allow_reset: AllowReset = False,
    as_json: Json = False,
) -> None:
    """Look for what is not in order; exit code 1 when something is an error. Nothing is sent that moves a machine."""
    if protocol is not None and protocol not in PROTOCOLS:
        raise CliError(ExitCode.USAGE, f"--protocol {safe(protocol)}: choose one of {', '.join(PROTOCOLS)}.")
    if protocol is not None and port is None:
        raise CliError(ExitCode.USAGE, "--protocol goes with --port; the machines of the configuration have theirs.")
    looking = Doctor(allow_reset=allow_reset)
    findings: list[Finding] = []
    asked = cast(ProtocolName | None, protocol)
    for finding in looking.examine_port(port, baud, asked) if port is not None else _configured(ctx, config, looking):
        findings.append(finding)
        if not as_json:
            _print(finding)
    wrong = sum(finding.level is Level.ERROR for finding in findings)
    doubtful = sum(finding.level is Level.WARNING for finding in findings)
    if as_json:
        say_json({"ok": not wrong, "findings": [finding.view() for finding in findings]})
    else:
        say(f"{_counted(wrong, 'error')}, {_counted(doubtful, 'warning')}")
    if wrong:
        raise typer.Exit(ExitCode.FAILED)


def _configured(ctx: typer.Context, path: Any, looking: Doctor) -> Iterator[Finding]:
    if path is None and DEFAULT_CONFIG.exists():
        path = DEFAULT_CONFIG
    if path is not None and not path.is_file():
        raise CliError(ExitCode.USAGE, f"{safe(path)}: there is no such file.")
    try:
        config = load(path, surroundings(ctx).environ)
    except ConfigError as error:
        yield from config_faults(error)
        config = Config()
    yield from looking.examine(config)


def _print(finding: Finding) -> None:
    machine = "" if finding.machine is None else f"{finding.machine}: "
    say(f"{MARKS[finding.level]} {finding.check}: {machine}{safe(finding.message)}")
    if finding.advice and finding.level is not Level.OK:
        say(f"        {safe(finding.advice)}")
    if "sent" in finding.data:
        say(f"        sent: {safe(' '.join(json.dumps(each) for each in finding.data['sent']))}")
    for line in finding.data.get("config", "").splitlines():
        say(f"        | {safe(line)}")


def _counted(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"
