"""`millstream recover`: what an interrupted job would go on with, block by block, and going on.

Not the plan itself (server/job/recovery.py). The one rule: without --run or --continue nothing is asked that could move
a machine; whoever runs a plan has had to say so.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer
from rich.table import Table

from server.cli.common import DEFAULT_URL, CliError, ExitCode, Json, Url, safe, say, say_json, terminal
from server.cli.daemon import Daemon
from server.cli.progress import describe

NEEDS = {
    "clearance": "--clearance (or [machine.reentry] in the configuration)",
    "operator_done": "--operator-done, when what people have to do is done",
    "force": "--force, for the machine is not homed; or home it",
}
"""What a plan still needs, as options of this command."""

Job = Annotated[int, typer.Argument(min=1, help="The job's number.", metavar="JOB")]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(recover)


def recover(
    ctx: typer.Context,
    job: Job,
    line: Annotated[int | None, typer.Option(min=1, help="Go on from this line.")] = None,
    run: Annotated[bool, typer.Option("--run", help="Run the plan: the machine begins to move.")] = False,
    go_on: Annotated[
        bool, typer.Option("--continue", help="Go on behind the certain lines, where that is proven to be possible.")
    ] = False,
    clearance: Annotated[float | None, typer.Option(help="Height in mm at which nothing is in the way.")] = None,
    clearance_is_machine: Annotated[
        bool, typer.Option("--clearance-is-machine", help="--clearance is in coordinates of the machine.")
    ] = False,
    plunge_feed: Annotated[float | None, typer.Option(help="Down to the work, mm/min.")] = None,
    spindle_wait: Annotated[float | None, typer.Option(help="For the spindle to come to speed, s.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Although the machine is not homed.")] = False,
    operator_done: Annotated[
        bool, typer.Option("--operator-done", help="What only people can do (the tool) is done.")
    ] = False,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Show how an interrupted job would be taken up; with --run or --continue do it."""
    way = {
        "line": line,
        "clearance": clearance,
        "clearance_is_machine": clearance_is_machine or None,
        "plunge_feed": plunge_feed,
        "spindle_wait": spindle_wait,
    }
    said = {key: value for key, value in way.items() if value is not None}
    words = {"force": force, "operator_done": operator_done}
    spoken = {key: True for key, on in words.items() if on}
    _check(said, spoken, run=run, go_on=go_on)
    body: dict[str, Any] | None = said or None
    if go_on:
        body = {"action": "continue"}
    elif run:
        body = {"action": "from_line", **said, **spoken}
    with Daemon.of(ctx, url) as daemon:
        answer = daemon.post(f"/jobs/{job}/recover", body)
    if as_json:
        say_json(answer)
    elif run or go_on:
        say(f"job {answer['id']}: {describe(answer)}")
    else:
        _show(answer)


def _check(said: Mapping[str, Any], spoken: Mapping[str, Any], *, run: bool, go_on: bool) -> None:
    """Raises CliError for options that contradict each other."""
    if run and go_on:
        raise CliError(ExitCode.USAGE, "Say --run or --continue, not both.")
    if go_on and (said or spoken):
        raise CliError(ExitCode.USAGE, "--continue takes nothing else: it goes on behind the certain lines.")
    if spoken and not run:
        raise CliError(ExitCode.USAGE, "--force and --operator-done belong to --run.")
    if "clearance_is_machine" in said and "clearance" not in said:
        raise CliError(ExitCode.USAGE, "--clearance-is-machine says what --clearance means: say both.")


def _show(plan: Mapping[str, Any]) -> None:
    for text in _head(plan):
        say(safe(text))
    steps = plan["steps"] or [{"text": block, "purpose": "", "note": ""} for block in plan["blocks"]]
    if steps:
        table = Table("block", "what for", "remark", box=None)
        for step in steps:
            table.add_row(*map(safe, (step["text"] or "(by hand)", step["purpose"], step["note"])))
        terminal().print(table)
    for text in _tail(plan):
        say(safe(text))


def _head(plan: Mapping[str, Any]) -> Iterator[str]:
    yield f"job {plan['job']}: lines up to {plan['certain_line']} are certain"
    if plan["line_from"] is not None:
        yield f"in doubt: lines {plan['line_from']} to {plan['line_to']}"
    if plan["reason"] is not None:
        yield f"why it stopped: {plan['reason']['message']}"
    yield "--continue: possible" if plan["can_continue"] else f"--continue: not possible. {plan['why_not']}"
    if plan["line_why_not"] is None:
        yield f"--run goes on from line {plan['next_line']}:"
    else:
        yield f"--run from line {plan['next_line']}: not possible. {plan['line_why_not']}"


def _tail(plan: Mapping[str, Any]) -> Iterator[str]:
    for warning in plan["warnings"]:
        yield f"warning: {warning}"
    for need in plan["needs"]:
        yield f"needs {NEEDS.get(need, need)}"
