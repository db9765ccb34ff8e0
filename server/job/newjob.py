"""What keeps a job from being queued: the check of its program, lines that it does not have, a key used twice.

Not the check (gcode/check/) and not the queue (job/service.py). The one rule: errors of a program are never forced;
everything else that is refused here says what would make it go.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jobs import holds
from jobs.holds import Hold
from jobs.store import Row
from server.machine.controller import Controller
from server.problems import ProblemError
from server.programs.service import ProgramService


@dataclass(frozen=True, slots=True)
class Checked:
    """A program that may be queued: the plain one, the one that it was made of, what the check has found, and the lines
    that a check by the controller would store."""

    program: Mapping[str, Any]
    source: str | None
    report: Mapping[str, Any]
    stored: list[int]


async def checked(programs: ProgramService, program_id: str, machine: str, mode: str, *, force: bool) -> Checked:
    """The whole program is read, which takes seconds for each million lines. Raises ProblemError."""
    program = await programs.get(program_id)
    report = await programs.check(program_id, machine=machine)
    stored = refused_or_stored(report, mode, force=force)
    if report["expanded_lines"] is None:
        return Checked(program, program["source_program"], report, stored)
    return Checked(await programs.expanded(program), program_id, report, stored)


def of_program(checked: Checked) -> Row:
    """What a job's row has of its program."""
    program = checked.program
    return {
        "program": program["id"],
        "program_name": program["name"],
        "lines": program["lines"],
        "total_seconds": checked.report["seconds"],
    }


def same_request(row: Row, request_hash: str) -> Row:
    """The row, where it was made by this request. Raises ProblemError where by another."""
    if row["request_hash"] != request_hash:
        raise ProblemError(
            "idempotency_conflict", f"This Idempotency-Key was used for job {row['id']}, which is another."
        )
    return row


def refuse_errors(report: Mapping[str, Any]) -> None:
    """Raises ProblemError where the check has found errors."""
    errors = report["errors"]
    if any(error["code"] == "no_blocks" for error in errors):
        raise ProblemError("empty_program", "The program has no blocks to execute.")
    if errors:
        worst = errors[0]
        detail = f"Line {worst['line']}: {worst['message']}. Mend the program; errors cannot be forced."
        raise ProblemError("preflight_failed", detail, report=report)


def refuse_warnings(report: Mapping[str, Any]) -> None:
    """Raises ProblemError where the check has found warnings, which can be forced."""
    if report["warnings"]:
        worst = report["warnings"][0]
        detail = f'Line {worst["line"]}: {worst["message"]}. Look at the report; "force": true runs it all the same.'
        raise ProblemError("preflight_warnings", detail, report=report)


def stored_lines(report: Mapping[str, Any], mode: str) -> list[int]:
    """The lines of a check that Grbl carries out all the same: those that write its memory (grbl II.4)."""
    if mode != "check":
        return []
    return sorted({info["line"] for info in report["infos"] if info["code"] == "stored"})


def refuse_stored(lines: list[int]) -> None:
    """Raises ProblemError where the controller's own check would change what the controller keeps."""
    if lines:
        raise ProblemError(
            "needs_force",
            f"The controller carries out G10, G28.1 and G30.1 in its check mode too (line {lines[0]}): its memory "
            'would be changed, with places of a motion that never was. "force": true checks it all the same.',
            lines=lines,
        )


def refused_or_stored(report: Mapping[str, Any], mode: str, *, force: bool) -> list[int]:
    """Raises ProblemError for what the check has found; else the lines that a check run would store."""
    refuse_errors(report)
    stored = stored_lines(report, mode)
    if not force:
        refuse_stored(stored)
        refuse_warnings(report)
    return stored


def refuse_lines_of_source(expanded: Mapping[str, Any], start_line: int | None, end_line: int | None) -> None:
    """A line within a loop or a subprogram is executed more than once, or never: it is no place to begin at."""
    if start_line is not None or end_line is not None:
        raise ProblemError(
            "invalid_request",
            f"This program is run as {expanded['name']}, program {expanded['id']}, which has {expanded['lines']} lines "
            "with the number of the line they came from. Queue that one with start_line and end_line.",
            expanded_program=expanded["id"],
        )


def held(controller: Controller, *, asked: bool) -> dict[str, Any]:
    """Whether the new job waits on hold, and why: somebody wants it so, or it can neither start now nor follow another
    one."""
    why = holds.ASKED if asked else None
    if why is None and not controller.stream.moving:
        try:
            controller.check_can_start()
        except ProblemError as problem:
            why = Hold(problem.code, problem.detail)
    if why is None:
        return {"hold": False, "hold_code": None, "hold_message": None}
    return {"hold": True, "hold_code": why.code, "hold_message": why.message}


def lines_of(checked: Checked, start_line: int | None, end_line: int | None) -> tuple[int, int]:
    """The first and the last line of a job. Raises ProblemError where the program does not have them."""
    program = checked.program
    if checked.report["expanded_lines"] is not None:
        refuse_lines_of_source(program, start_line, end_line)
    first, last = start_line or 1, end_line or program["lines"]
    if not 1 <= first <= last <= program["lines"]:
        raise ProblemError(
            "invalid_request", f"Lines {first} to {last} are not in {program['name']}, which has {program['lines']}."
        )
    return first, last
