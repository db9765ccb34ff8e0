"""Decimal numbers in a buffer to floats, all at once: eight characters of a number are one 64-bit integer.

Not a parser: where a number ends, its point and its sign are known already (columns.py). The one rule: each value is
`float(text)` to the last bit. Mantissa and power of ten are both exact in a float, so that the one division rounds
correctly; where the mantissa may be too long for that, `float` itself reads the text.
"""

import numpy as np
from numpy.typing import NDArray

PAD_BYTES = 16
"""Bytes that must stand before the first number of a buffer: numbers are loaded by their ends, 16 bytes at most."""

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int32]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
_Wide = NDArray[np.uint64]

_EXACT_MANTISSA = np.uint64(2**53)
_MAX_DIGITS = 16  # More would not fit a pair of loads; 10**16 is more than a float holds exactly anyway.
_MAX_DECIMALS = 15
_POWERS = np.array([10.0**n for n in range(_MAX_DECIMALS + 1)] + [-(10.0**n) for n in range(_MAX_DECIMALS + 1)])
_WIDE_POWERS = np.array([10**n for n in range(_MAX_DECIMALS + 1)], np.uint64)
_NEGATIVE = np.uint8(_MAX_DECIMALS + 1)
_BYTE = np.uint64(8)
_WORD = np.uint64(64)
_DIGITS = np.uint64(0x0F0F0F0F0F0F0F0F)
_PAIRS = np.uint64(0x00FF00FF00FF00FF)
_FOURS = np.uint64(0x0000FFFF0000FFFF)
_EIGHT = np.uint64(0xFFFFFFFF)


def read_decimals(text: bytes, end: Ints, chars: Ints, decimals: Ints, pointed: Bools, negative: Bools) -> Floats:
    """The values of numbers of `chars` digits and points, without sign, each of which ends before `text[end]`.

    `decimals`: digits behind the point, at most 15; before it are at most 9 (MAX_WHOLE_DIGITS of columns.py).
    """
    loads: _Wide = np.ndarray((len(text) - 7,), "<u8", text, 0, (1,))
    mantissa = _eight(_without_point(loads[end - 8], chars, decimals, pointed))
    power = _POWERS[decimals + negative * _NEGATIVE]
    values: Floats = mantissa.view(np.int64) / power
    longer = np.flatnonzero(chars > 8)
    if len(longer):
        # These do not fit one load with their point: whole digits and decimals are read apart.
        texts = end[longer], chars[longer], decimals[longer]
        values[longer] = _read_longer(text, loads, *texts, pointed[longer], power[longer])
    return values


def _without_point(eight: _Wide, chars: Ints, decimals: Ints, pointed: Bools) -> _Wide:
    """The digits of numbers of up to 8 characters, right-aligned (the last is the highest byte), zeros before them.

    A shift by 64 and more gives 0, as numpy defines it.
    """
    before = (64 - (chars << 3)).astype(np.uint64)
    eight = (eight >> before) << before
    behind = (decimals << 3).astype(np.uint64)
    through_point = behind + (pointed * _BYTE)
    whole = (eight << through_point) >> behind
    behind = _WORD - behind
    return ((eight >> behind) << behind) | whole


def _eight(digits: _Wide) -> _Wide:
    """Eight ASCII digits each (or zero bytes before the first) to integers: pairs, fours, eights."""
    digits = digits & _DIGITS
    digits = (digits * np.uint64(10) + (digits >> np.uint64(8))) & _PAIRS
    digits = (digits * np.uint64(100) + (digits >> np.uint64(16))) & _FOURS
    return (digits * np.uint64(10_000) + (digits >> np.uint64(32))) & _EIGHT


def _read_longer(
    text: bytes, loads: _Wide, end: Ints, chars: Ints, decimals: Ints, pointed: Bools, power: Floats
) -> Floats:
    digits = chars - pointed
    whole = _sixteen(loads, end - decimals - pointed, digits - decimals)
    mantissa = whole * _WIDE_POWERS[decimals] + _sixteen(loads, end, decimals)
    values: Floats = mantissa.view(np.int64) / power
    for index in np.flatnonzero((digits > _MAX_DIGITS) | (mantissa > _EXACT_MANTISSA)).tolist():
        value = float(text[end[index] - chars[index] : end[index]])
        values[index] = -value if power[index] < 0 else value
    return values


def _sixteen(loads: _Wide, end: Ints, digits: Ints) -> _Wide:
    """The integers of runs of up to 16 digits, which may be of none."""
    low = (64 - (np.minimum(digits, 8) << 3)).astype(np.uint64)
    value = _eight((loads[end - 8] >> low) << low)
    if digits.size and digits.max() > 8:
        high = (64 - (np.clip(digits - 8, 0, 8) << 3)).astype(np.uint64)
        value += _eight((loads[end - 16] >> high) << high) * np.uint64(100_000_000)
    return value
