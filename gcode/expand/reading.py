"""A line of a program without comments and blanks, with the column each character had. Not its meaning.

The one rule: what is left out here is a comment, a blank or a remark line, by the same rules as in gcode/words.py
(rs274 §1); the comments are kept aside, for people and for messages.
"""

import re
from dataclasses import dataclass

from gcode.expand.errors import ExpandError
from gcode.words import decode_line

_BLANKS = " \t\r\n"
_SWITCHES = frozenset("123456789")
_LINE_ENDS = str.maketrans({"\r": " ", "\n": " "})
# What makes a line that begins with # a setting and not a remark: `#1=`, `#<name>=`, `##1=`, `#[...]=`.
_ASSIGNMENT = re.compile(r"#(?:[0-9]+\.?[0-9]*|<[^>]*>|[#\[][^=]*)=")


@dataclass(frozen=True, slots=True)
class Source:
    """Line number `line` of the file. `chars`: upper case, no blanks, no comments, no block delete; `columns` theirs.

    `text` is the line as it stands; `comments` those in it, with their brackets. `remark`: the whole line is one.
    """

    line: int
    text: str
    chars: str
    columns: list[int]
    comments: tuple[str, ...]
    deleted: bool
    remark: bool

    def column(self, at: int) -> int:
        """The column of the character `at`; behind the last one, the column after it."""
        if at < len(self.columns):
            return self.columns[at]
        return self.columns[-1] + 1 if self.columns else 1

    def error(self, at: int, code: str, message: str) -> ExpandError:
        """An error at the character `at`."""
        return ExpandError(self.line, self.column(at), code, message)


def read_source(line: int, raw: bytes) -> Source:
    """Read the bytes of a line. Raises ExpandError for a comment that is not closed and for nothing else."""
    text = decode_line(raw).translate(_LINE_ENDS)
    if text.lstrip(_BLANKS).startswith(("%", "//")):
        return Source(line, text, "", [], (), False, True)
    chars, columns, comments = _strip(line, text)
    if chars.startswith("#") and not _ASSIGNMENT.match(chars):
        return Source(line, text, "", [], (), False, True)
    deleted = chars.startswith("/")
    if deleted:
        start = 2 if chars[1:2] in _SWITCHES else 1
        chars, columns = chars[start:], columns[start:]
    return Source(line, text, chars, columns, comments, deleted, False)


def _strip(line: int, text: str) -> tuple[str, list[int], tuple[str, ...]]:
    if "(" not in text and ";" not in text and text.isascii():
        # The usual line, without a step through every character.
        pairs = [(char, at) for at, char in enumerate(text.upper(), 1) if char not in _BLANKS]
        return "".join([char for char, _ in pairs]), [at for _, at in pairs], ()
    chars: list[str] = []
    columns: list[int] = []
    comments: list[str] = []
    at = 0
    while at < len(text):
        char = text[at]
        if char == "(":
            end = text.find(")", at)
            if end < 0:
                raise ExpandError(line, at + 1, "unclosed_comment", "the comment that begins here is not closed")
            comments.append(text[at : end + 1])
            at = end
        elif char == ";":
            comments.append(text[at:])
            break
        elif char not in _BLANKS:
            chars.append(char.upper() if char.isascii() else char)
            columns.append(at + 1)
        at += 1
    return "".join(chars), columns, tuple(comments)
