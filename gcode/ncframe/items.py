"""The items of one frame (ncframe §2) as integers, and their ranges. Not their bytes: those are made on the wire.

The one rule: a frame whose items do not all fit into their bytes is never given out; `faults` says what does not fit.
"""

from dataclasses import dataclass

CODES = (0, 99)
"""There are 100 G and 100 M codes."""

BYTE = (0, 255)

THREE_BYTES = (-(1 << 23), (1 << 23) - 1)
"""24 bits, two's complement: 8.388 m in steps of 0.001 mm."""

RANGES = {"G": CODES, "M": CODES, "X": THREE_BYTES, "Z": THREE_BYTES, "R": THREE_BYTES, "F": BYTE, "S": BYTE, "T": BYTE}
"""Lowest and highest value by letter, in the order of the frame."""


@dataclass(frozen=True, slots=True)
class Items:
    """One frame; None: the item is not in it. `x`, `z`, `r` in counts, `r` negative for over half a turn.

    With G4 `x` is no increment but the dwell in milliseconds, as lathes have it (G04 X).
    """

    g: int | None = None
    m: int | None = None
    x: int | None = None
    z: int | None = None
    r: int | None = None
    f: int | None = None
    s: int | None = None
    t: int | None = None

    def present(self) -> list[tuple[str, int]]:
        """Letter and value of all that is in the frame, in the frame's order."""
        values = (self.g, self.m, self.x, self.z, self.r, self.f, self.s, self.t)
        return [(letter, value) for letter, value in zip(RANGES, values, strict=True) if value is not None]

    def __bool__(self) -> bool:
        return bool(self.present())

    def text(self) -> str:
        """As a block of a job: `G0 M3 X40000 Z165000 F50 S7 T33`."""
        return " ".join([f"{letter}{value}" for letter, value in self.present()])

    def faults(self) -> list[tuple[str, str]]:
        """Letter and sentence for each item that does not fit into its bytes."""
        found = []
        for letter, value in self.present():
            low, high = RANGES[letter]
            if not low <= value <= high:
                found.append((letter, f"{letter}{value} does not fit into a frame, which takes {low} to {high}"))
        return found
