"""A line to statements: words, settings, O-words, macro statements. Not their execution.

The one rule: every character of a line is part of a statement or the line is an ExpandError at that character.
"""

import re
from dataclasses import dataclass

from gcode.expand.arithmetic import Dialect
from gcode.expand.errors import ExpandError
from gcode.expand.expressions import Expression, Parameter, Reader, begins_value
from gcode.expand.reading import Source
from gcode.words import MAX_NUMBER, parse_block

MAX_ARGUMENTS = 30
"""LinuxCNC: as many as there are local parameters."""


@dataclass(frozen=True, slots=True)
class Part:
    """A word whose number stands as `text` or is computed from `value`."""

    letter: str
    text: str
    value: Expression | None
    at: int


@dataclass(frozen=True, slots=True)
class Setting:
    """`target = value`."""

    target: Parameter
    value: Expression


@dataclass(frozen=True, slots=True)
class Words:
    """Words of one block and the settings among them. `as_written`: nothing is computed, the text may stay."""

    parts: tuple[Part, ...]
    settings: tuple[Setting, ...]
    as_written: bool


@dataclass(frozen=True, slots=True)
class Flow:
    """An O-word. `label`: `<NAME>` or digits; where it is computed, `computed` gives the digits."""

    keyword: str
    label: str
    computed: Expression | None
    arguments: tuple[Expression, ...]
    at: int


@dataclass(frozen=True, slots=True)
class ProgramNumber:
    """`O1234` or `:1234`: here a program or a subprogram begins."""

    number: str
    at: int


@dataclass(frozen=True, slots=True)
class Loop:
    """`WHILE [condition] DO number`; without a condition it goes on until a GOTO leaves it."""

    condition: Expression | None
    number: str
    at: int


@dataclass(frozen=True, slots=True)
class LoopEnd:
    """`END number`."""

    number: str
    at: int


@dataclass(frozen=True, slots=True)
class Jump:
    """`GOTO n`, and `IF [condition] GOTO n`."""

    condition: Expression | None
    target: Expression
    at: int


@dataclass(frozen=True, slots=True)
class Guarded:
    """`IF [condition] THEN setting`."""

    condition: Expression
    setting: Setting
    at: int


Statement = Words | Flow | ProgramNumber | Loop | LoopEnd | Jump | Guarded

FLOW = re.compile(
    r"O(<[^<>]*>|[0-9]+)"
    r"(ENDSUB|SUB|CALL|RETURN|ELSEIF|ELSE|ENDIF|IF|ENDWHILE|WHILE|DO|ENDREPEAT|REPEAT|BREAK|CONTINUE)"
)
COMPUTED_FLOW = re.compile(r"O[#\[]")
NUMBERED = re.compile(r"[O:]([0-9]+)")
MACRO = re.compile(r"WHILE|DO[0-9]|END[0-9]|IF|GOTO")
SEQUENCE = re.compile(r"N([0-9]+)")
_LITERAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)")
_CONDITIONAL = frozenset({"IF", "ELSEIF", "WHILE", "REPEAT"})
_VALUED = frozenset({"RETURN", "ENDSUB"})


def plain_number(digits: str) -> str:
    """Digits without the zeros before them: O0100 is O100."""
    return digits.lstrip("0") or "0"


def parse_statements(source: Source, dialect: Dialect) -> tuple[Statement, ...]:
    """The statements of a line, in their order. Raises ExpandError."""
    return _Parser(source, dialect).read()


class _Parser:
    """Reads one line. Words gather in `_parts` and `_settings` until another statement comes."""

    def __init__(self, source: Source, dialect: Dialect) -> None:
        self._source = source
        self._chars = source.chars
        self._dialect = dialect
        self._reader = Reader(source, dialect)
        self._parts: list[Part] = []
        self._settings: list[Setting] = []
        self._statements: list[Statement] = []
        self._computed = False

    def read(self) -> tuple[Statement, ...]:
        if not self._source.chars:
            return ()
        self._number_of_the_line()
        if self._begins_flow():
            # A number before an O-word of flow says nothing and goes with it.
            self._parts.clear()
            self._statements.append(self._flow())
        else:
            while self._reader.at < len(self._chars):
                self._next()
        self._close_words()
        return tuple(self._statements)

    def _number_of_the_line(self) -> None:
        if match := SEQUENCE.match(self._chars):
            self._parts.append(Part("N", match[1], None, 0))
            self._reader.at = match.end()

    def _next(self) -> None:
        at = self._reader.at
        char = self._chars[at]
        if char == "#":
            self._setting()
        elif MACRO.match(self._chars, at):
            self._close_words()
            self._statements.append(self._macro())
        elif match := NUMBERED.match(self._chars, at):
            self._close_words()
            self._reader.at = match.end()
            self._statements.append(ProgramNumber(plain_number(match[1]), at))
        elif char.isascii() and char.isalpha():
            self._word(char)
        else:
            raise self._unreadable()

    def _setting(self) -> None:
        setting = self._read_setting()
        self._computed = True
        if self._dialect == "fanuc":
            # Fanuc works statement by statement; LinuxCNC sets what it has read when the line is over (rs274 §1).
            if any(part.letter != "N" for part in self._parts):
                self._close_words()
            self._parts.clear()
            self._settings.append(setting)
            self._close_words()
        else:
            self._settings.append(setting)

    def _read_setting(self) -> Setting:
        reader = self._reader
        if not reader.peek("#"):
            raise self._source.error(reader.at, "bad_statement", "a setting like #1 = 2 is needed here")
        target = reader.parameter()
        if not reader.take("="):
            raise self._source.error(reader.at, "bad_statement", "a parameter that is not set with = and has no letter")
        # Fanuc needs no brackets on the right, LinuxCNC does.
        return Setting(target, reader.expression() if self._dialect == "fanuc" else reader.value())

    def _word(self, letter: str) -> None:
        at = self._reader.at
        self._reader.at += 1
        if letter != "N" and begins_value(self._chars, at + 1):
            self._computed = True
            self._parts.append(Part(letter, "", self._reader.value(), at))
            return
        match = _LITERAL.match(self._chars, at + 1)
        if match is None or len(match[0]) > 60 or abs(float(match[0])) >= MAX_NUMBER:
            raise self._unreadable(at)
        self._reader.at = match.end()
        self._parts.append(Part(letter, match[0], None, at))

    def _unreadable(self, at: int | None = None) -> ExpandError:
        """What the reader of plain lines says about it, where it says something at all."""
        faults = parse_block(self._source.text).faults
        hard = [fault for fault in faults if fault.code not in ("expression", "flow", "macro")]
        if hard:
            return ExpandError(self._source.line, hard[0].column, hard[0].code, hard[0].message)
        return self._source.error(self._reader.at if at is None else at, "bad_statement", "this cannot be read")

    def _close_words(self) -> None:
        # The number of a line, alone before another statement, makes no block.
        at_the_end = self._reader.at >= len(self._chars) and not self._statements
        if self._settings or any(part.letter != "N" for part in self._parts) or (self._parts and at_the_end):
            as_written = not self._computed and not self._statements
            self._statements.append(Words(tuple(self._parts), tuple(self._settings), as_written))
        self._parts.clear()
        self._settings.clear()

    # --- O-words --------------------------------------------------------------------------------------------------

    def _begins_flow(self) -> bool:
        at = self._reader.at
        if FLOW.match(self._chars, at) or COMPUTED_FLOW.match(self._chars, at):
            return True
        if self._chars.startswith("O<", at):
            raise self._source.error(at, "bad_flow", "an O-word without sub, call, if, while or the like")
        return False

    def _flow(self) -> Flow:
        at = self._reader.at
        if self._dialect == "fanuc":
            raise self._source.error(at, "other_dialect", "an O-word of LinuxCNC in a Fanuc program")
        match = FLOW.match(self._chars, at)
        computed = None
        label = keyword = ""
        if match:
            self._reader.at = match.end()
            label = match[1] if match[1].startswith("<") else plain_number(match[1])
            keyword = match[2]
        else:
            self._reader.at += 1
            computed = self._reader.value()
            keyword = "CALL"
            if not self._reader.take("CALL"):
                raise self._source.error(self._reader.at, "bad_flow", "only a call may have a computed O-number")
        arguments = self._arguments(keyword)
        if self._reader.at < len(self._chars):
            raise self._source.error(self._reader.at, "bad_flow", f"nothing more may stand behind {keyword.lower()}")
        return Flow(keyword, label, computed, arguments, at)

    def _arguments(self, keyword: str) -> tuple[Expression, ...]:
        reader = self._reader
        if keyword in _CONDITIONAL:
            return (reader.bracket(),)
        if keyword in _VALUED:
            return (reader.bracket(),) if reader.peek("[") else ()
        arguments: list[Expression] = []
        while keyword == "CALL" and reader.peek("["):
            if len(arguments) == MAX_ARGUMENTS:
                raise self._source.error(reader.at, "bad_flow", f"a call has at most {MAX_ARGUMENTS} arguments")
            arguments.append(reader.bracket())
        return tuple(arguments)

    # --- macro statements -----------------------------------------------------------------------------------------

    def _macro(self) -> Statement:
        reader, at = self._reader, self._reader.at
        if self._dialect == "linuxcnc":
            raise self._source.error(at, "other_dialect", "a macro statement of Fanuc in a LinuxCNC program")
        if reader.take("WHILE"):
            condition = reader.bracket()
            if not reader.peek("DO"):
                raise self._source.error(reader.at, "bad_statement", "DO and its number are needed behind WHILE [...]")
            return Loop(condition, self._loop_number("DO"), at)
        if reader.take("GOTO"):
            return Jump(None, reader.value(), at)
        if reader.take("IF"):
            return self._if(at)
        if reader.peek("DO"):
            return Loop(None, self._loop_number("DO"), at)
        return LoopEnd(self._loop_number("END"), at)

    def _loop_number(self, keyword: str) -> str:
        reader = self._reader
        reader.at += len(keyword)
        number = self._chars[reader.at : reader.at + 1]
        if number not in ("1", "2", "3"):
            raise self._source.error(reader.at, "bad_statement", f"{keyword} has the number 1, 2 or 3")
        reader.at += 1
        return number

    def _if(self, at: int) -> Statement:
        condition = self._reader.bracket()
        if self._reader.take("GOTO"):
            return Jump(condition, self._reader.value(), at)
        if self._reader.take("THEN"):
            return Guarded(condition, self._read_setting(), at)
        raise self._source.error(self._reader.at, "bad_statement", "GOTO or THEN is needed behind IF [...]")
