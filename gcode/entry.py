"""What the rest of a program wants of the machine when it goes on: the mode, a series of holes, a place to come from.

Reads ahead only as far as it must; what is said to the machine is planned in resume.py. The one rule: what the rest
hangs on is found by following it, with the one interpreter there is, not by a second reading of its words.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice
from math import isnan

import numpy as np

from gcode.actions import TAKES_AXES
from gcode.clean import clean
from gcode.cycles import CYCLES
from gcode.executor import MM_PER_INCH
from gcode.interpreter import Interpreter
from gcode.profile import Code, Profile
from gcode.reentry import number, refuse
from gcode.segments import CUTS, DWELL, PLANE_AXES, Segments
from gcode.state import State
from gcode.words import Block, code_name

AHEAD_BLOCKS = 1000
"""Blocks that are looked at before the first cut; a program that does not cut for so long has said where it is."""

BY_ITSELF = frozenset(("rapid", "feed", "cancel"))
"""Motion modes that a block without coordinates can set."""

PLACES_MM = (0.0, 1000.0)
"""Two places for an axis of which nobody knows where it stands: what differs between them hangs on it."""


@dataclass(frozen=True, slots=True)
class Rest:
    """`blocks`: the first ones of the rest, said anew so that the last of them names its mode; `takes_over` so many.

    `level`: its first motion is a hole of the series before. `hangs_on`: axes whose unknown place it goes on from.
    """

    blocks: tuple[str, ...] = ()
    takes_over: int = 0
    level: bool = False
    hangs_on: tuple[str, ...] = ()


@dataclass(slots=True)
class _Walk:
    taken: list[str] = field(default_factory=list)
    takes_over: int = 0
    level: bool = False
    settled: bool = False
    moved: bool = False


def look_ahead(before: State, at: Iterable[Block], profile: Profile) -> Rest:
    """What the blocks of the rest, in order, want. Raises CannotResumeError. `before` stays as it is."""
    blocks = list(islice(at, AHEAD_BLOCKS))
    one, other = (_placed(before, place_mm) for place_mm in PLACES_MM)
    rest, cut = _walk(one, blocks, profile)
    if not any(isnan(place) for place in before.position):
        return rest
    _, other_cut = _walk(other, blocks, profile)
    shifted = [axis for axis, left, right in zip(before.axes, one.frame, other.frame, strict=True) if left != right]
    return Rest(rest.blocks, rest.takes_over, rest.level, (*shifted, *_differing(before, cut, other_cut)))


def _placed(before: State, place_mm: float) -> State:
    state = before.copy()
    state.position = [place_mm if isnan(value) else value for value in before.position]
    if isnan(state.cycle.get("level", 0.0)):
        state.cycle["level"] = place_mm
    return state


def _walk(state: State, blocks: list[Block], profile: Profile) -> tuple[Rest, Segments | None]:
    """As far as the first cut, which comes with it. The state is that behind it then."""
    interpreter = Interpreter(profile, state)
    walk = _Walk(settled=state.motion in BY_ITSELF)
    for count, block in enumerate(blocks, 1):
        if not walk.settled:
            walk.settled = _settle(walk, interpreter.state, block, profile)
            if walk.settled and walk.taken:
                walk.takes_over = count
        interpreter.step(count, block)
        found = interpreter.take()
        walk.moved |= bool(np.any(found.kind != DWELL))
        if (cut := _first_cut(found)) is not None:
            return _rest(walk), cut
        if interpreter.state.ended:
            break
    if not walk.settled and len(blocks) == AHEAD_BLOCKS:
        refuse(
            "motion_unknown",
            f"For {AHEAD_BLOCKS} blocks nothing says whether {state.motion_name} goes on. Start at a line that names "
            "its own motion (G0, G1, ...).",
        )
    interpreter.finish()
    return _rest(walk), _first_cut(interpreter.take())


def _first_cut(found: Segments) -> Segments | None:
    cuts = np.flatnonzero(np.isin(found.kind, CUTS))
    return found.take(slice(int(cuts[0]), int(cuts[0]) + 1)) if len(cuts) else None


def _rest(walk: _Walk) -> Rest:
    # What was written down for a motion that never came is nothing to say.
    taken = tuple(text for text in walk.taken if text) if walk.takes_over else ()
    return Rest(taken, walk.takes_over, walk.level)


def _differing(before: State, one: Segments | None, other: Segments | None) -> tuple[str, ...]:
    """The axes whose unknown place the first cut starts from; one that it leaves alone matters only in X, Y, Z."""
    if one is None or other is None:
        return ()
    found = []
    for row, axis in enumerate(before.axes):
        start, end = one.start[row, 0], one.end[row, 0]
        differs = start != other.start[row, 0] and not (isnan(start) and isnan(other.start[row, 0]))
        if differs and (axis in "XYZ" or start != end):
            found.append(axis)
    return tuple(found)


# --- a mode that only a motion can set ----------------------------------------------------------------------------


def _settle(walk: _Walk, state: State, block: Block, profile: Profile) -> bool:
    """Whether this block ends the waiting for the first motion; what it has to say then is taken down."""
    codes = _codes(block, profile)
    modes = [code.effect for code in codes if code.group == "motion"]
    letters = {word.letter for word in block.words}
    text = clean(block)
    if modes:
        walk.level = state.motion in CYCLES and modes[-1] in CYCLES
        if not walk.level or modes[-1] != state.motion:
            # It says all that it needs; the blocks before it need not be said anew either.
            walk.taken.clear()
        else:
            walk.taken.append(text + _sticky(state, letters))
    elif any(code.effect == "program_end" for code in codes):
        walk.taken.clear()
        return True
    elif _moves(state, codes, letters, profile):
        walk.level = state.motion in CYCLES
        walk.taken.append(_named(state, text, letters))
    else:
        walk.taken.append(text)
        return False
    if walk.level and walk.moved:
        refuse("cycle_moved", f"Start at the first hole of {state.motion_name}.")
    return True


def _codes(block: Block, profile: Profile) -> list[Code]:
    found = (profile.codes.get(code_name(word.letter, word.text)) for word in block.words)
    return [code for code in found if code is not None]


def _moves(state: State, codes: list[Code], letters: set[str], profile: Profile) -> bool:
    if any(code.effect in TAKES_AXES for code in codes):
        return False
    in_place = state.motion in ("arc_cw", "arc_ccw") and not letters.isdisjoint("IJK")
    steps = "UVW" if "incremental_uw" in profile.features else ""
    return in_place or not letters.isdisjoint((*state.axes, *steps))


def _named(state: State, text: str, letters: set[str]) -> str:
    """The block with the name of the mode that it goes on with."""
    if state.motion in (None, "not_followed"):
        refuse(
            "motion_unknown",
            f"It is {state.motion_name or 'not known'}. Start at a line that names its own motion (G0, G1, ...).",
        )
    sticky = _sticky(state, letters) if state.motion in CYCLES else ""
    return f"{state.motion_name}{text}{sticky}"


def _sticky(state: State, letters: set[str]) -> str:
    """The words of a canned cycle that hold since an earlier hole (rs274 §2)."""
    scale = MM_PER_INCH if state.inches else 1.0
    third = PLANE_AXES[state.plane][2]
    words = [(letter, state.cycle[letter] / scale) for letter in "RQIJK" if letter in state.cycle]
    if "depth" in state.cycle:
        words.append((third, state.cycle["depth"] / scale))
    if "P" in state.cycle:
        words.append(("P", state.cycle["P"]))
    return "".join(letter + number(value) for letter, value in words if letter not in letters)


def names_motion(block: Block, profile: Profile) -> bool:
    """Whether a block has a motion code of its own (G0, G1, ..., G80)."""
    return any(code.group == "motion" for code in _codes(block, profile))
