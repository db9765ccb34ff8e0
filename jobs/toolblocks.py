"""What is sent in the place of M6 and M61 to a controller that does not know them, and what restores it afterwards.

Not when it goes out (toolside.py) and not what the profile says of the codes (gcode/toolcodes.py). The one rule: behind
a tool change the controller is in the modes in which the program left it, whatever the blocks before have set.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from gcode.clean import clean
from gcode.executor import MM_PER_INCH
from gcode.held import SYSTEM_NAMES
from gcode.profile import Profile
from gcode.reentry import number
from gcode.state import State
from gcode.words import Block

ALONE = frozenset({"M6", "M61"})
BY_ITSELF = frozenset({"rapid", "feed", "cancel"})
"""Motion modes that a block without coordinates can set. In another one a block that goes on with it is refused."""
NEUTRAL = "G21G90"
"""What the blocks of the configuration are written in: mm, absolute."""


@dataclass(frozen=True, slots=True)
class ToolBlocks:
    """`position`: how the machine gets to where tools are changed. `spindle_wait_s`: until the spindle has its speed,
    with a laser there is none. `knows_m61`: the controller is sent M61 too."""

    position: tuple[str, ...] = ()
    spindle_wait_s: float = 3.0
    laser: bool = False
    knows_m61: bool = False


def leading(blocks: ToolBlocks, state: State) -> list[str]:
    """In the place of M6: to the change position, then spindle and coolant off."""
    way = [NEUTRAL, *blocks.position] if blocks.position else []
    return [*way, "M5", *(["M9"] if state.mist or state.flood else [])]


def rest_of(block: Block) -> str:
    """What else stands in the line of an M6 or M61: it is executed behind the change."""
    m61 = any(word.letter == "M" and word.code == "M61" for word in block.words)
    words = [
        word
        for word in block.words
        if not (word.letter == "M" and word.code in ALONE) and not (m61 and word.letter == "Q")
    ]
    return clean(replace(block, words=tuple(words)))


def restoring(blocks: ToolBlocks, state: State, profile: Profile) -> Iterator[str]:
    """The modes of `state`, which the program has left. The feed comes with the mode: Grbl refuses a G1 without one."""
    modes = [
        "G20" if state.inches else "G21",
        f"G{state.plane}",
        *([] if state.absolute is None else ["G90" if state.absolute else "G91"]),
        f"G{state.feed_mode}",
        SYSTEM_NAMES[state.system - 1],
    ]
    yield "".join(name for name in modes if name in profile.codes)
    if state.spindle:
        yield f"{'M3' if state.spindle > 0 else 'M4'}S{number(state.speed)}"
        if blocks.spindle_wait_s > 0.0 and not blocks.laser:
            yield f"G4P{number(blocks.spindle_wait_s)}"
    if state.mist:
        yield "M7"
    if state.flood:
        yield "M8"
    if state.motion in BY_ITSELF and state.motion_name is not None:
        yield from _motion(state)


def _motion(state: State) -> Iterator[str]:
    lasting = state.feed is not None and state.feed_mode != 93
    feed = f"F{number((state.feed or 0.0) / (MM_PER_INCH if state.inches else 1.0))}" if lasting else ""
    if feed or state.motion != "feed":
        yield f"{state.motion_name}{feed}"


def wanted_by(block: Block, state: State) -> int | None:
    """The tool of an M6: T in its line counts."""
    named = [int(word.value) for word in block.words if word.letter == "T"]
    return named[-1] if named else state.selected


def set_by(block: Block) -> int | None:
    """The tool of an M61."""
    return next((int(word.value) for word in block.words if word.letter == "Q"), None)
