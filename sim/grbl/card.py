"""The SD card of a grblHAL: files that the controller lists and reads itself (`$F`, `$F=name`).

Not a file system: a flat card, names as on FAT without regard to case. The one rule: while a file is read, lines from
the wire are thrown away without an answer, and the lines of the file have none either.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from sim.grbl.lines import Line, LineReader

NOT_FOUND = 61
"""The error of a file that cannot be opened."""


@dataclass(slots=True)
class OpenFile:
    """`number`: of the line that was read last, from 1."""

    name: str
    lines: list[Line]
    number: int = 0

    @property
    def exhausted(self) -> bool:
        return self.number == len(self.lines)

    @property
    def percent(self) -> float:
        return min(100.0 * self.number / max(1, len(self.lines)), 99.9)

    def next(self) -> Line:
        self.number += 1
        return self.lines[self.number - 1]


def listing(card: Mapping[str, str]) -> list[str]:
    return [f"[FILE:/{name}|SIZE:{len(text)}]" for name, text in sorted(card.items())]


def opened(card: Mapping[str, str], asked: str, limit: int) -> OpenFile | None:
    """The file of this name, or None."""
    wanted = asked.removeprefix("/").upper()
    for name, text in card.items():
        if name.upper() == wanted:
            reader = LineReader(limit)
            lines = [line for byte in f"{text}\n".encode("latin-1") if (line := reader.feed(byte)) is not None]
            return OpenFile(name, lines)
    return None
