"""What a controller accepts, as data: one TOML file each in gcode/profiles/. Not the meaning of a code.

A code's `effect` is a name that interpreter.py has a rule for. The one rule: what is not in the table does not exist.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal, get_args

CodeStatus = Literal["exists", "ignored", "differs", "missing"]

Effect = Literal[
    "none",
    # Motion modes (rs274 §2, group 1).
    "rapid",
    "feed",
    "arc_cw",
    "arc_ccw",
    "probe",
    "thread",
    "rigid_tap",
    "not_followed",
    "drill",
    "drill_dwell",
    "peck",
    "chip_break",
    "tap",
    "tap_left",
    "bore",
    "bore_stop",
    "bore_dwell",
    "bore_manual",
    "back_bore",
    "cancel",
    # What changes the meaning of the words behind it.
    "absolute",
    "relative",
    "remember_distance",
    "restore_distance",
    "arc_absolute",
    "arc_relative",
    "inches",
    "millimetres",
    "inverse_time",
    "per_minute",
    "per_revolution",
    "diameter_on",
    "diameter_off",
    "system_1",
    "system_2",
    "system_3",
    "system_4",
    "system_5",
    "system_6",
    "system_7",
    "system_8",
    "system_9",
    "length_table",
    "length_direct",
    "length_add",
    "length_off",
    "save_modes",
    "restore_modes",
    "ignore_home",
    "heed_home",
    # What acts by itself.
    "home",
    "home_and_back",
    "set_position",
    "zero_all",
    "zero_z",
    "tool_change",
    "load_tool",
    "set_tool",
    "turn_a",
    "mill_plane",
    "dwell",
    "set_data",
    "go_home",
    "go_second_home",
    "store_home",
    "store_second_home",
    "machine_coordinates",
    "clear_shift",
    "suspend_shift",
    "resume_shift",
    "local_shift",
    "pause",
    "program_end",
    "subprogram",
    "unknown",
]

Setting = Literal[
    "",
    "plane_xy",
    "plane_zx",
    "plane_yz",
    "compensation_off",
    "compensation_left",
    "compensation_right",
    "return_to_start",
    "return_to_r",
    "spindle_cw",
    "spindle_ccw",
    "spindle_off",
    "mist",
    "flood",
    "coolant_off",
]
"""Modes that leave the meaning of coordinates alone."""

Sync = Literal["", "change", "always"]

Feature = Literal[
    "planes",
    "inches",
    "arc_absolute",
    "full_circle_without_axis",
    "arc_turns",
    "cycles",
    "cycle_end_unknown",
    "inverse_time",
    "per_revolution",
    "coordinate_systems",
    "tool_length",
    "compensation",
    "probing",
    "diameter",
    "incremental_uw",
    "strict_words",
    "cancel_with_motion",
    "other_offsets",
    "tool_at_once",
    "frames",
    "no_tool_changer",
]
"""What a controller can do beyond single codes. `strict_words`: a word that nothing uses is an error, not ignored;
`cycle_end_unknown`: where a canned cycle leaves Z is not documented; `incremental_uw`: U and W are X and Z in steps;
`cancel_with_motion`: G80 may stand beside another motion code; `other_offsets`: an arc may have I, J or K of the axis
that stands on its plane, for nothing; `tool_at_once`: T turns the tool in, as a turret does, M6 or not; `frames`: the
controller reads no text, its program goes out as binary frames (gcode/ncframe); `no_tool_changer`: nobody changes its
tools, M6 is an error."""


class ProfileError(ValueError):
    """There is no such profile, or its file is not as it should be."""


@dataclass(frozen=True, slots=True)
class Code:
    """A G, M or W code. `missing`: listed only because a rule needs it; the controller does not have it.

    `text` says what the controller makes of it. `barrier`: travels alone; `locate`: where the machine stands
    afterwards must be asked. `group`: two of one group in a block contradict each other. `sets`: a mode beside the
    effect. `sync`: the controller's queue runs dry, `always` or when the code changes something (gcode §5).
    """

    name: str
    status: CodeStatus = "exists"
    effect: Effect = "none"
    text: str = ""
    group: str = ""
    barrier: bool = False
    locate: bool = False
    sets: Setting = ""
    sync: Sync = ""


@dataclass(frozen=True, slots=True)
class Profile:
    """A controller. Axes in lower case; letters in upper case.

    `initial` are the fields of `State` at power-on, `at_end` those that the end of the program sets; without the
    latter the modes are not known behind it. `ranges`: lowest and highest value of a letter. `realtime`: bytes that
    act at once wherever they stand. `sync_letters`: their change empties the queue as a code with `sync` does.
    """

    name: str
    title: str
    axes: tuple[str, ...]
    letters: frozenset[str]
    ignored_letters: Mapping[str, str]
    code_letters: frozenset[str]
    barrier_letters: frozenset[str]
    codes: Mapping[str, Code]
    arc_planes: frozenset[str]
    max_block_bytes: int
    features: frozenset[str] = frozenset()
    initial: Mapping[str, Any] = field(default_factory=dict)
    at_end: Mapping[str, Any] | None = None
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    realtime: frozenset[int] = frozenset()
    sync_letters: frozenset[str] = frozenset()

    def code(self, name: str) -> Code | None:
        """The entry of a code that the controller has, ignores or names; None for all others."""
        return self.codes.get(name)


def load_profile(name: str, folder: Path | None = None) -> Profile:
    """Read a profile: the user's own in `folder` first, then those of the package. Raises ProfileError."""
    if not re.fullmatch(r"[a-z0-9][a-z0-9.-]*", name):
        raise _unknown(name, folder)
    if folder is not None and (path := folder / f"{name}.toml").is_file():
        return _parsed(name, path.read_bytes())
    return _shipped(name, folder)


@lru_cache(maxsize=64)
def _shipped(name: str, folder: Path | None) -> Profile:
    path = resources.files("gcode") / "profiles" / f"{name}.toml"
    if not path.is_file():
        raise _unknown(name, folder)
    return _parsed(name, path.read_bytes())


def _parsed(name: str, raw: bytes) -> Profile:
    try:
        return parse_profile(tomllib.loads(raw.decode("utf-8")))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ProfileError(f"profile {name!r} is not as it should be: {error}") from error


def _unknown(name: str, folder: Path | None) -> ProfileError:
    return ProfileError(f"there is no profile {name!r}; known are: {', '.join(profile_names(folder))}")


def profile_names(folder: Path | None = None) -> list[str]:
    """The profiles that ship with the package, and those in the user's `folder`."""
    shipped = [entry.name for entry in (resources.files("gcode") / "profiles").iterdir()]
    own = [entry.name for entry in folder.iterdir()] if folder is not None and folder.is_dir() else []
    return sorted({name.removesuffix(".toml") for name in [*shipped, *own] if name.endswith(".toml")})


def parse_profile(table: Mapping[str, Any]) -> Profile:
    """A profile from its table. Raises KeyError, TypeError or ProfileError when the table is wrong."""
    letters = table["letters"]
    features = frozenset(table.get("features", ()))
    if unknown := features - set(get_args(Feature)):
        raise ProfileError(f"features {', '.join(sorted(unknown))} are not known")
    at_end = table.get("at_end")
    return Profile(
        name=table["name"],
        title=table["title"],
        axes=tuple(table["axes"]),
        letters=frozenset(letters["accepted"]),
        ignored_letters=dict(letters["ignored"]),
        code_letters=frozenset(letters["codes"]),
        barrier_letters=frozenset(letters["barrier"]),
        codes={name: _code(name, entry) for name, entry in table["codes"].items()},
        arc_planes=frozenset(table["arc_planes"]),
        max_block_bytes=table["max_block_bytes"],
        features=features,
        initial=_modes("initial", table.get("initial", {})),
        at_end=None if at_end is None else _modes("at_end", at_end),
        ranges={letter: (float(low), float(high)) for letter, (low, high) in table.get("ranges", {}).items()},
        realtime=frozenset(byte for low, high in table.get("realtime", ()) for byte in range(low, high + 1)),
        sync_letters=frozenset(letters.get("sync", ())),
    )


_MODES: Mapping[str, type] = {
    "motion": str,
    "motion_name": str,
    "absolute": bool,
    "arc_absolute": bool,
    "inches": bool,
    "plane": int,
    "feed_mode": int,
    "spindle": int,
    "system": int,
    "compensation": int,
    "return_to_r": bool,
    "diameter_mode": bool,
    "mist": bool,
    "flood": bool,
}


def _modes(where: str, table: Mapping[str, Any]) -> dict[str, Any]:
    for name, value in table.items():
        if type(value) is not _MODES.get(name):
            raise ProfileError(f"{where}: {name} = {value!r} is not a mode of a controller")
    return dict(table)


def _code(name: str, entry: Mapping[str, Any]) -> Code:
    code = Code(name=name, **entry)
    if code.status not in get_args(CodeStatus) or code.effect not in get_args(Effect):
        raise ProfileError(f"{name}: status {code.status!r} or effect {code.effect!r} is not known")
    if code.sets not in get_args(Setting) or code.sync not in get_args(Sync):
        raise ProfileError(f"{name}: sets {code.sets!r} or sync {code.sync!r} is not known")
    return code
