"""The check before a run (preflight): what is wrong with a program for a controller, and what it will do.

Constant memory, one pass. Not the planner. The one rule: every word of the program is either understood by the
profile or stands in a finding with its line and column.
"""

from collections.abc import Iterable
from functools import lru_cache

from gcode.clean import clean
from gcode.findings import Findings, Level, Report
from gcode.inches import InchConverter
from gcode.lines import MAX_LINE_BYTES
from gcode.modal import Step, Tracker
from gcode.motion import Motion, Position
from gcode.profile import Code, Profile
from gcode.words import Block, code_name, decode_line, parse_block

ARC_GAP_MM = 0.005
"""Radii at start and end may differ by so much, or by ARC_GAP of the radius (the usual limits, rs274 §4)."""

ARC_GAP = 0.001

MAX_LISTED = 100
"""Most tools and feeds that a report lists."""

_FEED_KINDS = ("feed", "arc", "cycle")
_HOMING = frozenset(("home", "home_and_back"))
_SHIFTING = frozenset(("set_position", "zero_all", "zero_z"))


def check_program(
    lines: Iterable[bytes],
    profile: Profile,
    motion: Motion | None = None,
    *,
    position: Position | None = None,
    block_delete: bool = False,
    convert_inches: bool = False,
    max_block_bytes: int | None = None,
    envelope: bool = False,
    encoding: str = "utf-8",
    first_line: int = 1,
) -> Report:
    """Check a program for a controller; never raises on any bytes.

    `lines` as from `gcode.lines.split_lines` or `ProgramStore.lines`. `motion` brings rates and travel, `position`
    where the machine stands, `envelope`: its envelope control is on. `max_block_bytes` is what a batch may carry,
    where the configuration says something else than the profile.
    """
    checker = _Checker(profile, motion or Motion(), position, envelope=envelope)
    checker.limit_bytes = max_block_bytes or profile.max_block_bytes
    inches = InchConverter() if convert_inches else None
    for line, raw in enumerate(lines, first_line):
        checker.lines += 1
        if len(raw) > MAX_LINE_BYTES:
            checker.error(line, 0, "line_too_long", f"the line is longer than {MAX_LINE_BYTES} bytes")
            continue
        block = parse_block(decode_line(raw, encoding))
        if block_delete and block.deleted:
            continue
        if inches:
            checker.note_conversion(line, block)
            block = inches.convert(block)
        if block.words or block.faults:
            checker.block(line, block)
    return checker.report()


class _Checker:
    """One program, one pass. What is remembered is bounded by the profile, not by the program."""

    def __init__(self, profile: Profile, motion: Motion, position: Position | None, *, envelope: bool) -> None:
        self.lines = 0
        self.limit_bytes = profile.max_block_bytes
        self._profile = profile
        self._motion = motion
        self._tracker = Tracker(profile, motion, position)
        self._found = Findings()
        self._judge = lru_cache(maxsize=1024)(self._judge_name)
        self._blocks = 0
        self._seconds = self._cut_mm = self._rapid_mm = 0.0
        self._bounds: dict[str, tuple[float, float]] = {}
        self._tools: set[int] = set()
        self._feeds: set[float] = set()
        self._seen: set[str] = set()  # effects, groups and letters that the program has used so far
        self._plane = ""
        self._envelope = envelope
        self._shifted = False
        self._outside: dict[tuple[str, Level], tuple[int, float, int]] = {}

    def error(self, line: int, column: int, code: str, message: str, *, subject: str = "") -> None:
        self._found.add("error", line, column, code, message, subject=subject)

    def _warn(self, line: int, column: int, code: str, message: str, *, subject: str = "") -> None:
        self._found.add("warning", line, column, code, message, subject=subject)

    def _warn_once(self, line: int, code: str, message: str) -> None:
        if code not in self._seen:
            self._seen.add(code)
            self._warn(line, 1, code, message)

    def note_conversion(self, line: int, block: Block) -> None:
        """With convert_inches a G20 is no error, but people are to know."""
        for word in block.words:
            if word.letter == "G" and word.code == "G20":
                self._found.add("info", line, word.column, "converted", "inches are converted to mm from here on")

    def block(self, line: int, block: Block) -> None:
        """One block with something in it."""
        for fault in block.faults:
            self.error(line, fault.column, fault.code, fault.message)
        codes = self._words(line, block)
        if text := clean(block):
            self._sendable(line, text)
        self._order(line, block, codes)
        self._remember(codes)
        before = self._tracker.position
        step = self._tracker.step(block)
        self._seconds += step.seconds
        if step.moves and step.kind != "homing":
            self._first_motion(line)
            self._moved(line, block, step)
        elif self._tracker.position is not before and any(code.effect in _SHIFTING for code in codes):
            # From here on the program's coordinates are not the machine's any more.
            self._shifted = True

    # --- words --------------------------------------------------------------------------------------------------

    def _words(self, line: int, block: Block) -> list[Code]:
        """Judges every word; gives the codes that the profile knows."""
        profile = self._profile
        codes: list[Code] = []
        for word in block.words:
            letter = word.letter
            name = letter
            if letter in profile.code_letters:
                name = code_name(letter, word.text)
                if code := profile.codes.get(name):
                    codes.append(code)
            elif letter == "F" and len(self._feeds) < MAX_LISTED:
                self._feeds.add(word.value)
            elif letter == "T" and len(self._tools) < MAX_LISTED:
                self._tools.add(int(word.value))
            if verdict := self._judge(letter, name):
                level, kind, message = verdict
                self._found.add(level, line, word.column, kind, message, subject=name)
        return codes

    def _judge_name(self, letter: str, name: str) -> tuple[Level, str, str] | None:
        """What is to be said of a word, whatever its line; None for nothing."""
        profile = self._profile
        shown = name if len(name) <= 24 else name[:24] + "..."
        if letter not in profile.code_letters:
            if letter in profile.letters:
                return None
            if text := profile.ignored_letters.get(letter):
                return "warning", "ignored", f"{letter} words are ignored by {profile.title}: {text}"
            return "error", "unknown_word", f"{profile.title} has no {letter} words"
        code = profile.codes.get(name)
        if code is None or code.status == "missing":
            reason = f": {code.text}" if code and code.text else ""
            return "error", "unknown_code", f"{shown} does not exist on {profile.title}{reason}"
        if code.status == "ignored":
            return "warning", "ignored", f"{shown} is ignored by {profile.title}: {code.text}"
        if code.status == "differs":
            return "warning", "differs", f"{shown} means something else on {profile.title}: {code.text}"
        return None

    def _order(self, line: int, block: Block, codes: list[Code]) -> None:
        """Two of one modal group, a letter twice (rs274 §1, §2)."""
        groups = [code.group for code in codes if code.group] if len(codes) > 1 else []
        for group in {group for group in groups if groups.count(group) > 1}:
            names = " ".join(code.name for code in codes if code.group == group)
            self.error(line, 1, "group_conflict", f"{names} contradict each other in one block")
        letters = [word.letter for word in block.words if word.letter not in self._profile.code_letters]
        if len(set(letters)) < len(letters):
            twice = next(letter for letter in letters if letters.count(letter) > 1)
            self.error(line, _column(block, twice), "word_twice", f"{twice} stands twice in one block")

    def _sendable(self, line: int, text: str) -> None:
        self._blocks += 1
        if self._ended:
            self._warn_once(line, "after_end", "there are blocks after the end of the program")
        if len(text) > self.limit_bytes:
            message = f"the block has {len(text)} bytes without comments, the machine takes {self.limit_bytes}"
            self.error(line, 1, "block_too_long", message)

    def _remember(self, codes: list[Code]) -> None:
        for code in codes:
            self._seen.update((code.effect, code.group, code.name))
            if code.effect in _HOMING or code.name == "W72":
                self._envelope = True
            elif code.name == "W73":
                self._envelope = False
            if code.group == "plane":
                self._plane = code.name

    @property
    def _ended(self) -> bool:
        return "program_end" in self._seen

    # --- motion -------------------------------------------------------------------------------------------------

    def _first_motion(self, line: int) -> None:
        if "moved" in self._seen:
            return
        self._seen.add("moved")
        if not self._seen & {"absolute", "relative"}:
            self._warn(line, 1, "distance_not_set", "the program moves before it says G90 or G91")
        if "units" not in self._seen:
            self._warn(line, 1, "units_not_set", "the program moves before it says G21")

    def _moved(self, line: int, block: Block, step: Step) -> None:
        if not self._envelope:
            text = "the envelope control is off here: G28, G29 or W72 switch it on"
            self._warn_once(line, "envelope_off", text)
        if step.kind == "rapid":
            self._rapid_mm += step.length_mm
        else:
            self._cut_mm += step.length_mm
        if step.kind in _FEED_KINDS:
            self._fed(line, block)
        if step.kind == "arc":
            self._arc(line, block, step)
        self._extend(line, step)

    def _fed(self, line: int, block: Block) -> None:
        modal = self._tracker.modal
        if modal.motion is None or self._profile.codes[modal.motion].effect == "cancel":
            self.error(line, 1, "motion_not_set", "axis words without G0, G1, G2 or G3 before them")
        elif modal.feed_mm_min is None or modal.feed_mm_min <= 0:
            column = _column(block, "F")
            self.error(line, column, "feed_missing", f"{modal.motion} without a feed (no F before it, or F0)")
        if not self._seen & _SPINDLE_ON and not any(word.code in _SPINDLE_ON for word in block.words):
            self._warn_once(line, "spindle_off", "feed moves before the spindle was ever started")

    def _arc(self, line: int, block: Block, step: Step) -> None:
        letters = {word.letter for word in block.words}
        if self._plane and self._plane not in self._profile.arc_planes:
            self.error(line, 1, "arc_plane", f"an arc in {self._plane}: {self._profile.title} has arcs in XY only")
            return
        arc = step.arc
        if arc is None:
            if not letters & _CENTRE:
                self.error(line, 1, "arc_without_centre", "an arc without I, J or R")
            elif self._tracker.modal.absolute is False or all(axis in step.start for axis in ("x", "y")):
                self.error(line, 1, "arc_impossible", "no arc of this centre or radius joins its ends")
            return
        gap_mm = abs(arc.radius - arc.end_radius)
        if gap_mm > ARC_GAP_MM and gap_mm > ARC_GAP * arc.radius:
            radii = f"radius {arc.radius:.4f} mm at its start, {arc.end_radius:.4f} mm at its end"
            self.error(line, _column(block, "I"), "arc_not_closed", f"the arc does not close: {radii}")

    def _extend(self, line: int, step: Step) -> None:
        """Bounds and travel: the ends of moves, and where an arc bulges over them."""
        reach: list[Position] = [step.end]
        if step.arc is not None:
            low, high = step.arc.extremes()
            x, y = step.start.get("x"), step.start.get("y")
            if x is not None and y is not None:
                reach += [{"x": x + low[0], "y": y + low[1]}, {"x": x + high[0], "y": y + high[1]}]
        for place in reach:
            for axis, value in place.items():
                lowest, highest = self._bounds.get(axis, (value, value))
                if not lowest < value < highest:
                    self._bounds[axis] = (min(lowest, value), max(highest, value))
        if self._motion.travel and not self._shifted:
            self._travel(line, reach)

    def _travel(self, line: int, reach: list[Position]) -> None:
        for axis, (lowest, highest) in self._motion.travel.items():
            values = [place[axis] for place in reach if axis in place]
            over = max([0.0, *[max(lowest - value, value - highest) for value in values]])
            if over <= 0.0:
                continue
            worst = max(values, key=lambda value: max(lowest - value, value - highest))
            key: tuple[str, Level] = (axis, "error" if self._envelope else "warning")
            first, before, count = self._outside.get(key, (line, worst, 0))
            further = max(lowest - before, before - highest)
            self._outside[key] = (first, worst if over > further else before, count + 1)

    # --- the end ------------------------------------------------------------------------------------------------

    def report(self) -> Report:
        """Everything that was found. To be called once."""
        for (axis, level), (line, worst, count) in self._outside.items():
            lowest, highest = self._motion.travel[axis]
            message = f"{axis.upper()} leaves the travel of {lowest:g} to {highest:g} mm, as far as {worst:.3f}"
            self._found.add(level, line, 1, "outside_travel", message, subject=axis, count=count)
        if self._blocks and not self._ended:
            self._warn(max(1, self.lines), 1, "no_end", "the program has no end (M30 or M99)")
        if not self._blocks:
            self.error(1, 0, "no_blocks", "there is nothing to execute in this file")
        return Report(
            errors=self._found.of("error"),
            warnings=self._found.of("warning"),
            infos=self._found.of("info"),
            bounds=dict(sorted(self._bounds.items())),
            seconds=self._seconds,
            lines=self.lines,
            blocks=self._blocks,
            cut_mm=self._cut_mm,
            rapid_mm=self._rapid_mm,
            tools=tuple(sorted(self._tools)),
            feeds=tuple(sorted(self._feeds)),
        )


_CENTRE = frozenset("IJR")
_SPINDLE_ON = frozenset(("M3", "M4", "M7"))


def _column(block: Block, letter: str) -> int:
    """Where the last word of this letter stands; the line's beginning where there is none."""
    return next((word.column for word in reversed(block.words) if word.letter == letter), 1)
