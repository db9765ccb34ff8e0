"""Whether a program has to be expanded at all. Not the expansion.

Fast on big plain files, some 20 to 40 ns a line: first whole pieces are asked for bytes that plain lines hardly have,
then for what stands behind them; only then lines are read. The one rule: never "plain" when it is not; a line that
looks like it is read carefully, and that reading decides.
"""

import re
from collections.abc import Iterable

import numpy as np

from gcode.expand.errors import ExpandError
from gcode.expand.reading import read_source
from gcode.expand.statements import FLOW, MACRO
from gcode.expand.structure import CALLS

Bytes = np.ndarray[tuple[int], np.dtype[np.uint8]]
Ints = np.ndarray[tuple[int], np.dtype[np.int64]]

# A comment with brackets ends at the first closing one, as in reading.py. What stands behind a `;` is gone either way,
# so the two can go one after the other: patterns that begin with a fixed byte are found twice as fast as one of both.
_BRACKETED = re.compile(rb"\([^)\r\n]*\)")
_REST = re.compile(rb";[^\r\n]*")
# A parameter, an expression, an O-word or DO or GOTO; END or THEN; IF or WHILE; a code that calls. Blanks may stand
# anywhere.
_SUSPICIOUS = re.compile(rb"[#\[Oo:]|[Ee][ \t]*[Nn]|[Ii][ \t]*[FfLl]|[Mm][ \t0+]*9[ \t]*[89]|[Gg][ \t0+]*6[ \t]*[56]")
# The same one by one: a byte that has to be there, and what has to stand behind it.
_SIGNS = tuple(
    (sign, None if behind is None else re.compile(sign + behind))
    for sign, behind in (
        (b"#", None),
        (b"O", None),
        (b":", None),
        (b"E", rb"[ \t]*[Nn]"),
        (b"I", rb"[ \t]*[FfLl]"),
        (b"M", rb"[ \t0+]*9[ \t]*[89]"),
    )
)
# These are above Z, where most programs have nothing at all: one look for all of them.
_HIGH_SIGNS = tuple(
    (sign, None if behind is None else re.compile(sign + behind))
    for sign, behind in (
        (b"[", None),
        (b"o", None),
        (b"e", rb"[ \t]*[Nn]"),
        (b"i", rb"[ \t]*[FfLl]"),
        (b"m", rb"[ \t0+]*9[ \t]*[89]"),
        (b"g", rb"[ \t0+]*6[ \t]*[56]"),
    )
)
_G, _FIVE, _SIX, _ZERO, _NINE, _BLANK, _LETTER_Z = b"G5609 Z"
_BLANKS = np.frombuffer(b" \t", np.uint8)
_BLANKS_AND_ZEROS = np.frombuffer(b" \t0+", np.uint8)
_NONE = np.zeros(0, np.int64)
# An O-word that is no program number, and what is left of an IF.
_ODD = re.compile(r"[O:](?![0-9])|THEN")


def needs_expansion(pieces: Iterable[bytes]) -> bool:
    """Whether any line has a parameter, an expression, flow of control or a subprogram call.

    `pieces` are bytes of the program, each of whole lines: single lines, or a megabyte at a time.
    """
    return any(_needed(piece) for piece in pieces)


def _needed(piece: bytes) -> bool:
    text = _without_comments(piece)
    if not _has_signs(text):
        return False
    # No comment has a line end in it, so the lines are the same ones.
    lines = zip(piece.splitlines(), text.splitlines(), strict=True)
    return any(_SUSPICIOUS.search(line) and _careful(raw) for raw, line in lines)


def _without_comments(piece: bytes) -> bytes:
    if b"(" in piece:
        piece = _BRACKETED.sub(b"", piece)
    return _REST.sub(b"", piece) if b";" in piece else piece


def _has_signs(text: bytes) -> bool:
    values = np.frombuffer(text, np.uint8)
    if not len(values):
        return False
    signs = _SIGNS if values.max() <= _LETTER_Z else _SIGNS + _HIGH_SIGNS
    return any(sign in text and _fits(text, values, sign, pattern) for sign, pattern in signs) or _calls_macro(values)


def _fits(text: bytes, values: Bytes, sign: bytes, pattern: re.Pattern[bytes] | None) -> bool:
    if pattern is None:
        return True
    if sign in b"EI":
        # On every line, in some programs, before a number: a pattern would stop at each.
        following = values[1:]
        if not ((values[:-1] == sign[0]) & ((following <= _BLANK) | (following > _NINE))).any():
            return False
    return pattern.search(text) is not None


def _calls_macro(values: Bytes) -> bool:
    """G65, G66. Almost every line has a G, so a pattern would stop at each."""
    after = values[1:]
    letters = values[:-1] == _G
    found = letters & ((after == _SIX) | (after < _ZERO))
    zeros = letters & (after == _ZERO)
    if zeros.any():
        # G00 and G01: what stands behind the first zero leaves few of them.
        found[:-1] |= zeros[:-1] & ((values[2:] == _SIX) | (values[2:] <= _ZERO))
    at = np.flatnonzero(found) + 1 if found.any() else _NONE
    while len(at):
        here = values[at]
        if _five_or_six(values, at[here == _SIX] + 1):
            return True
        at = at[np.isin(here, _BLANKS_AND_ZEROS)] + 1
        at = at[at < len(values)]
    return False


def _five_or_six(values: Bytes, at: Ints) -> bool:
    at = at[at < len(values)]
    while len(at):
        here = values[at]
        if ((here == _FIVE) | (here == _SIX)).any():
            return True
        at = at[np.isin(here, _BLANKS)] + 1
        at = at[at < len(values)]
    return False


def _careful(raw: bytes) -> bool:
    try:
        source = read_source(1, raw)
    except ExpandError:
        # A comment that is not closed, the first bracket behind the last closed one: what is before it counts.
        return _careful(raw[: raw.index(b"(", raw.rfind(b")") + 1)])
    chars = source.chars
    return (
        "#" in chars
        or "[" in chars
        or FLOW.search(chars) is not None
        or _ODD.search(chars) is not None
        or MACRO.search(chars) is not None
        or CALLS.search(chars) is not None
    )
