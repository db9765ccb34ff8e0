"""A virtual machine's settings as text: the query of a port `sim:?speed_factor=20&repeat=reack`.

The one rule: nothing is guessed; an unknown key or a wrong value is a ValueError that says what is allowed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final, Generic, TypeVar
from urllib.parse import parse_qsl

from sim.elvinto.settings import SimSettings
from sim.faults import FaultRates
from sim.grbl.nonvolatile import HAL_TABLE
from sim.grbl.simsettings import SimSettings as GrblSettings
from sim.motion import AXES
from sim.ncframe.settings import CHECKS, FRAMINGS
from sim.ncframe.settings import SimSettings as LatheSettings

EXECUTED_LIMIT: Final = 10_000
"""A machine that runs for weeks inside the daemon must not keep every block it ever executed."""

S = TypeVar("S")

_RATES: Final = frozenset({"loss", "flip", "duplicate", "noise", "noise_bytes", "delay", "delay_s"})
_WIRE: Final = frozenset({"seed", "baud"})

_Take = Callable[[dict[str, Any], str, str], None]
"""Puts the value of a key that is no plain field into the settings."""


@dataclass(frozen=True, slots=True)
class SimOptions(Generic[S]):
    """All that a query can say. `baud` 0: the wire takes no time."""

    settings: S
    faults: FaultRates | None
    seed: int
    baud: int


@dataclass(frozen=True, slots=True)
class _Reader(Generic[S]):
    """How the settings of one kind of machine are read from a query."""

    make: Callable[..., S]
    plain: Mapping[str, type]
    """Fields that are one number, one word or true/false."""
    choices: Mapping[str, tuple[str, ...]]
    special: Mapping[str, _Take]
    """Keys of other fields; `set_N` stands for `set_` and any number."""
    first: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(self.plain) | frozenset(self.special) | _RATES | _WIRE

    def read(self, query: str) -> SimOptions[S]:
        text = query.removeprefix("sim:").removeprefix("?")
        pairs = parse_qsl(text, keep_blank_values=True, strict_parsing=True) if text else []
        settings: dict[str, Any] = {"executed_limit": EXECUTED_LIMIT, **self.first}
        rates: dict[str, Any] = {}
        wire = {"seed": 0, "baud": 0}
        for key, value in pairs:
            name = "set_N" if key.startswith("set_") else key
            if key in _RATES:
                rates[key] = _read(key, value, int if key == "noise_bytes" else float)
            elif key in wire:
                wire[key] = _read(key, value, int)
            elif name in self.special:
                self.special[name](settings, key, value)
            elif key in self.plain:
                settings[key] = _read(key, value, self.plain[key], self.choices.get(key))
            else:
                raise ValueError(
                    f"unknown key {key!r} for the virtual machine; known are {', '.join(sorted(self.keys))}"
                )
        return SimOptions(self.make(**settings), FaultRates(**rates) if rates else None, wire["seed"], wire["baud"])


def options_from_query(query: str) -> SimOptions[SimSettings]:
    """An ElVinto machine; with or without `sim:` and `?` before it. Raises ValueError, OSError for `sd`."""
    return _ELVINTO.read(query)


def grbl_options_from_query(query: str) -> SimOptions[GrblSettings]:
    """A Grbl controller, likewise. Raises ValueError."""
    return _GRBL.read(query)


def lathe_options_from_query(query: str) -> SimOptions[LatheSettings]:
    """A lathe behind NC frames, likewise. Raises ValueError."""
    return _LATHE.read(query)


READERS: Mapping[str, Callable[[str], SimOptions[Any]]] = {
    "elvinto": options_from_query,
    "grbl": grbl_options_from_query,
    "ncframe": lathe_options_from_query,
}
"""By the protocol that a virtual machine speaks."""


def settings_from_query(query: str) -> SimSettings:
    """The settings of an ElVinto machine alone; a query with faults in it is fine. Raises ValueError."""
    return options_from_query(query).settings


def sd_folder(path: Path) -> dict[str, bytes]:
    """The files of a folder as the root of an SD card. Raises OSError."""
    return {entry.name: entry.read_bytes() for entry in sorted(path.iterdir()) if entry.is_file()}


def _plain(settings: object, without: frozenset[str]) -> dict[str, type]:
    return {
        each.name: type(getattr(settings, each.name))
        for each in fields(settings)  # type: ignore[arg-type]
        if each.name not in without
    }


def _read(key: str, value: str, kind: type, choices: tuple[str, ...] | None = None) -> Any:
    if kind is bool:
        if value.lower() not in ("true", "false", "1", "0"):
            raise ValueError(f"{key} must be true or false, not {value!r}")
        return value.lower() in ("true", "1")
    if kind is str:
        if choices is not None and value not in choices:
            raise ValueError(f"{key} must be one of {', '.join(choices)}, not {value!r}")
        return value
    try:
        return kind(value)
    except ValueError:
        raise ValueError(f"{key} must be a number{' without a fraction' * (kind is int)}, not {value!r}") from None


# ElVinto.


def _take_range(settings: dict[str, Any], key: str, value: str) -> None:
    low, colon, high = value.partition(":")
    if not colon:
        raise ValueError(f"{key} must be LOW:HIGH in mm, not {value!r}")
    travel = settings.setdefault("travel", dict(SimSettings().travel))
    travel[key[-1].upper()] = (_read(key, low, float), _read(key, high, float))


def _take_card(settings: dict[str, Any], _: str, value: str) -> None:
    settings["sd_files"] = None if value == "none" else sd_folder(Path(value))


_ELVINTO: Final = _Reader(
    SimSettings,
    _plain(SimSettings(), frozenset({"travel", "start_position", "sd_files"})),
    {
        "repeat": ("silent", "reack"),
        "checksum_scope": ("message", "gcode"),
        "tool_change": ("report", "wait"),
        "sd_fs": ("FAT", "NO"),
        "dir_end": ("DIR_END", "END_BEGIN"),
    },
    {"sd": _take_card, **{f"travel_{axis.lower()}": _take_range for axis in AXES}},
)

KEYS: Final = _ELVINTO.keys
"""All keys of an ElVinto machine: fields of its settings and FaultRates, `travel_x=0:800`, `seed`, `baud`, `sd`."""


# Grbl.


def _take_length(settings: dict[str, Any], key: str, value: str) -> None:
    travel = settings.setdefault("travel", dict(GrblSettings().travel))
    travel[key[-1].upper()] = _read(key, value, float)


def _take_start(settings: dict[str, Any], key: str, value: str) -> None:
    place = list(settings.get("start_position", GrblSettings().start_position))
    place["xyz".index(key[-1])] = _read(key, value, float)
    settings["start_position"] = tuple(place)


def _take_plate(settings: dict[str, Any], key: str, value: str) -> None:
    settings["probe_z"] = None if value == "none" else _read(key, value, float)


def _take_dollar(settings: dict[str, Any], key: str, value: str) -> None:
    number = key.removeprefix("set_")
    if not number.isdigit():
        raise ValueError(f"{key} must name a setting by its number, as in set_110")
    if int(number) not in HAL_TABLE:
        raise ValueError(f"{key}: there is no setting ${number}")
    settings.setdefault("dollar", {})[int(number)] = _read(key, value, float)


def _take_grbl_card(settings: dict[str, Any], _: str, value: str) -> None:
    files = None if value == "none" else sd_folder(Path(value))
    settings["card"] = None if files is None else {name: data.decode("latin-1") for name, data in files.items()}


_GRBL: Final = _Reader(
    GrblSettings,
    _plain(GrblSettings(), frozenset({"travel", "start_position", "probe_z", "dollar", "card"})),
    {"flavour": ("1.1h", "grblHAL")},
    {
        "probe_z": _take_plate,
        "sd": _take_grbl_card,
        "set_N": _take_dollar,
        **{f"travel_{axis}": _take_length for axis in "xyz"},
        **{f"start_{axis}": _take_start for axis in "xyz"},
    },
)

GRBL_KEYS: Final = _GRBL.keys
"""All keys of a Grbl controller; `set_N` is `set_110=8000` and its like."""


# NC frames.

_LATHE: Final = _Reader(LatheSettings, _plain(LatheSettings(), frozenset()), {"check": CHECKS, "framing": FRAMINGS}, {})

LATHE_KEYS: Final = _LATHE.keys
"""All keys of a lathe behind NC frames."""
