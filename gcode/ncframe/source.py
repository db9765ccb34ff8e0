"""Lines of a program for NC frames to blocks (ncframe §3): commas between words, and what ends a block.

`;` and the letters LF, which the source prints where a line feed is meant, end a block as the end of the line does.
Not the reader of words. The one rule: what stands in brackets is for people, and a column of a block is its column
in the line.
"""

import re
from collections.abc import Iterable, Iterator

from gcode.expand.derived import source_line
from gcode.ncframe.rules import Semicolon

MAX_PADDING = 4096
"""Blanks in front of a block that began so far into its line. Further right a finding names a column of the block:
no program has such a line, and a hostile one would make of it the square of its length."""

_SPECIAL = re.compile(rb"[,;]|[Ll][Ff](?![^\s,;])")
_REMARKS = (b"%", b"//")
_TOKEN = re.compile(rb"\([^)]*\)?|,|;|(?<![A-Za-z])[Ll][Ff](?![^\s,;])")


def blocks_of_lines(lines: Iterable[tuple[int, bytes]], semicolon: Semicolon) -> Iterator[tuple[int, bytes]]:
    """The same lines, as many blocks as they have, each with the number of its line."""
    for number, raw in lines:
        for block in blocks_of_line(raw, semicolon):
            yield number, block


def blocks_of_line(raw: bytes, semicolon: Semicolon) -> Iterator[bytes]:
    """The blocks of a line, without commas; at least one, which may be empty.

    A line that begins with `;` is a remark: no block has begun that it could end.
    """
    if _SPECIAL.search(raw) is None:
        yield raw
        return
    if b";@" in raw and source_line(raw) is not None:
        # An expanded program: the mark says where the line came from, and is no block.
        raw = raw[: raw.rindex(b";@")].rstrip()
    start = raw.lstrip()
    if start.startswith(_REMARKS):
        yield raw
        return
    if start.startswith(b";"):
        yield b""
        return
    begin, some = 0, False
    parts: list[bytes] = []
    at = 0
    for found in _TOKEN.finditer(raw):
        token = found[0]
        if token.startswith(b"("):
            continue
        parts.append(raw[at : found.start()])
        at = found.end()
        if token == b",":
            parts.append(b" ")
            continue
        if block := _padded(b"".join(parts), begin):
            some = True
            yield block
        parts, begin = [], at
        if token == b";" and semicolon == "remark":
            at = len(raw)
            break
    parts.append(raw[at:])
    block = _padded(b"".join(parts), begin)
    if block or not some:
        yield block


def _padded(block: bytes, begin: int) -> bytes:
    """With as many blanks in front as it stands away from the line's start; empty where it is."""
    if not block.strip():
        return b""
    return b" " * begin + block if begin <= MAX_PADDING else block
