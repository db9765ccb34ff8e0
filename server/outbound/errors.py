"""What is wrong with a way out before the daemon has started. Later nothing of it raises.

The one rule: the message names the key of the configuration, and what to do.
"""

from importlib.util import find_spec
from pathlib import Path

MOST_SECRET_BYTES = 4096


class OutboundError(Exception):
    """A way out cannot be opened."""


def need(extra: str, module: str) -> None:
    """Raises OutboundError when the extra is not installed."""
    if find_spec(module) is None:
        raise OutboundError(
            f"{extra}.enabled: {module}, the extra {extra!r}, is not installed: pip install 'millstream[{extra}]'"
        )


def first_line(key: str, path: Path | None) -> str | None:
    """The secret in a file, None without one. Raises OutboundError."""
    if path is None:
        return None
    try:
        with path.open("rb") as file:
            text = file.read(MOST_SECRET_BYTES).decode().split("\n")[0].strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = (error.strerror or str(error)) if isinstance(error, OSError) else "it is not UTF-8 text"
        raise OutboundError(f"{key}: {path}: {reason}") from error
    if not text:
        raise OutboundError(f"{key}: {path}: the first line is empty")
    return text
