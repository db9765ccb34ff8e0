"""What a controller accepts, as data: one TOML file each in gcode/profiles/. Not the meaning of a code.

A code's `effect` is a name that modal.py has a rule for. The one rule: what is not in the table does not exist.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Literal, get_args

CodeStatus = Literal["exists", "ignored", "differs", "missing"]

Effect = Literal[
    "none",
    "rapid",
    "feed",
    "arc_cw",
    "arc_ccw",
    "drill",
    "peck",
    "cancel",
    "absolute",
    "relative",
    "remember_distance",
    "restore_distance",
    "ignore_home",
    "heed_home",
    "home",
    "home_and_back",
    "set_position",
    "zero_all",
    "zero_z",
    "tool_change",
    "turn_a",
    "mill_plane",
    "dwell",
    "program_end",
    "unknown",
]


class ProfileError(ValueError):
    """There is no such profile, or its file is not as it should be."""


@dataclass(frozen=True, slots=True)
class Code:
    """A G, M or W code. `missing`: listed only because a rule needs it; the controller does not have it.

    `text` says what the controller makes of it. `barrier`: travels alone; `locate`: where the machine stands
    afterwards must be asked. `group`: two of one group in a block contradict each other.
    """

    name: str
    status: CodeStatus = "exists"
    effect: Effect = "none"
    text: str = ""
    group: str = ""
    barrier: bool = False
    locate: bool = False


@dataclass(frozen=True, slots=True)
class Profile:
    """A controller. Axes in lower case; letters in upper case."""

    name: str
    title: str
    axes: tuple[str, ...]
    rotary_axes: frozenset[str]
    letters: frozenset[str]
    ignored_letters: Mapping[str, str]
    code_letters: frozenset[str]
    barrier_letters: frozenset[str]
    codes: Mapping[str, Code]
    arc_planes: frozenset[str]
    max_block_bytes: int

    def code(self, name: str) -> Code | None:
        """The entry of a code that the controller has, ignores or names; None for all others."""
        return self.codes.get(name)


@cache
def load_profile(name: str) -> Profile:
    """Read a profile that ships with the package. Raises ProfileError."""
    path = resources.files("gcode") / "profiles" / f"{name}.toml"
    if not re.fullmatch(r"[a-z0-9][a-z0-9.-]*", name) or not path.is_file():
        raise ProfileError(f"there is no profile {name!r}; known are: {', '.join(profile_names())}")
    try:
        return parse_profile(tomllib.loads(path.read_text(encoding="utf-8")))
    except (KeyError, TypeError, tomllib.TOMLDecodeError) as error:
        raise ProfileError(f"profile {name!r} is not as it should be: {error}") from error


def profile_names() -> list[str]:
    """The profiles that ship with the package."""
    folder = resources.files("gcode") / "profiles"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def parse_profile(table: Mapping[str, Any]) -> Profile:
    """A profile from its table. Raises KeyError, TypeError or ProfileError when the table is wrong."""
    codes = {name: _code(name, entry) for name, entry in table["codes"].items()}
    letters = table["letters"]
    return Profile(
        name=table["name"],
        title=table["title"],
        axes=tuple(table["axes"]),
        rotary_axes=frozenset(table["rotary_axes"]),
        letters=frozenset(letters["accepted"]),
        ignored_letters=dict(letters["ignored"]),
        code_letters=frozenset(letters["codes"]),
        barrier_letters=frozenset(letters["barrier"]),
        codes=codes,
        arc_planes=frozenset(table["arc_planes"]),
        max_block_bytes=table["max_block_bytes"],
    )


def _code(name: str, entry: Mapping[str, Any]) -> Code:
    code = Code(name=name, **entry)
    if code.status not in get_args(CodeStatus) or code.effect not in get_args(Effect):
        raise ProfileError(f"{name}: status {code.status!r} or effect {code.effect!r} is not known")
    return code
