"""Coordinate systems, shifts and tool lengths: what lies between machine and program coordinates (rs274 §2).

Every function changes a State and leaves the machine where it stands. Lengths are mm already. The one rule: an axis
whose offset nobody has told has no known place in the other system, so its position becomes NaN, never a guess.
"""

from collections.abc import Iterable, Mapping
from math import isnan, nan

from gcode.state import State

SYSTEMS = range(1, 10)
"""G54 is 1, G59.3 is 9."""

Named = Mapping[int, float]
"""Values of a block's axis words, in mm, by the row of their axis."""


def select_system(state: State, system: int) -> None:
    """G54-G59.3."""
    if system != state.system:
        before, state.system = _system(state), system
        _lose_unknown(state, before, _system(state))


def shift_to(state: State, named: Named) -> None:
    """G92: the named axes stand at these program coordinates.

    Where the machine coordinate is not known it is anchored anew, so that the program coordinate is.
    """
    if not state.shift_active:
        state.shift, state.shift_active = [0.0] * len(state.axes), True
        state.refresh_frame()
    shift, position = list(state.shift), list(state.position)
    anew = frozenset(row for row in named if isnan(position[row]))
    for row, value in named.items():
        if row in anew:
            position[row] = value + state.frame[row]
        else:
            shift[row] = position[row] - (state.frame[row] - _known(shift[row])) - value
    state.shift, state.position, state.adrift = shift, position, state.adrift | anew
    state.refresh_frame()


def set_local_shift(state: State, named: Named) -> None:
    """G52: the shift itself, in the place of that of G92."""
    _leave_shift(state, named)
    shift = list(state.shift) if state.shift_active else [0.0] * len(state.axes)
    for row, value in named.items():
        shift[row] = value
    state.shift, state.shift_active = shift, True
    state.refresh_frame()


def clear_shift(state: State, *, forget: bool) -> None:
    """G92.1, and G92.2, which remembers it for G92.3."""
    if not state.shift_active and not forget:
        return
    adrift = _leave_shift(state, range(len(state.axes)))
    state.shift_active = False
    if forget:
        state.shift = [0.0] * len(state.axes)
    else:
        state.shift = [nan if row in adrift else value for row, value in enumerate(state.shift)]
    state.refresh_frame()


def resume_shift(state: State) -> None:
    """G92.3."""
    if not state.shift_active:
        state.shift_active = True
        _lose(state, [row for row, value in enumerate(state.shift) if isnan(value)])


def adrift(state: State) -> frozenset[int]:
    """The rows whose true machine coordinate is not known, though their program coordinate may be."""
    system = _system(state)
    shift = state.shift if state.shift_active else [0.0] * len(system)
    untold = (
        row for row, parts in enumerate(zip(system, shift, state.tool_offset, strict=True)) if any(map(isnan, parts))
    )
    return state.adrift.union(untold)


def _leave_shift(state: State, rows: Iterable[int]) -> frozenset[int]:
    """The shift of these axes becomes another one: those that it had anchored are not known then. Gives these."""
    shift = state.shift if state.shift_active else [0.0] * len(state.axes)
    left = frozenset(row for row in rows if row in state.adrift or isnan(shift[row]))
    state.adrift -= left
    _lose(state, list(left))
    return left


def set_system(state: State, system: int, named: Named) -> None:
    """G10 L2: the offsets of a system; 0 is the active one."""
    system = system or state.system
    before = list(state.systems.get(system, [nan] * len(state.axes)))
    after = list(before)
    for row, value in named.items():
        after[row] = value
    state.systems[system] = after
    if system == state.system:
        rows = [row for row in named if isnan(before[row])]
        _lose(state, rows)


def set_system_here(state: State, system: int, named: Named) -> None:
    """G10 L20: offsets of a system such that the machine stands at these program coordinates in it."""
    system = system or state.system
    active = _system(state)
    after = list(state.systems.get(system, [nan] * len(state.axes)))
    position, untold = list(state.position), adrift(state)
    for row, value in named.items():
        others = state.frame[row] - _known(active[row])
        if row not in untold and not isnan(position[row]):
            after[row] = position[row] - others - value
            continue
        # What the machine stands at is not known, so the offset is not either.
        after[row] = nan
        if system == state.system:
            position[row] = value + others
    state.systems[system], state.position = after, position
    state.refresh_frame()


def set_tool_length(state: State, tool: int, named: Named, radius: float | None) -> None:
    """G10 L1: the offsets and the radius of a tool in the table."""
    offsets = list(state.tools.get(tool) or untold_tool(state))
    for row, value in named.items():
        offsets[row] = value
    state.tools[tool] = offsets
    if radius is not None:
        state.diameters[tool] = 2 * radius


def untold_tool(state: State) -> list[float]:
    """A tool that nobody has measured: only its length along Z can be off."""
    return [nan if axis == "Z" else 0.0 for axis in state.axes]


def use_tool_length(state: State, tool: int | None, *, add: bool = False) -> None:
    """G43 and G43.2: the offsets of a tool in the table; tool 0 is none."""
    found = [0.0] * len(state.axes)
    if tool != 0:
        found = list(state.tools.get(-1 if tool is None else tool) or untold_tool(state))
    if add:
        found = [one + other for one, other in zip(state.tool_offset, found, strict=True)]
    change_tool_offset(state, found)


def change_tool_offset(state: State, offset: list[float]) -> None:
    """The offset that is in force from here on."""
    before, state.tool_offset = state.tool_offset, offset
    _lose_unknown(state, before, offset)


def _lose_unknown(state: State, before: list[float], after: list[float]) -> None:
    """From one set of offsets to another: without both of an axis nobody knows how far apart they are."""
    _lose(state, [row for row in range(len(before)) if isnan(before[row]) or isnan(after[row])])


def _lose(state: State, rows: list[int]) -> None:
    if rows:
        state.position = [nan if row in rows else place for row, place in enumerate(state.position)]
    state.refresh_frame()


def _system(state: State) -> list[float]:
    return state.systems.get(state.system) or [nan] * len(state.axes)


def _known(offset: float) -> float:
    return 0.0 if isnan(offset) else offset


def forget_shift(state: State, rows: list[int]) -> None:
    """Homing has set these axes anew: program and machine coordinates are one again."""
    state.shift = [0.0 if row in rows else value for row, value in enumerate(state.shift)]
    state.adrift = state.adrift.difference(rows)
    state.refresh_frame()
