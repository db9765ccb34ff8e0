"""G20 programs for a controller that has millimetres only: lengths times 25.4, G20 written as G21 (elvinto §6).

Only with `convert_inches`; otherwise G20 is an error of the check. The one rule: exact. Decimal digits are
multiplied as decimals, so nothing is rounded and nothing adds up.
"""

from dataclasses import replace
from decimal import Context, Decimal

from gcode.words import Block, Word

_LENGTHS = frozenset("XYZIJKRQF")
_MM_PER_INCH = Decimal("25.4")
_EXACT = Context(prec=400)
"""More digits than a finite number of a line that can be sent ever has."""


class InchConverter:
    """Follows G20 and G21 through a program and converts the blocks between them."""

    __slots__ = ("active",)

    def __init__(self) -> None:
        self.active = False

    def convert(self, block: Block) -> Block:
        """The same block in millimetres. Units on a line hold for that line already (rs274 §3)."""
        changed = False
        for word in block.words:
            if word.letter == "G" and word.code in ("G20", "G21"):
                self.active = word.code == "G20"
                changed = True
        if not (changed or self.active):
            return block
        return replace(block, words=tuple(self._word(word) for word in block.words))

    def _word(self, word: Word) -> Word:
        if word.letter == "G" and word.code == "G20":
            return word._replace(value=21.0, text="21")
        if not self.active or word.letter not in _LENGTHS:
            return word
        text = format(_EXACT.multiply(Decimal(word.text), _MM_PER_INCH), "f")
        return word._replace(value=float(text), text=text)
