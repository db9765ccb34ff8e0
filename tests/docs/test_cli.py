"""docs/cli.md against the command line: every command, every option, every exit code."""

import re

import typer

from server.cli import build
from server.cli.common import ExitCode
from tests.harness.docs import page, rows

SAID_ONCE = {"--json", "--url", "--machine", "--config", "--profile", "--help"}
"""Options that the text says once for all commands."""


def commands(app: typer.Typer) -> dict[str, set[str]]:
    """Each command with its long options."""
    found: dict[str, set[str]] = {}

    def walk(command: object, path: str) -> None:
        inner = getattr(command, "commands", None)
        if inner is not None:
            for name, one in inner.items():
                walk(one, f"{path} {name}".strip())
            return
        options = {
            max((*parameter.opts, *parameter.secondary_opts), key=len)
            for parameter in command.params  # type: ignore[attr-defined]
            if parameter.opts[0].startswith("-")
        }
        found[path] = options

    walk(typer.main.get_command(app), "")
    return found


def documented() -> dict[str, str]:
    text = page("cli.md")
    table = rows(text, "command", "what")
    return {re.sub(r" [A-Z]+$", "", row[0].removeprefix("millstream ")): " ".join(row[1:]) for row in table}


def test_every_command_and_no_other() -> None:
    assert set(documented()) == set(commands(build()))


def test_every_option_and_no_other() -> None:
    text = documented()
    missing = {
        command: missed
        for command, options in commands(build()).items()
        if (missed := {one for one in options - SAID_ONCE if one not in text[command]})
    }
    assert missing == {}
    known = set().union(*commands(build()).values())
    known |= {one.replace("--no-", "--", 1) for one in known}  # the other half of a switch
    assert set(re.findall(r"--[a-z][a-z-]+", page("cli.md"))) <= known | {"--help"}


def test_every_exit_code() -> None:
    assert [int(row[0]) for row in rows(page("cli.md"), "exit code", "meaning")] == [code.value for code in ExitCode]
