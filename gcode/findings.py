"""What a check has to say: findings, bounded in number, and the report of a whole program. Not the rules.

The one rule: nothing that was found is lost. The first FULL_FINDINGS of a kind stand in full; all further ones are
in the `count` of the last of them, so the counts of a kind always add up to how often it was found.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

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
class Report:
    """The check of a whole program. Lengths in mm, `feeds` in mm/min, `seconds` estimated."""

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

    @property
    def ok(self) -> bool:
        """Whether a job may start (warnings want a look all the same)."""
        return not self.errors

    def to_json(self) -> dict[str, Any]:
        """The report as it stands in `check --json` and in the HTTP API."""
        table = asdict(self)
        table["bounds"] = {axis: list(span) for axis, span in self.bounds.items()}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in table.items()}


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
        key = (level, code, subject)
        if key not in self._kinds and len(self._kinds) >= MAX_KINDS:
            key = (level, code, "")
        kind = self._kinds.setdefault(key, _Kind([]))
        kind.total += count
        if len(kind.full) < FULL_FINDINGS:
            kind.full.append(Finding(line, column, code, message, count))

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
