"""What grblHAL has besides Grbl's `$` lines: enumerations of settings, errors and alarms, and texts (grbl.md, grblHAL).

A small and true subset. The one rule: None means that the line is Grbl's own business.
"""

from collections.abc import Callable
from typing import Final

from sim.grbl import reports
from sim.grbl.core import Core
from sim.grbl.errors import ALARMS, ERRORS
from sim.grbl.nonvolatile import HAL_TABLE, Setting

GROUPS: Final = {
    0: "Root",
    1: "General",
    2: "Stepper",
    3: "Limits",
    4: "Homing",
    5: "Spindle",
    6: "X-axis",
    7: "Y-axis",
}
_DATATYPES: Final = {"bool": 0, "mask": 1, "int": 5, "float": 6}
_GROUP_OF: Final = {**dict.fromkeys((20, 21), 3), **dict.fromkeys((30, 31, 32), 5), **dict.fromkeys(range(22, 28), 4)}


def extra_lines(core: Core, rest: str) -> list[str] | None:
    """The answer to `$rest`, before the ok."""
    made = _LINES.get(rest)
    if made is not None:
        return made(core)
    if rest.startswith("SED="):
        return _description(rest[4:])
    return None


def _setting(row: Setting) -> str:
    kind = _DATATYPES[row.kind]
    form = {"bool": "", "mask": "N/A", "int": "###0", "float": "#####0.000"}[row.kind]
    group = _GROUP_OF.get(row.number, 2 if row.number < 6 or row.number >= 100 else 1)
    return f"[SETTING:{row.number}|{group}|{row.name.capitalize()}|{row.unit}|{kind}|{form}|||0|0]"


def _settings(_: Core) -> list[str]:
    return [_setting(row) for row in HAL_TABLE.values()]


def _groups(_: Core) -> list[str]:
    return [f"[SETTINGGROUP:{number}|{0}|{name}]" for number, name in GROUPS.items()]


def _alarms(_: Core) -> list[str]:
    return [f"[ALARMCODE:{number}||{text}]" for number, text in ALARMS.items()]


def _errors(_: Core) -> list[str]:
    return [f"[ERRORCODE:{number}||{text}]" for number, text in ERRORS.items()]


def _all(core: Core) -> list[str]:
    return [*_groups(core), *_settings(core), *_errors(core), *_alarms(core)]


def _description(number: str) -> list[str]:
    row = HAL_TABLE.get(int(number)) if number.isdigit() else None
    return [f"[SETTINGDESCR:{row.number}|{row.name.capitalize()}.]"] if row is not None else []


def _help(_: Core) -> list[str]:
    """Free text, without brackets."""
    return ["Help topics:", " Commands", " Settings"]


_LINES: Final[dict[str, Callable[[Core], list[str]]]] = {
    "ES": _settings,
    "EG": _groups,
    "EA": _alarms,
    "EE": _errors,
    "E*": _all,
    "+": reports.settings,
    "I+": reports.build,
    "HELP": _help,
}
