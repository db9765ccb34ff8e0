"""A line of G-code to words: the reader. Not the meaning of words; that is modal.py and the profiles.

Two readers stand here: one compiled pattern for the usual shape of a line, and the careful one for everything else;
both give the same words. The one rule: nothing is dropped silently. Every character is part of a word, of a
comment, blank, or of a Fault with its column.
"""

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

MAX_NUMBER = 1e9
"""Numbers of this size and more are refused: no axis is that long, and every sum below stays finite."""

MAX_FAULTS = 16
"""Most faults reported of one line."""


class Word(NamedTuple):
    """`letter` upper case; `value` its number; `text` the number as written, without blanks; `column` from 1.

    A named tuple, because there are millions of them: it is made in half the time of a frozen dataclass.
    """

    letter: str
    value: float
    text: str
    column: int

    @property
    def code(self) -> str:
        """The canonical name of a G, M or W code: `G1` for G01, g1. or G1.0; `G81.99`."""
        return code_name(self.letter, self.text)


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that is no word. `code` is a stable name, `message` is for people."""

    column: int
    code: str
    message: str


@dataclass(frozen=True, slots=True)
class Block:
    """One line, read. `deleted`: it began with `/` (block delete). `words` are in the order of the line."""

    words: tuple[Word, ...]
    deleted: bool
    faults: tuple[Fault, ...]
    text: str


def decode_line(raw: bytes, encoding: str = "utf-8") -> str:
    """Bytes of a line to text, without its end and without a byte order mark. Never raises on any bytes.

    What is not `encoding` is read as CP1251, and where even that has no character, as Latin-1: outside comments
    such characters are a fault anyway, inside they are for people to read (rs274 §1).
    """
    raw = raw.rstrip(b"\r\n")
    for candidate in (encoding, "cp1251"):
        try:
            return raw.decode(candidate).removeprefix("\ufeff")
        except UnicodeDecodeError:
            continue
    return raw.decode("latin-1")


@lru_cache(maxsize=4096)
def code_name(letter: str, text: str) -> str:
    """`letter` and the number `text` without superfluous zeros, sign and point; a value that is no code stays odd."""
    return letter + shortest(text)


def shortest(text: str) -> str:
    """The same number in fewer characters: no `+`, no zeros that say nothing. Digits are never rounded.

    A zero before the point stays where one was written: not every controller reads `.5`.
    """
    if _SHORTEST.fullmatch(text):
        return text
    sign = "-" if text.startswith("-") else ""
    whole, _, fraction = text.lstrip("+-").partition(".")
    fraction = fraction.rstrip("0")
    had_whole = bool(whole)
    whole = whole.lstrip("0")
    if not whole and (had_whole or not fraction):
        whole = "0"
    number = f"{whole}.{fraction}" if fraction else whole
    return number if number == "0" else sign + number


# What most numbers are already; `-0` is not.
_SHORTEST = re.compile(r"-?(?:0|[1-9][0-9]*)?\.[0-9]*[1-9]|-?[1-9][0-9]*|0")


# --- the usual shape ------------------------------------------------------------------------------------------

# Each digit has one way only to be matched: these patterns meet hostile lines and must not backtrack.
_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
# All letters but O, which may begin flow of control; numbers short enough to be under MAX_NUMBER.
_USUAL_LINE = re.compile(r"(?:[A-NP-Z][+-]?(?:[0-9]{1,9}(?:\.[0-9]{0,15})?|\.[0-9]{1,15})[ ]*)+")
_USUAL_WORD = re.compile(rf"([A-NP-Z])({_NUMBER})( *)")


def parse_block(text: str) -> Block:
    """Read one line (without its end). Never raises; what cannot be read is in `faults`."""
    if not _USUAL_LINE.fullmatch(text):
        return parse_carefully(text)
    words = []
    column = 1
    for letter, number, blanks in _USUAL_WORD.findall(text):
        words.append(Word(letter, float(number), number, column))
        column += 1 + len(number) + len(blanks)
    return Block(tuple(words), False, (), text)


# --- the careful reader ---------------------------------------------------------------------------------------

_BLANKS = " \t\r\n"
_CAREFUL_NUMBER = re.compile(r"[+-]?[0-9.]*")
_VALID_NUMBER = re.compile(_NUMBER)
_REALTIME = "!~?"
_SWITCHES = frozenset("123456789")
_DIGITS = re.compile(r"[0-9]+")
_FLOW = re.compile(r"(?:SUB|ENDSUB|CALL|RETURN|IF|ELSEIF|ELSE|ENDIF|WHILE|ENDWHILE|DO|REPEAT|ENDREPEAT|BREAK|CONTINUE)")
# `#1=`, `#<name>=` and `#[...]=` set parameters of a program; other lines that begin with `#` are remarks.
_ASSIGNMENT = re.compile(r"#[ \t]*(?:(?:[0-9]+|<[^>]*>)[ \t]*=|[#\[][^=]*=)")
_MACRO = re.compile(r"(?:WHILE|IF|GOTO|DO[0-9]|END[0-9]|THEN)")


def parse_carefully(text: str) -> Block:
    """As `parse_block`, for a line of any shape."""
    return _Reader(text).read()


class _Reader:
    """Reads one line. `_chars` are its characters outside comments, without blanks, `_columns` where they stood."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._faults: list[Fault] = []
        self._words: list[Word] = []
        self._chars = ""
        self._columns: list[int] = []
        self._at = 0

    def read(self) -> Block:
        if self._is_remark():
            return Block((), False, (), self._text)
        self._strip()
        deleted = self._block_delete()
        while self._at < len(self._chars):
            self._next()
        return Block(tuple(self._words), deleted, tuple(self._faults), self._text)

    def _is_remark(self) -> bool:
        """`%` lines are markers (rs274 §1); `//` and `# text` at the line's start are comments of some tools."""
        start = self._text.lstrip(_BLANKS)
        if start.startswith(("%", "//")):
            return True
        return start.startswith("#") and not _ASSIGNMENT.match(start)

    def _strip(self) -> None:
        """Takes comments and blanks away. Blanks mean nothing, not even inside a number (rs274 §1)."""
        text, chars, at = self._text, [], 0
        while at < len(text):
            char = text[at]
            if char == "(":
                end = text.find(")", at)
                if end < 0:
                    self._fault(at + 1, "unclosed_comment", "the comment that begins here is not closed")
                    break
                at = end
            elif char == ";":
                break
            elif char not in _BLANKS:
                # Only ASCII is upcased: other letters change their number, or become ASCII, by it.
                chars.append(char.upper() if char.isascii() else char)
                self._columns.append(at + 1)
            at += 1
        self._chars = "".join(chars)

    def _block_delete(self) -> bool:
        if not self._chars.startswith("/"):
            return False
        # Fanuc numbers the switches: /1 to /9. One switch serves them all.
        self._at = 2 if self._chars[1:2] in _SWITCHES else 1
        return True

    def _next(self) -> None:
        char = self._chars[self._at]
        if char in "O:":
            self._program_number()
        elif _MACRO.match(self._chars, self._at):
            self._rest("macro", "macro statements (WHILE, IF, GOTO) are not supported")
        elif char.isascii() and char.isalpha():
            self._word(char)
        else:
            self._junk(char)

    def _word(self, letter: str) -> None:
        column = self._columns[self._at]
        self._at += 1
        following = self._chars[self._at : self._at + 1]
        if following and following in "#[":
            self._rest("expression", f"{letter} with a parameter or an expression is not supported")
            return
        match = _CAREFUL_NUMBER.match(self._chars, self._at)
        text = match[0] if match else ""
        self._at += len(text)
        if not text:
            self._fault(column, "no_number", f"{letter} without a number")
        elif not _VALID_NUMBER.fullmatch(text):
            self._fault(column, "bad_number", f"{letter}{_short(text)} is not a number")
        elif abs(value := float(text)) >= MAX_NUMBER:
            self._fault(column, "bad_number", f"the number of {letter} is too large")
        else:
            self._words.append(Word(letter, value, text, column))

    def _program_number(self) -> None:
        """`O1234` and `:1234` name a program; `O100 IF` and `O<name> CALL` are LinuxCNC's flow of control."""
        column = self._columns[self._at]
        match = _DIGITS.match(self._chars, self._at + 1)
        end = match.end() if match else self._at + 1
        if match is None or _FLOW.match(self._chars, end):
            self._rest("flow", "O-words with flow of control (sub, call, if, while) are not supported")
            return
        number = match[0]
        self._at = end
        if (value := float(number)) >= MAX_NUMBER:
            self._fault(column, "bad_number", "the program number is too large")
            return
        self._words.append(Word("O", value, number, column))

    def _junk(self, char: str) -> None:
        column = self._columns[self._at]
        if char == "#" or char == "[":
            self._rest("expression", "parameters and expressions are not supported")
            return
        if char == "$":
            self._rest("system_command", "a $ line is a command to a Grbl controller, not G-code")
            return
        code, message = _junk_of(char)
        if code != "stray_number":
            self._at += 1
        else:
            match = _CAREFUL_NUMBER.match(self._chars, self._at)
            self._at += max(1, len(match[0]) if match else 1)
        self._fault(column, code, message)

    def _rest(self, code: str, message: str) -> None:
        """What cannot be read word by word takes the rest of the line with it."""
        self._fault(self._columns[min(self._at, len(self._columns) - 1)], code, message)
        self._at = len(self._chars)

    def _fault(self, column: int, code: str, message: str) -> None:
        # A line of junk says the same a thousand times: the first faults are enough to refuse it.
        if len(self._faults) < MAX_FAULTS:
            self._faults.append(Fault(column, code, message))


def _junk_of(char: str) -> tuple[str, str]:
    if char in _REALTIME:
        return "realtime_character", f"{char} is a real-time command of some controllers"
    if not char.isascii():
        return "not_ascii", f"character {ascii(char)[1:-1]} outside a comment"
    if char == ")":
        return "stray_bracket", "a closing bracket without a comment"
    if char == "/":
        return "stray_slash", "/ is block delete only at the start of a line"
    if char.isdigit() or char in "+-.":
        return "stray_number", "a number without a letter before it"
    shown = char if char.isprintable() else ascii(char)[1:-1]
    return "bad_character", f"unreadable character {shown}"


def _short(text: str) -> str:
    return text if len(text) <= 24 else text[:24] + "..."
