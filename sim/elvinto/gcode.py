"""One block of G-code as this controller reads it (standard §3): words, and the table of codes that exist.

No motion and no state. The one rule: a code that is not in the table does not exist, whatever it means elsewhere.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

ERR_UNKNOWN_COMMAND: Final = 1
ERR_PARAMETER: Final = 2
ERR_BAD_WORD: Final = 3
ERR_UNKNOWN_CODE: Final = 4
ERR_BAD_ARC: Final = 5
ERR_BAD_CYCLE: Final = 6
ERR_NO_CARD: Final = 7
ERR_NO_FILE: Final = 8
"""ERROR,NUM: the standard names no numbers, these are this machine's own."""

MOTION: Final = frozenset({"G0", "G1", "G2", "G3", "G81", "G81.99", "G83", "G83.99"})
"""Modal motion: holds for later blocks that have axis words only."""

PLACING: Final = frozenset({"G27", "G28", "G29", "G92", "G100", "G101", "M200", "M210"})
"""Takes the axis words of its block; a motion code beside it only sets the mode."""

IGNORED: Final = frozenset({"G17", "G18", "G19", "G21", "G40", "G41", "G42", "G54", "G300", "M1", "M76", "M77", "M201"})
"""Accepted without an effect that can be seen from outside."""

MODES: Final = frozenset({"G75", "G76", "G80", "G90", "G91", "M3", "M4", "M5", "M6", "M7", "M8", "M30", "M99"})

W_CODES: Final = frozenset(f"W{number}" for number in (70, 71, 72, 73, 90, 91, 93, 94, 95, 96, 97, 98))

CODES: Final = MOTION | PLACING | IGNORED | MODES | W_CODES

QUERIES: Final = frozenset({"W90", "W91", "W95", "W96", "W97"})
"""Move nothing and change nothing about motion."""

AXIS_LETTERS: Final = frozenset("XYZABC")
VALUE_LETTERS: Final = AXIS_LETTERS | frozenset("DFHIJKLPQRST")

MAX_NUMBER: Final = 1e9
"""Beyond this no sum of coordinates is exact to a micrometre; it also keeps infinity out."""

_WORD = re.compile(r"\s*([A-Za-z])\s*([+-]?(?:\d+\.?\d*|\.\d+))", re.ASCII)
_NUMBER = r"([+-]?[0-9]{1,8}(?:\.[0-9]{0,9})?)"
_plain = re.compile(rf"(G[01])?(?:X{_NUMBER})?(?:Y{_NUMBER})?(?:Z{_NUMBER})?(?:F{_NUMBER})?").fullmatch
"""What nearly every block is. Read in one go: a virtual machine is measured by how little it takes."""

_SD_NOISE = re.compile(r"\([^)]*\)|;.*|%|\b[NO]\d+", re.ASCII | re.IGNORECASE)


class BlockError(Exception):
    """This block cannot be executed; `num` goes into ERROR,NUM."""

    def __init__(self, num: int) -> None:
        super().__init__(f"error {num}")
        self.num = num


@dataclass(slots=True)  # not frozen: that doubles the time of making one, and there is one a block
class Words:
    """A block taken apart: its codes in the order written, and the other words by letter."""

    codes: tuple[str, ...]
    values: dict[str, float]


def read_block(text: str) -> Words:
    """Raises BlockError for what is no word, a letter twice, two motions, and a code that does not exist."""
    found = _plain(text)
    if found is None:
        return read_words(text)
    motion, x, y, z, feed = found.groups()
    values: dict[str, float] = {}
    if x is not None:
        values["X"] = float(x)
    if y is not None:
        values["Y"] = float(y)
    if z is not None:
        values["Z"] = float(z)
    if feed is not None:
        values["F"] = float(feed)
    return Words((motion,) if motion else (), values)


def read_words(text: str) -> Words:
    """The same for a block of any shape."""
    codes: list[str] = []
    values: dict[str, float] = {}
    # Between two words there is nothing: what the split leaves over there is no word.
    *pieces, rest = _WORD.split(text)
    for strange, letter, digits in zip(pieces[::3], pieces[1::3], pieces[2::3], strict=True):
        number = float(digits)
        if strange or not -MAX_NUMBER <= number <= MAX_NUMBER:
            raise BlockError(ERR_BAD_WORD)
        letter = letter.upper()
        if letter in VALUE_LETTERS:
            if letter in values:
                raise BlockError(ERR_BAD_WORD)
            values[letter] = number
        elif letter in "GMW":
            codes.append(_code(letter, digits))
        else:
            raise BlockError(ERR_BAD_WORD)
    if rest and not rest.isspace():
        raise BlockError(ERR_BAD_WORD)
    if len(codes) > 1 and any(sum(code in group for code in codes) > 1 for group in (MOTION, PLACING)):
        raise BlockError(ERR_BAD_WORD)
    return Words(tuple(codes), values)


@lru_cache(maxsize=256)
def _code(letter: str, digits: str) -> str:
    code = f"{letter}{float(digits):g}"
    if code not in CODES:
        raise BlockError(ERR_UNKNOWN_CODE)
    return code


def split_batch(data: str) -> list[str]:
    """The blocks of GCODE,DATA (§4). Nothing between two `|` is no block."""
    return [text for block in data.split("|") if (text := block.strip())]


def sd_blocks(content: bytes, encoding: str) -> Iterator[str]:
    """The blocks of a file on the card: comments, `%`, N and O words left out."""
    for line in content.decode(encoding, errors="replace").splitlines():
        if text := _SD_NOISE.sub("", line).strip():
            yield text
