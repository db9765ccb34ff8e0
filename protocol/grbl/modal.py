"""The modal groups behind the words of `$G` (grbl II.6): which group a word belongs to, under which name it is shown.

Not their meaning (gcode/). The one rule: a word that no group knows is not lost, it stands under `other`.
"""

from collections.abc import Iterable
from typing import Final

_GCODES: Final[dict[str, tuple[str, ...]]] = {
    "motion": (
        "G0", "G1", "G2", "G3", "G5", "G5.1", "G33", "G38.2", "G38.3", "G38.4", "G38.5", "G73", "G76", "G80",
        "G81", "G82", "G83", "G84", "G85", "G86", "G87", "G88", "G89",
    ),
    "coordinate_system": ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"),
    "plane": ("G17", "G18", "G19"),
    "units": ("G20", "G21"),
    "distance": ("G90", "G91"),
    "arc_distance": ("G90.1", "G91.1"),
    "feed_mode": ("G93", "G94", "G95"),
    "spindle_mode": ("G96", "G97"),
    "cutter_compensation": ("G40", "G41", "G42", "G41.1", "G42.1"),
    "tool_length": ("G43", "G43.1", "G43.2", "G49"),
    "retract": ("G98", "G99"),
    "scaling": ("G50", "G51"),
    "path_control": ("G61", "G61.1", "G64"),
    "diameter": ("G7", "G8"),
    "program": ("M0", "M1", "M2", "M30", "M60"),
    "spindle": ("M3", "M4", "M5"),
    "overrides": ("M48", "M49", "M50", "M51", "M53", "M56"),
}  # fmt: skip
_COOLANT: Final = ("M7", "M8", "M9")
_VALUES: Final = {"T": "tool", "F": "feed", "S": "speed"}
_GROUP_OF: Final = {word: group for group, words in _GCODES.items() for word in words}


def groups(words: Iterable[str]) -> dict[str, str | list[str]]:
    """Every group that `$G` has named, with its word; `coolant` and `other` are lists. The F word is in the unit of
    `$13`, which `$G` does not tell."""
    found: dict[str, str | list[str]] = {}
    coolant: list[str] = []
    other: list[str] = []
    for word in words:
        group = _GROUP_OF.get(word) or _VALUES.get(word[:1])
        if word in _COOLANT:
            coolant.append(word)
        elif group is None or group in found:
            other.append(word)
        else:
            found[group] = word
    return {**found, "coolant": coolant, "other": other}
