"""A line of G-code to words and modal groups, with the errors that are found word by word (grbl II.8, II.10).

Grbl reads from left to right and stops at the first thing it does not like; so does this. The one rule: nothing here
looks at the machine's state; what the words mean together is checked in `gcodecheck.py`.
"""

import re
from dataclasses import dataclass, field
from typing import Final, Literal

from sim.grbl.errors import Refused
from sim.grbl.simsettings import SimSettings

AxisUser = Literal["motion", "nonmodal", "length"]
"""Which command of the block the axis words belong to."""

MAX_TOOL: Final = 255
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
_VALUES: Final = frozenset("FIJKLNPRSTXYZ")
_HAL_VALUES: Final = _VALUES | frozenset("HQ")
_NOT_NEGATIVE: Final = frozenset("FNPTS")

# Code (times ten, so that G38.2 is 382) to its modal group.
_G: Final[dict[int, str]] = {
    **dict.fromkeys((0, 10, 20, 30, 382, 383, 384, 385, 800), "motion"),
    **dict.fromkeys((40, 100, 280, 281, 300, 301, 530, 920, 921), "nonmodal"),
    **dict.fromkeys((170, 180, 190), "plane"),
    **dict.fromkeys((200, 210), "units"),
    **dict.fromkeys((900, 910), "distance"),
    911: "arc distance",
    **dict.fromkeys((930, 940), "feed mode"),
    400: "compensation",
    **dict.fromkeys((431, 490), "length"),
    **dict.fromkeys((540, 550, 560, 570, 580, 590), "system"),
    610: "path",
}
_HAL_G: Final[dict[int, str]] = _G | {
    **dict.fromkeys((591, 592, 593), "system"),
    **dict.fromkeys((730, 810, 820, 830), "motion"),
    **dict.fromkeys((980, 990), "retract"),
    500: "scaling",
    430: "length",
}
_TAKES_AXES: Final[dict[int, AxisUser]] = {
    **dict.fromkeys((0, 10, 20, 30, 382, 383, 384, 385, 730, 810, 820, 830), "motion"),
    **dict.fromkeys((100, 280, 300, 920), "nonmodal"),
    **dict.fromkeys((430, 431, 490), "length"),
}
_FRACTIONS: Final = frozenset({28, 30, 38, 43, 61, 90, 91, 92})
"""G numbers that may have a decimal: a wrong decimal is error:20 with them, error:23 with others."""

_M: Final[dict[int, str]] = {
    **dict.fromkeys((0, 1, 2, 30), "flow"),
    **dict.fromkeys((3, 4, 5), "spindle"),
    **dict.fromkeys((8, 9), "coolant"),
}


@dataclass(slots=True)
class Block:
    """What a line says. Codes as text: "G38.2", "M30"; one for each modal group."""

    codes: dict[str, str] = field(default_factory=dict[str, str])
    values: dict[str, float] = field(default_factory=dict[str, float])
    axis_user: AxisUser | None = None

    def code(self, group: str) -> str:
        return self.codes.get(group, "")

    def axes(self) -> list[str]:
        return [letter for letter in "XYZ" if letter in self.values]


def read_number(text: str, at: int) -> tuple[float, int]:
    """A number at `at` and where it ends. Raises Refused(2)."""
    found = _NUMBER.match(text, at)
    if found is None:
        raise Refused(2)
    return float(found.group()), found.end()


def read_block(text: str, kind: SimSettings) -> Block:
    """All words of a line. Raises Refused."""
    block = Block()
    at = 0
    while at < len(text):
        letter = text[at]
        if not "A" <= letter <= "Z":
            raise Refused(1)
        value, at = read_number(text, at + 1)
        if letter == "G":
            _add_g(block, value, kind)
        elif letter == "M":
            _add_m(block, value, kind)
        else:
            _add_value(block, letter, value, kind)
    return block


def _add_g(block: Block, value: float, kind: SimSettings) -> None:
    whole, fraction = int(value), round(100 * (value - int(value)))
    tenths = 10 * whole + fraction // 10 if fraction % 10 == 0 else -1
    group = (_HAL_G if kind.hal else _G).get(tenths)
    if group is None:
        known = (_HAL_G if kind.hal else _G).get(10 * whole)
        raise Refused(23 if known is not None and fraction and whole not in _FRACTIONS else 20)
    user = _TAKES_AXES.get(tenths)
    if user is not None:
        if block.axis_user is not None:
            raise Refused(24)
        block.axis_user = user
    _claim(block, group, f"G{tenths / 10:g}")


def _add_m(block: Block, value: float, kind: SimSettings) -> None:
    number = int(value)
    if round(100 * (value - number)):
        raise Refused(23)
    group = _M.get(number)
    if number == 7 and kind.mist:
        group = "coolant"
    if kind.hal and number in (6, 61):
        group = "tool"
    if group is None:
        raise Refused(20)
    _claim(block, group, f"M{number}")


def _claim(block: Block, group: str, code: str) -> None:
    if group in block.codes:
        raise Refused(21)
    block.codes[group] = code


def _add_value(block: Block, letter: str, value: float, kind: SimSettings) -> None:
    if letter not in (_HAL_VALUES if kind.hal else _VALUES):
        raise Refused(20)
    if letter == "T" and value > MAX_TOOL and not kind.hal:
        raise Refused(38)
    if letter in block.values:
        raise Refused(25)
    if letter in _NOT_NEGATIVE and value < 0:
        raise Refused(4)
    block.values[letter] = float(int(value)) if letter in "LNT" else value
