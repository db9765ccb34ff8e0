"""The virtual machine's settings as text: the query of a port `sim:?speed_factor=20&repeat=reack`.

The one rule: nothing is guessed; an unknown key or a wrong value is a ValueError that says what is allowed.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl

from sim.elvinto.settings import SimSettings
from sim.faults import FaultRates
from sim.motion import AXES

EXECUTED_LIMIT: Final = 10_000
"""A machine that runs for weeks inside the daemon must not keep every block it ever executed."""

_CHOICES: Final[dict[str, tuple[str, ...]]] = {
    "repeat": ("silent", "reack"),
    "checksum_scope": ("message", "gcode"),
    "tool_change": ("report", "wait"),
    "sd_fs": ("FAT", "NO"),
    "dir_end": ("DIR_END", "END_BEGIN"),
}

_SETTINGS: Final = {field.name: type(getattr(SimSettings(), field.name)) for field in fields(SimSettings)}
_NOT_TEXT: Final = frozenset({"travel", "start_position", "sd_files"})
_RATES: Final = frozenset({"loss", "flip", "duplicate", "noise", "noise_bytes", "delay", "delay_s"})
_TRAVEL: Final = frozenset(f"travel_{axis.lower()}" for axis in AXES)
_OWN: Final = frozenset({"seed", "baud", "sd"})

KEYS: Final = (frozenset(_SETTINGS) - _NOT_TEXT) | _RATES | _TRAVEL | _OWN
"""All keys: fields of SimSettings and FaultRates, `travel_x=0:800`, `seed`, `baud`, `sd` (folder or none)."""


@dataclass(frozen=True, slots=True)
class SimOptions:
    """All that a query can say. `baud` 0: the wire takes no time."""

    settings: SimSettings
    faults: FaultRates | None
    seed: int
    baud: int


def settings_from_query(query: str) -> SimSettings:
    """The settings alone; a query with faults in it is fine. Raises ValueError."""
    return options_from_query(query).settings


def options_from_query(query: str) -> SimOptions:
    """`speed_factor=20&repeat=reack`, with or without `sim:` and `?` before it. Raises ValueError, OSError for `sd`."""
    text = query.removeprefix("sim:").removeprefix("?")
    pairs = parse_qsl(text, keep_blank_values=True, strict_parsing=True) if text else []
    settings: dict[str, Any] = {"executed_limit": EXECUTED_LIMIT}
    rates: dict[str, Any] = {}
    own = {"seed": 0, "baud": 0}
    travel = dict(SimSettings().travel)
    for key, value in pairs:
        if key in _RATES:
            rates[key] = _read(key, value, int if key == "noise_bytes" else float)
        elif key in _TRAVEL:
            travel[key[-1].upper()] = _range(key, value)
        elif key == "sd":
            settings["sd_files"] = None if value == "none" else sd_folder(Path(value))
        elif key in own:
            own[key] = _read(key, value, int)
        elif key in KEYS:
            settings[key] = _read(key, value, _SETTINGS[key])
        else:
            raise ValueError(f"unknown key {key!r} for the virtual machine; known are {', '.join(sorted(KEYS))}")
    return SimOptions(
        SimSettings(**settings, travel=travel), FaultRates(**rates) if rates else None, own["seed"], own["baud"]
    )


def sd_folder(path: Path) -> dict[str, bytes]:
    """The files of a folder as the root of an SD card. Raises OSError."""
    return {entry.name: entry.read_bytes() for entry in sorted(path.iterdir()) if entry.is_file()}


def _read(key: str, value: str, kind: type) -> Any:
    if kind is bool:
        if value.lower() not in ("true", "false", "1", "0"):
            raise ValueError(f"{key} must be true or false, not {value!r}")
        return value.lower() in ("true", "1")
    if kind is str:
        if key in _CHOICES and value not in _CHOICES[key]:
            raise ValueError(f"{key} must be one of {', '.join(_CHOICES[key])}, not {value!r}")
        return value
    try:
        return kind(value)
    except ValueError:
        raise ValueError(f"{key} must be a number{' without a fraction' * (kind is int)}, not {value!r}") from None


def _range(key: str, value: str) -> tuple[float, float]:
    low, colon, high = value.partition(":")
    if not colon:
        raise ValueError(f"{key} must be LOW:HIGH in mm, not {value!r}")
    return _read(key, low, float), _read(key, high, float)
