"""What a program for NC frames makes the axes do, for drawings and estimates: where the tool goes and how fast.

Not the frames; nobody sends what comes of this. Along the contour the reader of every program does it; what "offset"
adds only the translation knows. The one rule: the motion is that of the frames but for the rounding to counts.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from gcode.check.source import gather_numbered
from gcode.columns import Columns, read_columns
from gcode.interpret import Reading
from gcode.interpreter import power_on
from gcode.motion import Motion
from gcode.ncframe.frame import Frame
from gcode.ncframe.rates import feeds_of_bytes
from gcode.ncframe.rules import FrameRules, profile_for
from gcode.ncframe.source import blocks_of_lines
from gcode.ncframe.translate import Translator
from gcode.profile import Profile
from gcode.rows import Rows
from gcode.segments import Segments
from gcode.state import State
from gcode.timeline import Timeline, TimelineMaker
from gcode.words import decode_line, parse_block

NumberedLines = Iterable[tuple[int, bytes]]

FRAMES_AT_ONCE = 4096


def motion_of_frames(
    lines: NumberedLines, profile: Profile, rules: FrameRules, *, to_its_end: bool = False
) -> Iterator[Segments]:
    """From a machine that has just been switched on and stands at 0. `to_its_end`: nothing behind M2 and M30. Raises
    only what `lines` raises."""
    profile = profile_for(profile, rules)
    blocks = blocks_of_lines(lines, rules.semicolon)
    if rules.compensation == "offset":
        return _by_frames(blocks, profile, rules, to_its_end=to_its_end)
    return _by_rows(blocks, profile, rules, to_its_end=to_its_end)


def measure_frames(
    lines: NumberedLines, profile: Profile, motion: Motion, rules: FrameRules, count: int, *, turn_s: float = 0.0
) -> Timeline:
    """The timeline of a program of `count` lines. `turn_s`: what each frame and its answers take on the link, during
    which the machine stands still. Raises only what `lines` raises."""
    maker = TimelineMaker(motion, "".join(profile.axes).upper(), count)
    for segments in motion_of_frames(lines, profile, rules, to_its_end=True):
        segments.feed = feeds_of_bytes(segments.feed, rules)
        maker.add(segments)
        maker.add_rests(segments.line, np.full(len(segments), turn_s))
    return maker.finish()


def _at_zero(profile: Profile) -> State:
    state = power_on(profile)
    state.position = [0.0] * len(state.axes)
    return state


def _by_rows(blocks: NumberedLines, profile: Profile, rules: FrameRules, *, to_its_end: bool) -> Iterator[Segments]:
    reading = Reading(profile, _at_zero(profile), skip_deleted=rules.block_delete)
    row = 1
    for piece in gather_numbered(blocks):
        columns = read_columns(piece.text, row, rules.encoding)
        row += columns.lines
        last = _end(columns, profile) if to_its_end else None
        yield reading.read(columns, end=None if last is None else last + 1, line=piece.numbers)
        reading.notes.clear()
        if last is not None:
            break
    yield reading.finish()


def _end(columns: Columns, profile: Profile) -> int | None:
    """The row of the block that ends the program."""
    names = [name for name, code in profile.codes.items() if code.effect == "program_end"]
    found = [columns.row[(columns.letter == ord(name[0])) & (columns.value == float(name[1:]))][:1] for name in names]
    return min((int(rows[0]) for rows in found if len(rows)), default=None)


def _by_frames(blocks: NumberedLines, profile: Profile, rules: FrameRules, *, to_its_end: bool) -> Iterator[Segments]:
    translator = Translator(profile, rules, dict.fromkeys(profile.axes, 0.0))
    rows = Rows(translator.state.axes)
    for number, raw in blocks:
        _gather(translator, translator.step(number, parse_block(decode_line(raw, rules.encoding))), rows)
        translator.errors.clear()
        if len(rows) >= FRAMES_AT_ONCE:
            yield rows.take()
        if to_its_end and translator.state.ended:
            break
    _gather(translator, translator.finish(), rows)
    yield rows.take()


def _gather(translator: Translator, frames: list[Frame], rows: Rows) -> None:
    """Each motion once, of however many frames it is."""
    frames_known = translator.interpreter.rows.frames
    before = None
    for row in [frame.row for frame in frames]:
        if row is not None and row is not before:
            rows.add(row._replace(line=int(row.line), frame=rows.frame_of(frames_known[row.frame])))
        before = row
