"""Bytes of a program, in pieces, to lines. Not the decoder and not the reader of words.

The one rule: memory stays bounded whatever comes. A line longer than MAX_LINE_BYTES is given out as soon as it is,
longer than the limit, so that whoever reads it can see and refuse it.
"""

from collections.abc import Iterable, Iterator

MAX_LINE_BYTES = 262_144
"""Real programs have comment lines of 12 kB; beyond this it is no program, and memory would grow with it."""

BOM = b"\xef\xbb\xbf"


def split_lines(chunks: Iterable[bytes]) -> Iterator[bytes]:
    r"""The lines of `chunks` without their ends (`\n`, `\r\n`, `\r`, mixed) and without a UTF-8 byte order mark.

    A last line without an end counts; an empty rest after the last end does not.
    """
    first = True
    tail = b""
    for chunk in chunks:
        data = tail + chunk
        if first:
            if len(data) < len(BOM) and BOM.startswith(data):
                tail = data
                continue
            data = data.removeprefix(BOM)
            first = False
        lines = data.splitlines(keepends=True)
        # A lone \r at the end of a piece may be the first half of \r\n.
        tail = lines.pop() if lines and not lines[-1].endswith(b"\n") else b""
        for line in lines:
            yield line.rstrip(b"\r\n")
        if len(tail) > MAX_LINE_BYTES:
            yield tail.rstrip(b"\r\n")
            tail = b""
    if tail:
        yield tail.rstrip(b"\r\n")
