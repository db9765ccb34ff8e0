"""`millstream check` and `millstream translate`: a program looked at without a machine and without a daemon.

The one rule: they read the same profile and plan the same batches as the daemon does; nothing is decided here.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from gcode.check import CheckOptions, check_source
from gcode.expand.derived import source_line
from gcode.expand.detection import needs_expansion
from gcode.findings import Finding, Report
from gcode.lines import pieces, split_lines
from gcode.motion import Motion
from gcode.ncframe.check import check_expandable, check_frames, check_frames_source
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.profile import Profile, ProfileError, load_profile
from jobs.batch import BatchPlanner
from jobs.expansion import check_stored, store_expanded
from jobs.linecount import NotAProgramError
from jobs.program import ProgramInfo, ProgramStore
from jobs.upcoming import PlanError
from protocol.iocontrol import tooltable
from server.cli.common import CliError, ExitCode, Json, ProgramFile, safe, say, say_json, warn
from server.cli.frames import (
    Compensation,
    Diameter,
    FeedUnit,
    FrameOptions,
    Hex,
    Resolution,
    Semicolon,
    SpeedUnit,
    ToolRadius,
    print_frames,
)
from server.config.elvinto import ElvintoConfig
from server.config.file import ConfigError, load_section
from server.config.model import MotionFile

CHUNK_BYTES = 64 * 1024

ProfileName = Annotated[
    str, typer.Option("--profile", "-p", help="The controller, e.g. elvinto; or your own .toml file.")
]
MotionPath = Annotated[Path | None, typer.Option("--motion", help="TOML with a table [motion], as [machine.motion].")]
BlockDelete = Annotated[bool, typer.Option("--block-delete", help="Leave out blocks that begin with '/'.")]
ConvertInches = Annotated[bool, typer.Option("--convert-inches", help="Convert G20 programs to mm.")]
Baud = Annotated[int | None, typer.Option("--baud", min=300, help="Say where a link of so many bit/s is too slow.")]
ToolsPath = Annotated[
    Path | None, typer.Option("--tools", help="A tool table in LinuxCNC's format: say which T is not in it.")
]
Override = Annotated[int, typer.Option(min=10, max=200, help="Percent; the time with it is told beside the other.")]

PERCENT = 100


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
    baud: Baud = None,
    feed_override: Override = PERCENT,
    rapid_override: Override = PERCENT,
    tools: ToolsPath = None,
    resolution: Resolution = None,
    tool_radius: ToolRadius = None,
    compensation: Compensation = None,
    diameter: Diameter = False,
    feed_unit: FeedUnit = None,
    speed_unit: SpeedUnit = None,
    semicolon: Semicolon = None,
    as_json: Json = False,
) -> None:
    """Check a program for a controller; exit code 1 when it has errors."""
    options = CheckOptions(
        block_delete=block_delete,
        convert_inches=convert_inches,
        baud=baud,
        feed_override=feed_override / PERCENT,
        rapid_override=rapid_override / PERCENT,
        tools=None if tools is None else _tools(tools),
    )
    controller, axes = _profile(profile), _motion(motion)
    told = FrameOptions(resolution, tool_radius, compensation, diameter, feed_unit, speed_unit, semicolon)
    rules = told.rules(controller, block_delete=block_delete)
    with _opened(file) as program:
        if rules is None:
            report = program.check(controller, axes, options)
        else:
            report = program.check_frames(controller, axes, rules, options)
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
    as_hex: Hex = False,
    resolution: Resolution = None,
    tool_radius: ToolRadius = None,
    compensation: Compensation = None,
    diameter: Diameter = False,
    feed_unit: FeedUnit = None,
    speed_unit: SpeedUnit = None,
    semicolon: Semicolon = None,
    as_json: Json = False,
) -> None:
    """Print what would go out on the wire, a block or a frame a line (with --json a batch or a frame a line)."""
    controller, axes = _profile(profile), _motion(motion)
    options = CheckOptions(block_delete=block_delete, convert_inches=convert_inches)
    told = FrameOptions(resolution, tool_radius, compensation, diameter, feed_unit, speed_unit, semicolon, as_hex)
    rules = told.rules(controller, block_delete=block_delete)
    with _opened(file) as program:
        if rules is not None:
            _pass(file, program.check_frames(controller, axes, rules, options))
            lines = program.frame_lines(block_delete=block_delete)
            print_frames(lines, controller, axes, rules, as_hex=as_hex, as_json=as_json)
            return
        _pass(file, program.check(controller, axes, options))
        planner = BatchPlanner(
            program.plain_lines(block_delete=block_delete),
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


def _pass(file: Path, report: Report) -> None:
    """Ends the command where a job would not start."""
    if report.ok:
        return
    for finding in report.errors:
        warn(_sentence(file, "error", finding))
    detail = f"{safe(file)}: nothing would go out, the program does not pass the check."
    raise CliError(ExitCode.FAILED, detail, {"code": "preflight_failed", "detail": detail, "report": report.to_json()})


@dataclass(frozen=True, slots=True)
class _Plain:
    """A file that is executed as it stands."""

    file: Path

    def check(self, profile: Profile, motion: Motion, options: CheckOptions) -> Report:
        return check_source(_chunks(self.file), profile, motion, **options)

    def check_frames(self, profile: Profile, motion: Motion, rules: FrameRules, options: CheckOptions) -> Report:
        return check_frames_source(_chunks(self.file), profile, motion, rules, **options)

    def plain_lines(self, *, block_delete: bool) -> Iterator[tuple[int, bytes]]:  # noqa: ARG002 - the planner does it
        return enumerate(split_lines(_chunks(self.file)), 1)

    def frame_lines(self, *, block_delete: bool) -> Iterator[tuple[int, bytes]]:
        return self.plain_lines(block_delete=block_delete)


@dataclass(frozen=True, slots=True)
class _Expanded:
    """A file with O-words, parameters or macros, in a store of its own, as the daemon has it."""

    programs: ProgramStore
    info: ProgramInfo

    def check(self, profile: Profile, motion: Motion, options: CheckOptions) -> Report:
        return check_stored(self.programs, self.info.id, profile, motion, options)

    def check_frames(self, profile: Profile, motion: Motion, rules: FrameRules, options: CheckOptions) -> Report:
        report = self.check(profile_for(profile, rules), motion, options)
        lost = check_expandable(self.programs.lines(self.info.id), rules)
        if lost or not report.ok:
            return replace(report, errors=(*report.errors, *lost))
        lines = self.frame_lines(block_delete=rules.block_delete)
        return replace(report, errors=check_frames(lines, profile, motion, rules, **options).errors)

    def plain_lines(self, *, block_delete: bool) -> Iterator[tuple[int, bytes]]:
        made = store_expanded(self.programs, self.info.id, self.info.name, block_delete=block_delete)
        return self.programs.lines(made.id)

    def frame_lines(self, *, block_delete: bool) -> Iterator[tuple[int, bytes]]:
        """The same with the numbers of the lines that they came from."""
        for number, raw in self.plain_lines(block_delete=block_delete):
            yield source_line(raw) or number, raw


@contextmanager
def _opened(file: Path) -> Iterator[_Plain | _Expanded]:
    if not needs_expansion(pieces(_chunks(file))):
        yield _Plain(file)
        return
    with TemporaryDirectory(prefix="millstream-") as folder:
        try:
            programs = ProgramStore(Path(folder))
            with programs.writer(file.name) as writer:
                for chunk in _chunks(file):
                    writer.write(chunk)
                program: _Plain | _Expanded = _Expanded(programs, writer.finish())
        except NotAProgramError:
            program = _Plain(file)  # whatever looked like a parameter in it: the check says what it is
        except OSError as error:
            raise CliError(ExitCode.FAILED, f"{safe(file)}: cannot be expanded: {error.strerror}") from error
        yield program


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
    """A profile that ships with the package by its name, or one of the user's own by the path of its file."""
    path = Path(name)
    try:
        return load_profile(path.stem, path.parent) if path.suffix == ".toml" else load_profile(name)
    except ProfileError as error:
        raise CliError(ExitCode.USAGE, safe(error)) from error


def _motion(path: Path | None) -> Motion:
    try:
        return Motion() if path is None else load_section(MotionFile, path).motion.motion()
    except ConfigError as error:
        raise CliError(ExitCode.USAGE, safe_lines(str(error))) from error


def _tools(path: Path) -> frozenset[int]:
    """The numbers of a tool table; of lines that are left out something is said."""
    table, warnings = tooltable.parse(b"".join(_chunks(path)).decode("utf-8", "replace"))
    for each in warnings:
        warn(safe(f"{path}:{each.line}: {each.message}"))
    return table.numbers


def safe_lines(text: str) -> str:
    """Several lines, each safe to show."""
    return "\n".join(map(safe, text.splitlines()))


def _chunks(file: Path) -> Iterator[bytes]:
    try:
        with file.open("rb") as opened:
            while chunk := opened.read(CHUNK_BYTES):
                yield chunk
    except OSError as error:
        raise CliError(ExitCode.USAGE, f"{safe(file)}: cannot be read: {error.strerror}") from error


def _sentence(file: Path, level: str, finding: Finding) -> str:
    """As compilers have it, so that editors can jump there."""
    more = f" ({finding.count} times)" if finding.count > 1 else ""
    return safe(f"{file}:{finding.line}:{finding.column}: {level}: {finding.message} [{finding.code}]{more}")


def _summary(report: Report) -> str:
    bounds = "  ".join(f"{axis.upper()} {low:.3f} to {high:.3f}" for axis, (low, high) in report.bounds.items())
    counts = ", ".join(
        f"{(count := sum(one.count for one in found))} {word}{'' if count == 1 else 's'}"
        for word, found in (("error", report.errors), ("warning", report.warnings))
    )
    parts = [
        f"{_lines(report)}, {report.blocks} blocks, about {_minutes(report.seconds)} min{_overridden(report)}",
        f"cut {report.cut_mm:.1f} mm, rapid {report.rapid_mm:.1f} mm, plunge {report.plunge_mm:.1f} mm",
        f"bounds mm: {bounds or 'nothing moves'}",
        f"tools: {', '.join(map(str, report.tools)) or 'none named'}",
        f"file: {report.bytes} bytes, {report.encoding}, line ends {report.line_ends}",
        counts,
    ]
    if report.median_mm is not None and report.shortest_mm is not None:
        lengths = f"shortest {report.shortest_mm:.4f} mm, median {report.median_mm:.3f} mm"
        parts.insert(2, f"{report.segments} segments, {report.arcs} arcs, {lengths}")
    return "\n".join(parts)


def _lines(report: Report) -> str:
    expanded = "" if report.expanded_lines is None else f" (expanded: {report.expanded_lines})"
    return f"{report.lines} lines{expanded}"


def _minutes(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


def _overridden(report: Report) -> str:
    told = report.seconds_overridden
    return "" if told is None else f" ({_minutes(told)} min with the overrides)"
