"""Comments that a control shows: LinuxCNC's (DEBUG,), (PRINT,), (LOG,) with the values of parameters put in.

(MSG,) stays as it is, as in LinuxCNC: `(MSG, fit tool #5)` is meant as it reads. The one rule: a comment never stops
an expansion; what cannot be put in is shown as LinuxCNC shows it.
"""

import re

from gcode.expand.arithmetic import Dialect, Value, as_number
from gcode.expand.errors import RefusalError
from gcode.expand.expressions import Scope
from gcode.expand.parameters import DEBUG_SWITCH

_ACTIVE = re.compile(r"\([ \t]*(?:MSG|DEBUG|PRINT|LOG),", re.IGNORECASE)
_COMPUTED = re.compile(r"\([ \t]*(?:DEBUG|PRINT|LOG),", re.IGNORECASE)
_DEBUG = re.compile(r"\([ \t]*DEBUG,", re.IGNORECASE)
_ITEM = re.compile(r"%(?:d|f|lf|\.[0-9]f)|#[0-9]{1,4}|#<[^<>]*>", re.IGNORECASE)
_UNDEFINED = "######"
_DEFAULT_DECIMALS = 6
_PLAIN_DECIMALS = 4


def is_active(comment: str) -> bool:
    """Whether a control shows this comment to its operator."""
    return _ACTIVE.match(comment) is not None


def needs_values(comments: tuple[str, ...]) -> bool:
    """Whether one of the comments may have to be shown in other words, or not at all."""
    return any(map(_COMPUTED.match, comments))


def shown(comments: tuple[str, ...], scope: Scope, dialect: Dialect) -> list[str]:
    """The comments with their values; Fanuc has none, and LinuxCNC no (DEBUG,) while #5599 is 0."""
    if dialect == "fanuc":
        return list(comments)
    silent = any(map(_DEBUG.match, comments)) and not scope.number(DEBUG_SWITCH)
    return [_with_values(comment, scope) for comment in comments if not (silent and _DEBUG.match(comment))]


def _with_values(comment: str, scope: Scope) -> str:
    """The comment with the values of its parameters; `%d`, `%f`, `%.3f` say how those behind it are written."""
    opening = _COMPUTED.match(comment)
    if opening is None or "#" not in comment:
        return comment
    decimals = _DEFAULT_DECIMALS

    def put(match: re.Match[str]) -> str:
        nonlocal decimals
        item = match[0].lower()
        if item.startswith("#"):
            return _shown(item, scope, decimals)
        decimals = _decimals(item)
        return ""

    return opening[0] + _ITEM.sub(put, comment[opening.end() :])


def _decimals(item: str) -> int:
    if item.startswith("%."):
        return int(item[2])
    return 0 if item == "%d" else _PLAIN_DECIMALS


def _shown(item: str, scope: Scope, decimals: int) -> str:
    value: Value
    try:
        if item.startswith("#<"):
            value = scope.named("".join(item[2:-1].split()).upper())
        else:
            value = scope.number(int(item[1:]))
    except RefusalError:
        return _UNDEFINED
    return f"{as_number(value):.{decimals}f}"
