"""Bytes of a program, in chunks, to pieces of whole lines and to lines. Not the decoder and not the reader of words.

The one rule: memory stays bounded whatever comes, and how the bytes were cut into chunks changes nothing. A line
longer than MAX_LINE_BYTES is given out in parts, the first of them one byte longer than the limit, so that whoever
reads it can see and refuse it.
"""

import re
from collections.abc import Iterable, Iterator
from itertools import chain

MAX_LINE_BYTES = 262_144
"""Real programs have comment lines of 12 kB; beyond this it is no program, and memory would grow with it."""

PIECE_BYTES = 1 << 20
"""Enough lines that the cost of a piece is spread over many, few enough that they stay in a processor's cache."""

BOM = b"\xef\xbb\xbf"

_PART_BYTES = MAX_LINE_BYTES + 1
_LINES_AT_ONCE_BYTES = 1 << 16
_LINE_END = re.compile(rb"\r\n?|\n")


def pieces(chunks: Iterable[bytes], size: int = PIECE_BYTES) -> Iterator[bytes]:
    r"""Whole lines, about `size` bytes of them, without a UTF-8 byte order mark; none is empty.

    A piece ends with a line end (`\n`, `\r\n`, `\r`, mixed). Only the last need not, and the parts of a line longer
    than MAX_LINE_BYTES do not: each is a piece by itself, as is a line longer than `size`.
    """
    # What a piece can have and a byte more, so that the \n behind a \r is seen.
    enough = max(size, _PART_BYTES + 1) + 1
    waiting: list[bytes] = []
    waiting_bytes = 0
    first = True
    for chunk in chunks:
        waiting.append(chunk)
        waiting_bytes += len(chunk)
        if waiting_bytes < enough:
            continue
        data = b"".join(waiting)
        at = len(BOM) if first and data.startswith(BOM) else 0
        first = False
        while len(data) - at >= enough:
            end = _end_of_piece(data, at, size)
            yield data[at:end]
            at = end
        waiting = [data[at:]]
        waiting_bytes = len(data) - at
    data = b"".join(waiting)
    at = len(BOM) if first and data.startswith(BOM) else 0
    while at < len(data):
        end = _end_of_piece(data, at, size)
        yield data[at:end]
        at = end


def split_lines(chunks: Iterable[bytes]) -> Iterator[bytes]:
    r"""The lines of `chunks` without their ends (`\n`, `\r\n`, `\r`, mixed) and without a UTF-8 byte order mark.

    A last line without an end counts; an empty rest after the last end does not.
    """
    # No generator that gives out line by line: there would be one step of it for every line of a job.
    return chain.from_iterable(map(bytes.splitlines, pieces(chunks, _LINES_AT_ONCE_BYTES)))


def _end_of_piece(data: bytes, begin: int, size: int) -> int:
    """Where the piece ends that begins at `begin`, if `data` has enough bytes or is all there is."""
    if len(data) - begin <= size:
        size = len(data) - begin
        rest = len(data)
    else:
        rest = begin
    at = begin
    while at < begin + size:
        stop = min(at + _PART_BYTES + 1, begin + size)
        end = _after_last_line_end(data, at, stop)
        if end == at:
            break
        at = end
    if at == begin:
        return _end_of_long_line(data, begin)
    # A rest that fits is the last line of all, which needs no end.
    return max(at, rest) if len(data) - at <= _PART_BYTES else at


def _after_last_line_end(data: bytes, begin: int, stop: int) -> int:
    r"""The offset behind the last line end that begins before `stop`, with the `\n` of a `\r\n`; `begin` if none."""
    last = max(data.rfind(b"\n", begin, stop), data.rfind(b"\r", begin, stop))
    if last < 0:
        return begin
    return last + 2 if data[last : last + 2] == b"\r\n" else last + 1


def _end_of_long_line(data: bytes, begin: int) -> int:
    """The end of the first line, which is longer than a piece should be, or of the first part of it."""
    found = _LINE_END.search(data, begin, begin + _PART_BYTES + 2)
    if found and found.start() <= begin + _PART_BYTES:
        return found.end()
    return min(begin + _PART_BYTES, len(data))
