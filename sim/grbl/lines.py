"""Bytes to lines as Grbl makes them: CR and LF each end one, blanks and comments go, letters are raised (grbl II.1).

The one rule: the length is counted after all that; character 80 of what is left makes the line an overflow (error:11).
"""

from dataclasses import dataclass

_COMMENT = ord("(")
_COMMENT_END = ord(")")
_TO_END = ord(";")


@dataclass(frozen=True, slots=True)
class Line:
    """`text` as the parser gets it; `raw_bytes` how many bytes it took in the ring, its end mark with it."""

    text: str
    overflow: bool
    raw_bytes: int


class LineReader:
    """One byte after the other; `feed` gives a line with each end mark."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._text = bytearray()
        self._raw_bytes = 0
        self._comment = 0
        """The character that opened a comment; it also stands for what comes after an overflow: all is thrown away."""
        self._overflow = False

    def clear(self) -> None:
        self._text.clear()
        self._raw_bytes = 0
        self._comment = 0
        self._overflow = False

    def feed(self, byte: int) -> Line | None:
        self._raw_bytes += 1
        if byte in (10, 13):
            line = Line(self._text.decode("ascii"), self._overflow, self._raw_bytes)
            self.clear()
            return line
        if self._comment or self._overflow:
            # Inside a comment nothing counts but its end; a `;` comment and an overflow last to the end of the line.
            if byte == _COMMENT_END and self._comment == _COMMENT:
                self._comment = 0
        elif byte in (_COMMENT, _TO_END):
            self._comment = byte
        elif byte > 32 and byte != 47:  # control characters, blanks, and the block delete that is none
            if len(self._text) >= self._limit:
                self._overflow = True
            else:
                self._text.append(byte - 32 if 97 <= byte <= 122 else byte)
        return None
