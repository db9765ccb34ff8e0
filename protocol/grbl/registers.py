"""What a Grbl keeps besides its settings, as lines: offsets, start-up blocks, the info text; what is wrong with them.

Not the asking (asking.py). The one rule: what a start-up block would do unasked at every power-up is said by name
before it is written, never found out at the machine.
"""

import re
from collections.abc import Mapping
from typing import Final, Literal

from protocol.errors import LocalError
from protocol.grbl.lines import read_line, words_of

MAX_INFO_CHARS: Final = 80
LINE_CHARS: Final = 79
"""Of a line without blanks (II.1); `$I=` and `$N0=` are part of it."""
MM_PER_INCH: Final = 25.4

SYSTEMS: Final[dict[str, int]] = {
    "active": 0, "G54": 1, "G55": 2, "G56": 3, "G57": 4, "G58": 5, "G59": 6, "G59.1": 7, "G59.2": 8, "G59.3": 9
}  # fmt: skip
"""Coordinate systems by their P word; the last three are grblHAL's."""
PLACES: Final = {"G28": "G28.1", "G30": "G30.1"}
"""Places that are stored where the machine stands."""
CLEARS: Final = {"G92": "G92.1", "TLO": "G49"}
"""Offsets that are not stored but can be cleared."""

_AXES: Final = frozenset("XYZABCUVW")
_MOTIONS: Final = frozenset(
    {0.0, 1.0, 2.0, 3.0, 5.0, 5.1, 28.0, 30.0, 33.0, 38.2, 38.3, 38.4, 38.5, 73.0, 76.0, *map(float, range(81, 90))}
)
_STORING: Final = frozenset({10.0, 28.1, 30.1})
_TAKE_AXES: Final = frozenset({10.0, 28.1, 30.1, 43.1, 51.0, 92.0})
"""Axis words of a block with one of these move nothing."""
_STARTING: Final = {
    3.0: "M3 starts the spindle", 4.0: "M4 starts the spindle", 6.0: "M6 asks for a tool",
    7.0: "M7 starts the mist", 8.0: "M8 starts the coolant",
}  # fmt: skip
_COMMENT: Final = re.compile(r"\([^)]*\)?|;.*")


def offset_block(
    system: str, mode: Literal["here", "absolute"], axes: Mapping[str, float], *, inches: bool = False
) -> str:
    """The block that sets an offset: `here` says which coordinates the machine has now, `absolute` where in machine
    space the origin lies. `axes` in mm; `inches`: the controller reads inches (G20)."""
    words = "".join(
        f"{axis.upper()}{_number(at / MM_PER_INCH if inches else at, 6 if inches else 4)}" for axis, at in axes.items()
    )
    return f"G10L{20 if mode == 'here' else 2}P{SYSTEMS[system]}{words}"


def _number(value: float, digits: int) -> str:
    """Without an exponent, which no controller reads, and without a minus before nothing."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("", "-0") else text


def kept_text(text: str) -> str:
    """What Grbl keeps of a line: no blanks, no comments, no `/`, upper case (II.1)."""
    return "".join(char for char in _COMMENT.sub("", text).upper() if char > " " and char != "/")


def unsendable(prefix: str, text: str) -> str | None:
    """Why `prefix` and `text` cannot be one line to the controller, or None."""
    try:
        read_line(prefix + text, LINE_CHARS + len(text))
    except LocalError as error:
        return str(error)
    room = LINE_CHARS - len(prefix)
    long = len(text.replace(" ", ""))
    return f"{long} characters without blanks; {room} fit" if long > room else None


def dangers(block: str) -> list[str]:
    """What a start-up block would do after every reset, and once when it is written, that somebody must want."""
    bare = kept_text(block)
    if not bare:
        return []
    if bare.startswith("$"):
        return [f"{bare} is a command of the controller, no G-code"]
    words = words_of(bare)
    if words is None:
        return [f"{bare} is not understood; what it does is not known"]
    gcodes = {value for letter, value in words if letter == "G"}
    found = [f"G{value:g} moves the machine" for value in sorted(gcodes & _MOTIONS)]
    found += [f"G{value:g} writes the controller's memory" for value in sorted(gcodes & _STORING)]
    if not found and not gcodes & _TAKE_AXES and any(letter in _AXES for letter, _ in words):
        found.append("axis words without a G word move the machine")
    mcodes = {value for letter, value in words if letter == "M"}
    return found + [_STARTING[value] for value in sorted(mcodes & set(_STARTING))]
