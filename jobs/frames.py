"""A program as NC frames for the batches of a job: all of it, or what comes behind a place in the middle of it.

Not the translation (gcode/ncframe) and not the batches (batch.py). A line may become several frames, so a place in
the program is a line and a part: so many of its frames that do something are behind it. Frames of G, F, S or T alone do
not count, for whether there are any depends on what the machine was told before. The one rule: a program is always
translated from its first line, so that every frame is the same however often a job is taken up; what is behind is left
out.
"""

import re
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isnan

from gcode.motion import Motion
from gcode.ncframe.reader import FrameBlock, FrameReader, TranslationError
from gcode.ncframe.rules import FrameRules
from gcode.profile import Profile
from gcode.state import State
from gcode.toolcodes import coolant_codes
from jobs.barriers import Barrier
from jobs.stretch import Stretch, Upcoming
from jobs.upcoming import PlanError
from protocol.commands import Position
from protocol.errors import LocalError

DOES_SOMETHING = re.compile(r"[MXZR]|G4\b")
"""What a frame has whose being there does not depend on those before it."""
SAME_COUNTS = 0.51
"""Two accounts of a place that is in whole counts differ by less."""
LINES_AT_ONCE = 256


@dataclass(frozen=True, slots=True)
class Behind:
    """A place in a program: lines up to `line` are executed, and of the next one what comes before `part`, which is one
    more than the frames of it that are executed; 0: none."""

    line: int = 0
    part: int = 0


class FrameBlocks:
    """Reads one program, once (jobs.batch.Reader). `lines` are those of the whole program, `position` where the machine
    stood before the first one, mm from the host's zero; an axis that is not known is absent."""

    def __init__(
        self,
        lines: Iterable[tuple[int, bytes]],
        profile: Profile,
        motion: Motion,
        rules: FrameRules,
        position: Mapping[str, float],
        behind: Behind = Behind(),
    ) -> None:
        self._reader = FrameReader(lines, profile, motion, rules, position)
        self._resolution_mm = rules.resolution_mm
        self._coolant = coolant_codes(profile)
        self._behind = behind
        self._opened = False
        self._ready: deque[Upcoming] = deque()
        self._last: tuple[FrameBlock, int] | None = None  # the newest one, and its part: does its line go on?
        self._line = self._solid = 0
        self._modes: dict[str, str] = {}
        self._fresh = behind == Behind()  # the first that is given out says its modes anyway
        self._place = self._reader.place
        self._broken: PlanError | None = None

    @property
    def state(self) -> State:
        """Behind everything that was read: ahead of what was given out."""
        return self._reader.state

    @property
    def in_inches(self) -> bool:
        """Never: frames are counts."""
        return False

    @property
    def ended(self) -> bool:
        """Everything has been given out."""
        return self._reader.ended and not self._ready and self._last is None and self._broken is None

    @property
    def place(self) -> tuple[float, ...]:
        """Where the machine stands behind everything given out."""
        return self._place

    def relocate(self, position: Position) -> None:
        """The account of the machine: it has to be ours. Raises LocalError where it is not: the program or the
        configuration is another one than it was, and every further increment would start from the wrong place."""
        self.skip()
        for axis, at in zip(self.state.axes.lower(), self._place, strict=True):
            known = position.get(axis)
            # Positions in X may be diameters: two counts' worth of a radius.
            if known is not None and not isnan(at) and abs(known - at) > 2 * SAME_COUNTS * self._resolution_mm:
                raise LocalError(
                    f"behind line {self._behind.line} the machine stands at {axis.upper()}{known:g}, and the program "
                    f"leads to {at:g}: program or configuration have changed since"
                )

    def forget(self) -> None:
        """The newest frame is left out: its T was not said."""
        self._reader.forget()

    def skip(self) -> None:
        """Translate what is behind, without giving it out. An error in it is told where blocks are asked for."""
        if self._opened:
            return
        self._opened = True
        while not self._ready and not self._reader.ended and self._broken is None:
            try:
                self._read(LINES_AT_ONCE)
            except PlanError as error:
                self._broken = error

    def more(self, most_lines: int) -> Stretch:
        """The next frames, up to a stop, which comes alone, of at most so many lines: there may be none.

        Raises PlanError when the very next line cannot be sent, OSError when the program cannot be read.
        """
        self.skip()
        if not self._ready:
            if self._broken is not None:
                raise self._broken
            self._read(most_lines)
        found: list[Upcoming] = []
        while self._ready and self._ready[0].barrier is None:
            found.append(self._ready.popleft())
        alone = self._ready.popleft() if self._ready and not found else None
        if found or alone is not None:
            self._place = (alone or found[-1]).end
        return Stretch.of(found, alone)

    # --- reading ------------------------------------------------------------------------------------------------

    def _read(self, most_lines: int) -> int:
        """What is certain now; whether a frame ends its line, the one behind it says."""
        try:
            blocks, taken = self._reader.more(most_lines)
        except TranslationError as error:
            self._close_last(0)
            broken = PlanError(error.line, error.reason)
            if not self._ready:
                raise broken from error
            self._broken = broken
            return 0
        for block in blocks:
            self._close_last(block.line)
            solid = DOES_SOMETHING.search(block.text) is not None
            self._solid = solid + (self._solid if block.line == self._line else 0)
            self._line = block.line
            self._last = block, self._solid + 1
            if self._is_behind(block.line, self._solid, solid=solid):
                self._follow(block)
                self._last = None
                self._place = block.end
        if self._reader.ended:
            self._close_last(0)
        return taken

    def _is_behind(self, line: int, count: int, *, solid: bool) -> bool:
        behind = self._behind
        if line != behind.line + 1 or not behind.part:
            return line <= behind.line
        return count < behind.part if solid else count < behind.part - 1

    def _follow(self, block: FrameBlock) -> None:
        """What the machine was told by a frame that is behind."""
        for word in block.text.split():
            if word[0] in "FS" or word in ("G0", "G1", "G2", "G3"):
                self._modes[word[0]] = word

    def _close_last(self, next_line: int) -> None:
        """The newest frame can be given out: `next_line` is that of the one behind it."""
        if self._last is None:
            return
        (block, part), self._last = self._last, None
        stop = block.barrier
        self._ready.append(
            Upcoming(
                line=block.line,
                text=block.text if self._fresh else self._with_modes(block.text),
                seconds=block.seconds,
                cost_s=block.cost_s,
                moves=block.moves,
                end=block.end,
                barrier=None
                if stop is None
                else Barrier(stop.locate, stop.ends_program, stop.tool_change, stop.pauses),
                tool=block.tool,
                io=self._said(block.text),
                part=part if block.line == next_line else 0,
            )
        )
        self._fresh = True

    def _said(self, text: str) -> tuple[tuple[str, int], ...]:
        """What a frame says to a tool changer: T, and the coolant."""
        words = [(word[0], int(word[1:])) for word in text.split() if word[0] in "MT"]
        return tuple([word for word in words if word[0] == "T" or word[1] in self._coolant])

    def _with_modes(self, text: str) -> str:
        """The first frame behind the place says what those before it have said: somebody may have moved by hand."""
        words = {word[0]: word for word in text.split()}
        return " ".join(word for letter in "GMXZRFST" if (word := words.get(letter) or self._modes.get(letter)))
