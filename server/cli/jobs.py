"""Commands for jobs: hand a program in, queue it, follow it, list what there is.

The one rule: the exit code of a watched job is the job's: 0 only when it was completed.
"""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from server.cli.common import (
    DEFAULT_URL,
    BrokenOffError,
    CliError,
    ExitCode,
    Json,
    Machine,
    ProgramFile,
    Url,
    safe,
    say,
    say_json,
    terminal,
    warn,
)
from server.cli.daemon import Daemon
from server.cli.progress import describe, follow


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(submit)
    app.command()(jobs)


def submit(
    ctx: typer.Context,
    file: ProgramFile,
    machine: Machine = None,
    watch: Annotated[bool, typer.Option("--watch", "-w", help="Show progress until the job ends.")] = False,
    hold: Annotated[bool, typer.Option("--hold", help="Queue it, but do not start before it is resumed.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Run in spite of warnings of the check.")] = False,
    note: Annotated[str | None, typer.Option(help="A remark that stays with the job.")] = None,
    start_line: Annotated[int | None, typer.Option(min=1, help="Begin at this line.")] = None,
    end_line: Annotated[int | None, typer.Option(min=1, help="End after this line.")] = None,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """Upload a program and queue a job; it starts when the machine is free."""
    with Daemon.of(ctx, url) as daemon:
        wanted = daemon.only_machine(machine)
        program = upload(daemon, file)
        body = {
            "program": program["id"],
            "machine": wanted,
            "hold": hold,
            "force": force,
            "note": note,
            "start_line": start_line,
            "end_line": end_line,
        }
        job = daemon.post_once(
            "/jobs",
            {key: value for key, value in body.items() if value is not None},
            waiting="The daemon still checks the program; waiting.",
        )
        for one in job.get("warnings", ()):
            warn(safe(one["message"]))
        if not watch:
            _tell(job, file, as_json)
            return
        try:
            job = follow(lambda: daemon.get(f"/jobs/{job['id']}"), file.name)
        except KeyboardInterrupt as pressed:
            advice = f"Job {job['id']} goes on; `millstream stop --machine {wanted}` stops it."
            raise BrokenOffError(advice) from pressed
    _tell(job, file, as_json)
    if job["status"] != "completed":
        raise typer.Exit(ExitCode.FAILED)


def upload(daemon: Daemon, file: Path) -> Any:
    """Hand in a program; the daemon's account of it. Raises CliError."""
    try:
        return daemon.upload(file, file.name)
    except OSError as error:
        raise CliError(ExitCode.USAGE, f"{safe(file)}: cannot be read: {error.strerror}") from error


def _tell(job: Any, file: Path, as_json: bool) -> None:
    if as_json:
        say_json(job)
    else:
        say(f"job {job['id']} ({safe(file.name)} on {safe(job['machine'])}): {describe(job)}")


def jobs(
    ctx: typer.Context,
    machine: Machine = None,
    status: Annotated[str | None, typer.Option(help="Only jobs of this status, e.g. queued.")] = None,
    limit: Annotated[int, typer.Option(min=1, max=1000, help="How many.")] = 20,
    url: Url = DEFAULT_URL,
    as_json: Json = False,
) -> None:
    """List jobs, the newest first."""
    with Daemon.of(ctx, url) as daemon:
        found = daemon.get("/jobs", machine=machine, status=status, limit=limit)
    if as_json:
        say_json(found)
        return
    table = Table("job", "machine", "program", "lines done", "status", box=None)
    for job in found:
        progress = job["progress"]
        done = f"{progress['line']}/{progress['lines']}"
        table.add_row(*map(safe, (job["id"], job["machine"], program_name(job), done)), describe(job))
    terminal().print(table)


def program_name(job: Any) -> str:
    """What people call a job's program."""
    program = job["program"]
    name = program.get("name") if isinstance(program, dict) else job.get("program_name")
    return str(name or program)
