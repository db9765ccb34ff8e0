"""The motion modes: what axis words do in G0-G3, G33, G38 and in canned cycles (rs274 §2 group 1, §4).

Not the codes that set a mode. The one rule: a motion whose end is not certain leaves NaN along every axis that it may
have moved.
"""

from collections.abc import Callable
from math import isnan, nan

from gcode.cycles import (
    CYCLES,
    MAX_MOVES,
    NEEDS_DWELL,
    NEEDS_OFFSET,
    NEEDS_PECK,
    STOPS_SPINDLE,
    Hole,
    Move,
    count_of,
    cycle_moves,
)
from gcode.executor import Executor, Work
from gcode.offsets import adrift
from gcode.rows import ArcWords
from gcode.segments import CCW, CW, DWELL, FEED, PLANE_AXES, PROBE, RAPID

OFFSETS = {17: ("I", "J"), 18: ("K", "I"), 19: ("J", "K")}
"""The offsets to an arc's centre, in the order of the plane's axes (rs274 §4)."""

ARCS = frozenset(("arc_cw", "arc_ccw"))

MAX_TURNS = 1_000_000
MAX_REPEATS = 10_000


def move(executor: Executor, work: Work, effect: str) -> None:
    """The motion of a block in this mode."""
    _MOTIONS.get(effect, _not_set)(executor, work, effect)
    if work.machine:
        # Where that is in the program's coordinates is known only with all offsets.
        executor.lose(adrift(executor.state).intersection(executor.named(work)))


def _not_set(executor: Executor, work: Work, _effect: str) -> None:
    """Axis words without a motion code, or after G80: where they lead is not known."""
    executor.note(work, "motion_not_set", "axis words without G0, G1, G2 or G3 before them")
    end = list(executor.state.position)
    for row in (*executor.named(work), *executor.steps(work)):
        end[row] = nan
    executor.emit(work, FEED, end)


def _rapid(executor: Executor, work: Work, _effect: str) -> None:
    executor.emit(work, RAPID, executor.target(work)[0])


def _feed(executor: Executor, work: Work, _effect: str) -> None:
    _want_feed(executor, work)
    executor.emit(work, FEED, executor.target(work)[0])


def _probe(executor: Executor, work: Work, _effect: str) -> None:
    """G38: the controller waits for the queue, moves until the probe says so, and waits again."""
    _want_feed(executor, work)
    rows = (*executor.named(work), *executor.steps(work))
    executor.state.sync = True
    executor.emit(work, PROBE, executor.target(work)[0])
    executor.lose(rows)
    executor.state.sync = True


def _thread(executor: Executor, work: Work, effect: str) -> None:
    """G33: along the thread, K mm a turn; G33.1 taps and comes back."""
    pitch = executor.length(work, "K")
    if pitch is None:
        executor.note(work, "word_missing", "G33 without its pitch K")
    start = executor.state.position
    feed = nan if pitch is None else abs(pitch * executor.state.speed)
    executor.emit(work, FEED, executor.target(work)[0], feed=feed)
    if effect == "rigid_tap":
        executor.emit(work, FEED, list(start), feed=feed, turning=-1)


def _not_followed(executor: Executor, work: Work, _effect: str) -> None:
    """Splines and threading cycles: a motion of its own kind, which ends somewhere."""
    work.used.update("EHIJKLPQR")
    executor.note(work, "not_followed", "the way of this motion is not followed here", level="warning")
    _want_feed(executor, work)
    rows = (*executor.named(work), *executor.steps(work)) or range(len(executor.state.axes))
    end = [nan if row in rows else value for row, value in enumerate(executor.state.position)]
    executor.emit(work, FEED, end)


def _want_feed(executor: Executor, work: Work) -> None:
    if executor.state.feed_mode == 93 and work.inverse is None:
        executor.note(work, "feed_missing", "G93 wants an F in every block with G1, G2 or G3")


# --- arcs ---------------------------------------------------------------------------------------------------------


def _arc(executor: Executor, work: Work, effect: str) -> None:
    state = executor.state
    _want_feed(executor, work)
    start = state.position
    clockwise = effect == "arc_cw"
    first, second, _ = executor.plane_rows()
    named = executor.has_axes(work)
    end, steps = executor.target(work)
    words: ArcWords | None = None
    if first is not None and second is not None:
        way = (_way(start, end, steps, first), _way(start, end, steps, second))
        words = _arc_words(executor, work, way, (first, second))
        _want_plane_axis(executor, work, named=named)
    executor.emit(work, CW if clockwise else CCW, end, arc=words)


def _way(start: list[float], end: list[float], steps: dict[int, float], row: int) -> float:
    """How far an axis goes: known for a step, and for an axis that is not named, wherever the machine stands."""
    way = end[row] - start[row]
    if not isnan(way):
        return way
    if row in steps:
        return steps[row]
    return 0.0 if end[row] is start[row] else nan


def _arc_words(executor: Executor, work: Work, way: tuple[float, float], rows: tuple[int, int]) -> ArcWords:
    state = executor.state
    letters = OFFSETS[state.plane]
    radius = executor.length(work, "R")
    turns = executor.number(work, "P") if "arc_turns" in executor.profile.features else None
    count = 1 if turns is None or turns != turns else int(max(1.0, min(turns, MAX_TURNS)))
    found = [executor.length(work, letter) for letter in letters]
    if radius is not None:
        if any(value is not None for value in found) and executor.strict:
            executor.note(work, "word_left_over", "an arc with R and with a centre", letters[0])
        return ArcWords(state.plane, way, (nan, nan), radius, count)
    if all(value is None for value in found):
        names = " or ".join(letters)
        executor.note(work, "arc_without_centre", f"an arc without {names} or R")
        return ArcWords(state.plane, way, (nan, nan), None, count)
    if "other_offsets" in executor.profile.features:
        work.used.update("IJK")
    if not state.arc_absolute:
        return ArcWords(state.plane, way, (found[0] or 0.0, found[1] or 0.0), None, count)
    if any(value is None for value in found):
        executor.note(work, "arc_without_centre", f"G90.1 wants both {letters[0]} and {letters[1]}")
    place = [nan if value is None else value for value in found]
    # Absolute centres are program coordinates (rs274 §2, group 4).
    centre = [place[n] + state.frame[row] - state.position[row] for n, row in enumerate(rows)]
    return ArcWords(state.plane, way, (centre[0], centre[1]), None, count)


def _want_plane_axis(executor: Executor, work: Work, *, named: bool) -> None:
    features = executor.profile.features
    in_plane = any(axis in work.values for axis in PLANE_AXES[executor.state.plane][:2])
    if "full_circle_without_axis" in features or in_plane or executor.coordinate_letters & {"U", "W"} & set(work.used):
        return
    what = "an arc without a word of an axis of its plane" if named else "a full circle without its end point"
    executor.note(work, "arc_without_axis", f"{what}: {executor.profile.title} refuses it")


# --- canned cycles ------------------------------------------------------------------------------------------------


def _cycle(executor: Executor, work: Work, effect: str) -> None:
    state = executor.state
    rows = [row for row in executor.plane_rows() if row is not None]
    if len(rows) < 3:
        _lost_cycle(executor, work, "a canned cycle needs the three axes of its plane")
        return
    _remember(executor, work)
    hole = _hole(executor, work, rows)
    problem = _problem(effect, hole, state.cycle)
    if problem is not None:
        _lost_cycle(executor, work, problem)
        return
    _warn(executor, work, effect, hole)
    if state.feed_mode == 93:
        executor.note(work, "cycle_words", "a canned cycle in G93", level="warning")
    for step in cycle_moves(effect, hole):
        _step(executor, work, step, rows)
        if step.spindle != 1 and effect in STOPS_SPINDLE:
            state.sync = True
    # G88: the operator retracts the spindle, as far as he likes; elvinto §6 does not say where a cycle ends.
    if effect == "bore_manual" or "cycle_end_unknown" in executor.profile.features:
        executor.lose(rows[2:])


def _step(executor: Executor, work: Work, step: Move, rows: list[int]) -> None:
    state = executor.state
    if step.kind == DWELL:
        state.sync = True
        executor.emit(work, DWELL, state.position, dwell_s=step.dwell_s, turning=step.spindle)
        return
    end = list(state.position)
    for row, value in zip(rows, (step.a, step.b, step.c), strict=True):
        end[row] = value
    if any(one != other for one, other in zip(end, state.position, strict=True)):
        executor.emit(work, step.kind, end, turning=step.spindle)


def _remember(executor: Executor, work: Work) -> None:
    """R, Z, Q, P, I, J, K hold for the further holes of the same cycle (rs274 §2)."""
    cycle = executor.state.cycle
    first, second, third = PLANE_AXES[executor.state.plane]
    for letter in "RQIJK":
        if letter in work.values:
            cycle[letter] = executor.length(work, letter) or 0.0
    if (seconds := executor.number(work, "P")) is not None:
        cycle["P"] = seconds
    if third in work.values:
        cycle["depth"] = executor.named(work)[executor.axis_rows[third]]
    executor.number(work, "L")
    work.used.update((first, second, third))


def _hole(executor: Executor, work: Work, rows: list[int]) -> Hole:
    state = executor.state
    cycle, frame = state.cycle, state.frame
    first, second, third = rows
    at = state.position
    level = cycle.setdefault("level", at[third])
    top, depth = cycle.get("R", nan), cycle.get("depth", nan)
    offset_a, offset_b, middle = _offsets_of(state.plane, cycle)
    named = executor.named(work)
    a, b, step_a, step_b = at[first], at[second], 0.0, 0.0
    if state.absolute:
        a = named[first] + frame[first] if first in named else a
        b = named[second] + frame[second] if second in named else b
        top, bottom, middle = top + frame[third], depth + frame[third], middle + frame[third]
    elif state.absolute is False:
        step_a, step_b = named.get(first, 0.0), named.get(second, 0.0)
        a, b = a + step_a, b + step_b
        top += level
        bottom = top + depth
        middle += bottom
    else:
        a = nan if first in named else a
        b = nan if second in named else b
        top = bottom = nan
    repeats = work.values.get("L", 1.0) if "L" in executor.profile.letters else 1.0
    return Hole(
        at[first],
        at[second],
        at[third],
        a,
        b,
        step_a,
        step_b,
        top,
        bottom,
        level,
        state.return_to_r,
        int(max(0.0, min(repeats, MAX_REPEATS + 1))),
        max(0.0, cycle.get("P", 0.0)),
        cycle.get("Q", 0.0),
        offset_a,
        offset_b,
        middle,
    )


def _offsets_of(plane: int, cycle: dict[str, float]) -> tuple[float, float, float]:
    """G87: the way aside in the plane, and the top of the back bore, which is K in G17, J in G18, I in G19."""
    first, second = OFFSETS[plane]
    third = {17: "K", 18: "J", 19: "I"}[plane]
    return cycle.get(first, 0.0), cycle.get(second, 0.0), cycle.get(third, nan)


def _problem(effect: str, hole: Hole, cycle: dict[str, float]) -> str | None:
    """Why a cycle has no motion that anybody could name."""
    if count_of(effect, hole) > MAX_MOVES:
        return f"a canned cycle of more than {MAX_MOVES} moves (L, or Q, is wrong)"
    if effect in NEEDS_PECK and hole.peck <= 0:
        return "Q must be over 0"
    if effect in NEEDS_OFFSET and not {"I", "J", "K"} <= cycle.keys():
        return "G87 without I, J and K"
    return None


def _warn(executor: Executor, work: Work, effect: str, hole: Hole) -> None:
    """What is wrong with the words, though it is clear where they lead."""
    cycle = executor.state.cycle
    missing = [name for key, name in (("R", "R"), ("depth", "its depth")) if key not in cycle]
    if effect in NEEDS_DWELL and "P" not in cycle:
        missing.append("P")
    if missing:
        executor.note(work, "cycle_words", f"a canned cycle without {' and '.join(missing)}")
    if hole.top < hole.bottom:
        executor.note(work, "cycle_words", "R is below the bottom of the hole", "R", "warning")
    if hole.repeats == 0:
        executor.note(work, "cycle_words", "a canned cycle with L0 does nothing", "L", "warning")


def _lost_cycle(executor: Executor, work: Work, why: str) -> None:
    executor.note(work, "cycle_words", why)
    rows = {row for row in (*executor.plane_rows(), *executor.named(work)) if row is not None}
    end = [nan if row in rows else value for row, value in enumerate(executor.state.position)]
    executor.emit(work, FEED, end)


_MOTIONS: dict[str, Callable[[Executor, Work, str], None]] = {
    "rapid": _rapid,
    "feed": _feed,
    "arc_cw": _arc,
    "arc_ccw": _arc,
    "probe": _probe,
    "thread": _thread,
    "rigid_tap": _thread,
    "not_followed": _not_followed,
    **dict.fromkeys(CYCLES, _cycle),
}
