"""From the bytes of a program to its timeline: what is executed, how long each line takes, what goes over the link.

Not the model of time (planner.py) and not the table (timeline.py). The one rule: one pass in constant memory, and what
stands behind the end of the program (M2, M30) takes no time, for it is never sent.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gcode.blocks import Blocks
from gcode.check.link import BITS_A_BYTE
from gcode.check.millimetres import Converter
from gcode.columns import Columns, read_columns
from gcode.interpret import Reading
from gcode.motion import Motion
from gcode.profile import Profile
from gcode.segments import Floats, Ints, Segments
from gcode.timeline import Timeline, TimelineMaker
from gcode.writer import Writer


@dataclass(frozen=True, slots=True)
class Sending:
    """How a program is read and sent. `baud`: of the link in bit/s, None where it has no rate that counts."""

    encoding: str = "utf-8"
    convert_inches: bool = False
    compact: bool = False
    baud: int | None = None


AS_IT_IS = Sending()


def measure(
    pieces: Iterable[bytes], profile: Profile, motion: Motion, lines: int, sending: Sending = AS_IT_IS
) -> Timeline:
    """The timeline of a program of `lines` lines, from pieces of whole lines (gcode.lines.pieces).

    Any bytes have one. Raises only what `pieces` raises.
    """
    measuring = _Measuring(profile, motion, lines, sending)
    for piece in pieces:
        if not measuring.take(piece):
            break
    return measuring.finish()


class _Measuring:
    """One program, once."""

    def __init__(self, profile: Profile, motion: Motion, lines: int, sending: Sending) -> None:
        self._sending = sending
        self._ends = {
            (ord(name[0]), float(name[1:])) for name, code in profile.codes.items() if code.effect == "program_end"
        }
        self._converter = Converter() if sending.convert_inches else None
        self._reading = Reading(profile, laser=motion.laser)
        # As jobs/batch.py begins: a machine that has said nothing else is in G90.
        self._reading.state.absolute = True
        self._writer = Writer(profile, self._reading.table, compact=sending.compact) if sending.baud else None
        self._next_line = 1
        self._unsent_s = 0.0
        self._maker = TimelineMaker(motion, self._reading.state.axes, lines)

    def take(self, piece: bytes) -> bool:
        """The next piece; False when the program ends in it."""
        columns = read_columns(piece, self._next_line, self._sending.encoding)
        self._next_line += columns.lines
        if self._converter is not None:
            columns = self._converter.convert(columns)
        last = self._end(columns)
        rows = columns.lines if last is None else last + 1
        blocks = self._reading.blocks(columns)
        if self._writer is None:
            self._maker.add(self._reading.read(columns, blocks, end=rows))
        else:
            self._add_sent(columns, blocks, rows, self._writer)
        self._reading.notes.clear()
        return last is None

    def finish(self) -> Timeline:
        """The program is over: what compensation has held back is carried out too."""
        self._maker.add(self._reading.finish())
        return self._maker.finish()

    def _end(self, columns: Columns) -> int | None:
        """The row of the block that ends the program."""
        found = [columns.row[(columns.letter == letter) & (columns.value == value)][:1] for letter, value in self._ends]
        return min((int(rows[0]) for rows in found if len(rows)), default=None)

    def _add_sent(self, columns: Columns, blocks: Blocks, rows: int, writer: Writer) -> None:
        """The same where the link counts."""
        writer.open(columns)
        segments = self._reading.read(columns, blocks, end=rows, follower=writer)
        _, sent = writer.texts(0, rows)
        # A line end, or what else stands between blocks.
        link_s = (sent + (sent > 0.0)) * BITS_A_BYTE / float(self._sending.baud or 1)
        self._maker.add_link(np.arange(columns.first_line, columns.first_line + rows), link_s)
        self._maker.add(segments, self._floors(segments, columns.first_line, link_s))

    def _floors(self, segments: Segments, first_line: int, link_s: Floats) -> Floats:
        """What goes out before each segment; lines that move nothing go with the next."""
        upto = np.concatenate(([0.0], np.cumsum(link_s)))
        # A way that compensation has held back is one of an earlier piece: its line has gone out long ago.
        rows: Ints = np.clip(segments.line - first_line + 1, 0, len(link_s))
        here = np.concatenate(([-self._unsent_s], upto[rows]))
        self._unsent_s = float(upto[-1] - here[-1])
        return np.maximum(np.diff(here), 0.0)
