"""The plan to take a program up at a line: the machine's state built anew, and a safe way back to the path.

The plan is data: blocks with a purpose each, to be shown, edited and sent by somebody else, on the operator's word.
The one rule: plan and rest cut what the program cuts from that line on, from whatever modes the machine was in; what
cannot be said that way is refused with its reason (reentry.REASONS), never left out.
"""

from collections.abc import Iterable, Mapping
from math import isfinite, isnan

from gcode.entry import Rest, look_ahead
from gcode.executor import MM_PER_INCH
from gcode.offsets import adrift
from gcode.past import Past, Saying, past_of, state_before
from gcode.profile import Code, Profile
from gcode.reentry import CannotResumeError, Purpose, Reentry, Step, Way, number, refuse
from gcode.segments import PLANE_AXES, ROTARY_AXES
from gcode.state import State
from gcode.words import Block

MAX_NOTES = 3
"""Notes about the lines before that become warnings: the rest stands in the check of the program."""

_SAME_MM = 1e-6


def plan_reentry(
    before: Past | State,
    at: Iterable[Block],
    profile: Profile,
    way: Way,
    *,
    position: Mapping[str, float] | None = None,
) -> Reentry:
    """The plan to go on behind the lines that left `before`, with the blocks `at`, which are those of the rest.

    Of the rest the blocks up to the first cut are looked at, with those of `/` lines emptied where these are left out.
    `position`: where the machine stands now, in the program coordinates of `before`, by lower-case axis; without it
    the machine is lifted to the clearance from wherever it is. The controller must still have its G54-G59.3, G28,
    G30 and tool table; modes, G92, tool length, T, F and S it may have lost. Raises CannotResumeError.
    """
    past = before if isinstance(before, Past) else Past(before, compensating=before.compensation != 40)
    return _Planner(past, at, profile, way, position).plan()


class _Planner:
    def __init__(
        self, past: Past, at: Iterable[Block], profile: Profile, way: Way, position: Mapping[str, float] | None
    ) -> None:
        self._past, self._profile, self._way = past, profile, way
        self._state = state = past.state
        self._steps: list[Step] = []
        self._warnings: list[str] = []
        self._lift_axis = (way.along or ("Z" if "Y" in state.axes else "X")).upper()
        self._check()
        self._rest: Rest = look_ahead(state, at, profile)
        self._entry = self._place()
        self._lift_row = state.axes.index(self._lift_axis)
        self._now = None if position is None else position.get(self._lift_axis.lower())
        # Without G52 the shift of G92 can only be said where the machine stands at a known place: behind the moves.
        self._late = state.shift_active and self._effect("local_shift") is None
        self._check_place()

    def plan(self) -> Reentry:
        self._modes()
        self._offsets()
        self._groups()
        if self._way.laser:
            self._add(self._required("M5", sets="spindle_off"), "beam_off", "dark on the way")
        travel = self._lift()
        if self._tool():
            travel = None
        self._over()
        if not self._way.laser:
            self._spindle()
        self._coolant()
        self._down(travel)
        self._late_shift()
        self._motion()
        if self._way.laser:
            self._spindle()
        for text in self._rest.blocks:
            self._add(text, "first", "the rest begins, with the mode and the sticky words of the lines before")
        self._warn()
        known = {axis.lower(): value for axis, value in self._entry.items() if not isnan(value)}
        return Reentry(tuple(self._steps), self._rest.takes_over, tuple(self._warnings), known)

    # --- what is refused ------------------------------------------------------------------------------------------

    def _check(self) -> None:
        state, said, way = self._state, self._past.said, self._way
        feed_is_good = isfinite(way.plunge_feed_mm_min) and way.plunge_feed_mm_min > 0
        if not (feed_is_good and isfinite(way.clearance_mm) and 0 <= way.spindle_wait_s < 1e9):
            refuse("bad_value", "Give a clearance, a feed over 0 and a time to wait.")
        if self._lift_axis not in state.axes:
            refuse("bad_value", f"This machine has no axis {self._lift_axis} to lift.")
        if state.ended:
            refuse("ended", "Start before the end of the program.")
        if self._past.compensating or state.compensation != 40:
            refuse("compensation", "Start before G41 or G42, or behind the straight move that follows G40.")
        if state.absolute is None:
            refuse("distance_unknown", "Start at a line behind the next G90 or G91.")
        if state.adrift:
            axes = " ".join(state.axes[row] for row in sorted(state.adrift))
            refuse("shift_unknown", f"Set the origin of {axes} by G10 L20 instead of G92, or start at the first line.")
        if state.saved is not None or state.remembered is not None:
            refuse("saved_modes", "Start before they are saved.")
        if state.spindle is None:
            refuse("spindle_unknown", "Start at a line behind the next M3, M4 or M5.")
        if "tool" in said and state.tool is None:
            refuse("tool_unknown", "Start at the line that loads the next tool.")
        if said.get("scaling", Saying("G50")).name == "G51":
            refuse("scaling", "Start behind G50.")

    def _check_place(self) -> None:
        state = self._state
        shift_lost = [axis for axis, value in zip(state.axes, state.shift, strict=True) if isnan(value)]
        if shift_lost:
            refuse("shift_unknown", f"The shift of {' '.join(shift_lost)} is not known. Start at the first line.")
        lost = [axis for axis in self._rest.hangs_on if not (self._way.laser and axis == self._lift_axis)]
        entry = self._entry
        if not isnan(entry[self._lift_axis]):
            # Going down where nobody knows what is below is worse than not to start.
            lost += [axis for axis in "XYZ" if isnan(entry.get(axis, 0.0)) and axis not in lost]
        if self._late:
            lost += [state.axes[row] for row, value in enumerate(state.shift) if value and isnan(state.position[row])]
        if lost:
            refuse(
                "position_unknown",
                f"Where the path goes on along {' '.join(dict.fromkeys(lost))} is not known. Start at a line before "
                "which every axis has been moved to a coordinate, or at the first line.",
            )

    def _place(self) -> dict[str, float]:
        """Program coordinates of the entry. A series of holes goes on from the level that it began at."""
        state = self._state
        place = {axis: at - off for axis, at, off in zip(state.axes, state.position, state.frame, strict=True)}
        axis = PLANE_AXES[state.plane][2]
        if self._rest.level and "level" in state.cycle and axis in place:
            place[axis] = state.cycle["level"] - state.frame[state.axes.index(axis)]
        return place

    # --- words ----------------------------------------------------------------------------------------------------

    def _add(self, text: str, purpose: Purpose, note: str = "") -> None:
        if text:
            self._steps.append(Step(text, purpose, note))

    def _find(self, **wanted: str) -> Code | None:
        """The code that the controller has for this; one that it ignores says nothing."""
        for code in self._profile.codes.values():
            if code.status in ("exists", "differs") and all(getattr(code, key) == wanted[key] for key in wanted):
                return code
        return None

    def _effect(self, effect: str) -> str | None:
        code = self._find(effect=effect)
        return None if code is None else code.name

    def _sets(self, setting: str) -> str | None:
        code = self._find(sets=setting)
        return None if code is None else code.name

    def _required(self, usual: str, **wanted: str) -> str:
        code = self._find(**wanted)
        if code is None:
            refuse("no_code", f"{self._profile.title} has nothing like {usual}. Start at the first line.")
        return code.name

    def _mode(self, purpose: Purpose, effects: tuple[str, str], *, second: bool) -> None:
        """A mode of two. A controller with one of the codes or none is always in the first."""
        names = [self._effect(effect) or self._sets(effect) for effect in effects]
        if all(names):
            self._add(names[second] or "", purpose)
        elif second:
            refuse("no_code", f"{self._profile.title} has no code for {effects[1]}. Start at the first line.")

    def _length(self, axis: str, value_mm: float) -> str:
        """An axis word in the units of the program."""
        if self._state.diameter_mode and axis == "X":
            value_mm *= 2
        rotary = axis in ROTARY_AXES
        return axis + number(value_mm if rotary else self._scaled(value_mm))

    def _scaled(self, value_mm: float) -> float:
        return value_mm / MM_PER_INCH if self._state.inches else value_mm

    def _target(self, axis: str, value_mm: float) -> str:
        """An axis word of a move: the shift of G92 is not in force yet where it is said late."""
        shift = self._state.shift[self._state.axes.index(axis)] if self._late else 0.0
        return self._length(axis, value_mm + shift)

    # --- the state ------------------------------------------------------------------------------------------------

    def _modes(self) -> None:
        state = self._state
        self._mode("units", ("millimetres", "inches"), second=state.inches)
        self._mode("diameter", ("diameter_off", "diameter_on"), second=state.diameter_mode)
        planes = {17: self._sets("plane_xy"), 18: self._sets("plane_zx"), 19: self._sets("plane_yz")}
        if sum(name is not None for name in planes.values()) > 1:
            self._add(planes[state.plane] or "", "plane")
        self._add(self._required("G90", effect="absolute"), "distance", "for the way; the program's own comes last")
        self._mode("arc_distance", ("arc_relative", "arc_absolute"), second=state.arc_absolute)
        self._mode("return", ("return_to_start", "return_to_r"), second=state.return_to_r)
        self._add(self._effect("per_minute") or "", "feed_mode", "for the way")
        if state.home_ignored:
            self._add(self._required("W93", effect="ignore_home"), "home")

    def _offsets(self) -> None:
        state = self._state
        self._add(self._effect(f"system_{state.system}") or "", "system")
        self._add(self._effect("clear_shift") or "", "offset", "what may be left of another job")
        local = self._effect("local_shift")
        if local is not None and any(state.shift):
            words = [self._length(axis, off) for axis, off in zip(state.axes, state.shift, strict=True) if off]
            self._add(f"{local} {' '.join(words)}", "offset", "the shift that G92 or G52 has left")
            if not state.shift_active:
                self._add(self._required("G92.2", effect="suspend_shift"), "offset", "not in force, but remembered")
        self._add(self._effect("length_off") or "", "length")
        if any(off != 0.0 for off in state.tool_offset):
            self._tool_length()

    def _tool_length(self) -> None:
        state, said = self._state, self._past.said.get("length")
        direct = self._effect("length_direct")
        known = not any(isnan(off) for off in state.tool_offset)
        if known and direct is not None:
            words = [self._length(axis, off) for axis, off in zip(state.axes, state.tool_offset, strict=True) if off]
            self._add(f"{direct} {' '.join(words)}", "length")
        elif said is not None and said.name == "G43" and said.words:
            self._add(self._spoken(said), "length", "from the controller's tool table")
        else:
            refuse("length_unknown", "Tell the tool table, or start at the line that sets the tool length.")

    def _groups(self) -> None:
        for group in ("path", "override", "spindle_mode"):
            if group in self._past.said:
                self._add(self._spoken(self._past.said[group]), "mode")

    def _spoken(self, saying: Saying) -> str:
        lengths = saying.name == "G64"
        words = [letter + number(self._scaled(value) if lengths else value) for letter, value in saying.words]
        if saying.name == "G96":
            words.append(f"S{number(self._state.speed)}")
        return " ".join((saying.name, *words))

    # --- the way --------------------------------------------------------------------------------------------------

    def _lift(self) -> float | None:
        """Up to the clearance. Gives the height of the way, program coordinates, where it is known."""
        way, axis, entry = self._way, self._lift_axis, self._entry[self._lift_axis]
        if way.laser and isnan(entry):
            return None
        if way.clearance_is_machine:
            machine = self._required("G53", effect="machine_coordinates")
            at = self._state.position[self._lift_row]
            known = not isnan(at) and self._lift_row not in adrift(self._state)
            height = max(way.clearance_mm, at) if known else way.clearance_mm
            self._add(f"{machine} G0 {self._length(axis, height)}", "lift", "machine coordinates")
            return height - self._state.frame[self._lift_row] if known else None
        height = way.clearance_mm if isnan(entry) else max(way.clearance_mm, entry)
        if self._now is not None and self._now >= height - _SAME_MM:
            return self._now
        self._add(f"G0 {self._target(axis, height)}", "lift", "before anything else moves")
        if self._now is None:
            self._warnings.append(
                f"Where the machine stands is not known: from there it goes straight to {axis}{number(height)} mm."
            )
        return height

    def _tool(self) -> bool:
        """The tool, with the machine lifted. Whether the change itself has moved it (elvinto §6)."""
        state = self._state
        load = self._effect("load_tool") or self._effect("tool_change")
        if state.tool is not None and load is not None:
            self._add(f"T{state.tool} {load}", "tool")
        wanted = state.selected if state.tool is None else state.tool
        if wanted is None:
            self._warnings.append("The lines before name no tool: the one that the program began with must be in it.")
        elif load is None or state.tool is None:
            self._steps.append(Step("", "operator", f"make sure that tool {wanted} is in the spindle"))
        if state.selected is not None and (load is None or state.selected != state.tool):
            self._add(f"T{state.selected}", "tool", "selected for the next change")
        return state.tool is not None and self._effect("load_tool") is None and load is not None

    def _over(self) -> None:
        words = [
            self._target(axis, value)
            for axis, value in self._entry.items()
            if axis != self._lift_axis and not isnan(value)
        ]
        if words:
            self._add(f"G0 {' '.join(words)}", "over", "over the place where the path goes on")

    def _spindle(self) -> None:
        state, way = self._state, self._way
        setting = {1: "spindle_cw", -1: "spindle_ccw", 0: "spindle_off"}[state.spindle or 0]
        name = self._required({1: "M3", -1: "M4", 0: "M5"}[state.spindle or 0], sets=setting)
        self._add(f"{name} S{number(state.speed)}", "spindle")
        plasma = self._past.said.get("plasma")
        if plasma is not None:
            self._add(plasma.name, "spindle", "the plasma")
        if not state.spindle:
            return
        if way.laser:
            if state.spindle == 1:
                self._warnings.append("M3 lights the beam before the machine moves: it may leave a mark. M4 does not.")
        elif way.spindle_wait_s > 0:
            dwell = self._effect("dwell")
            if dwell is not None:
                self._add(f"{dwell} P{number(way.spindle_wait_s)}", "wait", "until the spindle has its speed")
            else:
                self._steps.append(Step("", "operator", "wait until the spindle has its speed"))

    def _coolant(self) -> None:
        state = self._state
        self._add(self._sets("coolant_off") or "", "coolant")
        for on, setting in ((state.mist, "mist"), (state.flood, "flood")):
            if on:
                self._add(self._required("M7, M8", sets=setting), "coolant")

    def _down(self, travel: float | None) -> None:
        """To the depth where the path goes on: fast above the clearance, at feed below."""
        way, axis, entry = self._way, self._lift_axis, self._entry[self._lift_axis]
        if isnan(entry) or (travel is not None and abs(travel - entry) < _SAME_MM):
            return
        if way.laser:
            self._add(f"G0 {self._target(axis, entry)}", "focus", "in the dark: nothing is plunged into")
            return
        clear = max(way.clearance_mm, entry)
        if not way.clearance_is_machine and (travel is None or travel > clear + _SAME_MM):
            self._add(f"G0 {self._target(axis, clear)}", "approach", "down to the clearance")
        if abs(clear - entry) >= _SAME_MM or way.clearance_is_machine:
            feed = number(self._scaled(way.plunge_feed_mm_min))
            self._add(f"G1 {self._target(axis, entry)} F{feed}", "plunge", "to the depth where the path goes on")

    # --- what the rest expects ------------------------------------------------------------------------------------

    def _late_shift(self) -> None:
        state = self._state
        if not self._late or not any(state.shift):
            return
        words = [self._length(axis, self._entry[axis]) for row, axis in enumerate(state.axes) if state.shift[row]]
        name = self._required("G92", effect="set_position")
        self._add(f"{name} {' '.join(words)}", "offset", "the shift: this place has these coordinates")

    def _motion(self) -> None:
        """The feed before the mode: Grbl refuses a G1 as long as it has no feed (error:22)."""
        state = self._state
        plunged = any(step.purpose == "plunge" for step in self._steps)
        lasting = state.feed is not None and state.feed_mode == 94
        if lasting:
            self._add(self._feed(), "feed")
        if state.motion in ("rapid", "feed", "cancel"):
            needs_feed = state.motion == "feed" and not (lasting or plunged)
            feed = f" F{number(self._scaled(self._way.plunge_feed_mm_min))}" if needs_feed else ""
            self._add(f"{state.motion_name}{feed}", "motion")
            plunged |= needs_feed
        mode = {93: "inverse_time", 94: "per_minute", 95: "per_revolution"}[state.feed_mode]
        if state.feed_mode != 94:
            name = self._required(f"G{state.feed_mode}", effect=mode)
            self._add(f"{name} {self._feed()}".strip(), "feed")
        if state.feed is None and plunged:
            self._warnings.append("No line before sets a feed: that of the plunge holds until the rest says F.")
        if not state.absolute:
            self._add(self._required("G91", effect="relative"), "distance")

    def _feed(self) -> str:
        feed = self._state.feed
        return "" if feed is None else f"F{number(self._scaled(feed))}"

    def _warn(self) -> None:
        said = self._past.said
        if "data" in said:
            self._warnings.append(
                "The lines before change offsets or tools (G10): the controller must still have them."
            )
        if "io" in said:
            self._warnings.append("Outputs that the lines before have switched (M62-M68) are not switched again.")
        if self._state.mist and (code := self._find(sets="mist")) is not None and code.text:
            self._warnings.append(f"{code.name}: {code.text}.")
        for note in self._past.notes[:MAX_NOTES]:
            self._warnings.append(f"Line {note.line} is in doubt, and what is said here with it: {note.message}.")


__all__ = ["CannotResumeError", "Past", "Reentry", "Step", "Way", "past_of", "plan_reentry", "state_before"]
