"""Canned cycles as moves: G73, G74, G81-G89 in any plane, as LinuxCNC's interpreter makes them (rs274 §2).

Not the words of a block, only the geometry of a hole: a and b are the axes of the plane, c the one that stands on
it, all machine coordinates in mm. The one rule: what is NaN stays NaN; a cycle makes no more than MAX_MOVES moves.
"""

from collections.abc import Iterator
from math import ceil, isnan
from typing import NamedTuple

from gcode.segments import DWELL, FEED, RAPID

MAX_MOVES = 20_000
"""Of one block. More is a slip of Q or L, and must not eat the memory."""

CLEARANCE_MM = 0.254
"""How far a peck stays off the bottom that was drilled before, and how far G73 backs off: LinuxCNC's 0.010 inch."""

CYCLES = frozenset(
    (
        "drill",
        "drill_dwell",
        "peck",
        "chip_break",
        "tap",
        "tap_left",
        "bore",
        "bore_stop",
        "bore_dwell",
        "bore_manual",
        "back_bore",
    )
)
"""The effects of motion codes that are cycles."""

NEEDS_DWELL = frozenset(("drill_dwell", "bore_stop", "bore_dwell", "bore_manual"))
NEEDS_PECK = frozenset(("peck", "chip_break"))
NEEDS_OFFSET = frozenset(("back_bore",))
STOPS_SPINDLE = frozenset(("tap", "tap_left", "bore_stop", "bore_manual", "back_bore"))


class Hole(NamedTuple):
    """`a`, `b`: of the first hole, `step_a`, `step_b` to each further one (G91). `level`: c before the series began.

    `top` is the R plane, `now` where c stands at the beginning, `from_a`, `from_b` where a and b do.
    """

    from_a: float
    from_b: float
    now: float
    a: float
    b: float
    step_a: float
    step_b: float
    top: float
    bottom: float
    level: float
    return_to_top: bool
    repeats: int
    dwell_s: float = 0.0
    peck: float = 0.0
    offset_a: float = 0.0
    offset_b: float = 0.0
    middle: float = 0.0


class Move(NamedTuple):
    """`kind` RAPID, FEED or DWELL; `spindle`: -1 where it turns against its direction, 0 where it stands."""

    kind: int
    a: float
    b: float
    c: float
    dwell_s: float = 0.0
    spindle: int = 1


def count_of(effect: str, hole: Hole) -> float:
    """About how many moves a cycle makes; infinite for a peck that never arrives."""
    depth = hole.top - hole.bottom
    pecks = 1
    if effect in NEEDS_PECK and not isnan(depth):
        pecks = ceil(min(depth / hole.peck, MAX_MOVES)) if hole.peck > 0 else MAX_MOVES
    return (8 + 3.0 * pecks) * hole.repeats


def cycle_moves(effect: str, hole: Hole) -> Iterator[Move]:
    """The moves of a cycle, the way to each hole included."""
    a, b, now, top = hole.a, hole.b, hole.now, hole.top
    clear = top if hole.return_to_top or hole.level < top else hole.level
    if hole.level < top:
        yield Move(RAPID, hole.from_a, hole.from_b, top)
        now = top
    for repeat in range(hole.repeats):
        if repeat:
            a, b = a + hole.step_a, b + hole.step_b
        above = clear if repeat or now <= top else now
        yield Move(RAPID, a, b, above)
        if above != top:
            yield Move(RAPID, a, b, top)
        yield from _body(effect, hole, a, b, clear)


def _body(effect: str, hole: Hole, a: float, b: float, clear: float) -> Iterator[Move]:
    bottom = hole.bottom
    if effect == "back_bore":
        yield from _back_bore(hole, a, b, clear)
        return
    if effect in NEEDS_PECK:
        yield from _pecks(effect, hole, a, b)
    yield Move(FEED, a, b, bottom)
    if effect in NEEDS_DWELL:
        yield Move(DWELL, a, b, bottom, hole.dwell_s, 1)
    match effect:
        case "tap" | "tap_left":
            if hole.dwell_s > 0:
                yield Move(DWELL, a, b, bottom, hole.dwell_s, -1)
            yield Move(FEED, a, b, clear, 0.0, -1)
        case "bore":
            yield Move(FEED, a, b, hole.top)
            yield Move(RAPID, a, b, clear)
        case "bore_dwell":
            yield Move(FEED, a, b, clear)
        case "bore_stop":
            yield Move(RAPID, a, b, clear, 0.0, 0)
        case "bore_manual":
            return  # the operator retracts the spindle here
        case _:
            yield Move(RAPID, a, b, clear)


def _pecks(effect: str, hole: Hole, a: float, b: float) -> Iterator[Move]:
    depth = hole.top - hole.peck
    while depth > hole.bottom:
        yield Move(FEED, a, b, depth)
        if effect == "peck":
            yield Move(RAPID, a, b, hole.top)
        yield Move(RAPID, a, b, depth + CLEARANCE_MM)
        depth -= hole.peck


def _back_bore(hole: Hole, a: float, b: float, clear: float) -> Iterator[Move]:
    """Past the wall of the hole with the spindle oriented, and back up from below (rs274: G87)."""
    aside_a, aside_b = a + hole.offset_a, b + hole.offset_b
    yield Move(RAPID, aside_a, aside_b, hole.top)
    yield Move(RAPID, aside_a, aside_b, hole.bottom, 0.0, 0)
    yield Move(RAPID, a, b, hole.bottom, 0.0, 0)
    yield Move(FEED, a, b, hole.middle)
    yield Move(FEED, a, b, hole.bottom)
    yield Move(RAPID, aside_a, aside_b, hole.bottom, 0.0, 0)
    yield Move(RAPID, aside_a, aside_b, clear, 0.0, 0)
    yield Move(RAPID, a, b, clear, 0.0, 0)
