"""What a block says beside its motion: why it must travel alone, and what a tool changer has to hear of it.

Not what is done about it (upcoming.py, toolside.py). The one rule: a code that nobody knows is a barrier.
"""

from dataclasses import dataclass

import numpy as np

from gcode.blocks import Blocks, CodeTable
from gcode.columns import Columns
from gcode.profile import Profile
from gcode.words import Block
from jobs.toolblocks import set_by

COOLANT = frozenset({"mist", "flood", "coolant_off"})


@dataclass(frozen=True, slots=True)
class Barrier:
    """Why a block travels alone (elvinto §7)."""

    locate: bool = False
    ends_program: bool = False
    tool_change: bool = False
    pauses: bool = False
    set_tool: int | None = None

    @property
    def of_tools(self) -> bool:
        """It is an M6 or an M61."""
        return self.tool_change or self.set_tool is not None


def barrier_of(block: Block, profile: Profile) -> Barrier | None:
    """What makes `block` travel alone (elvinto §7); None for the many that do not."""
    found = locate = ends_program = tool_change = set_tool = False
    for word in block.words:
        if word.letter in profile.barrier_letters:
            found = True
        if word.letter not in profile.code_letters:
            continue
        code = profile.codes.get(word.code)
        if code is None:
            # Nobody knows what it does, so nothing else may hang on it.
            found = locate = True
        elif code.barrier:
            found = True
            locate |= code.locate
            ends_program |= code.effect == "program_end"
            tool_change |= code.effect in ("tool_change", "load_tool")
            set_tool |= code.effect == "set_tool"
    if not found:
        return None
    return Barrier(locate, ends_program, tool_change, set_tool=set_by(block) if set_tool else None)


def io_words(columns: Columns, blocks: Blocks, table: CodeTable) -> dict[int, tuple[tuple[str, int], ...]]:
    """What the rows say to a tool changer: T, and M7 to M9 where they switch coolant."""
    words = [("T", int(columns.row[at]), int(columns.value[at])) for at in np.flatnonzero(columns.letter == ord("T"))]
    for number, rows in blocks.settings.items():
        code = table.codes[number]
        if code.sets in COOLANT and code.name in ("M7", "M8", "M9"):
            words += [("M", int(row), int(code.name[1:])) for row in rows]
    found: dict[int, tuple[tuple[str, int], ...]] = {}
    for letter, row, value in words:
        found[row] = (*found.get(row, ()), (letter, value))
    return found
