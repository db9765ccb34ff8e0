"""Where each value of the configuration comes from: a line of the file, a variable of the environment, or the default.

Not the reading itself (config/file.py). The one rule: what is shown is what the daemon works with, and a secret is
never shown.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from server.config.file import SECRET, Key, load_with_sources
from server.config.model import PROTOCOLS, Config, MachineConfig

DEFAULT = "default"
_IN_ADDRESS = re.compile(r"(?<=://)[^/@\s]+(?=@)")
"""`user:password@` of an address."""
MASK = "********"


@dataclass(frozen=True, slots=True)
class Setting:
    """One value. `key` as in the configuration, a machine by its name; `source`: default, file:line or the variable."""

    key: str
    value: Any
    source: str


def settings(path: Path | None, environ: Mapping[str, str]) -> list[Setting]:
    """Every value with its source. Raises ConfigError."""
    config, overridden = load_with_sources(path, environ)
    lines = {} if path is None else key_lines(path.read_text(encoding="utf-8"))
    found = []
    for key, value in _values(config, ()):
        variable, line = _of_whole(key, overridden), lines.get(key)
        source = variable or (DEFAULT if line is None else f"{path}:{line}")
        found.append(Setting(_named(key, config), masked(key, value), source))
    return found


def masked(key: Key, value: Any) -> Any:
    """The value, unless it is a secret; an address without the password in it."""
    if value and SECRET.search(str(key[-1])):
        return MASK
    return _IN_ADDRESS.sub(MASK, value) if isinstance(value, str) else value


def key_lines(text: str) -> dict[Key, int]:
    """On which line of a TOML text each key stands that is written there; counted from 1.

    The text is taken apart into its statements: each is the fewest lines that TOML can read by themselves.
    """
    found: dict[Key, int] = {}
    header: Key = ()
    counts: dict[Key, int] = {}
    pending: list[str] = []
    begun = 1
    for number, line in enumerate(text.splitlines(), 1):
        if not pending:
            begun = number
        pending.append(line)
        try:
            read = tomllib.loads("\n".join(pending))
        except tomllib.TOMLDecodeError:
            continue  # a value goes on over several lines
        first = pending[0]
        pending.clear()
        if first.lstrip().startswith("["):
            header = _header(read, header, counts)
        else:
            for key in _keys(read, header):
                found[key] = begun
    return found


def _header(read: Mapping[str, Any], before: Key, counts: dict[Key, int]) -> Key:
    """The key of a `[table]`, or of the next of `[[tables]]`; one inside them belongs to the last of them."""
    key: Key = ()
    place: Any = read
    while isinstance(place, dict) and place:
        ((name, place),) = place.items()
        key = (*key, name)
        if isinstance(place, list):
            if place == [{}]:
                counts[key] = counts.get(key, -1) + 1
                return (*key, counts[key])
            place = place[0]
        elif key in counts:
            key = (*key, counts[key])
    return key or before


def _keys(read: Mapping[str, Any], above: Key) -> Iterator[Key]:
    for name, value in read.items():
        key = (*above, name)
        yield key
        if isinstance(value, dict):
            yield from _keys(value, key)
        elif isinstance(value, list):
            for index, each in enumerate(value):
                yield from _keys(each, (*key, index)) if isinstance(each, dict) else ()


def _of_whole(key: Key, overridden: Mapping[Key, str]) -> str | None:
    """The variable that wrote the key, or the whole table in which it is."""
    lengths = range(len(key), 0, -1)
    return next((overridden[key[:length]] for length in lengths if key[:length] in overridden), None)


def _values(model: BaseModel, above: Key) -> Iterator[tuple[Key, Any]]:
    """Every value; of the dialects that of a machine's own protocol alone."""
    others = set(PROTOCOLS.values()) - {PROTOCOLS[model.protocol]} if isinstance(model, MachineConfig) else ()
    for name in type(model).model_fields:
        if name in others:
            continue
        value, key = getattr(model, name), (*above, name)
        if isinstance(value, BaseModel):
            yield from _values(value, key)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for index, each in enumerate(value):
                yield from _values(each, (*key, index))
        elif key != ("machine",):
            yield key, value


def _named(key: Key, config: Config) -> str:
    """`machine.router.port`: by the name, which is what variables and addresses use, too."""
    steps = [str(step) for step in key]
    if key[0] == "machine" and isinstance(key[1], int):
        steps[1] = config.machine[key[1]].name
    return ".".join(steps)
