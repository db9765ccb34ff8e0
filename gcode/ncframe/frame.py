"""What the translation hands on: a frame with its place in the program, and a block that waits for its motion.

Not what goes into them; that is blockwriter.py. The one rule: a frame says where the tool stands behind it, so that
whoever stops there knows what is left.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from gcode.executor import Note
from gcode.ncframe.items import Items
from gcode.profile import Code
from gcode.rows import Row
from gcode.segments import DWELL
from gcode.words import Block


class BlockLine(int):
    """The line of a block, that knows which block of the program it is: a line may have several."""

    block: int

    def __new__(cls, line: int, block: int) -> "BlockLine":
        made = super().__new__(cls, line)
        made.block = block
        return made


@dataclass(frozen=True, slots=True)
class Stop:
    """Why nothing of the program may be on its way behind this frame. The machine cannot say where it stands.

    `pauses`: M0. The machine has a frame of it like any other; whoever sends the frames waits for people.
    """

    locate: bool = False
    ends_program: bool = False
    tool_change: bool = False
    pauses: bool = False


@dataclass(slots=True)  # not frozen: there is one a frame, and that doubles the time of making it
class Frame:
    """`end`: where the tool stands behind it, mm from the host's zero, NaN unknown. `share` of the motion `row`."""

    line: int
    items: Items
    end: tuple[float, ...]
    row: Row | None = None
    share: float = 1.0
    stop: Stop | None = None
    tool: int | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves an axis."""
        still = self.row is None or self.row.kind == DWELL
        return not still and (self.items.x is not None or self.items.z is not None)


@dataclass(slots=True)
class Pending:
    """A block whose rows may still be to come. `feed` mm/min and `speed` are those in force behind its words."""

    line: BlockLine
    block: Block
    codes: list[Code]
    values: Mapping[str, float]
    errors: list[Note]
    rows: list[Row] = field(default_factory=list)
    feed: float | None = None
    per_turn: bool = False
    speed: float | None = None

    def note(self, code: str, message: str, letter: str = "") -> None:
        """Something that makes it impossible to send this block, at the word of `letter` where there is one."""
        column = next((word.column for word in reversed(self.block.words) if word.letter == letter), 1)
        self.errors.append(Note(int(self.line), column, code, message))
