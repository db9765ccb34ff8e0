"""What a check has to say: findings, bounded in number, and the report of a whole program. Not the rules.

The one rule: nothing that was found is lost. The first FULL_FINDINGS of a kind stand in full; all further ones are
in the `count` of the last of them, so the counts of a kind always add up to how often it was found.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

MOST_MESSAGE_CHARS = 300
"""A line with a thousand codes makes a message that names them all; nobody reads it to its end."""

Level = Literal["error", "warning", "info"]

FULL_FINDINGS = 100
"""Most findings of one kind in full."""

MAX_KINDS = 200
"""A hostile file could make up ever new codes; beyond this they are counted under their code alone."""


@dataclass(frozen=True, slots=True)
class Finding:
    """`line` and `column` from 1 (column 0: the whole line); `code` is stable, `message` is for people."""

    line: int
    column: int
    code: str
    message: str
    count: int = 1


@dataclass(frozen=True, slots=True)
class ToolUse:
    """What one tool does: ways in mm, `seconds` of all its segments. `tool` is -1 before the first tool change."""

    tool: int
    cut_mm: float
    rapid_mm: float
    seconds: float


@dataclass(frozen=True, slots=True)
class Report:
    """The check of a whole program. Lengths in mm, `feeds` in mm/min, `spindle` in rpm, `seconds` estimated.

    `bounds` are in program coordinates and hold feed moves and rapids, not homing. `cut_mm` and `rapid_mm` are all
    feed moves and all rapids, `plunge_mm` the part of the first that goes straight down. `seconds_overridden` is with
    the feed override that was asked for. `wire_bytes` go out without comments, blanks and line numbers, one line end
    each; `link_seconds` is how long a link of the given baud rate needs for them at least. `shortest_mm` and
    `median_mm` are of the segments that cut, the median to 1 %. `encoding` (`ascii`, `utf-8`, `utf-8 with BOM`, or
    what was read in place of it), `line_ends` (`lf`, `crlf`, `cr`, `mixed`, `none`), `bytes` and `sha256` are None
    where lines were given and not the bytes of a file. `expanded_lines` is how many plain lines a program with
    parameters, O-words or macros stands for, None for a plain one; `lines` are those of the file.
    """

    errors: tuple[Finding, ...]
    warnings: tuple[Finding, ...]
    infos: tuple[Finding, ...]
    bounds: Mapping[str, tuple[float, float]]
    seconds: float
    lines: int
    blocks: int
    cut_mm: float
    rapid_mm: float
    tools: tuple[int, ...]
    feeds: tuple[float, ...]
    plunge_mm: float = 0.0
    segments: int = 0
    arcs: int = 0
    shortest_mm: float | None = None
    median_mm: float | None = None
    spindle: tuple[float, float] | None = None
    dwell_seconds: float = 0.0
    seconds_overridden: float | None = None
    wire_bytes: int = 0
    link_seconds: float | None = None
    by_tool: tuple[ToolUse, ...] = ()
    encoding: str | None = None
    line_ends: str | None = None
    bytes: int | None = None
    sha256: str | None = None
    expanded_lines: int | None = None

    @property
    def ok(self) -> bool:
        """Whether a job may start (warnings want a look all the same)."""
        return not self.errors

    def to_json(self) -> dict[str, Any]:
        """The report as it stands in `check --json` and in the HTTP API."""
        table = asdict(self)
        table["bounds"] = {axis: list(span) for axis, span in self.bounds.items()}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in table.items()}


def _short(message: str) -> str:
    return message if len(message) <= MOST_MESSAGE_CHARS else f"{message[: MOST_MESSAGE_CHARS - 1]}…"


@dataclass(slots=True)
class _Kind:
    """One kind of finding: those in full, and how many there were."""

    full: list[Finding]
    total: int = 0


class Findings:
    """Collects findings of one program in bounded memory."""

    def __init__(self) -> None:
        self._kinds: dict[tuple[Level, str, str], _Kind] = {}

    def add(
        self, level: Level, line: int, column: int, code: str, message: str, *, subject: str = "", count: int = 1
    ) -> None:
        """Findings with the same level, `code` and `subject` (`M8`, an axis) are of one kind."""
        kind = self._kinds.setdefault(self._key(level, code, subject), _Kind([]))
        kind.total += count
        if len(kind.full) < FULL_FINDINGS:
            kind.full.append(Finding(line, column, code, _short(message), count))

    def room(self, level: Level, code: str, subject: str = "") -> int:
        """How many more of this kind would stand in full; all others need no more than to be counted."""
        kind = self._kinds.get(self._key(level, code, subject))
        return FULL_FINDINGS - (len(kind.full) if kind else 0)

    def count(self, level: Level, code: str, count: int, *, subject: str = "") -> None:
        """`count` more of a kind that has one in full already. Raises KeyError where it has none."""
        self._kinds[self._key(level, code, subject)].total += count

    def _key(self, level: Level, code: str, subject: str) -> tuple[Level, str, str]:
        key = (level, code, subject)
        return key if key in self._kinds or len(self._kinds) < MAX_KINDS else (level, code, "")

    def of(self, level: Level) -> tuple[Finding, ...]:
        """All of one level, in the order of lines."""
        found: list[Finding] = []
        for (kind_level, _, _), kind in self._kinds.items():
            if kind_level != level:
                continue
            *before, last = kind.full
            uncounted = kind.total - sum(finding.count for finding in kind.full)
            found += [*before, Finding(last.line, last.column, last.code, last.message, last.count + uncounted)]
        return tuple(sorted(found, key=lambda finding: (finding.line, finding.column)))
