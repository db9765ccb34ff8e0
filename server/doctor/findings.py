"""What the doctor says: findings with a level and advice. Not how they are come by (doctorsystem, doctorports).

The one rule: whatever is not in order says what to do about it, in one sentence that can be typed or done.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class Level(StrEnum):
    """How bad it is. An error keeps the daemon or a machine from working."""

    OK = "ok"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Finding:
    """`check` is the name of what was looked at; `machine` the one that it concerns; `data` what a script may want."""

    check: str
    level: Level
    message: str
    advice: str = ""
    machine: str | None = None
    data: Mapping[str, Any] = field(default_factory=dict)

    def view(self) -> dict[str, Any]:
        """As `--json` prints it."""
        return {
            "check": self.check,
            "level": self.level.value,
            "machine": self.machine,
            "message": self.message,
            "advice": self.advice,
            "data": dict(self.data),
        }


def ok(check: str, message: str, **data: Any) -> Finding:
    """In order."""
    return Finding(check, Level.OK, message, data=data)


def info(check: str, message: str, advice: str = "", **data: Any) -> Finding:
    """Worth knowing."""
    return Finding(check, Level.INFO, message, advice, data=data)


def warning(check: str, message: str, advice: str, **data: Any) -> Finding:
    """It works, but it will not always."""
    return Finding(check, Level.WARNING, message, advice, data=data)


def error(check: str, message: str, advice: str, **data: Any) -> Finding:
    """It does not work."""
    return Finding(check, Level.ERROR, message, advice, data=data)
