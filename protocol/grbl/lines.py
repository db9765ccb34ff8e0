"""What of a line matters to the stream: its bytes, whether it must travel alone, what its `ok` proves.

Not the language: that is gcode/. Lines come clean (no comments, no blanks that matter, ASCII); here that is only
verified. The one rule: a line that could press a real-time key, or be two lines, is never sent (grbl II.1, trap).
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import repeat
from typing import Final, NamedTuple

from protocol.errors import LocalError, MessageTooLongError
from protocol.grbl.realtime import acts_anywhere

_NUMBER: Final = r"[-+]?+(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)"
WORD: Final = re.compile(rf"([A-Z])({_NUMBER})")
_PROGRAM: Final = re.compile(rf"/?(?:[A-Z]{_NUMBER})+")

# grbl II.4: interrupts are off while the EEPROM is written, and incoming bytes may be lost.
_EEPROM_GCODES: Final = frozenset({10.0, 28.1, 30.1})

# grbl II.4, sync point: their ok comes when all earlier motion is done.
_SYNC_GCODES: Final = frozenset({4.0, 38.2, 38.3, 38.4, 38.5})
_SYNC_MCODES: Final = frozenset({0.0, 2.0, 30.0})

# Words that put nothing into the planner: a line of these alone is executed when it is acknowledged.
_INERT_GCODES: Final = frozenset(
    {17.0, 18.0, 19.0, 20.0, 21.0, 40.0, 49.0, *map(float, range(54, 60)), 61.0, 80.0, 90.0, 91.0, 91.1, 93.0, 94.0}
)
_INERT_MCODES: Final = frozenset({3.0, 4.0, 5.0, 7.0, 8.0, 9.0})


# Words with which a line still goes as far as it was planned to: no origin is set, no way of the controller's own.
_STEADY_GCODES: Final = frozenset(
    {0.0, 1.0, 2.0, 3.0, 4.0, 17.0, 18.0, 19.0, 20.0, 21.0, 40.0, 61.0, 80.0, 90.0, 91.0, 91.1, 93.0, 94.0}
)

Words = list[tuple[str, float]]
"""Letters and numbers, in order."""


class Line(NamedTuple):
    """`steady`: it takes the axes as far as it was planned to. `alone`: nothing else may be in the controller while it
    is there. `syncs`: its ok proves that everything up to it is executed. `inert`: it makes no motion. `dwell_s`: so
    long it may stay without an answer in Idle. `plain`: a motion and where it goes, nothing else, as nearly all are."""

    text: str
    data: bytes
    steady: bool = False
    alone: bool = False
    syncs: bool = False
    inert: bool = False
    dwell_s: float = 0.0
    tool: int | None = None
    plain: bool = False


_MAKE: Final = tuple.__new__
"""Makes a Line without the function that a NamedTuple has for it: there is one for every line."""
_OF_A_MOVE: Final = (repeat(True), repeat(False), repeat(False), repeat(False), repeat(0.0), repeat(None), repeat(True))
"""All of a Line but its text and its bytes."""


def words_of(text: str) -> Words | None:
    """Letters and numbers, or None where the line holds anything else ($, expressions, O-words' brackets)."""
    if not _PROGRAM.fullmatch(text):
        return None
    return [(letter, float(value)) for letter, value in WORD.findall(text)]


@lru_cache(maxsize=8)
def _moves(line_chars: int) -> re.Pattern[str]:
    """What nearly all lines of a program are: a motion and where it goes. These are told by the quickest way there is,
    their length with the rest; beside `G03` there is room for so many."""
    move = rf"(?:G0?[0-3](?=[FXYZIJKR])|(?=[XYZIJKR]))[-+.0-9XYZFIJKR]{{1,{max(line_chars - len('G03'), 1)}}}+"
    return re.compile(rf"{move}(?:\n{move})*+")


def read_lines(texts: Sequence[str], line_chars: int) -> tuple[Line, ...]:
    """Classify lines. Raises LocalError for one that must never be sent, MessageTooLongError for one too long."""
    together = "\n".join(texts)
    if _moves(line_chars).fullmatch(together):
        rows = f"{together}\n".encode("ascii").splitlines(keepends=True)
        if len(rows) == len(texts):  # else one of them is two
            return tuple(map(_MAKE, repeat(Line), zip(texts, rows, *_OF_A_MOVE, strict=False)))
    return tuple([read_line(text, line_chars) for text in texts])


def read_line(text: str, line_chars: int) -> Line:
    """Classify a line. Raises LocalError for one that must never be sent, MessageTooLongError for one too long."""
    wrong = next((c for c in text if ord(c) > 0xFF or acts_anywhere(ord(c))), None)
    if wrong is not None:
        raise LocalError(f"a line may not hold {wrong!r}: the controller would act on it or break the line")
    bare = text.upper().replace(" ", "")
    if not bare:
        raise LocalError("an empty line would be answered with an ok of its own")
    if len(bare) > line_chars:
        raise MessageTooLongError(f"a line of {len(bare)} characters; the controller takes {line_chars}: {text[:40]}")
    data = text.encode("ascii") + b"\n"
    if bare[0] == "$":
        return Line(text, data, alone=not bare.startswith(("$J=", "$G")) or bare.startswith("$G="), inert=True)
    words = words_of(bare)
    if words is None:
        return Line(text, data)
    gcodes = {value for letter, value in words if letter == "G"}
    mcodes = {value for letter, value in words if letter == "M"}
    letters = {letter for letter, _ in words}
    return Line(
        text,
        data,
        steady=gcodes <= _STEADY_GCODES and mcodes <= _INERT_MCODES and letters <= set("GMXYZABCUVWIJKRFSTPN"),
        alone=bool(gcodes & _EEPROM_GCODES),
        syncs=bool(gcodes & _SYNC_GCODES or mcodes & _SYNC_MCODES),
        inert=letters <= set("GMFSTN") and gcodes <= _INERT_GCODES and mcodes <= _INERT_MCODES,
        dwell_s=sum(value for letter, value in words if letter == "P") if 4.0 in gcodes else 0.0,
        tool=next((int(value) for letter, value in words if letter == "T"), None),
        plain=_moves(line_chars).fullmatch(text) is not None,
    )
