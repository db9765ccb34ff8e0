"""The words of many lines at once, as columns: the fast reader. Not the meaning of words, and no second grammar.

The usual lines are read all together with numpy: what is no digit separates, and a rule over each separator, the
digits behind it and the next separator tells whether its line is usual. Every other line goes through the careful
reader of words.py. The one rule: the columns are what `parse_block` gives for each line, whatever the bytes.
"""

import codecs
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode.decimals import PAD_BYTES, read_decimals
from gcode.words import Block, Fault, decode_line, parse_block

BITE_BYTES = 131_072
"""Read at a time: the temporary arrays of so many bytes stay in the core's own cache."""

MAX_WHOLE_DIGITS, MAX_DECIMALS = 9, 15
"""Longest numbers of usual lines, as in words.py: all of them are below `MAX_NUMBER`."""

Ints = NDArray[np.int32]
Indices = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]

_LF, _CR, _PLUS, _MINUS, _POINT, _ZERO, _A, _N, _O = b"\n\r+-.0ANO"


@dataclass(slots=True)
class Columns:
    """The words of `lines` lines, of which the first is line `first_line` of its file; a row is a line, from 0.

    `row` (ascending), `letter` (ASCII, upper case), `value`, `start` and `end` have one entry a word: the number as
    written is `text[start:end]`, without blanks, the letter stands before it. `faults` and `messages` are (row, ...)
    in the order of the lines, `deleted` the rows that begin with `/`, `unusual` those read by the careful reader.
    `text` has all lines without blanks and comments behind PAD_BYTES, and behind them the words of the unusual rows.
    """

    first_line: int
    lines: int
    row: Ints
    letter: Bytes
    value: Floats
    start: Ints
    end: Ints
    text: bytes
    faults: list[tuple[int, Fault]]
    deleted: Ints
    messages: list[tuple[int, str]]
    unusual: Ints
    _source: "_Source" = field(repr=False)

    def block(self, row: int) -> Block:
        """The careful reading of a line, with the columns of its words: read again from the bytes."""
        return parse_block(self._source.text_line(row))

    def raw_line(self, row: int) -> bytes:
        """The bytes of a line as they came, without its end."""
        return self._source.raw_line(row)

    def words_of(self, row: int) -> slice:
        """Where the words of a row stand in the columns."""
        first, last = np.searchsorted(self.row, np.array((row, row + 1), np.int32)).tolist()
        return slice(first, last)

    def sent_bytes(self) -> Ints:
        """Bytes of each line as `gcode.clean` writes it: without blanks, comments, N and O words, without an end."""
        sent = (self.letter != _N) & (self.letter != _O)
        total = np.zeros(len(self.row) + 1, np.int32)
        np.cumsum((self.end - self.start + 1) * sent, dtype=np.int32, out=total[1:])
        bounds = np.searchsorted(self.row, np.arange(self.lines + 1, dtype=np.int32))
        return np.diff(total[bounds])


class _Source:
    """The original bytes of a piece, kept by reference; where its lines begin is worked out when first asked for."""

    __slots__ = ("_encoding", "_lines", "_piece", "_starts")

    def __init__(self, piece: bytes, lines: int, encoding: str) -> None:
        self._piece = piece
        self._lines = lines
        self._encoding = encoding
        self._starts: Indices | None = None

    def raw_line(self, row: int) -> bytes:
        if not 0 <= row < self._lines:
            raise IndexError(f"row {row} of {self._lines}")
        start, end = self.starts()[row : row + 2].tolist()
        return self._piece[start:end].rstrip(b"\r\n")

    def text_line(self, row: int) -> str:
        return decode_line(self.raw_line(row), self._encoding)

    def starts(self) -> Indices:
        """Offset of each line, and of the end of the last."""
        if self._starts is None:
            data = np.frombuffer(self._piece, np.uint8)
            ends = data == _LF
            if b"\r" in self._piece:
                returns = data == _CR
                # The \r of \r\n ends nothing by itself.
                returns[:-1] &= ~ends[1:]
                ends |= returns
            starts = np.full(self._lines + 1, len(self._piece), np.int64)
            found = np.flatnonzero(ends)[: self._lines]
            starts[0] = 0
            starts[1 : 1 + len(found)] = found + 1
            self._starts = starts
        return self._starts


def read_columns(piece: bytes, first_line: int = 1, encoding: str = "utf-8") -> Columns:
    """Read whole lines, about 1 MiB of them (`gcode.lines.pieces`). Never raises on any bytes.

    `encoding`: of the comments, as in `decode_line`; LookupError where Python does not know it.
    """
    cleaned, has_messages = _cleaned(piece)
    text = b"\n" * PAD_BYTES + cleaned
    data = np.frombuffer(text, np.uint8)
    usual = _is_ascii_based(encoding)
    parts: list[_Words] = []
    odd: list[Ints] = []
    lines = 0
    for begin, end in _bites(text):
        words, count, odd_rows = _read_bite(text, data[begin - 1 : end], begin - 1, lines)
        parts.append(words)
        odd.append(odd_rows)
        lines += count
    rows = np.concatenate(odd) if odd else np.zeros(0, np.int32)
    words = _Words(*map(np.concatenate, zip(*parts, strict=True))) if parts else _no_words()
    if not usual:
        rows, words = np.arange(lines, dtype=np.int32), _no_words()
    source = _Source(piece, lines, encoding)
    columns = Columns(first_line, lines, *words, text, [], np.zeros(0, np.int32), [], rows, source)
    if len(rows):
        _read_carefully(columns, source, rows.tolist())
    if has_messages or not usual:
        columns.messages = list(_messages(piece, source, lines, everywhere=not usual))
    return columns


# --- bytes to usual bytes -------------------------------------------------------------------------------------

_UPPER = bytes(range(256)).upper()
_BLANKS = b" \t"
# Both go through any text once only: a pattern that fails at a bracket would look through the rest of the line again
# at the next one. The first eats the line end behind a bracket that is not closed, which can be counted.
_COMMENT = re.compile(rb"\([^)\n]*[)\n]|;[^\n]*")
_COMMENT_OR_UNCLOSED = re.compile(rb"\([^)\n]*\)|;[^\n]*|(\()[^)\n]*")
# Encodings in which a byte below 0x80 is that ASCII character wherever it stands. In others, as UTF-16 or Johab, a
# bracket may be half of something else.
_ASCII_BASED = re.compile(r"utf-8(?:-sig)?|ascii|iso8859-[0-9]+|koi8-[rtu]|cp(?:125[0-8]|437|85[0258]|866)|mac-.*")


@lru_cache(maxsize=16)
def _is_ascii_based(encoding: str) -> bool:
    return _ASCII_BASED.fullmatch(codecs.lookup(encoding).name) is not None


def _cleaned(piece: bytes) -> tuple[bytes, bool]:
    r"""Upper case, without blanks and comments, every line with `\n`; and whether there may be a message.

    What the careful reader would not take for a comment stays, and makes its line an unusual one.
    """
    if piece and not piece.endswith((b"\n", b"\r")):
        piece += b"\n"
    if b"\r" in piece:
        piece = piece.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    cleaned = piece.translate(_UPPER, _BLANKS)
    has_brackets = b"(" in cleaned
    has_messages = has_brackets and b"(MSG," in cleaned
    if has_brackets or b";" in cleaned:
        cleaned = _without_comments(cleaned)
    return cleaned, has_messages


def _without_comments(cleaned: bytes) -> bytes:
    without = _COMMENT.sub(b"", cleaned)
    if without.count(b"\n") == cleaned.count(b"\n"):
        return without
    return _COMMENT_OR_UNCLOSED.sub(rb"\1", cleaned)


def _bites(text: bytes) -> Iterator[tuple[int, int]]:
    """Begin and end of whole lines, of about `BITE_BYTES` together."""
    begin = PAD_BYTES
    while begin < len(text):
        end = text.rfind(b"\n", begin, begin + BITE_BYTES) + 1
        if not end:
            end = text.index(b"\n", begin + BITE_BYTES) + 1
        yield begin, end
        begin = end


# --- the usual lines ------------------------------------------------------------------------------------------


class _Words(NamedTuple):
    row: Ints
    letter: Bytes
    value: Floats
    start: Ints
    end: Ints


def _no_words() -> _Words:
    none = np.zeros(0, np.int32)
    return _Words(none, np.zeros(0, np.uint8), np.zeros(0), none, none)


def _read_bite(text: bytes, data: Bytes, offset: int, first_row: int) -> tuple[_Words, int, Ints]:
    """The words of the usual lines in `data`, how many lines it has, and the rows of the unusual ones.

    `data` is `text` from `offset` on; it begins with the line end before its first line, and ends with a line end.
    """
    at = np.flatnonzero(data - np.uint8(_ZERO) > 9).astype(np.int32)
    char = data.take(at)
    at += np.int32(offset)
    is_end = char == _LF
    is_letter = (char - np.uint8(_A) < 26) & (char != _O)
    is_head = is_end | is_letter
    wrong = _wrong_pairs(at, char, is_end, is_letter)
    heads = np.flatnonzero(is_head)
    head_row = np.cumsum(is_end.take(heads), dtype=np.int32)
    lines = int(head_row[-1]) - 1
    head_row += np.int32(first_row - 1)
    is_word = is_letter.take(heads)
    odd_rows = head_row[:0]
    if wrong.any():
        odd = np.zeros(lines, np.bool_)
        odd[(np.cumsum(is_end, dtype=np.int32) - 1)[:-1][wrong]] = True
        # The last head is the end of the last line, and begins none.
        is_word[:-1] &= ~odd[head_row[:-1] - np.int32(first_row)]
        odd_rows = np.flatnonzero(odd).astype(np.int32) + np.int32(first_row)
    word = np.flatnonzero(is_word)
    return _words(text, (at, char), heads.take(word), heads.take(word + 1), head_row.take(word)), lines, odd_rows


def _wrong_pairs(at: Ints, char: Bytes, is_end: NDArray[np.bool_], is_letter: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of each separator but the last: whether it, the digits behind it and the next one are in no usual line.

    A usual line is `(letter sign? (digits point? digits? | point digits))*` up to its end.
    """
    is_point = char == _POINT
    is_sign = (char - np.uint8(_PLUS)) & 0xFD == 0
    gap = at[1:] - at[:-1]
    digits = gap > 1
    this_end, this_letter, this_point, this_sign = is_end[:-1], is_letter[:-1], is_point[:-1], is_sign[:-1]
    # A line end has no digits behind it, a word has; a point may have them before it instead.
    complete = digits ^ this_end
    complete[1:] |= this_point[1:] & digits[:-1]
    right = (is_end | is_letter)[1:] & complete
    right |= is_point[1:] & (this_letter | this_sign)
    right |= is_sign[1:] & (this_letter & ~digits)
    if gap.max() > MAX_WHOLE_DIGITS + 1:
        right &= gap <= np.where(this_point, MAX_DECIMALS + 1, MAX_WHOLE_DIGITS + 1)
    return ~right


def _words(text: bytes, separators: tuple[Ints, Bytes], head: Indices, next_head: Indices, row: Ints) -> _Words:
    """The words that begin at the separators `head`; the letter or line end after each is `next_head`."""
    at, char = separators
    end = at.take(next_head)
    start = at.take(head) + np.int32(1)
    sign = char.take(head + 1)
    last = next_head - 1
    pointed = char.take(last) == _POINT
    decimals = (end - at.take(last) - np.int32(1)) * pointed
    chars = end - start - ((sign == _PLUS) | (sign == _MINUS))
    value = read_decimals(text, end, chars, decimals, pointed, sign == _MINUS)
    return _Words(row, char.take(head), value, start, end)


# --- the others -----------------------------------------------------------------------------------------------


def _read_carefully(columns: Columns, source: _Source, rows: Iterable[int]) -> None:
    """Reads `rows` word by word and merges them into `columns`, which has no words of these rows."""
    word_rows: list[int] = []
    letters: list[str] = []
    values: list[float] = []
    texts: list[str] = []
    deleted: list[int] = []
    for row in rows:
        block = parse_block(source.text_line(row))
        if block.deleted:
            deleted.append(row)
        columns.faults += [(row, fault) for fault in block.faults]
        for letter, value, text, _ in block.words:
            word_rows.append(row)
            letters.append(letter)
            values.append(value)
            texts.append(letter + text)
    columns.deleted = np.array(deleted, np.int32)
    bounds = np.fromiter(accumulate(map(len, texts), initial=len(columns.text)), np.int32, len(texts) + 1)
    columns.text += "".join(texts).encode("ascii")
    all_rows = np.concatenate((columns.row, np.array(word_rows, np.int32)))
    # Two ascending runs, which a stable sort merges in one go.
    order = np.argsort(all_rows, kind="stable")
    columns.row = all_rows[order]
    columns.letter = np.concatenate((columns.letter, np.frombuffer("".join(letters).encode("ascii"), np.uint8)))[order]
    columns.value = np.concatenate((columns.value, np.array(values, np.float64)))[order]
    columns.start = np.concatenate((columns.start, bounds[:-1] + np.int32(1)))[order]
    columns.end = np.concatenate((columns.end, bounds[1:]))[order]


# --- messages -------------------------------------------------------------------------------------------------

_MAYBE_MESSAGE = re.compile(rb"\([ \t]*[Mm][ \t]*[Ss][ \t]*[Gg][ \t]*,")
_TEXT_COMMENT = re.compile(r"\(([^)]*)(\)?)|;.*", re.DOTALL)
_MESSAGE = re.compile(r"[ \t]*M[ \t]*S[ \t]*G[ \t]*,(.*)", re.DOTALL | re.IGNORECASE | re.ASCII)


def messages_of(text: str) -> list[str]:
    """The texts of the `(MSG, text)` comments of a line (rs274 §1), outermost blanks taken off."""
    start = text.lstrip(" \t\r\n")
    # Remarks are nothing but remarks; a `#` line that is read is an assignment, which is a fault.
    if start.startswith(("%", "//")) or (start.startswith("#") and not parse_block(text).faults):
        return []
    comments = (comment[1] for comment in _TEXT_COMMENT.finditer(text) if comment[2])
    return [found[1].strip() for comment in comments if (found := _MESSAGE.match(comment))]


def _messages(piece: bytes, source: _Source, lines: int, *, everywhere: bool) -> Iterator[tuple[int, str]]:
    rows: Iterable[int] = range(lines)
    if not everywhere:
        found = np.array([match.start() for match in _MAYBE_MESSAGE.finditer(piece)], np.int64)
        rows = np.unique(np.searchsorted(source.starts(), found, side="right") - 1).tolist()
    for row in rows:
        for message in messages_of(source.text_line(row)):
            yield row, message
