"""The mill behind the controller: modal state, where it stands, and what a block makes it do.

It has no clock, no IDs and no wire. The one rule: `begin` only plans; the carriage does not move before `stop`.

Three systems of coordinates: *shown* (STATE's MX..), *field* = shown + offset (what the envelope control compares with
the travel), *true* (where the carriage really stands from the switches; unknown to the machine until G28).
"""

from collections.abc import Callable
from typing import TypeAlias

from sim.elvinto.gcode import (
    AXIS_LETTERS,
    ERR_BAD_ARC,
    ERR_BAD_CYCLE,
    ERR_PARAMETER,
    IGNORED,
    MOTION,
    PLACING,
    BlockError,
    Words,
    read_block,
)
from sim.elvinto.settings import SimSettings
from sim.motion import AXES, ORIGIN, Leg, Point, arc_by_centre, arc_by_radius, first_exit

X, Y, Z = 0, 1, 2

UNBOUNDED_MM = 1e12

ALARM_START_SWITCH, ALARM_END_SWITCH = 1, 2
ALARM_START_SWITCH_FAULTY, ALARM_END_SWITCH_FAULTY = 3, 4
ALARM_START_BORDER, ALARM_END_BORDER = 5, 6
ALARM_EMERGENCY = 100

PECK_CLEARANCE_MM = 0.5
PLANE_STEP_MM = 5.0

MAX_LEGS = 30_000
"""Of one block: a peck of a micrometre must not take all memory."""


class Plan:
    """What one block does: its legs, and what happens when they are done."""

    # Defaults of the class: of almost every block there is nothing but its legs to set.
    homes: bool = False
    alarm: tuple[int, int] | None = None
    """(ALARMNUM, AXISNUM) at the end of the last leg: it was cut at the border of the field."""
    tool: int | None = None
    query: str | None = None
    emergency: bool = False
    ends_program: bool = False

    def __init__(self) -> None:
        self.legs: list[Leg] = []

    @property
    def only_moves(self) -> bool:
        """Nothing else happens at its end: of almost every block that is true."""
        happens = self.emergency or self.ends_program
        return not happens and self.alarm is None and self.tool is None and self.query is None


Placing: TypeAlias = Callable[["Mill", Words, Plan], None]


def _plus(point: Point, by: Point) -> Point:
    x, y, z, a, b, c = point
    dx, dy, dz, da, db, dc = by
    return (x + dx, y + dy, z + dz, a + da, b + db, c + dc)


def _minus(point: Point, by: Point) -> Point:
    x, y, z, a, b, c = point
    dx, dy, dz, da, db, dc = by
    return (x - dx, y - dy, z - dz, a - da, b - db, c - dc)


def _replace(point: Point, **axes: float) -> Point:
    x, y, z, a, b, c = (axes.get(axis, value) for axis, value in zip(AXES, point, strict=True))
    return (x, y, z, a, b, c)


class Mill:
    """All that a power cut forgets is set in `forget`; the carriage itself stays where it is."""

    def __init__(self, settings: SimSettings) -> None:
        self._settings = settings
        self.shown: Point = ORIGIN
        self._zero: Point = (*settings.start_position, 0.0, 0.0, 0.0)
        """Where the zero of what is shown lies, counted from the limit switches."""
        self._low: Point = self._border(0)
        self._high: Point = self._border(1)
        self.faulty_switch: tuple[int, int] | None = None
        """(ALARMNUM, AXISNUM) that the next homing will run into."""
        self.forget()

    def _border(self, side: int) -> Point:
        unbounded = (-UNBOUNDED_MM, UNBOUNDED_MM)
        x, y, z, a, b, c = (self._settings.travel.get(axis, unbounded)[side] for axis in AXES)
        return (x, y, z, a, b, c)

    def forget(self) -> None:
        """Power-on: coordinates 0 wherever the carriage stands, no envelope control (§7)."""
        self._zero, self.shown = self.true, ORIGIN
        self.offset: Point = ORIGIN
        self.envelope = False
        self.absolute = True
        self._absolute_kept = True
        self.motion = "G0"
        self._cycle: dict[str, float] = {}
        self.feed_mm_min = 0.0
        self.spindle_rpm = 0.0
        self.spindle_on = False
        self.plasma_on = False
        self.a_turning: float = 0.0
        self.tool = 0
        self.reports_moves = False
        self._ignores_g28 = False
        self._determined = False

    @property
    def true(self) -> Point:
        """Where the carriage really stands, counted from the limit switches."""
        return _plus(self.shown, self._zero)

    def begin(self, block: str) -> Plan:
        """Take a block: modal changes happen at once, motion is only planned. Raises BlockError."""
        words = read_block(block)
        plan = Plan()
        values = words.values
        if "F" in values:
            self.feed_mm_min = values["F"]
        if "S" in values:
            self.spindle_rpm = values["S"]
        if "T" in values:
            self.tool = int(values["T"])
        motion, placing = self._codes(words, plan) if words.codes else ("", "")
        if placing:
            _PLACINGS[placing](self, words, plan)
            self.motion = motion or self.motion
        elif motion or not AXIS_LETTERS.isdisjoint(values):
            self._move(motion or self.motion, words, plan)
        if self.envelope and not plan.homes:
            self._guard(plan)
        if "M30" in words.codes:
            self._reset_modal()
        return plan

    def _codes(self, words: Words, plan: Plan) -> tuple[str, str]:
        """Sets modes; the code of motion and the one that takes the axis words in its place, empty for none."""
        motion = placing = ""
        for code in words.codes:
            if code in MOTION:
                motion = code
            elif code in PLACING:
                placing = code
            elif code not in IGNORED:
                self._mode(code, words, plan)
        return motion, placing

    def stop(self, plan: Plan, leg_index: int, elapsed_s: float | None) -> None:
        """The carriage stands still in that leg, or at the end of the plan when `elapsed_s` is None."""
        if not plan.legs:
            return
        if plan.homes and any(leg.rebases for leg in plan.legs[: None if elapsed_s is None else leg_index + 1]):
            self._zero = self.offset = ORIGIN
            self.envelope = True
        self.shown = plan.legs[-1].end if elapsed_s is None else plan.legs[leg_index].after(elapsed_s)

    def _reset_modal(self) -> None:
        """M30: end of program with a reset of the modal functions (§3)."""
        self.absolute = True
        self.motion = "G0"
        self._cycle = {}
        self.spindle_on = False
        self.plasma_on = False
        self.a_turning = 0.0

    def _mode(self, code: str, words: Words, plan: Plan) -> None:
        match code:
            case "G90" | "G91":
                self.absolute = code == "G90"
            case "G80":
                self.motion, self._cycle = "G0", {}
            case "G75" | "G76":
                self.a_turning = words.values.get("S", 0.0)
            case "M3" | "M4" | "M5":
                self.spindle_on = code != "M5"
            case "M7" | "M8":
                self.plasma_on = code == "M7"
            case "M6":
                if self.shown[Z] < self._settings.safe_z:
                    self._go(plan, _replace(self.shown, Z=self._settings.safe_z))
                plan.tool = self.tool
            case "M30" | "M99":
                plan.ends_program = True
            case _:
                self._w_code(code, plan)

    def _w_code(self, code: str, plan: Plan) -> None:
        match code:
            case "W70":
                self._absolute_kept = self.absolute
            case "W71":
                self.absolute = self._absolute_kept
            case "W72" | "W73":
                self.envelope = code == "W72"
            case "W90" | "W91":
                self.reports_moves = code == "W90"
            case "W93" | "W94":
                self._ignores_g28 = code == "W93"
            case "W98":
                plan.emergency = True
            case _:
                plan.query = code

    def _at(self, plan: Plan) -> Point:
        return plan.legs[-1].end if plan.legs else self.shown

    def _go(self, plan: Plan, end: Point, *, feed: bool = False) -> None:
        """A straight leg from where the plan has come to; rapid unless `feed`."""
        legs = plan.legs
        start = legs[-1].end if legs else self.shown
        if start != end:
            speed = self._feed_mm_s if feed else self._settings.rapid_mm_min / 60
            legs.append(Leg(start, end, speed, self._settings.acceleration))

    @property
    def _feed_mm_s(self) -> float:
        return (self.feed_mm_min if self.feed_mm_min > 0 else self._settings.default_feed_mm_min) / 60

    def _target(self, start: Point, values: dict[str, float]) -> Point:
        x, y, z, a, b, c = start
        get = values.get
        if self.absolute:
            return (get("X", x), get("Y", y), get("Z", z), get("A", a), get("B", b), get("C", c))
        return _plus(start, (get("X", 0.0), get("Y", 0.0), get("Z", 0.0), get("A", 0.0), get("B", 0.0), get("C", 0.0)))

    def _move(self, motion: str, words: Words, plan: Plan) -> None:
        if motion == "G1" or motion == "G0":
            self._go(plan, self._target(self._at(plan), words.values), feed=motion == "G1")
        elif motion in ("G2", "G3"):
            self._arc(motion == "G2", words, plan)
        else:
            self._drill(motion, words, plan)
        self.motion = motion

    def _arc(self, clockwise: bool, words: Words, plan: Plan) -> None:
        start, values = self._at(plan), words.values
        end = self._target(start, values)
        if "R" in values:
            offset = arc_by_radius(start, end, values["R"], clockwise=clockwise)
            if offset is None:
                raise BlockError(ERR_BAD_ARC)
        elif "I" in values or "J" in values:
            offset = (values.get("I", 0.0), values.get("J", 0.0))
        elif not AXIS_LETTERS.isdisjoint(values):
            raise BlockError(ERR_BAD_ARC)
        else:
            return
        if offset == (0.0, 0.0):
            raise BlockError(ERR_BAD_ARC)
        centre, sweep = arc_by_centre(start, end, offset, clockwise=clockwise)
        plan.legs.append(Leg(start, end, self._feed_mm_s, self._settings.acceleration, centre, sweep))

    def _drill(self, motion: str, words: Words, plan: Plan) -> None:
        """A hole: over it, to R, down (in pecks of Q), and up to where Z was, with .99 only to R."""
        start = self._at(plan)
        here = self._target(start, {axis: words.values[axis] for axis in "XY" if axis in words.values})
        cycle = {**self._cycle, **{key: words.values[key] for key in "ZRQ" if key in words.values}}
        if "Z" not in cycle or (motion.startswith("G83") and cycle.get("Q", 0.0) <= 0.0):
            raise BlockError(ERR_BAD_CYCLE)
        self._cycle = cycle
        level = start[Z] if "R" not in cycle else cycle["R"] if self.absolute else start[Z] + cycle["R"]
        bottom = cycle["Z"] if self.absolute else level + cycle["Z"]
        top = level if motion.endswith(".99") else max(start[Z], level)
        self._go(plan, _replace(here, Z=max(start[Z], level)))
        self._go(plan, _replace(here, Z=level))
        depth = level
        if motion.startswith("G83") and (level - bottom) / cycle["Q"] > MAX_LEGS / 3:
            raise BlockError(ERR_BAD_CYCLE)
        while motion.startswith("G83") and depth - cycle["Q"] > bottom:
            depth -= cycle["Q"]
            self._go(plan, _replace(here, Z=depth), feed=True)
            self._go(plan, _replace(here, Z=level))
            self._go(plan, _replace(here, Z=min(level, depth + PECK_CLEARANCE_MM)))
        self._go(plan, _replace(here, Z=bottom), feed=True)
        self._go(plan, _replace(here, Z=top))

    def _home(self, plan: Plan) -> None:
        """To the switches, Z first, then Y, then X (§8); from there coordinates count from them."""
        plan.homes = True
        if self.faulty_switch is not None:
            plan.alarm, self.faulty_switch = self.faulty_switch, None
            return
        start = self._at(plan)
        home = _minus((0.0, 0.0, self._settings.safe_z, 0.0, 0.0, 0.0), self._zero)
        for axes in ("Z", "ZY", "ZYX"):
            self._go(plan, _replace(start, **{axis: home[AXES.index(axis)] for axis in axes}))
        base = (0.0, 0.0, self._settings.safe_z, *self.true[3:])
        plan.legs.append(Leg(base, base, 1.0, self._settings.acceleration, rebases=True))

    def g27(self, _words: Words, plan: Plan) -> None:
        """As G29, but once since power-on (§8)."""
        if not self._determined:
            self.g29(_words, plan)
            self._determined = plan.homes

    def g28(self, _words: Words, plan: Plan) -> None:
        if not self._ignores_g28:
            self._home(plan)

    def g29(self, _words: Words, plan: Plan) -> None:
        """G28 and back to where the carriage stood, X and Y together and then Z (§8)."""
        if self._ignores_g28:
            return
        self._home(plan)
        if plan.alarm is not None:
            return
        stood = self.true
        self._go(plan, _replace(self._at(plan), X=stood[X], Y=stood[Y]))
        self._go(plan, _replace(self._at(plan), Z=stood[Z]))

    def g92(self, words: Words, _plan: Plan) -> None:
        self._show(_replace(self.shown, **{axis: words.values[axis] for axis in AXES if axis in words.values}))

    def m200(self, _words: Words, _plan: Plan) -> None:
        self._show(ORIGIN)

    def m210(self, _words: Words, _plan: Plan) -> None:
        self._show(_replace(self.shown, Z=0.0))

    def _show(self, point: Point) -> None:
        by = _minus(self.shown, point)
        self.offset, self._zero = _plus(self.offset, by), _plus(self._zero, by)
        self.shown = point

    def g100(self, words: Words, plan: Plan) -> None:
        self._plane(words, plan, along=X)

    def g101(self, words: Words, plan: Plan) -> None:
        self._plane(words, plan, along=Y)

    def _plane(self, words: Words, plan: Plan, *, along: int) -> None:
        """An odd number of strips: the last one ends in the opposite corner, which is all the standard names."""
        if "X" not in words.values or "Y" not in words.values:
            raise BlockError(ERR_PARAMETER)
        start = self._at(plan)
        corner = self._target(start, {axis: words.values[axis] for axis in "XY"})
        across = Y if along == X else X
        width = corner[across] - start[across]
        steps = max(1, int(abs(width) / PLANE_STEP_MM) // 2) * 2
        if steps > MAX_LEGS / 2:
            raise BlockError(ERR_PARAMETER)
        for strip in range(steps + 1):
            ends = (corner[along], start[along])
            side = start[across] + width * strip / steps
            self._go(plan, _replace(self._at(plan), **{AXES[across]: side}), feed=True)
            self._go(plan, _replace(self._at(plan), **{AXES[along]: ends[strip % 2]}), feed=True)

    def _guard(self, plan: Plan) -> None:
        """The positioner outside the field is an alarm (§7): the carriage comes as far as the border."""
        low, high = _minus(self._low, self.offset), _minus(self._high, self.offset)
        for index, leg in enumerate(plan.legs):
            found = first_exit(leg, low, high)
            if found is not None:
                plan.legs[index:] = [leg.cut(found.fraction)]
                plan.alarm = (ALARM_END_BORDER if found.beyond_end else ALARM_START_BORDER, found.axis + 1)
                return


_PLACINGS: dict[str, Placing] = {
    "G27": Mill.g27,
    "G28": Mill.g28,
    "G29": Mill.g29,
    "G92": Mill.g92,
    "G100": Mill.g100,
    "G101": Mill.g101,
    "M200": Mill.m200,
    "M210": Mill.m210,
}
