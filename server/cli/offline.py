"""`millstream check` and `millstream translate`: a program looked at without a machine and without a daemon.

The one rule: they read the same profile and plan the same batches as the daemon does; nothing is decided here.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from gcode.check import check_program
from gcode.findings import Finding, Report
from gcode.lines import split_lines
from gcode.motion import Motion
from gcode.profile import Profile, ProfileError, load_profile
from jobs.batch import BatchPlanner, PlanError
from server.cli.common import CliError, ExitCode, Json, ProgramFile, safe, say, say_json, warn
from server.config import ElvintoConfig, MotionFile
from server.configfile import ConfigError, load_section

CHUNK_BYTES = 64 * 1024

ProfileName = Annotated[str, typer.Option("--profile", "-p", help="The controller, e.g. elvinto.")]
MotionPath = Annotated[Path | None, typer.Option("--motion", help="TOML with a table [motion], as [machine.motion].")]
BlockDelete = Annotated[bool, typer.Option("--block-delete", help="Leave out blocks that begin with '/'.")]
ConvertInches = Annotated[bool, typer.Option("--convert-inches", help="Convert G20 programs to mm.")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(check)
    app.command()(translate)


def check(
    file: ProgramFile,
    profile: ProfileName,
    motion: MotionPath = None,
    block_delete: BlockDelete = False,
    convert_inches: ConvertInches = False,
    as_json: Json = False,
) -> None:
    """Check a program for a controller; exit code 1 when it has errors."""
    report = _report(file, _profile(profile), _motion(motion), block_delete=block_delete, convert_inches=convert_inches)
    if as_json:
        say_json(report.to_json())
    else:
        for level, findings in (("error", report.errors), ("warning", report.warnings), ("info", report.infos)):
            for finding in findings:
                say(_sentence(file, level, finding))
        say(_summary(report))
    if not report.ok:
        raise typer.Exit(ExitCode.FAILED)


def translate(
    file: ProgramFile,
    profile: ProfileName,
    motion: MotionPath = None,
    block_delete: BlockDelete = False,
    convert_inches: ConvertInches = False,
    compact: Annotated[bool, typer.Option(help="Leave out words that change nothing.")] = True,
    as_json: Json = False,
) -> None:
    """Print what would go out on the wire, a block a line (with --json a batch a line)."""
    controller, axes = _profile(profile), _motion(motion)
    report = _report(file, controller, axes, block_delete=block_delete, convert_inches=convert_inches)
    if not report.ok:
        for finding in report.errors:
            warn(_sentence(file, "error", finding))
        detail = f"{safe(file)}: nothing would go out, the program does not pass the check."
        raise CliError(
            ExitCode.FAILED, detail, {"code": "preflight_failed", "detail": detail, "report": report.to_json()}
        )
    planner = BatchPlanner(
        enumerate(_lines(file), 1),
        controller,
        axes,
        ElvintoConfig().limits(),
        compact=compact,
        block_delete=block_delete,
        convert_inches=convert_inches,
    )
    try:
        _print_batches(planner, as_json)
    except PlanError as error:
        raise CliError(ExitCode.FAILED, f"{safe(file)}: {safe(error)}") from error


def _print_batches(planner: BatchPlanner, as_json: bool) -> None:
    while (batch := planner.next()) is not None:
        if as_json:
            say_json(
                {
                    "line_from": batch.first_line,
                    "line_to": batch.last_line,
                    "blocks": batch.blocks,
                    "seconds": batch.seconds,
                    "barrier": batch.barrier,
                }
            )
        else:
            say("\n".join(map(safe, batch.blocks)))


def _profile(name: str) -> Profile:
    try:
        return load_profile(name)
    except ProfileError as error:
        raise CliError(ExitCode.USAGE, safe(error)) from error


def _motion(path: Path | None) -> Motion:
    try:
        return Motion() if path is None else load_section(MotionFile, path).motion.motion()
    except ConfigError as error:
        raise CliError(ExitCode.USAGE, safe_lines(str(error))) from error


def safe_lines(text: str) -> str:
    """Several lines, each safe to show."""
    return "\n".join(map(safe, text.splitlines()))


def _report(file: Path, profile: Profile, motion: Motion, *, block_delete: bool, convert_inches: bool) -> Report:
    lines = _lines(file)
    return check_program(lines, profile, motion, block_delete=block_delete, convert_inches=convert_inches)


def _lines(file: Path) -> Iterator[bytes]:
    def chunks() -> Iterator[bytes]:
        try:
            with file.open("rb") as opened:
                while chunk := opened.read(CHUNK_BYTES):
                    yield chunk
        except OSError as error:
            raise CliError(ExitCode.USAGE, f"{safe(file)}: cannot be read: {error.strerror}") from error

    return split_lines(chunks())


def _sentence(file: Path, level: str, finding: Finding) -> str:
    """As compilers have it, so that editors can jump there."""
    more = f" ({finding.count} times)" if finding.count > 1 else ""
    return safe(f"{file}:{finding.line}:{finding.column}: {level}: {finding.message} [{finding.code}]{more}")


def _summary(report: Report) -> str:
    bounds = "  ".join(f"{axis.upper()} {low:.3f} to {high:.3f}" for axis, (low, high) in report.bounds.items())
    minutes, seconds = divmod(round(report.seconds), 60)
    counts = ", ".join(
        f"{sum(one.count for one in found)} {word}"
        for word, found in (("errors", report.errors), ("warnings", report.warnings))
    )
    parts = [
        f"{report.lines} lines, {report.blocks} blocks, about {minutes}:{seconds:02d} min",
        f"cut {report.cut_mm:.1f} mm, rapid {report.rapid_mm:.1f} mm",
        f"bounds mm: {bounds or 'nothing moves'}",
        f"tools: {', '.join(map(str, report.tools)) or 'none named'}",
        counts,
    ]
    return "\n".join(parts)
