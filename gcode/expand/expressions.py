"""Expressions: `[1 + #2 * sin[30]]` read into functions of a scope. Not the line around them.

The one rule: reading and evaluating are bounded. Brackets nest at most MAX_NESTING deep, and a row of operators, as
long as it may be, is worked off in a loop.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from gcode.expand.arithmetic import (
    BINARIES,
    COMPARISONS,
    FUNCTIONS,
    LOGIC,
    Binary,
    Dialect,
    Value,
    arc_tangent,
    as_number,
    finite,
    integer,
)
from gcode.expand.errors import RefusalError
from gcode.expand.reading import Source

MAX_NESTING = 100
"""Brackets, signs and # within each other. Real programs nest five deep; Python's own stack ends at some hundred."""


class Scope(Protocol):
    """Where the values of parameters come from. Both ways of reading raise RefusalError."""

    def number(self, index: int) -> Value:
        """The value of `#index`."""

    def named(self, name: str) -> Value:
        """The value of `#<name>`; the name in upper case without blanks."""

    def exists(self, name: str) -> bool:
        """Whether `#<name>` has a value."""


Expression = Callable[[Scope], Value]


@dataclass(frozen=True, slots=True)
class Parameter:
    """`#<name>`, or `#` and the `index` that is computed first. `at`: its place in the line."""

    at: int
    name: str = ""
    index: Expression | None = None


_OPERATOR = {
    "linuxcnc": re.compile(r"\*\*|[*/+-]|MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE"),
    "fanuc": re.compile(r"[*/+-]|MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE"),
}
_FUNCTION = re.compile(r"([A-Z]{2,6})\[")
_NUMBER = re.compile(r"[0-9]+(?:\.[0-9]*)?|\.[0-9]+")
_NAME = re.compile(r"<([^<>]+)>")
MAX_DIGITS = 300
"""More digits than this are no number, and float() would be infinite."""


def begins_value(chars: str, at: int) -> bool:
    """Whether a computed value begins here: a parameter, a bracket or a function, behind signs or not."""
    while chars[at : at + 1] in ("+", "-"):
        at += 1
    return chars[at : at + 1] in ("#", "[") or _FUNCTION.match(chars, at) is not None


class Reader:
    """Reads values from `at` on. `at` is where the next unread character stands. All methods raise ExpandError."""

    def __init__(self, source: Source, dialect: Dialect) -> None:
        self.source = source
        self.at = 0
        self.dialect: Dialect = dialect
        self._depth = 0

    def peek(self, text: str) -> bool:
        """Whether `text` comes next."""
        return self.source.chars.startswith(text, self.at)

    def take(self, text: str) -> bool:
        """Step over `text` if it comes next."""
        found = self.peek(text)
        if found:
            self.at += len(text)
        return found

    def value(self) -> Expression:
        """One value: number, parameter, bracket, function, with any signs before it."""
        self._enter()
        chars, start = self.source.chars, self.at
        negative = False
        while chars[self.at : self.at + 1] in ("+", "-"):
            negative ^= chars[self.at] == "-"
            self.at += 1
        value = self._unsigned()
        self._depth -= 1
        return self._located(start, lambda scope: _negated(value(scope))) if negative else value

    def bracket(self) -> Expression:
        """`[...]`."""
        start = self.at
        if not self.take("["):
            raise self.source.error(start, "bracket_missing", "an expression in [ ] is needed here")
        self._enter()
        value = self.expression()
        self._depth -= 1
        if not self.take("]"):
            raise self.source.error(self.at, "bad_expression", "an operator or ] is needed here")
        return value

    def expression(self) -> Expression:
        """Values with operators between them, up to the first character that is no operator."""
        postfix: list[Expression | Binary] = [self.value()]
        waiting: list[Binary] = []
        names: set[str] = set()
        start = self.at
        while match := _OPERATOR[self.dialect].match(self.source.chars, self.at):
            binary = BINARIES[self.dialect][match[0]]
            self._check_mixture(names, binary.name)
            self.at = match.end()
            while waiting and waiting[-1].precedence >= binary.precedence:
                postfix.append(waiting.pop())
            waiting.append(binary)
            postfix.append(self.value())
        postfix += reversed(waiting)
        if len(postfix) == 1 and not isinstance(postfix[0], Binary):
            return postfix[0]
        return self._located(start, lambda scope: _work_off(postfix, scope))

    def parameter(self) -> Parameter:
        """`#` and what names the parameter."""
        start = self.at
        chars = self.source.chars
        self.at += 1
        if match := _NAME.match(chars, self.at):
            if self.dialect == "fanuc":
                raise self.source.error(start, "bad_parameter", f"#<{match[1]}>: Fanuc's parameters have numbers")
            self.at = match.end()
            return Parameter(start, name=match[1])
        self._enter()
        if self.peek("#"):
            index = self._read(self.parameter())
        elif self.peek("["):
            index = self.bracket()
        elif _NUMBER.match(chars, self.at):
            index = self._number()
        else:
            raise self.source.error(start, "bad_parameter", "# without the number or the <name> of a parameter")
        self._depth -= 1
        return Parameter(start, index=index)

    def _enter(self) -> None:
        self._depth += 1
        if self._depth > MAX_NESTING:
            raise self.source.error(self.at, "too_nested", f"an expression nested more than {MAX_NESTING} deep")

    def _check_mixture(self, names: set[str], name: str) -> None:
        """Controls differ in what `[#1 EQ 1 AND #2 EQ 2]` means; Fanuc's manual would compare with `1 AND #2`."""
        compares = bool(names & COMPARISONS)
        if self.dialect == "fanuc" and (
            (name in COMPARISONS and (compares or names & LOGIC)) or (name in LOGIC and compares)
        ):
            raise self.source.error(
                self.at,
                "ambiguous_condition",
                f"each side of {name} needs brackets of its own: [[a EQ b] AND [c GT d]]",
            )
        names.add(name)

    def _unsigned(self) -> Expression:
        chars = self.source.chars
        if self.peek("["):
            return self.bracket()
        if self.peek("#"):
            return self._read(self.parameter())
        if match := _FUNCTION.match(chars, self.at):
            return self._function(match[1])
        if _NUMBER.match(chars, self.at):
            return self._number()
        raise self.source.error(self.at, "value_missing", "a number, a parameter or an expression is needed here")

    def _number(self) -> Expression:
        match = _NUMBER.match(self.source.chars, self.at)
        assert match is not None
        start, self.at = self.at, match.end()
        if self.peek(".") or len(match[0]) > MAX_DIGITS:
            raise self.source.error(start, "bad_number", f"{match[0][:24]}... is not a number")
        number = float(match[0])
        return lambda _scope: number

    def _read(self, parameter: Parameter) -> Expression:
        name, index = parameter.name, parameter.index
        if index is None:
            return self._located(parameter.at, lambda scope: scope.named(name))
        return self._located(parameter.at, lambda scope: scope.number(integer(index(scope), "a parameter's number")))

    def _function(self, name: str) -> Expression:
        start = self.at
        self.at += len(name)
        if name == "EXISTS" and self.dialect == "linuxcnc":
            return self._exists(start)
        if name == "ATAN":
            return self._arc_tangent(start)
        function = FUNCTIONS[self.dialect].get(name)
        if function is None:
            raise self.source.error(start, "unknown_function", f"there is no function {name}")
        argument = self.bracket()
        return self._located(start, lambda scope: finite(function(as_number(argument(scope)))))

    def _exists(self, start: int) -> Expression:
        self.at += 1
        if not self.peek("#"):
            raise self.source.error(start, "bad_expression", "EXISTS asks for a parameter: EXISTS[#<name>]")
        parameter = self.parameter()
        if not self.take("]"):
            raise self.source.error(self.at, "bad_expression", "] is needed behind the parameter of EXISTS")
        # Numbered parameters always exist.
        return lambda scope: float(not parameter.name or scope.exists(parameter.name))

    def _arc_tangent(self, start: int) -> Expression:
        over = self.bracket()
        under: Expression = _one
        if self.peek("/["):
            self.at += 1
            under = self.bracket()
        elif self.dialect == "linuxcnc":
            raise self.source.error(self.at, "bad_expression", "ATAN has two arguments: ATAN[y]/[x]")
        else:
            # One argument: -90 to 90.
            return self._located(start, lambda scope: arc_tangent(as_number(over(scope)), 1.0, "linuxcnc"))
        return self._located(
            start, lambda scope: arc_tangent(as_number(over(scope)), as_number(under(scope)), self.dialect)
        )

    def _located(self, at: int, expression: Expression) -> Expression:
        """The same, with the place in the program when it cannot be computed."""
        source = self.source

        def evaluate(scope: Scope) -> Value:
            try:
                return expression(scope)
            except RefusalError as error:
                raise source.error(at, error.code, error.message) from error

        return evaluate


def _one(_scope: Scope) -> Value:
    return 1.0


def _negated(value: Value) -> Value:
    """Null stays null, also with a sign before it."""
    return None if value is None else -value


def _work_off(postfix: list[Expression | Binary], scope: Scope) -> Value:
    stack: list[Value] = []
    for item in postfix:
        if isinstance(item, Binary):
            right = stack.pop()
            stack[-1] = finite(item.apply(stack[-1], right))
        else:
            stack.append(item(scope))
    return stack[0]
