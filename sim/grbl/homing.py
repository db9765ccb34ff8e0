"""$H: search, back off, locate, pull off; Z first, then X and Y together (grbl II.3, II.9).

The controller looks at nothing but the switches, a reset and the door meanwhile: `?` is answered when it is over. The
one rule: switches stand where they really are, so a travel setting that is too small for the machine ends in ALARM:9.
"""

from typing import Final

from sim.grbl.core import Core, Flag, Task
from sim.grbl.events import Move
from sim.grbl.motion import settle
from sim.grbl.service import realtime
from sim.grbl.simsettings import AXES, Point
from sim.grbl.stepper import Piece, profile

SEARCH: Final = 1.5
"""Times the travel."""
LOCATE: Final = 5.0
"""Times the pull-off."""
_CYCLES: Final = ((2,), (0, 1))


def home(core: Core, axes: str = "") -> Task[None]:
    """All axes, or one. Ends with `core.abort` set when it failed."""
    cycles = tuple((AXES.index(axis),) for axis in axes) or _CYCLES
    for cycle in cycles:
        yield from _cycle(core, cycle)
        if core.alarm or core.flags & Flag.RESET:
            break
    yield from realtime(core)
    if core.abort:
        return
    core.forget_motion()
    core.homed = core.homed or not axes


def _cycle(core: Core, axes: tuple[int, ...]) -> Task[None]:
    memory = core.memory
    travel, pull_off = memory.axes(130), memory[27]
    search = SEARCH * max(travel[axis] for axis in axes)
    passes = [
        (True, search, memory[25]),
        (False, pull_off, memory[25]),
        (True, pull_off * LOCATE, memory[24]),
        (False, pull_off, memory[25]),
    ]
    for approach, length_mm, rate in passes:
        yield from _pass(core, axes, approach, length_mm, rate)
        if core.alarm:
            return
        yield from settle(core, memory[26] / 1000)
    place = list(core.stepper.rest)
    for axis in axes:
        place[axis] = pull_off - travel[axis] if _negative(core, axis) else -pull_off
    _believe(core, (place[0], place[1], place[2]))


def _negative(core: Core, axis: int) -> bool:
    """$23: this axis is homed at its far, negative end."""
    return bool(int(core.memory[23]) >> axis & 1)


def _believe(core: Core, place: Point) -> None:
    """From now on the controller calls the place where it stands so; the machine has not moved."""
    true = core.true_position()
    core.stepper.rest = place
    x, y, z = (t - p for t, p in zip(true, place, strict=True))
    core.true_shift = (x, y, z)


def _to_switch(core: Core, axis: int) -> float:
    """Millimetres to the switch in homing direction; not more than 0 when it is closed."""
    if AXES[axis] in core.pressed:
        return 0.0
    place = core.true_position()[axis]
    return place + core.kind.travel[AXES[axis]] if _negative(core, axis) else -place


def _pass(core: Core, axes: tuple[int, ...], approach: bool, length_mm: float, rate: float) -> Task[None]:
    """One movement: every axis goes at `rate` until its switch closes, or the length is through.

    Each begins at 0: a search that finds nothing ends at 1.5 times the travel, wherever the machine was."""
    x, y, z = (0.0 if axis in axes else at for axis, at in enumerate(core.stepper.rest))
    _believe(core, (x, y, z))
    start = core.stepper.rest
    reach = {axis: min(length_mm, max(0.0, _to_switch(core, axis))) if approach else length_mm for axis in axes}
    acceleration = min(core.memory.axes(120)[axis] for axis in axes)
    limit = min(core.memory.axes(110)[axis] for axis in axes)
    pieces = profile(length_mm, 0.0, max(min(rate, limit), 1.0) / 60, 0.0, acceleration)
    found = approach and all(_to_switch(core, axis) <= length_mm for axis in axes)
    seconds = _seconds(pieces, max(reach.values())) if found else _seconds(pieces, length_mm)
    seconds = 0.0 if core.kind.instant else seconds / core.kind.speed_factor
    move = Move("home", start, start, rate, began_at=core.now)
    if core.current is not None:
        core.current.moves.append(move)
    began, factor = core.now, core.kind.speed_factor
    core.stepper.glide = lambda now: _place(core, start, reach, _covered(pieces, (now - began) * factor), approach)
    while core.now < began + seconds:
        yield began + seconds
        if _interrupted(core):
            return
    core.stepper.glide = None
    core.stepper.rest = _place(core, start, reach, length_mm, approach)
    move.end, move.ended_at = core.stepper.rest, core.now
    if approach and not found:
        _fail(core, 9)
    elif not approach and any(AXES[axis] in core.pressed or _to_switch(core, axis) <= 0 for axis in axes):
        _fail(core, 8)


def _place(core: Core, start: Point, reach: dict[int, float], covered_mm: float, approach: bool) -> Point:
    place = list(start)
    for axis, most in reach.items():
        sign = (-1.0 if _negative(core, axis) else 1.0) * (1.0 if approach else -1.0)
        place[axis] = start[axis] + sign * min(covered_mm, most)
    return place[0], place[1], place[2]


def _interrupted(core: Core) -> bool:
    if core.flags & Flag.RESET:
        _fail(core, 6)
    elif core.flags & Flag.DOOR:
        core.unflag(Flag.DOOR)
        _fail(core, 7)
    return bool(core.alarm)


def _fail(core: Core, num: int) -> None:
    core.alarm = num
    core.reset()


def _covered(pieces: list[Piece], seconds: float) -> float:
    length_mm = 0.0
    for piece in pieces:
        part = min(seconds, piece.seconds)
        length_mm += piece.covered(part)
        seconds -= part
    return length_mm


def _seconds(pieces: list[Piece], length_mm: float) -> float:
    seconds = 0.0
    for piece in pieces:
        if length_mm <= piece.length_mm:
            return seconds + piece.when(length_mm)
        length_mm -= piece.length_mm
        seconds += piece.seconds
    return seconds
