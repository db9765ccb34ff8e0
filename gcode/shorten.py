"""Words of many lines to the bytes that go out, all at once: `gcode.clean` and `gcode.compact` for columns.

Not the choice of words; the caller makes it. The one rule: each number is what `gcode.words.shortest` writes. Nothing
is copied word by word: what is not sent becomes a blank or a zero byte in a copy of the text, and these go at once.
"""

import numpy as np
from numpy.typing import NDArray

from gcode.columns import Columns
from gcode.decimals import PAD_BYTES
from gcode.words import shortest

Ints = NDArray[np.int32]
Sizes = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Bools = NDArray[np.bool_]

_BLANK, _PLUS, _MINUS, _POINT, _ZERO = b" +-.0"
_LF = b"\n"[0]


def texts(columns: Columns, kept: Bools, *, shorten: bool = True) -> tuple[list[str], Sizes]:
    """The text of each row, without an end, of the words that are `kept` (one entry a word), and its bytes; empty
    without words.

    With `shorten` numbers lose `+`, superfluous zeros and point; otherwise they stay as written.
    """
    text = columns.text
    if shorten or not kept.all():
        data = np.frombuffer(text, np.uint8).copy()
        left = np.flatnonzero(~kept)
        _clear(data, columns.start[left] - np.int32(1), columns.end[left])
        if shorten:
            words = np.flatnonzero(kept)
            _shorten(data, columns.start[words], columns.end[words], columns.value[words] == 0)
        text = data.tobytes().translate(None, b" \0")
    # Behind the last line end are the words of the unusual rows.
    text = text[PAD_BYTES - 1 : text.rfind(b"\n") + 1]
    sizes = np.diff(np.flatnonzero(np.frombuffer(text, np.uint8) == _LF)) - 1
    # What is not ASCII is in unusual rows only.
    rows = text[1:].decode("latin-1").split("\n")[: columns.lines]
    _write_unusual(rows, sizes, columns, kept, shorten=shorten)
    return rows, sizes


def _clear(data: Bytes, start: Ints, end: Ints) -> None:
    """Makes zero bytes of the ranges from `start` to `end`, of which none overlap."""
    inside = np.zeros(len(data) + 1, np.int8)
    inside[start] += np.int8(1)
    inside[end] -= np.int8(1)
    np.cumsum(inside, dtype=np.int8, out=inside)
    data &= (inside[:-1] - np.int8(1)).view(np.uint8)


def _shorten(data: Bytes, start: Ints, end: Ints, is_zero: Bools) -> None:
    zeros = np.flatnonzero(is_zero)
    if len(zeros):
        # One digit remains of a zero, without sign and point: the last character, or that before the point.
        digit = end[zeros] - 1 - (data[end[zeros] - 1] == _POINT)
        _clear(data, start[zeros], end[zeros])
        data[digit] = _ZERO
        others = np.flatnonzero(~is_zero)
        start, end = start[others], end[others]
    first = data[start]
    data[start[first == _PLUS]] = _BLANK
    _leading_zeros(data, start + ((first == _PLUS) | (first == _MINUS)))
    _trailing_zeros(data, start, end)


def _leading_zeros(data: Bytes, at: Ints) -> None:
    """A zero before another digit says nothing; one before the point stays (`shortest`)."""
    while len(at := at[data[at] == _ZERO]):
        following = data[at + 1]
        at = at[(following - np.uint8(_ZERO)) <= 9]
        data[at] = _BLANK
        at = at + np.int32(1)


def _trailing_zeros(data: Bytes, start: Ints, end: Ints) -> None:
    """Zeros at the end of decimals, and a point that then is last."""
    last = data[end - 1]
    maybe = np.flatnonzero((last == _ZERO) | (last == _POINT))
    start, at = start[maybe], end[maybe] - np.int32(1)
    points = np.flatnonzero(data == _POINT).astype(np.int32)
    if not len(points):
        return
    # The first point from the number's start on is its own, or lies behind its end.
    point = points[np.minimum(np.searchsorted(points, start), len(points) - 1)]
    at = at[(start <= point) & (point <= at)]
    while len(at):
        char = data[at]
        at = at[(char == _ZERO) | (char == _POINT)]
        was_zero = data[at] == _ZERO
        data[at] = _BLANK
        at = at[was_zero] - np.int32(1)


def _write_unusual(rows: list[str], sizes: Sizes, columns: Columns, kept: Bools, *, shorten: bool) -> None:
    """The rows whose numbers may have any length, word by word."""
    first = np.searchsorted(columns.row, columns.unusual).tolist()
    behind = np.searchsorted(columns.row, columns.unusual, side="right").tolist()
    for row, begin, stop in zip(columns.unusual.tolist(), first, behind, strict=True):
        words = []
        for index in (np.flatnonzero(kept[begin:stop]) + begin).tolist():
            number = columns.text[columns.start[index] : columns.end[index]].decode("ascii")
            words.append(chr(columns.letter[index]) + (shortest(number) if shorten else number))
        rows[row] = "".join(words)
        sizes[row] = len(rows[row])
