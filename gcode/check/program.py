"""A program through all rules, piece by piece: words, motion, times. Not a rule, and not where the bytes come from.

The one rule: constant memory, one pass; what is remembered is bounded by the rules, not by the program.
"""

from dataclasses import replace
from typing import TypedDict

import numpy as np

from gcode.blocks import Blocks
from gcode.check.assumed import Assumed
from gcode.check.course import CourseRules
from gcode.check.height import HeightRules
from gcode.check.link import BITS_A_BYTE, LinkRules
from gcode.check.millimetres import Converter, Millimetres
from gcode.check.motion import MotionRules
from gcode.check.moves import Moves
from gcode.check.piece import Piece, Reporter
from gcode.check.source import Fingerprint
from gcode.check.summary import Summary
from gcode.check.tools import ToolRules
from gcode.check.travel import TravelRules
from gcode.check.words import WordRules
from gcode.columns import Columns, read_columns
from gcode.findings import Findings, Report
from gcode.interpret import Reading
from gcode.interpreter import NO_COMPENSATION
from gcode.lines import MAX_LINE_BYTES
from gcode.motion import Motion, Position
from gcode.planner import Planner
from gcode.profile import Profile
from gcode.segments import Ints, Segments
from gcode.state import State


class CheckOptions(TypedDict, total=False):
    """What else is known of a run. `position`: where the machine stands; `envelope`: its coordinates are the
    machine's own (homed, the envelope control on). `block_delete`: lines with `/` are left out. `convert_inches`:
    lengths after G20 are converted, so it is no error. `max_block_bytes`: what the machine takes, where that is not
    what the profile says. `encoding`: of comments. `first_line`: the number of the first line. `baud`: of the link,
    bit/s. `tools`: those of the tool table, None: every number is a tool. `feed_override`, `rapid_override`: factors
    for `seconds_overridden`. `piece_bytes`: how much is worked on at once, where not as much as is fastest; memory
    grows with it.
    """

    position: Position | None
    block_delete: bool
    convert_inches: bool
    max_block_bytes: int | None
    envelope: bool
    encoding: str
    first_line: int
    baud: int | None
    tools: frozenset[int] | None
    feed_override: float
    rapid_override: float
    piece_bytes: int


class Checker:
    """One program, one pass: `look` at its pieces in order, then `report` once."""

    def __init__(self, profile: Profile, motion: Motion, options: CheckOptions) -> None:
        self._profile = profile
        self._skip_deleted = options.get("block_delete", False)
        self._next_line = 1
        self._baud = options.get("baud")
        self._found = Findings()
        self._converter = Converter() if options.get("convert_inches") else None
        self._reading = Reading(profile, laser=motion.laser, skip_deleted=self._skip_deleted)
        self._assumed = Assumed(profile, laser=motion.laser, skip_deleted=self._skip_deleted)
        if position := options.get("position"):
            self._reading.state.locate(dict(position))
        reporter = Reporter(self._found)
        self._reporter = reporter
        self._words = WordRules(profile, reporter, options.get("max_block_bytes") or profile.max_block_bytes)
        tools = options.get("tools")
        self._tools = None if tools is None else ToolRules(tools, reporter)
        self._course = CourseRules(profile, motion, reporter)
        self._travel = TravelRules(profile, motion, reporter, envelope=options.get("envelope", False))
        self._motions = MotionRules(profile, motion, reporter)
        self._height = HeightRules(profile, reporter)
        self._summary = Summary()
        self._link = LinkRules(reporter, self._baud, motion.planner_blocks) if self._baud else None
        axes = self._reading.state.axes
        self._planner = Planner(motion, axes)
        factors = options.get("feed_override", 1.0), options.get("rapid_override", 1.0)
        self._overridden: Planner | None = None
        if factors != (1.0, 1.0):
            self._overridden = Planner(motion, axes, feed_override=factors[0], rapid_override=factors[1])
        self._seconds_overridden = 0.0

    def too_long(self, line: int) -> None:
        """A line that is no line; it stands empty in the columns."""
        message = f"the line is longer than {MAX_LINE_BYTES} bytes"
        self._found.add("error", line, 0, "line_too_long", message)

    def look(self, columns: Columns, numbers: Ints | None = None) -> None:
        """The next rows. `numbers`: the line of each, where they do not count up from `columns.first_line`."""
        if self._skip_deleted and len(columns.deleted):
            columns = _without(columns, columns.deleted)
        if self._converter:
            columns = self._converter.convert(columns)
        piece = Piece(columns, self._profile.code_letters, numbers)
        self._next_line = columns.first_line + columns.lines
        before = self._reading.state.copy()
        blocks = self._reading.blocks(columns)
        self._judge(piece, self._reading.read(columns, blocks), before, blocks)

    def _finish(self) -> None:
        """The motion that was held back for the corner behind it, and has none."""
        before = self._reading.state.copy()
        segments = self._reading.finish()
        if len(segments):
            columns = read_columns(b"", self._next_line)
            self._judge(Piece(columns, self._profile.code_letters), segments, before, self._reading.blocks(columns))

    def _judge(self, piece: Piece, segments: Segments, before: State, blocks: Blocks) -> None:
        columns = piece.columns
        moves = Moves(segments, segments.line - columns.first_line)
        assumed = self._assumed.read(columns, blocks, before, segments, self._reading.state)
        sums = moves if assumed is segments else Moves(assumed, assumed.line - columns.first_line)
        self._notes(piece)
        self._words.look(piece)
        if self._tools:
            self._tools.look(piece)
        self._course.look(piece, moves)
        self._travel.look(piece, moves)
        self._motions.look(piece, moves)
        self._height.look(piece, moves)
        self._summary.look(piece, sums)
        if self._link:
            self._link.look(piece, sums)
        self._time(self._planner.feed(assumed))
        if self._overridden:
            self._seconds_overridden += float(self._overridden.feed(assumed).sum())

    def report(self, source: Fingerprint | None = None) -> Report:
        """Everything that was found. To be called once."""
        left_on = self._reading.state.compensation != NO_COMPENSATION
        self._finish()
        self._time(self._planner.flush())
        if self._overridden:
            self._seconds_overridden += float(self._overridden.flush().sum())
        if self._link:
            self._link.close()
        self._words.close()
        self._travel.close()
        blocks = self._course.close(self._reading.state, compensating=left_on)
        summary = self._summary
        report = Report(
            errors=self._found.of("error"),
            warnings=self._found.of("warning"),
            infos=self._found.of("info"),
            bounds=dict(sorted(self._travel.bounds.items())),
            seconds=summary.seconds,
            lines=summary.lines,
            blocks=blocks,
            cut_mm=summary.cut_mm,
            rapid_mm=summary.rapid_mm,
            tools=summary.tools,
            feeds=summary.feeds,
            plunge_mm=summary.plunge_mm,
            segments=summary.segments,
            arcs=summary.arcs,
            shortest_mm=summary.shortest_mm,
            median_mm=summary.median_mm,
            spindle=summary.spindle,
            dwell_seconds=summary.dwell_seconds,
            seconds_overridden=self._seconds_overridden if self._overridden else None,
            wire_bytes=summary.wire_bytes,
            link_seconds=summary.wire_bytes * BITS_A_BYTE / self._baud if self._baud else None,
            by_tool=summary.by_tool,
        )
        if source is None:
            return report
        return replace(
            report,
            encoding=source.encoding,
            line_ends=source.line_ends,
            bytes=source.bytes,
            sha256=source.sha256,
        )

    def _notes(self, piece: Piece) -> None:
        """What the interpreter said of blocks; and where inches were converted, for people to know."""
        notes = self._reading.notes
        for note in notes:
            row = note.line - piece.columns.first_line
            self._found.add(note.level, piece.line(row), note.column, note.code, note.message)
            if note.level == "error" or note.code == "not_followed":
                piece.noted.add(row)
        notes.clear()
        columns = piece.columns
        if isinstance(columns, Millimetres):
            rows = columns.rows_of_g20()
            text = "inches are converted to mm from here on"
            self._reporter.rows(
                piece, rows, "info", "converted", text, at=lambda place: columns.column_of_g20(int(rows[place]))
            )

    def _time(self, seconds: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> None:
        self._summary.take_seconds(seconds)
        if self._link:
            self._link.take_seconds(seconds)


def _without(columns: Columns, rows: "np.ndarray[tuple[int], np.dtype[np.int32]]") -> Columns:
    """The same lines, these rows empty."""
    stays = ~np.isin(columns.row, rows)
    gone = set(rows.tolist())
    return replace(
        columns,
        row=columns.row[stays],
        letter=columns.letter[stays],
        value=columns.value[stays],
        start=columns.start[stays],
        end=columns.end[stays],
        faults=[(row, fault) for row, fault in columns.faults if row not in gone],
        messages=[(row, text) for row, text in columns.messages if row not in gone],
    )
