"""Starting in the middle of a program: the modal state that the lines before would have left, as blocks to send first.

Not the geometry: the first motion begins where the machine stands. The one rule: what the lines left out would have
set is said again, and where that cannot be said in a block (an arc or a cycle that goes on), starting there is refused.
"""

from collections.abc import Iterable, Iterator
from itertools import chain

from gcode.entry import names_motion
from gcode.profile import Profile
from gcode.state import State
from gcode.words import Block, Word, code_name, decode_line, parse_block
from protocol.errors import MillstreamError

Lines = Iterable[tuple[int, bytes]]

SAYABLE = {"rapid": "G0", "feed": "G1"}
"""Motion modes that a block without coordinates can set."""
SPINDLE = frozenset({"M3", "M4", "M5"})
PLASMA = frozenset({"M7", "M8"})


class CannotStartError(MillstreamError):
    """The program cannot be started at this line; the message says why and what to do. `reason`: one of
    gcode.reentry.REASONS, where a plan to take it up was refused."""

    def __init__(self, message: str, *, reason: str | None = None) -> None:
        super().__init__(message)
        self.reason = reason


class Switches:
    """What is switched on and how fast, followed through the lines that are left out."""

    def __init__(self, lines: Lines, encoding: str) -> None:
        self._lines = lines
        self._encoding = encoding
        self.spindle: str | None = None
        self.speed: str | None = None
        self.plasma: str | None = None

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        for number, raw in self._lines:
            if any(letter in raw for letter in b"MmSs"):
                for word in parse_block(decode_line(raw, self._encoding)).words:
                    self._take(word)
            yield number, raw

    def _take(self, word: Word) -> None:
        if word.letter == "S":
            self.speed = f"S{word.text}"
        elif word.letter == "M":
            name = code_name("M", word.text)
            if name in SPINDLE:
                self.spindle = name
            elif name in PLASMA:
                self.plasma = name

    def blocks(self) -> list[str]:
        """What switches them as the lines would have."""
        found = []
        if self.speed is not None or self.spindle not in (None, "M5"):
            found.append(" ".join(word for word in (self.spindle, self.speed) if word is not None))
        if self.plasma == "M7":
            found.append(self.plasma)
        return found


def prologue(
    state: State, switches: Switches, profile: Profile, first: Block | None, *, in_inches: bool = False
) -> list[str]:
    """The blocks to send before `first`, the first block that goes out. Raises CannotStartError.

    `in_inches`: the program stands in G20 there and is being converted, which these blocks, in mm, must not be.
    """
    blocks = [] if state.absolute is None else ["G90" if state.absolute else "G91"]
    if state.motion in SAYABLE:
        blocks.append(SAYABLE[state.motion])
    elif state.motion not in (None, "cancel") and first is not None and not names_motion(first, profile):
        raise CannotStartError(
            f"This line goes on with {state.motion_name} of a line before it, which cannot be taken up in the middle. "
            "Start at a line that names its own motion (G0, G1, ...)."
        )
    if state.feed is not None:
        blocks.append(f"F{state.feed:g}")
    blocks += switches.blocks()
    return ["G21", *blocks, "G20"] if in_inches else blocks


def first_block(lines: Lines, encoding: str) -> Block | None:
    """The first block with words."""
    for _, raw in lines:
        block = parse_block(decode_line(raw, encoding))
        if block.words:
            return block
    return None


def with_prologue(before: Lines, line: int, blocks: list[str], rest: Lines) -> Lines:
    """The lines of a planner that skips to `line - 1`, under which the prologue goes: when it is done `line` is not,
    and a batch of it alone must not say so. The lines before are numbered 0, for none of them is sent."""
    return chain(((0, raw) for _, raw in before), ((line - 1, block.encode()) for block in blocks), rest)
