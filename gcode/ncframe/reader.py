"""Lines of a program to frames that are ready to go: their text, how long they take, where they end.

It has the shape of the reader that makes text blocks for the other machines, so that batches are planned from either.
Not the batches. The one rule: behind a stop (M0, M1, M2, M6, M30) nothing is given out before it is asked for, because
somebody may have moved the machine there.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gcode.motion import Motion
from gcode.ncframe.frame import Frame, Stop
from gcode.ncframe.rates import feeds_of_bytes
from gcode.ncframe.rules import FrameRules
from gcode.ncframe.source import blocks_of_line
from gcode.ncframe.translate import Translator
from gcode.planner import plan
from gcode.profile import Profile
from gcode.rows import Rows
from gcode.state import State
from gcode.words import decode_line, parse_block

LINES_AT_ONCE = 256
"""Lines of one go, some ten milliseconds: a pause waits so long at most."""


class TranslationError(ValueError):
    """A line that cannot be sent. The check before the run reports it first; here it is the last guard."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line
        self.reason = reason


@dataclass(slots=True)
class FrameBlock:
    """A frame as a block of a job. `end`: mm from the host's zero in the order of the state's axes, NaN unknown.

    `cost_s` is what counts against the bound of a batch. `tool` is wanted by an M6, None where none was named.
    """

    line: int
    text: str
    seconds: float
    cost_s: float
    moves: bool
    end: tuple[float, ...]
    barrier: Stop | None = None
    tool: int | None = None


class FrameReader:
    """Reads one program, once, from lines with their numbers."""

    def __init__(
        self,
        lines: Iterable[tuple[int, bytes]],
        profile: Profile,
        motion: Motion,
        rules: FrameRules,
        position: Mapping[str, float] | None = None,
        *,
        skip_to: int = 1,
    ) -> None:
        self._lines = iter(lines)
        self._rules = rules
        # The machine stands still until the next frame has come: nothing looks ahead.
        self._motion = replace(motion, planner_blocks=1)
        self._translator = Translator(profile, rules, position)
        self._skip_to = skip_to
        self._opened = False
        self._exhausted = False
        self._first: list[tuple[int, bytes]] = []
        self._ready: deque[FrameBlock] = deque()
        self._broken: TranslationError | None = None
        self._place = self._translator.place

    @property
    def state(self) -> State:
        """Behind everything that was read: ahead of what was given out only inside compensation."""
        return self._translator.state

    @property
    def in_inches(self) -> bool:
        """Never: frames are counts, whatever the program is written in."""
        return False

    @property
    def ended(self) -> bool:
        """Everything has been given out."""
        return self._exhausted and not self._ready and self._broken is None

    @property
    def place(self) -> tuple[float, ...]:
        """Where the machine stands behind everything given out, mm from the host's zero, in the order of the axes."""
        return self._place

    @property
    def settled(self) -> bool:
        """Whether nothing has been read that was not given out: only then the machine can be relocated."""
        return self._translator.settled and not self._ready

    def relocate(self, position: Mapping[str, float]) -> None:
        """The machine's own account of where it stands, mm from the host's zero. Raises ValueError unless settled."""
        self.skip()
        if not self.settled:
            raise ValueError("the machine cannot be relocated while moves wait for the corner behind them")
        self._translator.relocate(position)
        self._place = self._translator.place

    def forget(self) -> None:
        """Somebody else may have been at the machine."""
        self._translator.forget()

    def skip(self) -> None:
        """Follow the lines before `skip_to` without giving them out; the lines from there on are open then."""
        if self._opened:
            return
        self._opened = True
        for number, raw in self._lines:
            if number >= self._skip_to:
                self._first = [(number, raw)]
                break
            self._translate(number, raw)
            self._guard(0)
        if self._skip_to > 1:
            self._translator.forget()
            self._place = self._translator.place

    def more(self, most_lines: int) -> tuple[list[FrameBlock], int]:
        """The next frames, up to a stop, which comes alone, and how many lines that took: none at the end.

        Raises TranslationError when the very next line cannot be sent, OSError when the program cannot be read.
        """
        self.skip()
        taken = 0
        if not self._ready and self._broken is None:
            taken = self._read(min(most_lines, LINES_AT_ONCE))
        if not self._ready and self._broken is not None:
            raise self._broken
        found: list[FrameBlock] = []
        while self._ready:
            if self._ready[0].barrier is not None and found:
                break
            found.append(self._ready.popleft())
            if found[-1].barrier is not None:
                break
        if found:
            self._place = found[-1].end
        return found, taken

    # --- reading --------------------------------------------------------------------------------------------------

    def _read(self, most_lines: int) -> int:
        """Translate so many lines, or up to a stop."""
        frames: list[Frame] = []
        taken = 0
        while taken < most_lines:
            line = self._first.pop() if self._first else next(self._lines, None)
            if line is None:
                if not self._exhausted:
                    self._exhausted = True
                    frames += self._translator.finish()
                    self._guard(len(frames))
                break
            taken += 1
            frames += self._translate(*line)
            if self._guard(len(frames)) or (frames and frames[-1].stop is not None):
                break
        self._ready.extend(self._blocks([frame for frame in frames if frame.line >= self._skip_to]))
        return taken

    def _translate(self, number: int, raw: bytes) -> list[Frame]:
        frames: list[Frame] = []
        for block in blocks_of_line(raw, self._rules.semicolon):
            frames += self._translator.step(number, parse_block(decode_line(block, self._rules.encoding)))
            if self._translator.errors:
                # Nothing of a line that has an error goes out.
                return []
        return frames

    def _guard(self, ready: int) -> bool:
        """Whether the program cannot go on. Raises TranslationError where nothing before that is left to give out."""
        errors = self._translator.errors
        if errors and self._broken is None:
            first = errors[0]
            self._broken = TranslationError(first.line, f"column {first.column}: {first.message}")
        if self._broken is not None and not ready:
            raise self._broken
        return self._broken is not None

    def _blocks(self, frames: list[Frame]) -> list[FrameBlock]:
        seconds = self._seconds(frames)
        return [
            FrameBlock(
                line=frame.line,
                text=frame.items.text(),
                seconds=took,
                cost_s=took,
                moves=frame.moves,
                end=frame.end,
                barrier=frame.stop,
                tool=frame.tool,
            )
            for frame, took in zip(frames, seconds, strict=True)
        ]

    def _seconds(self, frames: list[Frame]) -> list[float]:
        """Each motion planned from rest to rest; its frames share it by their length."""
        rows = Rows(self.state.axes)
        places: dict[int, int] = {}
        for frame in frames:
            if frame.row is not None and id(frame.row) not in places:
                places[id(frame.row)] = len(places)
                rows.add(frame.row._replace(frame=0))
        planned = np.zeros(0)
        if places:
            segments = rows.take()
            segments.feed = feeds_of_bytes(segments.feed, self._rules)
            planned = plan(segments, self._motion)
        return [0.0 if frame.row is None else float(planned[places[id(frame.row)]]) * frame.share for frame in frames]
