"""Operators and functions of both dialects, with their precedence. Not the reader of expressions.

None is Fanuc's null: nothing was ever written there. The one rule: every result is a finite number or null; what has
none is a RefusalError that says why.
"""

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gcode.expand.errors import RefusalError

Value = float | None
Dialect = Literal["linuxcnc", "fanuc"]

EQUAL_WITHIN = 1e-6
"""LinuxCNC: values this near are EQ. Its other comparisons are exact."""

FANUC_EQUAL_WITHIN = 1e-9
"""Fanuc counts in decimal digits: a tenth taken away ten times is one. Relative to the larger value, at least 1."""

INTEGER_WITHIN = 1e-4
"""rs274 §1: a value that must be an integer may be off by this."""


@dataclass(frozen=True, slots=True)
class Binary:
    """An operator. Higher `precedence` binds tighter; all of one precedence go from left to right."""

    name: str
    precedence: int
    apply: Callable[[Value, Value], float]


def as_number(value: Value) -> float:
    """Null counts as 0 in arithmetic. Zero keeps its sign: ATAN[-0]/[-1] is -180."""
    return 0.0 if value is None else value


def finite(value: float) -> float:
    """`value`, when it is a number. Raises RefusalError."""
    if not math.isfinite(value):
        raise RefusalError("not_finite", "the result is infinite or no number at all")
    return value


def integer(value: Value, what: str) -> int:
    """`value` as an integer. Raises RefusalError when it is none (rs274 §1)."""
    number = finite(as_number(value))
    if abs(number - round(number)) > INTEGER_WITHIN:
        raise RefusalError("not_integer", f"{what} must be an integer, not {number:g}")
    return round(number)


def _on_numbers(function: Callable[[float, float], float]) -> Callable[[Value, Value], float]:
    def apply(left: Value, right: Value) -> float:
        return function(as_number(left), as_number(right))

    return apply


def _divide(left: float, right: float) -> float:
    if right == 0.0:
        raise RefusalError("division_by_zero", "division by zero")
    return left / right


def _power(left: float, right: float) -> float:
    if left < 0.0 and not float(right).is_integer():
        raise RefusalError("domain", "a negative number to a power that is no integer")
    if left == 0.0 and right < 0.0:
        raise RefusalError("division_by_zero", "zero to a negative power")
    try:
        return float(left**right)
    except OverflowError as error:
        raise RefusalError("not_finite", "the power is too large") from error


def _modulo(left: float, right: float) -> float:
    """LinuxCNC: never negative."""
    if right == 0.0:
        raise RefusalError("division_by_zero", "MOD by zero")
    rest = math.fmod(left, right)
    return rest + abs(right) if rest < 0.0 else rest


def _fanuc_modulo(left: float, right: float) -> float:
    """Fanuc: of the rounded numbers, with the sign of the first."""
    divisor = _half_away(right)
    if divisor == 0.0:
        raise RefusalError("division_by_zero", "MOD by zero")
    return math.fmod(_half_away(left), divisor)


def _near(left: float, right: float) -> bool:
    return abs(left - right) <= FANUC_EQUAL_WITHIN * max(1.0, abs(left), abs(right))


def _fanuc_equal(left: Value, right: Value) -> bool:
    """Null equals null only: it is not 0."""
    if left is None or right is None:
        return left is right
    return _near(left, right)


def _bits(function: Callable[[int, int], int]) -> Callable[[float, float], float]:
    """Fanuc's AND, OR and XOR work on the bits of integers; on the 1 and 0 of conditions that is logic."""

    def apply(left: float, right: float) -> float:
        return float(function(integer(left, "a side of AND, OR, XOR"), integer(right, "a side of AND, OR, XOR")))

    return apply


def _as_truth(test: Callable[[Value, Value], bool]) -> Callable[[Value, Value], float]:
    return lambda left, right: float(test(left, right))


def _table(
    levels: list[dict[str, Callable[[float, float], float]]], equality: dict[str, Callable[[Value, Value], bool]]
) -> dict[str, Binary]:
    table = {
        name: Binary(name, precedence, _on_numbers(function))
        for precedence, level in enumerate(levels, 1)
        for name, function in level.items()
    }
    comparison = table["LT"].precedence
    for name, test in equality.items():
        table[name] = Binary(name, comparison, _as_truth(test))
    return table


def _linuxcnc_equal(left: Value, right: Value) -> bool:
    return abs(as_number(left) - as_number(right)) < EQUAL_WITHIN


COMPARISONS = frozenset({"EQ", "NE", "GT", "GE", "LT", "LE"})
LOGIC = frozenset({"AND", "OR", "XOR"})

# LinuxCNC: AND, OR and XOR are of one precedence, and ** goes from the left as all others.
_LINUXCNC = _table(
    [
        {
            "AND": lambda left, right: float(left != 0.0 and right != 0.0),
            "OR": lambda left, right: float(left != 0.0 or right != 0.0),
            "XOR": lambda left, right: float((left != 0.0) != (right != 0.0)),
        },
        {
            "GT": lambda left, right: float(left > right),
            "GE": lambda left, right: float(left >= right),
            "LT": lambda left, right: float(left < right),
            "LE": lambda left, right: float(left <= right),
        },
        {"+": operator.add, "-": operator.sub},
        {"*": operator.mul, "/": _divide, "MOD": _modulo},
        {"**": _power},
    ],
    {"EQ": _linuxcnc_equal, "NE": lambda left, right: not _linuxcnc_equal(left, right)},
)

# Fanuc: AND stands with the multiplications, OR and XOR with the additions.
_FANUC = _table(
    [
        {
            "GT": lambda left, right: float(left > right and not _near(left, right)),
            "GE": lambda left, right: float(left >= right or _near(left, right)),
            "LT": lambda left, right: float(left < right and not _near(left, right)),
            "LE": lambda left, right: float(left <= right or _near(left, right)),
        },
        {"+": operator.add, "-": operator.sub, "OR": _bits(operator.or_), "XOR": _bits(operator.xor)},
        {"*": operator.mul, "/": _divide, "MOD": _fanuc_modulo, "AND": _bits(operator.and_)},
    ],
    {"EQ": _fanuc_equal, "NE": lambda left, right: not _fanuc_equal(left, right)},
)

BINARIES: dict[Dialect, dict[str, Binary]] = {"linuxcnc": _LINUXCNC, "fanuc": _FANUC}


def _half_away(value: float) -> float:
    """To the nearest integer, halves away from zero; what becomes zero has no sign."""
    return float(math.floor(value + 0.5)) if value >= 0.0 else float(math.ceil(value - 0.5))


def _down(value: float) -> float:
    """To the integer below; -0 keeps its sign, as in C."""
    return math.copysign(float(math.floor(value)), value)


def _up(value: float) -> float:
    """To the integer above; what is between -1 and 0 becomes -0, as in C."""
    return math.copysign(float(math.ceil(value)), value)


# As LinuxCNC: in extended precision where there is one. COS[90] is nothing then, and no -1E-16 that MOD 7 makes a 7.
_PI = np.longdouble("3.14159265358979323846264338327950288")


def _circular(function: Callable[[np.longdouble], np.longdouble]) -> Callable[[float], float]:
    def apply(degrees: float) -> float:
        # An angle this large has lost its fraction long before; in radians it might overflow.
        small = degrees if abs(degrees) < 1e15 else math.fmod(degrees, 360.0)
        return float(function(np.longdouble(small) * _PI / 180))

    return apply


def _degrees(radians: float) -> float:
    return float(np.longdouble(radians) * 180 / _PI)


def _arc(name: str, function: Callable[[float], float]) -> Callable[[float], float]:
    def apply(value: float) -> float:
        if not -1.0 <= value <= 1.0:
            raise RefusalError("domain", f"{name} of {value:g}: only -1 to 1 is possible")
        return _degrees(function(value))

    return apply


def _square_root(value: float) -> float:
    if value < 0.0:
        raise RefusalError("domain", f"square root of {value:g}, which is negative")
    return math.sqrt(value)


def _logarithm(value: float) -> float:
    if value <= 0.0:
        raise RefusalError("domain", f"LN of {value:g}: only numbers over 0 have a logarithm")
    return math.log(value)


def _exponential(value: float) -> float:
    try:
        return math.exp(value)
    except OverflowError as error:
        raise RefusalError("not_finite", f"EXP of {value:g} is too large") from error


def _fanuc_asin(value: float) -> float:
    """Fanuc's own range (parameter NAT = 0): 270 to 360 for negative values, not -90 to 0."""
    angle = _arc("ASIN", math.asin)(value)
    return angle + 360.0 if angle < 0.0 else angle


_COMMON: dict[str, Callable[[float], float]] = {
    "ABS": abs,
    "ACOS": _arc("ACOS", math.acos),
    "ASIN": _arc("ASIN", math.asin),
    "COS": _circular(np.cos),
    "EXP": _exponential,
    "FIX": _down,
    "FUP": _up,
    "LN": _logarithm,
    "ROUND": _half_away,
    "SIN": _circular(np.sin),
    "SQRT": _square_root,
    "TAN": _circular(np.tan),
}

FUNCTIONS: dict[Dialect, dict[str, Callable[[float], float]]] = {
    "linuxcnc": _COMMON,
    # Fanuc cuts towards zero with FIX and away from it with FUP, where LinuxCNC goes down and up.
    "fanuc": {
        **_COMMON,
        "ASIN": _fanuc_asin,
        "FIX": lambda value: float(math.trunc(value)),
        "FUP": lambda value: math.copysign(float(math.ceil(abs(value))), value),
    },
}


def arc_tangent(over: float, under: float, dialect: Dialect) -> float:
    """ATAN[over]/[under] in degrees: -180 to 180 in LinuxCNC, 0 to 360 in Fanuc (parameter NAT = 0)."""
    angle = _degrees(math.atan2(over, under))
    return angle + 360.0 if dialect == "fanuc" and angle < 0.0 else angle
