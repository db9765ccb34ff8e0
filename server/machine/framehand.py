"""What people type for a machine behind NC frames, as frames: blocks of G-code and steps of a jog. Not a job's program.

G90, G91, the feed and the rest stay from one block to the next, as people expect of a controller, until a job begins;
the machine itself is told everything with every block. The one rule: what is not understood to its end sends nothing
and changes nothing.
"""

from collections.abc import Mapping
from dataclasses import fields
from functools import partial

from gcode.ncframe.rules import FrameRules
from gcode.ncframe.source import blocks_of_line
from gcode.ncframe.translate import Translator
from gcode.profile import Profile, load_profile
from gcode.state import State
from gcode.words import Block, parse_block
from protocol.commands import Position, RunBlock, SetPosition
from server.config.model import MachineConfig
from server.config.ncframe import LATHE_AXES, NcFrameConfig
from server.machine.manual import Make
from server.problems import ProblemError

SETS_POSITION = frozenset({"G92", "G50"})
OF_THE_PLACE = frozenset({"position"})
"""Of a State: where the machine stands, which it says anew each time."""
DECIMALS = 4


def hand_of(config: MachineConfig) -> "FrameHand | None":
    """For a machine that reads no G-code; None for all others."""
    dialect = config.dialect
    if not isinstance(dialect, NcFrameConfig):
        return None
    return FrameHand(load_profile(dialect.profile), dialect.rules())


class FrameHand:
    """Of one machine. Every method raises ProblemError for what cannot be sent."""

    def __init__(self, profile: Profile, rules: FrameRules) -> None:
        self._profile = profile
        self._rules = rules
        self._modes: State | None = None

    def forget(self) -> None:
        """A job has the machine: behind it the modes are those of power-on again."""
        self._modes = None

    def commands(self, line: str, position: Position) -> list[Make]:
        """What a line makes the machine do, from where it stands; none where it only sets modes."""
        translator = self._translator(position)
        makes: list[Make] = []
        for raw in blocks_of_line(line.strip().encode(), self._rules.semicolon):
            block = parse_block(raw.decode())
            codes = {word.code for word in block.words}
            if codes & SETS_POSITION:
                makes.append(partial(SetPosition, position=self._said(line, block, translator.state)))
            elif texts := self._texts(translator, block, line):
                makes.append(partial(RunBlock, blocks=texts))
        if len(makes) > 1 and any(make.func is SetPosition for make in makes if isinstance(make, partial)):
            raise _refused(line, "G92 and what moves are two commands")
        self._modes = translator.state
        return makes

    def jog(self, axes: Mapping[str, float], feed_mm_min: float, position: Position) -> Make:
        """A step by hand, no faster than the machine can. It leaves the modes as they are."""
        if not axes.keys() <= set(LATHE_AXES):
            raise ProblemError("invalid_request", "A lathe is moved in x and z.")
        feed = min(feed_mm_min, self._rules.fastest_feed_mm_min)
        words = " ".join(f"{axis.upper()}{_number(way)}" for axis, way in sorted(axes.items()))
        line = f"G91 G1 {words} F{_number(feed)}"
        translator = Translator(self._profile, self._rules, position)
        texts = self._texts(translator, parse_block(line), line)
        if not any(letter in text for text in texts for letter in "XZ"):
            raise ProblemError("invalid_request", f"That is less than a count of {self._rules.resolution_mm:g} mm.")
        return partial(RunBlock, blocks=texts)

    def _translator(self, position: Position) -> Translator:
        translator = Translator(self._profile, self._rules, position)
        if self._modes is not None:
            kept = self._modes.copy()
            for field in fields(State):
                if field.name not in OF_THE_PLACE:
                    setattr(translator.state, field.name, getattr(kept, field.name))
        return translator

    def _texts(self, translator: Translator, block: Block, line: str) -> tuple[str, ...]:
        frames = translator.step(1, block)
        if translator.errors:
            note = translator.errors[0]
            raise _refused(line, f"column {note.column}: {note.message}")
        if not translator.settled:
            raise _refused(line, "compensation needs the move behind: it is for programs")
        return tuple(frame.items.text() for frame in frames)

    def _said(self, line: str, block: Block, state: State) -> dict[str, float]:
        """G92 by hand: somebody has looked where the machine stands, in mm from the host's zero."""
        axes = {word.letter.lower(): word.value for word in block.words if word.letter in "XZ"}
        if block.faults or len(axes) + 1 != len(block.words) or not axes:
            raise _refused(line, "G92 by hand takes X and Z and nothing else")
        if any(state.frame):
            raise _refused(line, "G92 by hand says where the machine stands in G54: choose that first")
        scale = 25.4 if state.inches else 1.0
        return {axis: value * scale for axis, value in axes.items()}


def _refused(line: str, why: str) -> ProblemError:
    return ProblemError("invalid_request", f"{line!r} cannot be sent: {why}.")


def _number(value: float) -> str:
    """Without an exponent."""
    return f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
