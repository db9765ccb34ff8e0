"""Modal state and position through a program: what a block does to where the machine stands, and how long it takes.

Not a planner: times come from lengths, feeds and rates. Not a judge: check.py reports what is wrong with a block.
The one rule: a coordinate that is not certain is absent from `position`, never guessed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import ceil, hypot, sqrt
from typing import ClassVar, Literal

from gcode.arcs import Arc, arc_from_offsets, arc_from_radius
from gcode.motion import ASSUMED_FEED_MM_MIN, Motion, Position
from gcode.profile import Code, Profile
from gcode.words import Block, code_name

Kind = Literal["still", "rapid", "feed", "arc", "cycle", "homing", "dwell"]

MAX_PECKS = 1_000
"""A peck deeper than this many steps is a slip of Q; the estimate must not run away with it."""

_SECONDS_PER_MINUTE = 60.0


@dataclass(frozen=True, slots=True)
class Step:
    """What one block did. `exact`: start and length were known; without it `length_mm` and `seconds` are too short.

    `start` and `end` hold the known axes only. Arcs have their geometry in `arc`.
    """

    seconds: float = 0.0
    moves: bool = False
    exact: bool = True
    kind: Kind = "still"
    length_mm: float = 0.0
    start: Position = field(default_factory=dict)
    end: Position = field(default_factory=dict)
    arc: Arc | None = None


@dataclass(frozen=True, slots=True)
class Modal:
    """The modal state as the tracker knows it; None: not known."""

    motion: str | None
    absolute: bool | None
    remembered_absolute: bool | None
    feed_mm_min: float | None
    tool: int | None
    home_ignored: bool


class Tracker:
    """Follows a program block by block.

    `position` is what the machine would report (STATE MX.. on ElVinto) and is replaced, never edited, so that a
    reference to it stays true. `absolute` at the start is the power-on state; give the machine's own account
    (ISABS) where there is one, None where nobody knows.
    """

    __slots__ = (
        "_absolute",
        "_feed",
        "_hole",
        "_home_ignored",
        "_mode",
        "_motion",
        "_profile",
        "_remembered",
        "_tool",
        "position",
    )

    def __init__(
        self,
        profile: Profile,
        motion: Motion,
        position: Position | None = None,
        *,
        absolute: bool | None = True,
    ) -> None:
        self._profile = profile
        self._motion = motion
        self.position: dict[str, float] = dict(position or {})
        self._mode: Code | None = None
        self._hole: dict[str, float] = {}
        self._absolute = absolute
        self._remembered: bool | None = None
        self._feed: float | None = None
        self._tool: int | None = None
        self._home_ignored = False

    @property
    def modal(self) -> Modal:
        """The modal state now."""
        mode = self._mode.name if self._mode else None
        return Modal(mode, self._absolute, self._remembered, self._feed, self._tool, self._home_ignored)

    def copy(self) -> "Tracker":
        """A second tracker that goes on from here by itself."""
        other = Tracker(self._profile, self._motion, self.position, absolute=self._absolute)
        other._mode = self._mode
        other._hole = dict(self._hole)
        other._remembered = self._remembered
        other._feed = self._feed
        other._tool = self._tool
        other._home_ignored = self._home_ignored
        return other

    def step(self, block: Block) -> Step:
        """Execute `block`: modal words first, then what moves (rs274 §3). Never raises on any block."""
        code_letters, known = self._profile.code_letters, self._profile.codes
        acting: list[Code] = []
        values: dict[str, float] = {}
        codes = modes = 0
        lost = ended = False
        for letter, value, text, _ in block.words:
            if letter not in code_letters:
                values[letter] = value
                continue
            codes += 1
            code = known.get(code_name(letter, text))
            if code is None:
                lost = True
            elif code.group == "motion":
                self._mode = code
                self._hole = {}
                modes += 1
            elif code.effect in _MODAL_EFFECTS:
                self._set_mode(code.effect)
            elif code.effect == "program_end":
                ended = True
            elif code.effect != "none":
                acting.append(code)
        self._feed = values.get("F", self._feed)
        if "T" in values:
            self._tool = int(values["T"])
        # A code nobody knows, a letter twice, two motions at once: where that leads is anyone's guess.
        if lost or modes > 1 or len(acting) > 1 or codes + len(values) != len(block.words):
            step = self._lose(values)
        elif acting:
            step = self._act(acting[0].effect, values)
        else:
            step = self._move(values)
        if ended:
            self._forget_modes()
        return step

    def _lose(self, values: Mapping[str, float]) -> Step:
        start, self.position = self.position, {}
        return Step(moves=self._has_axes(values), exact=False, kind="feed", start=start, end={})

    def _act(self, effect: str, values: dict[str, float]) -> Step:
        if effect in _TAKES_AXES or not self._has_axes(values):
            return self._ACTING_RULES[effect](self, values)
        if effect not in _BEFORE_MOTION:
            return self._lose(values)
        step = self._ACTING_RULES[effect](self, values)
        moved = self._move(values)
        return replace(moved, seconds=step.seconds + moved.seconds, exact=step.exact and moved.exact)

    def _forget_modes(self) -> None:
        """M30 resets the modal state (elvinto §6); to what, nobody says."""
        self._mode = self._absolute = self._remembered = self._feed = None

    # --- motion ------------------------------------------------------------------------------------------------

    def _has_axes(self, values: Mapping[str, float]) -> bool:
        return any(letter.lower() in self._profile.axes for letter in values)

    def _move(self, values: dict[str, float]) -> Step:
        effect = self._mode.effect if self._mode else "unknown"
        start = self.position
        end, deltas, exact = self._target(values)
        if end is start and not (effect in _ARCS and ("I" in values or "J" in values)):
            return STILL
        if effect in _CYCLES:
            return self._cycle(values, deltas, pecking=effect == "peck")
        if effect not in _MOVING:
            # Axis words without a motion code that we know: where they lead is not known.
            self.position = _without(start, *(letter.lower() for letter in values))
            return Step(moves=True, exact=False, kind="feed", start=start, end=self.position)
        self.position = end
        if effect in _ARCS:
            return self._arc(values, deltas, start, clockwise=effect == "arc_cw")
        rapid = effect == "rapid"
        length_mm = self._length(deltas)
        seconds = self._rapid_seconds(deltas) if rapid else self._feed_seconds(deltas, length_mm)
        return Step(seconds, True, exact, "rapid" if rapid else "feed", length_mm, start, end)

    def _target(self, values: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float], bool]:
        """The position after the axis words, the known way of each axis that is named, and whether all are known."""
        position = self.position
        end = position
        deltas: dict[str, float] = {}
        exact = True
        for letter, value in values.items():
            axis = _AXIS_OF.get(letter)
            if axis is None or axis not in self._profile.axes:
                continue
            if end is position:
                end = dict(position)
            before = position.get(axis)
            if self._absolute:
                end[axis] = value
                if before is None:
                    exact = False
                else:
                    deltas[axis] = value - before
            elif self._absolute is False:
                deltas[axis] = value
                if before is not None:
                    end[axis] = before + value
            else:
                exact = False
                end.pop(axis, None)
        return end, deltas, exact

    def _length(self, deltas: Mapping[str, float]) -> float:
        """Length of the way in mm; of a turn without any linear axis, in degrees."""
        rotary = self._profile.rotary_axes
        if rotary.isdisjoint(deltas):
            return hypot(*deltas.values())
        linear = [way for axis, way in deltas.items() if axis not in rotary]
        return hypot(*linear) if any(linear) else hypot(*deltas.values())

    def _rapid_seconds(self, deltas: Mapping[str, float]) -> float:
        """From rest to rest, as the slowest axis needs."""
        longest_s = 0.0
        for axis, way in deltas.items():
            rate = self._motion.rate_mm_min(axis) / _SECONDS_PER_MINUTE
            acceleration = self._motion.acceleration_mm_s2(axis)
            way = abs(way)
            if way >= rate * rate / acceleration:
                axis_s = way / rate + rate / acceleration
            else:
                axis_s = 2.0 * sqrt(way / acceleration)
            longest_s = max(longest_s, axis_s)
        return longest_s

    def _feed_seconds(self, deltas: Mapping[str, float], length_mm: float) -> float:
        """At the feed, or as fast as the slowest axis can."""
        longest_s = length_mm * _SECONDS_PER_MINUTE / self._feed_mm_min()
        for axis, way in deltas.items():
            longest_s = max(longest_s, abs(way) * _SECONDS_PER_MINUTE / self._motion.rate_mm_min(axis))
        return longest_s

    def _feed_mm_min(self) -> float:
        return self._feed if self._feed is not None and self._feed > 0 else ASSUMED_FEED_MM_MIN

    def _arc(self, values: Mapping[str, float], deltas: dict[str, float], start: Position, *, clockwise: bool) -> Step:
        # An axis that is not named does not move; one that is named but unknown before leaves the arc unknown.
        way = (deltas.get("x", 0.0), deltas.get("y", 0.0))
        known = all(axis in deltas or letter not in values for axis, letter in (("x", "X"), ("y", "Y"), ("z", "Z")))
        arc: Arc | None = None
        if known and ("I" in values or "J" in values):
            arc = arc_from_offsets(way, (values.get("I", 0.0), values.get("J", 0.0)), clockwise=clockwise)
        elif known and "R" in values:
            arc = arc_from_radius(way, values["R"], clockwise=clockwise)
        if arc is None:
            length_mm = self._length(deltas)
            return Step(self._feed_seconds(deltas, length_mm), True, False, "arc", length_mm, start, self.position)
        rise = deltas.get("z", 0.0)
        length_mm = hypot(arc.length, rise)
        seconds = self._feed_seconds({"z": rise}, length_mm)
        return Step(seconds, True, True, "arc", length_mm, start, self.position, arc)

    def _cycle(self, values: Mapping[str, float], deltas: dict[str, float], *, pecking: bool) -> Step:
        """G81, G83, roughly: rapid to the hole, feed to the bottom, rapid out. Where Z stays is not certain."""
        start = self.position
        end, _, exact = self._target({letter: value for letter, value in values.items() if letter != "Z"})
        self.position = end = _without(end, "z")
        deltas = {axis: way for axis, way in deltas.items() if axis != "z"}
        # R, Z and Q hold for the further holes of the same cycle (rs274 §2).
        self._hole.update({letter: value for letter, value in values.items() if letter in "RZQ"})
        hole = self._hole
        depth_mm = abs(hole["R"] - hole["Z"]) if "R" in hole and "Z" in hole else 0.0
        pecks = min(ceil(depth_mm / hole["Q"]), MAX_PECKS) if pecking and hole.get("Q", 0.0) > 0 else 1
        seconds = (
            self._rapid_seconds(deltas)
            + self._feed_seconds({"z": depth_mm}, depth_mm)
            + pecks * self._rapid_seconds({"z": depth_mm})
        )
        return Step(seconds, True, exact, "cycle", self._length(deltas) + 2 * depth_mm, start, end)

    # --- rules of codes that act instead of the modal motion ----------------------------------------------------

    def _home(self, _values: Mapping[str, float]) -> Step:
        """G28: Z to the safe plane, then X0 Y0 (elvinto §6). How high the safe plane is, the machine knows."""
        if self._home_ignored:
            return STILL
        start = self.position
        self.position = {**_without(start, "z"), "x": 0.0, "y": 0.0}
        return Step(self._homing_seconds(start), True, False, "homing", 0.0, start, self.position)

    def _home_and_back(self, _values: Mapping[str, float]) -> Step:
        """G27, G29: back to where it was, but in coordinates that the switches have set anew."""
        start = self.position
        self.position = _without(start, "x", "y", "z")
        return Step(2 * self._homing_seconds(start), True, False, "homing", 0.0, start, self.position)

    def _homing_seconds(self, start: Position) -> float:
        """As far as it is known from here: up, and to X0 Y0."""
        return self._rapid_seconds({axis: start.get(axis, 0.0) for axis in ("x", "y", "z")})

    def _set_position(self, values: Mapping[str, float]) -> Step:
        """G92: the coordinates of the named axes. What it does without any, nobody says: all are unknown then."""
        named = {axis: value for letter, value in values.items() if (axis := _AXIS_OF.get(letter))}
        self.position = {**self.position, **named} if named else {}
        return STILL

    def _zero_all(self, _values: Mapping[str, float]) -> Step:
        self.position = dict.fromkeys({*self.position, "x", "y", "z"}, 0.0)
        return STILL

    def _zero_z(self, _values: Mapping[str, float]) -> Step:
        self.position = {**self.position, "z": 0.0}
        return STILL

    def _tool_change(self, _values: Mapping[str, float]) -> Step:
        """M6 lifts the spindle to safetyZ (elvinto §6)."""
        start = self.position
        self.position = _without(start, "z")
        return Step(0.0, True, False, "homing", 0.0, start, self.position)

    def _turn_a(self, _values: Mapping[str, float]) -> Step:
        self.position = _without(self.position, "a")
        return STILL

    def _mill_plane(self, _values: Mapping[str, float]) -> Step:
        start = self.position
        self.position = _without(start, "x", "y", "z")
        return Step(0.0, True, False, "feed", 0.0, start, self.position)

    def _dwell(self, values: Mapping[str, float]) -> Step:
        return Step(seconds=max(0.0, values.get("P", 0.0)), kind="dwell", start=self.position, end=self.position)

    def _unknown(self, _values: Mapping[str, float]) -> Step:
        self.position = {}
        return STILL

    # --- codes that only set something --------------------------------------------------------------------------

    def _set_mode(self, effect: str) -> None:
        match effect:
            case "absolute" | "relative":
                self._absolute = effect == "absolute"
            case "remember_distance":
                self._remembered = self._absolute
            case "restore_distance":
                self._absolute = self._remembered
            case "ignore_home" | "heed_home":
                self._home_ignored = effect == "ignore_home"

    _ACTING_RULES: ClassVar[dict[str, Callable[["Tracker", dict[str, float]], Step]]] = {
        "home": _home,
        "home_and_back": _home_and_back,
        "set_position": _set_position,
        "zero_all": _zero_all,
        "zero_z": _zero_z,
        "tool_change": _tool_change,
        "turn_a": _turn_a,
        "mill_plane": _mill_plane,
        "dwell": _dwell,
        "unknown": _unknown,
    }


STILL = Step()
"""A block that moves nothing."""

_ARCS = frozenset(("arc_cw", "arc_ccw"))
_CYCLES = frozenset(("drill", "peck"))
_MOVING = frozenset(("rapid", "feed")) | _ARCS
_BEFORE_MOTION = frozenset(("tool_change", "dwell"))
# Codes that take the block's axis words for themselves, or, as G28, for nothing.
_TAKES_AXES = frozenset(("home", "home_and_back", "set_position", "mill_plane"))

_AXIS_OF = {letter: letter.lower() for letter in "XYZABCUVW"}

_MODAL_EFFECTS = frozenset(
    ("absolute", "relative", "remember_distance", "restore_distance", "ignore_home", "heed_home")
)


def _without(position: Position, *axes: str) -> dict[str, float]:
    return {axis: value for axis, value in position.items() if axis not in axes}
