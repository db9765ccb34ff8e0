"""Whether a program has to be expanded at all. Not the expansion.

Fast on big plain files: comments go, and one pattern looks for what no plain line has. The one rule: never "plain"
when it is not; a line that looks like it is read carefully, and that reading decides.
"""

import re
from collections.abc import Iterable

from gcode.expand.errors import ExpandError
from gcode.expand.reading import read_source
from gcode.expand.statements import FLOW, MACRO
from gcode.expand.structure import CALLS

_COMMENT = re.compile(rb"\([^()\r\n]*\)|;[^\r\n]*")
# A parameter, an expression, an O-word, two letters in a row, or a code that calls; blanks may stand anywhere.
_SUSPICIOUS = re.compile(rb"[#\[Oo:]|[A-Za-z][ \t]*[A-Za-z]|[Mm][ \t0+]*9[ \t]*[89]|[Gg][ \t0+]*6[ \t]*[56]")
# An O-word that is no program number, and what is left of an IF.
_ODD = re.compile(r"[O:](?![0-9])|THEN")


def needs_expansion(pieces: Iterable[bytes]) -> bool:
    """Whether any line has a parameter, an expression, flow of control or a subprogram call.

    `pieces` are bytes of the program, each of whole lines: single lines, or a megabyte at a time.
    """
    return any(_suspicious(piece) and any(map(_careful, piece.splitlines())) for piece in pieces)


def _suspicious(piece: bytes) -> bool:
    return _SUSPICIOUS.search(_COMMENT.sub(b"", piece)) is not None


def _careful(raw: bytes) -> bool:
    if not _suspicious(raw):
        return False
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
