"""What the machine has said, from the bytes between two silences. Pure functions.

The bytes of a count may look like anything, an ACK too, and a late ACK may stand before an answer. So nothing is read
byte by byte while ENQ is open. The one rule: what can be read in two ways is not read at all, but asked for again.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Final

from protocol.ncframe import codec
from protocol.ncframe.codec import ACK, CAN, COUNT_BYTES, NAK, XOFF, XON

NAMES: Final = {ACK: "ACK", NAK: "NAK", CAN: "CAN", XON: "XON", XOFF: "XOFF"}
BURST_BYTES_MOST: Final = 64
"""Ten answers and some: more between two silences is noise."""
_ANSWER_BYTES: Final = 1 + COUNT_BYTES


@dataclass(frozen=True, slots=True)
class Reading:
    """`count`: what every answer in it said; None: there was none, or the machine has no counter. Then what else was
    in it: single ACKs and NAKs, a CAN, and whether XOFF (True) or XON (False) came last."""

    count: int | None = None
    acks: int = 0
    naks: int = 0
    cancelled: bool = False
    held: bool | None = None

    @property
    def singles(self) -> int:
        """How much stands beside the answer, roughly."""
        return self.acks + self.naks + self.cancelled + (self.held is not None)

    def behind(self, byte: int) -> "Reading | None":
        """This with one byte before it; None when that byte means nothing."""
        match byte:
            case codec.ACK:
                return replace(self, acks=self.acks + 1)
            case codec.NAK:
                return replace(self, naks=self.naks + 1)
            case codec.CAN:
                return replace(self, cancelled=True)
            case codec.XON | codec.XOFF:
                return replace(self, held=byte == XOFF) if self.held is None else self
            case _:
                return None


def read(burst: bytes, *, counter: bool, plausible: frozenset[int] = frozenset()) -> Reading | None:
    """The one way to read `burst`; None where there is none, or more than one.

    Of several counts a `plausible` one is preferred, as long as it is the only one; an answer is preferred to none.
    """
    if len(burst) > BURST_BYTES_MOST:
        return None
    ways = _ways(burst, counter)
    answers = {way for way in ways if way.count is not None}
    for chosen in ({way for way in answers if way.count in plausible}, answers, ways):
        if chosen:
            # The same count by two ways: what stands beside it is less certain than the count.
            counts = {way.count for way in chosen}
            return min(chosen, key=lambda way: way.singles) if len(counts) == 1 else None
    return None


def _ways(burst: bytes, counter: bool) -> frozenset[Reading]:
    """Every way to read it as answers of one count with single bytes around them. Few: little is told apart."""

    @cache
    def rest(at: int) -> frozenset[Reading]:
        if at == len(burst):
            return frozenset({Reading()})
        found = {way for after in rest(at + 1) if (way := after.behind(burst[at])) is not None}
        if counter and burst[at] == ACK and at + _ANSWER_BYTES <= len(burst):
            count = int.from_bytes(burst[at + 1 : at + _ANSWER_BYTES], "big")
            found |= {replace(way, count=count) for way in rest(at + _ANSWER_BYTES) if way.count in (None, count)}
        return frozenset(found)

    return rest(0)


def console(burst: bytes, *, counter: bool) -> str:
    """For people: the names of the bytes, an answer with its count, anything else in hexadecimal."""
    words: list[str] = []
    at = 0
    while at < len(burst):
        name = NAMES.get(burst[at], f"{burst[at]:02X}")
        if counter and burst[at] == ACK and len(burst) - at == _ANSWER_BYTES:
            words.append(f"ACK {int.from_bytes(burst[at + 1 :], 'big')}")
            break
        words.append(name)
        at += 1
    return " ".join(words)
