"""Reading the configuration: a TOML file, the environment over it, and errors that a person can act on.

Not the model (config/model.py). The one rule: every error names the file or the variable, the key (with the machine's
name, not only its number), the value, and what is allowed; all errors of a file are told at once.

`MILLSTREAM_SERVER__PORT` overrides `server.port`. A machine is addressed by its name in capitals with `_` for
`-` (`MILLSTREAM_MACHINE__ROUTER__PORT`) or by its number; the number after the last one adds a machine.
"""

import difflib
import itertools
import re
import tomllib
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from protocol.errors import MillstreamError
from server.config.model import Config
from server.config.section import Allowed

ENV_PREFIX = "MILLSTREAM_"
ENV_SEPARATOR = "__"
LISTED = frozenset({("machine",), ("webhook",)})
"""Sections of which there may be several."""
SECRET = re.compile(r"(^|_)(password|passphrase|secret|token|key|credentials)($|_)")
"""Keys whose values are never shown."""
SHOWN_VALUE_CHARS = 80

Key = tuple[str | int, ...]
Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class ConfigFault:
    """One thing that is wrong. `source` is the file or the environment variable, `advice` what is allowed."""

    source: str
    key: str
    value: str
    advice: str

    def __str__(self) -> str:
        return f"{self.source}: {self.key} = {self.value}: {self.advice}"


class ConfigError(MillstreamError):
    """The configuration cannot be used. `faults` is empty when the file could not even be read."""

    def __init__(self, message: str, faults: Sequence[ConfigFault] = ()) -> None:
        super().__init__(message)
        self.faults = tuple(faults)


def load(path: Path | None, environ: Mapping[str, str]) -> Config:
    """The configuration of `path` (None: the defaults) with the environment over it.

    Raises ConfigError with one line for each fault.
    """
    return load_with_sources(path, environ)[0]


def load_with_sources(path: Path | None, environ: Mapping[str, str]) -> tuple[Config, dict[Key, str]]:
    """The same, and which keys were written by which variable. Raises ConfigError."""
    source = str(path) if path is not None else "the defaults"
    data = _read(path) if path is not None else {}
    overridden, faults = _overlay(data, environ)
    if not faults:
        try:
            return Config.model_validate(data), overridden
        except ValidationError as error:
            faults = [_fault(detail, data, source, overridden) for detail in error.errors(include_url=False)]
    raise ConfigError("\n".join(str(fault) for fault in faults), faults)


def load_section(model: type[Model], path: Path) -> Model:
    """A TOML file that holds one section alone (the motion file of `check`). Raises ConfigError."""
    data = _read(path)
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = [_fault(detail, data, str(path), {}, model) for detail in error.errors(include_url=False)]
        raise ConfigError("\n".join(str(fault) for fault in faults), faults) from error


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text (byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is not TOML: {error}") from error


# --- the environment ----------------------------------------------------------------------------------------


def _overlay(data: dict[str, Any], environ: Mapping[str, str]) -> tuple[dict[Key, str], list[ConfigFault]]:
    """Write the variables into `data`. Answers which key came from which, and what could not be placed."""
    overridden: dict[Key, str] = {}
    faults = []
    for variable in sorted(environ):
        # MILLSTREAM_URL, MILLSTREAM_TOKEN and the like have no section; they are the command line's.
        if not variable.startswith(ENV_PREFIX) or ENV_SEPARATOR not in variable:
            continue
        parts = variable.removeprefix(ENV_PREFIX).lower().split(ENV_SEPARATOR)
        key = _key_of(parts, data)
        if key is None:
            unknown = _unknown_webhook if parts[0] == "webhook" else _unknown_machine
            faults.append(unknown(variable, environ[variable], data))
            continue
        if not _put(data, key, _typed(environ[variable], _annotation(Config, key))):
            faults.append(ConfigFault(variable, _dotted(key), _shown(environ[variable]), "not a section"))
        overridden[key] = variable
    return overridden, faults


def _key_of(parts: list[str], data: Mapping[str, Any]) -> Key | None:
    """The key that a variable means; None: there is no such section among those that are a list."""
    if parts[0] == "machine":
        return _machine_key(parts, data)
    if parts[0] != "webhook":
        return tuple(parts)
    there = data.get("webhook", [])
    known = len(parts) > 2 and parts[1].isdecimal() and isinstance(there, list) and int(parts[1]) <= len(there)
    return ("webhook", int(parts[1]), *parts[2:]) if known else None


def _unknown_webhook(variable: str, value: str, data: Mapping[str, Any]) -> ConfigFault:
    known = f"{ENV_PREFIX}WEBHOOK__N__KEY, N from 0 to {len(data.get('webhook', []))}"
    return ConfigFault(variable, "webhook", _shown(value), f"no such webhook; allowed is {known}")


def _machine_key(parts: list[str], data: Mapping[str, Any]) -> Key | None:
    machines = data.get("machine", [])
    if len(parts) < 3 or not isinstance(machines, list):
        return None
    if parts[1].isdecimal():
        index = int(parts[1])
        return ("machine", index, *parts[2:]) if index <= len(machines) else None
    for index, machine in enumerate(machines):
        if isinstance(machine, dict) and str(machine.get("name")).replace("-", "_") == parts[1]:
            return ("machine", index, *parts[2:])
    return None


def _unknown_machine(variable: str, value: str, data: Mapping[str, Any]) -> ConfigFault:
    machines = data.get("machine", [])
    names = [str(machine.get("name")).upper().replace("-", "_") for machine in machines if isinstance(machine, dict)]
    known = ", ".join(f"{ENV_PREFIX}MACHINE__{name}__KEY" for name in [*names, str(len(machines))])
    return ConfigFault(variable, "machine", _shown(value), f"no such machine; allowed is {known}")


def _put(data: dict[str, Any], key: Key, value: object) -> bool:
    """Write `value` at `key`, making the sections on the way. False when something else stands in the way."""
    place: Any = data
    for step, following in itertools.pairwise(key):
        empty: Any = [] if isinstance(following, int) else {}
        if isinstance(step, int):
            if step == len(place):
                place.append(empty)
            place = place[step]
        else:
            place = place.setdefault(step, empty)
        if not isinstance(place, list if isinstance(following, int) else dict):
            return False
    place[key[-1]] = value
    return True


def _typed(text: str, annotation: Any) -> object:
    """A variable is text; where the key wants anything else, it is read as TOML would be."""
    if annotation is str or annotation is Path or _is_text_choice(annotation):
        return text
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _is_text_choice(annotation: Any) -> bool:
    return typing.get_origin(annotation) is Literal and all(isinstance(arg, str) for arg in typing.get_args(annotation))


# --- errors -------------------------------------------------------------------------------------------------


def _fault(
    detail: ErrorDetails,
    data: Mapping[str, Any],
    source: str,
    overridden: Mapping[Key, str],
    model: type[BaseModel] = Config,
) -> ConfigFault:
    key: Key = detail["loc"]
    context = detail.get("ctx", {})
    match detail["type"]:
        case "refused":
            key, value = (*key, *_steps(context["key"])), context["value"]
            advice = f"allowed is {context['allowed']}"
        case "unusable":
            key, value, advice = (*key, *_steps(context["key"])), context["value"], context["advice"]
        case "extra_forbidden":
            value, advice = detail["input"], _no_such_key(model, key)
        case _:
            key = _up_to_field(model, key)
            value, advice = _value_at(data, key), f"allowed is {_allowed_at(model, key)}"
    shown = "(not shown)" if SECRET.search(str(key[-1])) else _shown(value)
    return ConfigFault(_origin(key, overridden) or source, _dotted(key, data), shown, advice)


def _origin(key: Key, overridden: Mapping[Key, str]) -> str | None:
    """The variable that wrote `key`, the section above it or something inside it."""
    for written, variable in overridden.items():
        shorter = min(len(key), len(written))
        if key[:shorter] == written[:shorter]:
            return variable
    return None


def _steps(key: str) -> Key:
    return tuple(int(part) if part.isdecimal() else part for part in key.replace("[", ".").replace("]", "").split("."))


def _dotted(key: Key, data: Mapping[str, Any] | None = None) -> str:
    """`machine[0].elvinto.crc_radix (machine "router")`."""
    text = ""
    for step in key:
        text += f"[{step}]" if isinstance(step, int) else f".{step}"
    text = text.removeprefix(".")
    inside_machine = len(key) > 1 and key[0] == "machine" and isinstance(key[1], int)
    name = _value_at(data, (*key[:2], "name")) if inside_machine else None
    return f'{text} (machine "{name}")' if isinstance(name, str) else text


def _value_at(data: object, key: Key) -> object:
    for step in key:
        try:
            data = data[step]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def _shown(value: object) -> str:
    if value is None:
        return "(nothing)"
    if isinstance(value, bool):
        return str(value).lower()
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= SHOWN_VALUE_CHARS else text[:SHOWN_VALUE_CHARS] + "…"


# --- what the model says about a key ------------------------------------------------------------------------


def describe(field: FieldInfo) -> str:
    """In words, what a field may hold."""
    for note in _notes(field):
        if isinstance(note, Allowed):
            return note.text
    annotation = _plain(field.annotation)
    if typing.get_origin(annotation) is Literal:
        return " or ".join(_shown(choice) for choice in typing.get_args(annotation))
    if annotation is bool:
        return "true or false"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "a section with " + ", ".join(annotation.model_fields)
    return ("a whole number" if annotation is int else "a number") + _bounds(field)


def _notes(field: FieldInfo) -> Iterator[object]:
    yield from field.metadata
    for choice in typing.get_args(field.annotation):
        yield from getattr(choice, "__metadata__", ())


def _bounds(field: FieldInfo) -> str:
    bounds = {
        name: getattr(note, name) for note in field.metadata for name in ("gt", "ge", "le") if hasattr(note, name)
    }
    low = f" above {bounds['gt']} up" if "gt" in bounds else f" from {bounds['ge']}"
    return f"{low} to {bounds['le']}"


def _plain(annotation: Any) -> Any:
    """The annotation without `| None` and without its metadata."""
    if typing.get_origin(annotation) in (types.UnionType, typing.Union):
        annotation = next(arg for arg in typing.get_args(annotation) if arg is not type(None))
    return typing.get_args(annotation)[0] if typing.get_origin(annotation) is typing.Annotated else annotation


def _field(model: type[BaseModel], key: Key) -> FieldInfo | None:
    field: FieldInfo | None = None
    inside: Any = model
    for step in key:
        if isinstance(step, int):
            inside = typing.get_args(inside)[0] if typing.get_origin(inside) is tuple else None
            continue
        if not (isinstance(inside, type) and issubclass(inside, BaseModel)) or step not in inside.model_fields:
            return None
        field = inside.model_fields[step]
        inside = _plain(field.annotation)
    return field


def _annotation(model: type[BaseModel], key: Key) -> Any:
    field = _field(model, key)
    return None if field is None else _plain(field.annotation)


def _up_to_field(model: type[BaseModel], key: Key) -> Key:
    """pydantic goes on into a value (`travel[0]`); people think of the key."""
    while key and ((isinstance(key[-1], int) and key[:-1] not in LISTED) or _field(model, key) is None):
        key = key[:-1]
    return key


def _allowed_at(model: type[BaseModel], key: Key) -> str:
    field = _field(model, key)
    if field is None:
        return "a table"
    if key[-1:] != () and isinstance(key[-1], int):
        return f"a [[{key[0]}]] section"
    return describe(field)


def _no_such_key(model: type[BaseModel], key: Key) -> str:
    section: Any = _annotation(model, key[:-1]) if len(key) > 1 else model
    if typing.get_origin(section) is tuple:
        section = typing.get_args(section)[0]
    known = list(section.model_fields)
    near = difflib.get_close_matches(str(key[-1]), known, n=1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    return f"there is no such key{meant}; allowed are {', '.join(known)}"
