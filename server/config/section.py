"""A table of the configuration as a model: strict, frozen, no unknown keys; and the types that several tables share.

The tables themselves are in config/model.py and in a file for each protocol. The one rule: `Allowed` says in words what
may stand in a field, wherever its type and bounds do not.
"""

import codecs
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError


@dataclass(frozen=True, slots=True)
class Allowed:
    """What may stand in a field, in words, where type and bounds do not say it."""

    text: str


def refused(key: str, value: object, allowed: str) -> PydanticCustomError:
    """An error of a check over several keys: `key` is relative to the section in which the check stands."""
    return PydanticCustomError("refused", "{allowed}", {"key": key, "value": value, "allowed": allowed})


class Section(BaseModel):
    """A TOML table. Strict: `"8420"` is not a port, `1` is not `true`, and no unknown keys."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)


def _known_encoding(value: str) -> str:
    try:
        codecs.lookup(value)
    except LookupError as error:
        raise ValueError from error
    return value


def as_tuple(value: object) -> object:
    """TOML has lists only."""
    return tuple(value) if isinstance(value, list) else value


Encoding = Annotated[
    str,
    AfterValidator(_known_encoding),
    Allowed('the name of a character encoding, e.g. "utf-8" or "cp1251"'),
]
Seconds = Annotated[float, Field(gt=0, le=3600)]
