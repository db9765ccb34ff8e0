"""The status report `<State[:sub]|field|...>` of Grbl 1.1 and grblHAL (grbl II.5), read into one dataclass.

Not what follows from it: that is `protocol.machine.reduce` and the engine. The one rule: a report with a field that
is not as the sheet says is no report at all; half a report would be half a truth about a machine that moves.
"""

import re
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from protocol.events import Status

AXES: Final = ("x", "y", "z", "a", "b", "c", "u", "v", "w")
"""In the order of the coordinates, where the controller names none itself ([AXS:])."""

STATES: Final[dict[str, Status]] = {
    "Idle": "idle",
    "Run": "run",
    "Hold": "hold",
    "Jog": "jog",
    "Alarm": "alarm",
    "Door": "door",
    "Check": "check",
    "Home": "home",
    "Sleep": "sleep",
    "Tool": "tool",
}

PINS: Final[dict[str, str]] = {
    **{axis.upper(): f"limit_{axis}" for axis in AXES},
    "P": "probe",
    "O": "probe_disconnected",
    "R": "reset",
    "H": "feed_hold",
    "S": "cycle_start",
    "D": "safety_door",
    "L": "block_delete",
    "T": "optional_stop",
    "E": "emergency_stop",
    "F": "motor_fault",
    "M": "motor_warning",
    "Q": "single_block",
}
"""Letters of `Pn:` and what they name; a letter that is not here is shown as `pin_<letter>`."""

ACCESSORIES: Final[dict[str, str]] = {
    "S": "spindle_cw",
    "C": "spindle_ccw",
    "F": "flood",
    "M": "mist",
    "T": "tool_change",
    "E": "encoder",
}
"""Letters of `A:`."""

INCH_DECIMALS: Final = 4
"""Grbl prints coordinates with 3 decimals in mm and with 4 in inches: each report says itself what `$13` is."""
MM_PER_INCH: Final = 25.4

_MOST_VALUES: Final = 16
_DECIMAL = r"[-+]?(?:\d{1,12}(?:\.\d{0,9})?|\.\d{1,9})"
_NUMBER = re.compile(_DECIMAL, re.ASCII)
_NUMBERS = re.compile(rf"{_DECIMAL}(?:,{_DECIMAL}){{0,{_MOST_VALUES - 1}}}", re.ASCII)
_INTEGER = re.compile(r"\d{1,9}", re.ASCII)
_INTEGERS = re.compile(rf"\d{{1,9}}(?:,\d{{1,9}}){{0,{_MOST_VALUES - 1}}}", re.ASCII)
_INCH = rf"[^.,]*\.[^,]{{{INCH_DECIMALS}}}"
_INCHES = re.compile(rf"{_INCH}(?:,{_INCH})*")
_MOST_FIELDS: Final = 40
"""grblHAL's full report has 15 fields; a line that has more than this is noise."""


class StatusReport(NamedTuple):  # not a frozen dataclass: of so many fields that takes eight times as long to make
    """Everything a report can hold. None: the field was not there; positions and feeds in mm, whatever `$13` is.

    `pins` None cannot be: absent means that no input is active. `accessories` are absent with `Ov` when all are off.
    """

    status: Status
    substate: int | None = None
    machine_position: tuple[float, ...] | None = None
    work_position: tuple[float, ...] | None = None
    work_offset: tuple[float, ...] | None = None
    feed_mm_min: float | None = None
    spindle_rpm: float | None = None
    spindle_actual_rpm: float | None = None
    overrides: tuple[int, int, int] | None = None
    accessories: frozenset[str] | None = None
    planner_free: int | None = None
    rx_free: int | None = None
    line: int | None = None
    pins: frozenset[str] = frozenset()
    work_system: str | None = None
    scaled_axes: str | None = None
    mpg: bool | None = None
    homed: bool | None = None
    diameter: bool | None = None
    tool: int | None = None
    probe: int | None = None
    tool_reference: bool | None = None
    auto_report: bool | None = None
    distance_to_go: tuple[float, ...] | None = None
    sd: str | None = None
    input_waited: int | None = None
    firmware: str | None = None
    other: tuple[tuple[str, str], ...] = ()


class MalformedReportError(ValueError):
    """The line begins like a report and is none. Stays inside the codec."""


def number(text: str) -> float:
    """A plain decimal number. Raises MalformedReportError."""
    if not _NUMBER.fullmatch(text):
        raise MalformedReportError(f"{text[:20]!r} is no number")
    return float(text)


def numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between, _MOST_VALUES at most. Raises MalformedReportError."""
    if not _NUMBERS.fullmatch(text):
        raise MalformedReportError(f"{text[:20]!r} is not a list of numbers")
    return tuple(map(float, text.split(",")))


def integer(text: str) -> int:
    """A whole number of at most 9 digits. Raises MalformedReportError."""
    if not _INTEGER.fullmatch(text):
        raise MalformedReportError(f"{text[:20]!r} is no whole number")
    return int(text)


def integers(text: str) -> tuple[int, ...]:
    """Whole numbers with commas between. Raises MalformedReportError."""
    if not _INTEGERS.fullmatch(text):
        raise MalformedReportError(f"{text[:20]!r} is not a list of whole numbers")
    return tuple(map(int, text.split(",")))


def are_inches(coordinates: str) -> bool:
    """Whether coordinates as printed are inches."""
    return _INCHES.fullmatch(coordinates) is not None


def in_mm(values: tuple[float, ...], *, inches: bool) -> tuple[float, ...]:
    """Coordinates in mm, to the micrometre's tenth: what inches with 4 decimals can tell."""
    return tuple(round(value * MM_PER_INCH, 5) for value in values) if inches else values


def parse_report(text: str) -> StatusReport:
    """Read `<...>`. Raises MalformedReportError."""
    if len(text) < 3 or text[0] != "<" or text[-1] != ">":
        raise MalformedReportError("a report ends with '>'")
    head, *fields = text[1:-1].split("|")
    if len(fields) > _MOST_FIELDS:
        raise MalformedReportError("too many fields")
    found: dict[str, Any] = _read_state(head)
    other: list[tuple[str, str]] = []
    seen: set[str] = set()
    inches = False
    for part in fields:
        key, colon, value = part.partition(":")
        if not colon or not key or key in seen:
            raise MalformedReportError(f"field {part[:20]!r}")
        seen.add(key)
        if key in _COORDINATES:
            inches = inches or are_inches(value)
            found[_COORDINATES[key]] = numbers(value)
        elif key in _FIELDS:
            found |= _FIELDS[key](value)
        else:
            other.append((key, value))
    if {"F", "FS"} <= seen or {"MPos", "WPos"} <= seen:
        raise MalformedReportError("two fields that exclude each other")
    if "Ov" in seen:
        found.setdefault("accessories", frozenset())
    return StatusReport(**(_scaled(found) if inches else found), other=tuple(other))


def _scaled(found: dict[str, Any]) -> dict[str, Any]:
    for name in _COORDINATES.values():
        if name in found:
            found[name] = in_mm(found[name], inches=True)
    if "feed_mm_min" in found:
        found["feed_mm_min"] = round(found["feed_mm_min"] * MM_PER_INCH, 3)
    return found


def _read_state(head: str) -> dict[str, Any]:
    name, colon, substate = head.partition(":")
    if name not in STATES:
        raise MalformedReportError(f"state {name[:20]!r}")
    return {"status": STATES[name], "substate": integer(substate) if colon else None}


def _flag(value: str) -> bool:
    if value not in ("0", "1"):
        raise MalformedReportError(f"{value[:20]!r} is neither 0 nor 1")
    return value == "1"


def _letters(value: str, names: dict[str, str], unknown: str) -> frozenset[str]:
    if len(value) > len(names) + _MOST_VALUES or not (value.isalnum() or not value) or not value.isascii():
        raise MalformedReportError(f"letters {value[:20]!r}")
    return frozenset(names.get(letter, unknown + letter.lower()) for letter in value)


def _feed(value: str) -> dict[str, Any]:
    return {"feed_mm_min": number(value)}


def _feed_and_speed(value: str) -> dict[str, Any]:
    """`FS:feed,programmed rpm[,actual rpm]`."""
    values = numbers(value)
    if not 2 <= len(values) <= 3:
        raise MalformedReportError("FS has two or three values")
    actual = values[2] if len(values) == 3 else None
    return {"feed_mm_min": values[0], "spindle_rpm": values[1], "spindle_actual_rpm": actual}


def _overrides(value: str) -> dict[str, Any]:
    percents = integers(value)
    if len(percents) != 3:
        raise MalformedReportError("Ov has three values")
    return {"overrides": percents}


def _buffers(value: str) -> dict[str, Any]:
    values = integers(value)
    if len(values) != 2:
        raise MalformedReportError("Bf has two values")
    return {"planner_free": values[0], "rx_free": values[1]}


def _homed(value: str) -> dict[str, Any]:
    """`H:0`, `H:1` or `H:1,mask`."""
    flag, comma, mask = value.partition(",")
    if comma:
        integer(mask)
    return {"homed": _flag(flag)}


def _text(name: str) -> Callable[[str], dict[str, Any]]:
    return lambda value: {name: value}


def _integer(name: str) -> Callable[[str], dict[str, Any]]:
    return lambda value: {name: integer(value)}


def _bool(name: str) -> Callable[[str], dict[str, Any]]:
    return lambda value: {name: _flag(value)}


_COORDINATES: Final = {
    "MPos": "machine_position",
    "WPos": "work_position",
    "WCO": "work_offset",
    "DTG": "distance_to_go",
}

_FIELDS: Final[dict[str, Callable[[str], dict[str, Any]]]] = {
    "F": _feed,
    "FS": _feed_and_speed,
    "Ov": _overrides,
    "Bf": _buffers,
    "Ln": _integer("line"),
    "Pn": lambda value: {"pins": _letters(value, PINS, "pin_")},
    "A": lambda value: {"accessories": _letters(value, ACCESSORIES, "accessory_")},
    "WCS": _text("work_system"),
    "Sc": _text("scaled_axes"),
    "MPG": _bool("mpg"),
    "H": _homed,
    "D": _bool("diameter"),
    "T": _integer("tool"),
    "P": _integer("probe"),
    "TLR": _bool("tool_reference"),
    "AR": lambda value: {"auto_report": value == "" or integer(value) > 0},
    "SD": _text("sd"),
    "In": lambda value: {"input_waited": int(number(value))},
    "FW": _text("firmware"),
}
