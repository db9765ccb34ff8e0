"""The program as it lies there: lines gathered to pieces, and what the bytes of a file say before they are read.

The one rule: a line that is too long to be one is told, and reads as an empty one, so that all others keep their
numbers.
"""

import codecs
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from gcode.lines import BOM, MAX_LINE_BYTES
from gcode.segments import Ints

PIECE_BYTES = 262_144
"""Lines are gathered up to about so many bytes: enough for numpy, little for memory."""

_LINES_AT_ONCE = 64
"""With lines of MAX_LINE_BYTES even these are 16 MB."""


@dataclass(frozen=True, slots=True)
class Gathered:
    """Whole lines. `numbers`: the line of each row where they do not count up. `too_long`: rows told and left out."""

    text: bytes
    numbers: Ints | None
    too_long: tuple[int, ...]


def gather(lines: Iterable[bytes]) -> Iterator[Gathered]:
    """Pieces of lines that are given one by one, without their ends. A line end inside a line is a blank there."""
    several = iter(lines)
    gathered: list[bytes] = []
    size = 0
    while batch := list(islice(several, _LINES_AT_ONCE)):
        gathered += batch
        size += sum(map(len, batch))
        if size >= PIECE_BYTES:
            yield _piece(gathered, None)
            gathered, size = [], 0
    if gathered:
        yield _piece(gathered, None)


def gather_numbered(lines: Iterable[tuple[int, bytes]]) -> Iterator[Gathered]:
    """The same of lines with numbers in any order, as a program has them whose loops are written out."""
    several = iter(lines)
    numbers: list[int] = []
    gathered: list[bytes] = []
    size = 0
    while batch := list(islice(several, _LINES_AT_ONCE)):
        numbers += [number for number, _ in batch]
        gathered += [line for _, line in batch]
        size += sum(len(line) for _, line in batch)
        if size >= PIECE_BYTES:
            yield _piece(gathered, np.array(numbers, np.int64))
            numbers, gathered, size = [], [], 0
    if gathered:
        yield _piece(gathered, np.array(numbers, np.int64))


def _piece(lines: list[bytes], numbers: Ints | None) -> Gathered:
    too_long = tuple(row for row, line in enumerate(lines) if len(line) > MAX_LINE_BYTES)
    for row in too_long:
        lines[row] = b""
    text = b"\n".join(lines) + b"\n"
    if b"\r" in text or text.count(b"\n") != len(lines):
        text = b"\n".join([line.replace(b"\r", b" ").replace(b"\n", b" ") for line in lines]) + b"\n"
    return Gathered(text, numbers, too_long)


class Fingerprint:
    """What the bytes of a file are: length, hash, encoding, line ends. Chunks of any size."""

    def __init__(self, encoding: str) -> None:
        self.bytes = 0
        self._hash = hashlib.sha256()
        self._ascii = True
        self._begin = b""
        self._fallback = encoding
        self._decoder: codecs.IncrementalDecoder | None = codecs.getincrementaldecoder("utf-8")()
        self._feeds = self._returns = self._both = 0
        self._ends_with_return = False

    def through(self, chunks: Iterable[bytes]) -> Iterator[bytes]:
        """The same chunks; each is looked at on its way."""
        for chunk in chunks:
            self._look(chunk)
            yield chunk

    @property
    def sha256(self) -> str:
        """Of all bytes, in hex."""
        return self._hash.hexdigest()

    @property
    def encoding(self) -> str:
        """`ascii`, `utf-8`, `utf-8 with BOM`, or what is read in place of it."""
        if self._begin.startswith(BOM):
            return "utf-8 with BOM"
        if self._ascii:
            return "ascii"
        if self._is_utf8():
            return "utf-8"
        # As decode_line: what is not the encoding that was told is read as CP1251.
        return "cp1251" if self._fallback.lower().replace("_", "-") in ("utf-8", "utf8") else self._fallback

    @property
    def line_ends(self) -> str:
        r"""`lf`, `crlf`, `cr`, `mixed`, or `none`."""
        counts = {"lf": self._feeds - self._both, "crlf": self._both, "cr": self._returns - self._both}
        kinds = [kind for kind, count in counts.items() if count]
        return kinds[0] if len(kinds) == 1 else "mixed" if kinds else "none"

    def _look(self, chunk: bytes) -> None:
        self._hash.update(chunk)
        if len(self._begin) < len(BOM):
            self._begin += chunk[: len(BOM) - len(self._begin)]
        self.bytes += len(chunk)
        self._feeds += chunk.count(b"\n")
        if b"\r" in chunk:
            self._returns += chunk.count(b"\r")
            self._both += chunk.count(b"\r\n")
        if self._ends_with_return and chunk.startswith(b"\n"):
            self._both += 1
        if chunk:
            self._ends_with_return = chunk.endswith(b"\r")
        if self._ascii and chunk.isascii():
            return
        self._ascii = False
        if self._decoder is not None:
            try:
                self._decoder.decode(chunk)
            except UnicodeDecodeError:
                self._decoder = None

    def _is_utf8(self) -> bool:
        # A character that the file breaks off in is none.
        return self._decoder is not None and not self._decoder.getstate()[0]
