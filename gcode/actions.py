"""What codes do beside motion: modes, offsets, homing, tools, dwell, the end of a program (rs274 §2, §3).

Not their order; that is interpreter.py. The one rule: a code whose effect on the position nobody has written down
leaves NaN there.
"""

from collections.abc import Callable
from dataclasses import replace
from math import isnan, nan

from gcode import offsets
from gcode.executor import Executor, Work
from gcode.profile import Code
from gcode.segments import DWELL, FEED, HOMING, RAPID

Action = Callable[[Executor, Work, Code], None]

TAKES_AXES = frozenset(
    (
        *("home", "home_and_back", "set_position", "mill_plane", "set_data", "go_home", "go_second_home"),
        *("local_shift", "length_direct"),
    )
)
"""Effects that take the block's axis words for themselves, or, as elvinto's G28, for nothing."""

HOMES = {"go_home": 28, "go_second_home": 30, "store_home": 28, "store_second_home": 30}


# --- modes --------------------------------------------------------------------------------------------------------


def _distance(executor: Executor, _work: Work, code: Code) -> None:
    executor.state.absolute = code.effect == "absolute"


def _remember_distance(executor: Executor, _work: Work, _code: Code) -> None:
    executor.state.remembered = executor.state.absolute


def _restore_distance(executor: Executor, _work: Work, _code: Code) -> None:
    executor.state.absolute = executor.state.remembered


def _arc_distance(executor: Executor, _work: Work, code: Code) -> None:
    executor.state.arc_absolute = code.effect == "arc_absolute"


def _units(executor: Executor, _work: Work, code: Code) -> None:
    executor.state.inches = code.effect == "inches"


def _diameter(executor: Executor, _work: Work, code: Code) -> None:
    executor.state.diameter_mode = code.effect == "diameter_on"


FEED_MODES = {"inverse_time": 93, "per_minute": 94, "per_revolution": 95}


def _feed_mode(executor: Executor, _work: Work, code: Code) -> None:
    """A change leaves the feed undefined (rs274 §2)."""
    mode = FEED_MODES[code.effect]
    if mode != executor.state.feed_mode:
        executor.state.feed_mode, executor.state.feed = mode, None


def _heed(executor: Executor, _work: Work, code: Code) -> None:
    executor.state.home_ignored = code.effect == "ignore_home"


_KEPT_MODES = (
    *("absolute", "arc_absolute", "inches", "plane", "feed_mode", "feed", "spindle", "speed", "mist", "flood"),
    *("return_to_r", "diameter_mode"),
)


def _save_modes(executor: Executor, _work: Work, _code: Code) -> None:
    """M70, M73."""
    executor.state.saved = replace(executor.state.copy(), saved=None)


def _restore_modes(executor: Executor, work: Work, _code: Code) -> None:
    """M72. The position stays, and what is sticky in a cycle."""
    state, saved = executor.state, executor.state.saved
    if saved is None:
        executor.note(work, "nothing_saved", "M72 without a state that M70 has saved")
        return
    for name in _KEPT_MODES:
        setattr(state, name, getattr(saved, name))
    offsets.select_system(state, saved.system)
    state.sync = True


# --- spindle, coolant, plane, compensation ------------------------------------------------------------------------

_SPINDLE = {"spindle_cw": 1, "spindle_ccw": -1, "spindle_off": 0}
_PLANES = {"plane_xy": 17, "plane_zx": 18, "plane_yz": 19}


def apply_setting(executor: Executor, work: Work, code: Code) -> None:
    """A mode that leaves the meaning of coordinates alone."""
    state, setting = executor.state, code.sets
    if setting in _SPINDLE:
        state.spindle = _SPINDLE[setting]
    elif setting in _PLANES:
        state.plane = _PLANES[setting]
    elif setting in ("return_to_start", "return_to_r"):
        state.return_to_r = setting == "return_to_r"
    elif setting == "compensation_off":
        executor.end_compensation()
    elif setting in ("compensation_left", "compensation_right"):
        _compensation(executor, work, code)
    else:
        state.mist = setting == "mist" or (state.mist and setting == "flood")
        state.flood = setting == "flood" or (state.flood and setting == "mist")


def _compensation(executor: Executor, work: Work, code: Code) -> None:
    """G41, G42 with the tool D, or the one in the spindle; G41.1, G42.1 with the diameter D itself."""
    state = executor.state
    if code.name.endswith(".1"):
        diameter = executor.length(work, "D")
    else:
        number = executor.number(work, "D")
        tool = state.tool if number is None else int(number)
        diameter = None if tool is None else state.diameters.get(tool)
        if number == 0:
            diameter = 0.0
    state.radius = None if diameter is None else diameter / 2
    executor.compensate(work, 41 if code.sets == "compensation_left" else 42)


# --- offsets ------------------------------------------------------------------------------------------------------


def _system(executor: Executor, _work: Work, code: Code) -> None:
    offsets.select_system(executor.state, int(code.effect.removeprefix("system_")))


def _set_position(executor: Executor, work: Work, _code: Code) -> None:
    """G92. What it does without any axis word, nobody says: all are unknown then."""
    named = executor.named(work)
    if named:
        offsets.shift_to(executor.state, named)
    else:
        executor.note(work, "axis_words_missing", "G92 without an axis word")
        executor.lose()


def _local_shift(executor: Executor, work: Work, _code: Code) -> None:
    offsets.set_local_shift(executor.state, executor.named(work))


def _clear_shift(executor: Executor, _work: Work, code: Code) -> None:
    offsets.clear_shift(executor.state, forget=code.effect == "clear_shift")


def _resume_shift(executor: Executor, _work: Work, _code: Code) -> None:
    offsets.resume_shift(executor.state)


def _length_table(executor: Executor, work: Work, code: Code) -> None:
    number = executor.number(work, "H")
    tool = executor.state.tool if number is None else int(number)
    offsets.use_tool_length(executor.state, tool, add=code.effect == "length_add")


def _length_direct(executor: Executor, work: Work, _code: Code) -> None:
    offset = list(executor.state.tool_offset)
    for row, value in executor.named(work).items():
        offset[row] = value
    offsets.change_tool_offset(executor.state, offset)


def _length_off(executor: Executor, _work: Work, _code: Code) -> None:
    offsets.change_tool_offset(executor.state, [0.0] * len(executor.state.axes))


def _set_data(executor: Executor, work: Work, _code: Code) -> None:
    """G10 L1, L2, L20 with P."""
    kind, number = executor.number(work, "L"), executor.number(work, "P")
    turned = executor.length(work, "R")
    named = executor.named(work)
    state = executor.state
    if kind is None or number is None or number < 0:
        executor.note(work, "word_missing", "G10 wants L and P", "P")
        executor.lose()
    elif kind in (2, 20) and int(number) in (0, *offsets.SYSTEMS):
        if kind == 2:
            offsets.set_system(state, int(number), named)
        else:
            offsets.set_system_here(state, int(number), named)
        if kind == 2 and turned:
            executor.note(work, "not_followed", "a turned coordinate system (G10 L2 R) is not followed here", "R")
            executor.lose()
    elif kind == 1 and number >= 1:
        offsets.set_tool_length(state, int(number), named, turned)
        work.used.update("IJQ")
    else:
        work.used.update("IJQ")
        executor.note(work, "not_followed", f"G10 L{kind:g} P{number:g} is not followed here", "L")
        executor.lose()


# --- homes --------------------------------------------------------------------------------------------------------


def _go_home(executor: Executor, work: Work, code: Code) -> None:
    """G28, G30: over the point that the axis words name, to the stored place, only with those axes (rs274 §2)."""
    state = executor.state
    rows = {*executor.named(work), *executor.steps(work)}
    if rows:
        executor.emit(work, RAPID, executor.target(work)[0])
    home = state.homes.get(HOMES[code.effect], [nan] * len(state.axes))
    rows = rows or set(range(len(state.axes)))
    end = [home[row] if row in rows else value for row, value in enumerate(state.position)]
    executor.emit(work, RAPID, end)
    executor.lose(rows & offsets.adrift(state))


def _store_home(executor: Executor, _work: Work, code: Code) -> None:
    state = executor.state
    untold = offsets.adrift(state)
    place = [nan if row in untold else value for row, value in enumerate(state.position)]
    state.homes[HOMES[code.effect]] = place


def _linear_rows(executor: Executor) -> list[int]:
    return [row for axis in "XYZ" if (row := executor.axis_rows.get(axis)) is not None]


def _home(executor: Executor, work: Work, _code: Code) -> None:
    """G28 of elvinto: Z to the safe plane, as high as the machine knows, then X0 Y0 at the switches."""
    if executor.state.home_ignored:
        return
    _by_itself(executor, work, HOMING, {"X": 0.0, "Y": 0.0, "Z": nan})
    offsets.forget_shift(executor.state, _linear_rows(executor))


def _home_and_back(executor: Executor, work: Work, _code: Code) -> None:
    """G27, G29: back to where it was, but in coordinates that the switches have set anew."""
    _by_itself(executor, work, HOMING, {"X": nan, "Y": nan, "Z": nan})


def _mill_plane(executor: Executor, work: Work, _code: Code) -> None:
    _by_itself(executor, work, FEED, {"X": nan, "Y": nan, "Z": nan})


def _tool_change(executor: Executor, work: Work, _code: Code) -> None:
    """M6 of elvinto lifts the spindle to safetyZ (elvinto §6)."""
    executor.state.tool = executor.state.selected
    _by_itself(executor, work, HOMING, {"Z": nan})


def _by_itself(executor: Executor, work: Work, kind: int, ends: dict[str, float]) -> None:
    work.used.update(executor.coordinate_letters)
    end = list(executor.state.position)
    for axis, value in ends.items():
        if axis in executor.axis_rows:
            end[executor.axis_rows[axis]] = value
    executor.emit(work, kind, end)


def _zero_all(executor: Executor, _work: Work, _code: Code) -> None:
    state = executor.state
    known = [row for row, value in enumerate(state.position) if not isnan(value)]
    offsets.shift_to(state, dict.fromkeys((*known, *_linear_rows(executor)), 0.0))


def _zero_z(executor: Executor, _work: Work, _code: Code) -> None:
    if "Z" in executor.axis_rows:
        offsets.shift_to(executor.state, {executor.axis_rows["Z"]: 0.0})


def _turn_a(executor: Executor, _work: Work, _code: Code) -> None:
    if "A" in executor.axis_rows:
        executor.lose([executor.axis_rows["A"]])


# --- the rest -----------------------------------------------------------------------------------------------------


def _load_tool(executor: Executor, _work: Work, _code: Code) -> None:
    executor.state.tool = executor.state.selected


def _set_tool(executor: Executor, work: Work, _code: Code) -> None:
    """M61 Q."""
    number = executor.number(work, "Q")
    executor.state.tool = None if number is None else int(number)


def _dwell(executor: Executor, work: Work, _code: Code) -> None:
    seconds = executor.number(work, "P")
    if seconds is None:
        executor.note(work, "word_missing", "G4 without P")
    executor.emit(work, DWELL, executor.state.position, dwell_s=max(0.0, seconds or 0.0))


def _machine_coordinates(_executor: Executor, work: Work, _code: Code) -> None:
    work.machine = True


def _pause(executor: Executor, _work: Work, _code: Code) -> None:
    """M0, M1, M60. The operator may press what he likes, but not move: the position stays."""


def _program_end(executor: Executor, _work: Work, _code: Code) -> None:
    """What the modes are behind it, the profile says; elvinto §6 only says that they are reset."""
    state, at_end = executor.state, executor.profile.at_end
    executor.end_compensation(entirely=True)
    state.ended = True
    state.cycle = {}
    if at_end is None:
        state.motion = state.motion_name = state.absolute = state.remembered = state.feed = None
        return
    for name, value in at_end.items():
        if name == "system":
            offsets.select_system(state, value)
        else:
            setattr(state, name, value)


def _subprogram(executor: Executor, work: Work, code: Code) -> None:
    executor.note(work, "subprogram", f"{code.name}: subprograms are to be expanded before")
    executor.lose()


def _unknown(executor: Executor, _work: Work, _code: Code) -> None:
    executor.lose()


ACTIONS: dict[str, tuple[int, Action]] = {
    # The order of execution within a block (rs274 §3); F, S and T come after WORDS.
    "inches": (0, _units),
    "millimetres": (0, _units),
    "diameter_on": (0, _diameter),
    "diameter_off": (0, _diameter),
    "inverse_time": (1, _feed_mode),
    "per_minute": (1, _feed_mode),
    "per_revolution": (1, _feed_mode),
    "load_tool": (20, _load_tool),
    "set_tool": (20, _set_tool),
    "tool_change": (20, _tool_change),
    "save_modes": (35, _save_modes),
    "restore_modes": (35, _restore_modes),
    "dwell": (45, _dwell),
    "length_table": (60, _length_table),
    "length_add": (60, _length_table),
    "length_direct": (60, _length_direct),
    "length_off": (60, _length_off),
    **{f"system_{number}": (65, _system) for number in offsets.SYSTEMS},
    "absolute": (70, _distance),
    "relative": (70, _distance),
    "remember_distance": (70, _remember_distance),
    "restore_distance": (70, _restore_distance),
    "arc_absolute": (70, _arc_distance),
    "arc_relative": (70, _arc_distance),
    "ignore_home": (72, _heed),
    "heed_home": (72, _heed),
    "set_data": (80, _set_data),
    "go_home": (80, _go_home),
    "go_second_home": (80, _go_home),
    "store_home": (80, _store_home),
    "store_second_home": (80, _store_home),
    "set_position": (80, _set_position),
    "local_shift": (80, _local_shift),
    "clear_shift": (80, _clear_shift),
    "suspend_shift": (80, _clear_shift),
    "resume_shift": (80, _resume_shift),
    "machine_coordinates": (80, _machine_coordinates),
    "home": (80, _home),
    "home_and_back": (80, _home_and_back),
    "zero_all": (80, _zero_all),
    "zero_z": (80, _zero_z),
    "turn_a": (80, _turn_a),
    "mill_plane": (80, _mill_plane),
    "unknown": (80, _unknown),
    "subprogram": (80, _subprogram),
    "pause": (120, _pause),
    "program_end": (120, _program_end),
}
"""Every effect that is no motion mode: when in the block, and what."""

SETTING_RANKS = {"spindle": 25, "mist": 30, "flood": 30, "coolant": 30, "plane": 50, "compensation": 55, "return": 75}
"""When a mode of `Code.sets` is set, by the first part of its name."""

WORDS = 10
"""F, S and T are set after the codes of a lower rank and before all others."""

MOTION = 100

ONLY_MODES = frozenset(
    (
        *(effect for effect, (rank, _) in ACTIONS.items() if rank in (0, 1, 70, 72)),
        "program_end",
    )
)
"""Effects that still hold of a block that cannot be followed otherwise."""
