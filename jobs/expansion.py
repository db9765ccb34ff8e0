"""Stored programs with O-words, parameters, expressions or macros: whether they are such, and the plain program made
of one. Not the expansion itself (gcode/expand) and not who remembers what was made of what (store.py).

The one rule: a program that was made here is complete and durable like an upload, or there is nothing of it.
"""

from collections.abc import Iterator
from dataclasses import replace

from gcode.check import CheckOptions, check_source
from gcode.check.source import gather_numbered
from gcode.columns import read_columns
from gcode.expand.checked import check_expanded
from gcode.expand.derived import write_expanded
from gcode.expand.detection import needs_expansion
from gcode.expand.errors import ExpandError, Limits
from gcode.expand.expander import Expander
from gcode.findings import Report
from gcode.interpret import Reading, segments_of
from gcode.lines import pieces
from gcode.motion import Motion
from gcode.ncframe.check import check_expandable, check_frames, check_frames_source
from gcode.ncframe.motion import motion_of_frames
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.profile import Profile
from gcode.segments import Segments
from gcode.state import State
from jobs.program import PIECE_BYTES, ProgramInfo, ProgramStore

EXPANDED_NAME = "{} (expanded)"
WRITE_BYTES = 65_536
"""Lines are gathered up to so many bytes."""


class TooLargeError(ValueError):
    """The plain program has more bytes than a program may have."""


def has_to_be_expanded(programs: ProgramStore, program_id: str) -> bool:
    """Whether a stored program is not plain. Raises UnknownProgramError, OSError."""
    return needs_expansion(pieces(programs.chunks(program_id), PIECE_BYTES))


def check_stored(
    programs: ProgramStore,
    program_id: str,
    profile: Profile,
    motion: Motion,
    options: CheckOptions,
    limits: Limits | None = None,
) -> Report:
    """The check of a stored program, expanded where it has to be. Raises UnknownProgramError, OSError."""
    if not has_to_be_expanded(programs, program_id):
        return check_source(programs.chunks(program_id), profile, motion, **({"piece_bytes": PIECE_BYTES} | options))
    chunks = programs.chunks(program_id)
    return check_expanded(programs.access(program_id), chunks, profile, motion, limits=limits, **options)


def check_stored_frames(
    programs: ProgramStore,
    program_id: str,
    profile: Profile,
    motion: Motion,
    rules: FrameRules,
    options: CheckOptions,
) -> Report:
    """The same for a machine behind NC frames: the whole program is translated. Raises UnknownProgramError, OSError."""
    if not has_to_be_expanded(programs, program_id):
        return check_frames_source(programs.chunks(program_id), profile, motion, rules, **options)
    report = check_stored(programs, program_id, profile_for(profile, rules), motion, options)
    lost = check_expandable(programs.lines(program_id), rules)
    if lost or not report.ok:
        return replace(report, errors=(*report.errors, *lost))
    expanded = Expander(block_delete=rules.block_delete).expand(programs.access(program_id))
    lines = ((each.line, each.text.encode("utf-8", "replace")) for each in expanded)
    return replace(report, errors=check_frames(lines, profile, motion, rules, **options).errors)


def motion_of(
    programs: ProgramStore,
    program_id: str,
    profile: Profile,
    limits: Limits | None = None,
    *,
    state: State | None = None,
    frames: FrameRules | None = None,
) -> Iterator[Segments]:
    """What the program makes the axes do, expanded where it has to be; `line` of the segments are lines of the program.
    `state` is that of the machine before; where `frames` are sent, it stands at 0.

    Raises ExpandError, UnknownProgramError, OSError, each at any time.
    """
    plain = not has_to_be_expanded(programs, program_id)
    if frames is not None:
        yield from motion_of_frames(_lines(programs, program_id, limits, plain=plain), profile, frames)
        return
    if plain:
        yield from segments_of(pieces(programs.chunks(program_id), PIECE_BYTES), profile, state)
        return
    reading = Reading(profile, state)
    first_line = 1
    for piece in gather_numbered(_lines(programs, program_id, limits, plain=False)):
        columns = read_columns(piece.text, first_line)
        first_line += columns.lines
        yield reading.read(columns, line=piece.numbers)
    yield reading.finish()


def _lines(
    programs: ProgramStore, program_id: str, limits: Limits | None, *, plain: bool
) -> Iterator[tuple[int, bytes]]:
    if plain:
        yield from programs.lines(program_id)
        return
    for each in Expander(limits=limits).expand(programs.access(program_id)):
        yield each.line, each.text.encode("utf-8", "replace")


def store_expanded(
    programs: ProgramStore,
    program_id: str,
    name: str,
    *,
    max_bytes: int | None = None,
    limits: Limits | None = None,
    block_delete: bool = False,
) -> ProgramInfo:
    """Make the plain program of one called `name` and store it, each line with the number of the one it came from.

    Raises ExpandError, TooLargeError, UnknownProgramError and OSError; nothing is left behind then.
    """
    expander = Expander(limits=limits, block_delete=block_delete)
    with programs.writer(EXPANDED_NAME.format(name)) as writer:
        gathered: list[bytes] = []
        size = 0
        for line in write_expanded(expander.expand(programs.access(program_id))):
            gathered.append(line)
            size += len(line)
            if size >= WRITE_BYTES:
                writer.write(b"".join(gathered))
                gathered, size = [], 0
                if max_bytes is not None and writer.bytes_written > max_bytes:
                    raise TooLargeError(f"the plain program has more than {max_bytes} bytes")
        writer.write(b"".join(gathered))
        return writer.finish()


__all__ = [
    "ExpandError",
    "TooLargeError",
    "check_stored",
    "check_stored_frames",
    "has_to_be_expanded",
    "motion_of",
    "store_expanded",
]
