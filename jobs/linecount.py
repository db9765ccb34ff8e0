"""Where the lines of an upload begin, counted piece by piece, and whether it is text at all.

Not the lines themselves (`gcode/lines.py`) and not a file. A gigabyte passes here beside a running job, so each step
is one of numpy's over a whole piece: those let other threads run meanwhile, an expression or a loop would not. Pieces
in which all lines end alike, as in nearly all files, take a third less. The one rule: how the bytes were cut into
pieces changes nothing.
"""

import numpy as np
from numpy.typing import NDArray

from gcode.lines import MAX_LINE_BYTES

LINES_PER_ENTRY = 1024
"""One u64 per so many lines: 8 kB of index for a million lines, at most 1,023 lines read in vain."""

_LF, _CR = 0x0A, 0x0D
_FIRST_PRINTABLE = 0x20
_TEXT = frozenset({0x09, _LF, 0x0B, 0x0C, _CR, 0x1A, 0x1B})
"""Control characters that a text may have: tabs, line ends, form feed, DOS's end of file and Escape."""
_BINARY: NDArray[np.bool_] = np.array([code not in _TEXT for code in range(_FIRST_PRINTABLE)])


class NotAProgramError(ValueError):
    """The upload is not text. Says where it stops being a program."""


class LineCounter:
    r"""Lines end with `\n`, `\r\n` or `\r`, mixed. After an error it must not be fed any more."""

    def __init__(self) -> None:
        self._ends = 0
        self._line_start = 0
        self._at = 0
        self._held = b""
        r"""A `\r` at the end of a piece: whether it is half of a `\r\n` the next one says."""

    @property
    def lines(self) -> int:
        """So many so far; a last line without an end counts."""
        return self._ends + (bool(self._held) or self._line_start < self._at)

    def feed(self, piece: bytes) -> bytes:
        """The entries of the index that this piece adds: where every LINES_PER_ENTRYth line begins, as u64, lowest
        byte first. Raises NotAProgramError."""
        data = self._held + piece
        self._held = b"\r" if data.endswith(b"\r") else b""
        codes = np.frombuffer(data, np.uint8, len(data) - len(self._held))
        at = np.flatnonzero(codes < _FIRST_PRINTABLE)
        marks = codes.take(at)
        texts_end, ends = self._ends_of(at, marks)
        return self._count(texts_end + self._at, ends + (self._at + 1), len(codes))

    def _ends_of(self, at: NDArray[np.intp], marks: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Where the texts of lines end, and the last byte of each end. Raises NotAProgramError."""
        is_lf = marks == _LF
        if is_lf.all():
            return at, at
        if not len(marks) % 2 and is_lf[1::2].all() and (marks[::2] == _CR).all() and (at[1::2] - at[::2] == 1).all():
            return at[::2], at[1::2]
        self._refuse_binary(at, marks)
        is_end = is_lf | (marks == _CR)
        pairs = (marks[:-1] == _CR) & is_lf[1:] & (at[1:] == at[:-1] + 1)
        is_end[:-1] &= ~pairs
        texts_end = at.copy()
        texts_end[1:] -= pairs
        return texts_end[is_end], at[is_end]

    def _refuse_binary(self, at: NDArray[np.intp], marks: NDArray[np.uint8]) -> None:
        found = np.flatnonzero(_BINARY[marks])
        if found.size:
            first = found[0]
            raise NotAProgramError(
                f"byte {self._at + at[first]} is 0x{marks[first]:02x}: this is a binary file, not a G-code program"
            )

    def _count(self, texts_end: NDArray[np.intp], starts: NDArray[np.intp], size: int) -> bytes:
        """Lines end with their text at `texts_end`, and the next ones begin at `starts`."""
        rest = self._at + size
        # All of them at once, in one array: each of the lengths but the last is from one start to the next end.
        lengths = np.empty(starts.size + 1, np.intp)
        lengths[:-1], lengths[-1] = texts_end, rest
        lengths[0] -= self._line_start
        lengths[1:] -= starts
        if lengths.max() > MAX_LINE_BYTES:
            raise NotAProgramError(
                f"line {self._ends + int(np.argmax(lengths > MAX_LINE_BYTES)) + 1} is longer than {MAX_LINE_BYTES} "
                "bytes: this is not a G-code program"
            )
        entries = starts[(-self._ends - 1) % LINES_PER_ENTRY :: LINES_PER_ENTRY]
        self._ends += starts.size
        self._line_start = int(starts[-1]) if starts.size else self._line_start
        self._at = rest
        return entries.astype("<u8").tobytes()

    def finish(self) -> bytes:
        r"""The end of the upload: a `\r` that was held back ends a line. The entry that this adds, if it does."""
        if not self._held:
            return b""
        self._held = b""
        end = np.array([self._at], np.intp)
        return self._count(end, end + 1, 1)
