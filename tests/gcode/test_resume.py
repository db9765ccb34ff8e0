"""Taking a program up at a line: plan and rest cut what the program cuts from there on, or it is refused by name.

The judge is the interpreter: the program from its first line on one side, plan and rest from the modes that a
controller may be in on the other. Every step of a plan is left out once, and something must be wrong then.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isnan, nan
from pathlib import Path
from random import Random
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode.entry import AHEAD_BLOCKS
from gcode.interpreter import Interpreter, power_on
from gcode.past import Past, past_of
from gcode.profile import Profile, load_profile
from gcode.reentry import REASONS, Purpose
from gcode.resume import CannotResumeError, Reentry, Step, Way, plan_reentry
from gcode.segments import CUTS, DWELL, HOMING, RAPID, Segments
from gcode.state import State
from gcode.words import Block, parse_block

WAY = Way(20.0, 150.0, spindle_wait_s=3.0)
LASER = replace(WAY, laser=True)


# --- the judge ----------------------------------------------------------------------------------------------------


@dataclass
class Case:
    """A program, a line of it (from 1), and what was before."""

    lines: list[str]
    line: int
    profile: Profile
    past: Past
    way: Way = WAY

    @classmethod
    def of(
        cls, program: str | list[str], line: int, profile: str, start: State | None = None, way: Way = WAY
    ) -> "Case":
        lines = program.split("\n") if isinstance(program, str) else program
        known = load_profile(profile)
        state = power_on(known) if start is None else start.copy()
        text = "\n".join(lines).encode()
        return cls(lines, line, known, past_of([text], line, known, state=state, laser=way.laser), way)

    @property
    def rest(self) -> list[Block]:
        return [parse_block(line) for line in self.lines[self.line - 1 :]]

    def plan(self, position: dict[str, float] | None = None) -> Reentry:
        return plan_reentry(self.past, self.rest, self.profile, self.way, position=position)

    def original(self) -> Segments:
        """From this line on, behind all that the program has done."""
        interpreter = Interpreter(self.profile, self.past.state.copy(), laser=self.way.laser)
        return followed(interpreter, self.rest)


def followed(interpreter: Interpreter, blocks: list[Block]) -> Segments:
    for number, block in enumerate(blocks, 1):
        if block.words and not interpreter.state.ended:
            interpreter.step(number, block)
    interpreter.finish()
    return interpreter.take()


def after_reset(past: Past, profile: Profile, random: Random) -> State:
    """What a controller may remember: offsets and tables, but any modes, and it may stand anywhere."""
    kept = past.state.copy()
    axes = range(len(kept.axes))
    features, effects = profile.features, {code.effect for code in profile.codes.values()}
    planes = {"plane_xy": 17, "plane_zx": 18, "plane_yz": 19}
    has = {code.sets for code in profile.codes.values() if code.status == "exists"}
    modes = [94, *([93] if "inverse_time" in effects else []), *([95] if "per_revolution" in effects else [])]
    state = State(kept.axes, [random.choice((nan, random.uniform(-50, 50))) for _ in axes])
    state.systems, state.homes, state.tools, state.diameters = kept.systems, kept.homes, kept.tools, kept.diameters
    state.absolute = random.random() < 0.5
    state.arc_absolute = "arc_absolute" in effects and random.random() < 0.5
    state.inches = "inches" in effects and random.random() < 0.5
    state.plane = random.choice([plane for setting, plane in planes.items() if setting in has] or [17])
    state.feed_mode, state.feed = random.choice(modes), random.choice((None, 77.0))
    state.motion, state.motion_name = random.choice((("rapid", "G0"), ("feed", "G1"), ("arc_cw", "G2"), (None, None)))
    state.spindle, state.speed = random.choice((-1, 0, 1)), random.choice((0.0, 4321.0))
    state.mist, state.flood = "mist" in has and random.random() < 0.5, "flood" in has and random.random() < 0.5
    # A tool can be changed by a block only where the controller has one.
    state.tool = random.choice((None, 9)) if effects & {"load_tool", "tool_change"} else kept.tool
    state.selected = random.choice((None, 8))
    state.return_to_r = "return_to_r" in has and random.random() < 0.5
    state.diameter_mode = "diameter_on" in effects and random.random() < 0.5
    state.system = random.choice((1, 2)) if "coordinate_systems" in features else 1
    if "length_off" in effects:
        state.tool_offset = [random.choice((0.0, 3.5)) if axis == "Z" else 0.0 for axis in kept.axes]
    if "clear_shift" in effects:
        state.shift, state.shift_active = [random.choice((0.0, -2.5)) for _ in axes], random.random() < 0.5
    state.refresh_frame()
    return state


def faults(case: Case, plan: Reentry, steps: tuple[Step, ...], start: State) -> Iterator[str]:
    """What is wrong with these steps and the rest, from that state of the machine."""
    interpreter = Interpreter(case.profile, start, laser=case.way.laser)
    for step in steps:
        if step.text and step.purpose != "first":
            block = parse_block(step.text)
            assert not block.faults, step
            assert len(step.text) <= case.profile.max_block_bytes, step
            interpreter.step(0, block)
    ways = interpreter.take()
    yield from wrong_way(case, plan, ways, start)
    handed_over, before = interpreter.state, case.past.state
    modes = ("mist", "flood", "absolute", "inches", "plane", "feed_mode", "system", "return_to_r", "home_ignored")
    for name in ("selected", *modes):
        wanted = getattr(before, name)
        if wanted is not None and getattr(handed_over, name) != wanted:
            yield f"{name} is {getattr(handed_over, name)}, not {wanted}"
    text = "\n".join(step.text for step in steps if step.purpose != "first")
    said = past_of([text.encode()], 10**6, case.profile).said
    for group in ("path", "override", "spindle_mode"):
        if case.past.said.get(group) != said.get(group):
            yield f"{group}: {said.get(group)}"
    firsts = [parse_block(step.text) for step in steps if step.purpose == "first"]
    yield from differing(case, followed(interpreter, [*firsts, *case.rest[plan.takes_over :]]))


def differing(case: Case, found: Segments) -> Iterator[str]:
    """What the rest cuts otherwise. What nobody knew in the program may be anything."""
    left, right = seen(case, case.original()), seen(case, found)
    for name, wanted in left.items():
        if right[name].shape != wanted.shape:
            yield f"{right[name].shape[-1]} segments, not {wanted.shape[-1]}"
            return
        known = ~np.isnan(wanted)
        if not np.allclose(right[name][known], wanted[known], rtol=1e-6, atol=1e-5):
            yield f"{name} {right[name].tolist()}, not {wanted.tolist()}"


def seen(case: Case, segments: Segments) -> dict[str, np.ndarray]:
    """The columns that must be the same: of every cut and dwell, and of rapids but for the way to a series' level."""
    kind = segments.kind
    cuts = np.isin(kind, CUTS)
    chosen = cuts | (kind == DWELL)
    if "cycles" not in case.profile.features:
        chosen |= kind == RAPID
    columns: dict[str, np.ndarray] = {name: getattr(segments, name) for name in ("kind", "start", "end", "spindle")}
    columns["tool"] = np.where(segments.tool < 0, nan, segments.tool)
    columns["frame"] = np.array(segments.frames, float).reshape(-1, len(segments.axes))[segments.frame].T
    columns["dwell_s"] = segments.dwell_s
    for name in ("feed", "plane", "centre", "radius", "end_radius", "sweep"):
        columns[name] = np.where(cuts, getattr(segments, name).astype(float), 0.0)
    return {name: np.asarray(column, float)[..., chosen] for name, column in columns.items()}


def wrong_way(case: Case, plan: Reentry, ways: Segments, start: State) -> Iterator[str]:
    """The way to the path: up before aside, aside before down, down with the spindle turning."""
    state, way = case.past.state, case.way
    axis = (way.along or ("Z" if "Y" in state.axes else "X")).upper()
    row = state.axes.index(axis)
    place = plan.place.get(axis.lower(), nan)
    moving = [at for at in range(len(ways)) if ways.kind[at] != DWELL]
    frames = [np.array(ways.frames[number]) for number in ways.frame]
    lifted = way.clearance_is_machine or (way.laser and isnan(place))
    late = np.array(state.frame) - (frames[moving[-1]] if moving else np.array(state.frame))
    for at in moving:
        if ways.kind[at] == HOMING:  # a tool change of elvinto, which lifts to its own safe plane
            lifted = True
            continue
        begin, end = (ways.start[:, at] - frames[at] - late), (ways.end[:, at] - frames[at] - late)
        goes = (begin != end) & ~(np.isnan(begin) & np.isnan(end))
        aside = [n for n in np.flatnonzero(goes) if n != row]
        if aside and not lifted and not begin[row] >= way.clearance_mm - 1e-4:
            yield f"moves aside at {axis}{begin[row]}"
        if aside and way.clearance_is_machine and ways.start[row, at] < way.clearance_mm - 1e-4:
            yield f"moves aside at {axis}{ways.start[row, at]} of the machine"
        if aside and ways.kind[at] != RAPID:
            yield "cuts on the way"
        if ways.kind[at] != RAPID:
            if abs(ways.spindle[at] - state.speed * (state.spindle or 0)) > 1e-6:
                yield f"plunges with spindle {ways.spindle[at]}"
            if not begin[row] <= max(way.clearance_mm, place) + 1e-4 and not way.clearance_is_machine:
                yield "plunges from too high up"
            if ways.feed[at] > way.plunge_feed_mm_min * (1 + 1e-6) or isnan(ways.feed[at]):
                yield f"plunges at feed {ways.feed[at]}"
            if state.spindle and not any(ways.kind[:at] == DWELL) and "dwell" in effects_of(case.profile):
                yield "does not wait for the spindle"
        if way.laser and ways.spindle[at] != 0:
            yield "the beam is lit on the way"


def effects_of(profile: Profile) -> set[str]:
    return {code.effect for code in profile.codes.values() if code.status == "exists"}


def check(case: Case, random: Random) -> str:
    """All start states that a seed gives; the reason where it is refused."""
    try:
        plan = case.plan()
    except CannotResumeError as error:
        return error.reason
    for _ in range(2):
        wrong = list(faults(case, plan, plan.steps, after_reset(case.past, case.profile, random)))
        assert not wrong, (case.line, case.lines, " / ".join(plan.blocks), plan.takes_over, wrong)
    return ""


# --- random programs ----------------------------------------------------------------------------------------------

numbers = st.sampled_from(("0", "1", "-2.5", "7.125", "30", "12.0004"))
FULL = ("grblhal", "rs274ngc")
PROFILES = ("grbl-1.1", "grblhal", "rs274ngc", "ncframe-lathe", "elvinto")

ANY = (
    *("G0 X# Y#", "G0 Z#", "G1 X# Y# F300", "G1 X# F#5", "G1 Z#", "X# Y#", "X#", "Y# Z#", "F250", "G0", "G1", "G80"),
    *(
        "G2 X# Y# I3 J4",
        "G3 X# Y# R80",
        "X# Y# R90",
        "X# Y# I2 J1",
        "G90",
        "G91",
        "M3 S1000",
        "S750",
        "M4",
        "M5",
        "(-)",
    ),
)
MILL = (
    *("G17", "G18", "G19", "G20", "G21", "G54", "G55", "G92 X# Y#", "G92 Z#", "G92.1", "G43.1 Z#", "G49", "G93", "G94"),
    *(
        "G1 X# Y# F4",
        "G4 P0.5",
        "G53 G0 Z0",
        "G28 Z0",
        "G10 L2 P1 X# Y#",
        "G10 L20 P2 X#",
        "M8",
        "M9",
        "M7",
        "T2",
        "G61",
    ),
    *("G18 G2 X# Z# R60", "G38.2 Z-5 F50", "M30"),
)
RICH = (
    *(
        "G98",
        "G99",
        "G81 X# Y# Z-2 R1",
        "G83 X# Y# Z-3 R2 Q1",
        "X# Y#",
        "X#",
        "G82 X# Z-1 R1 P0.2",
        "G83 X# Y#",
        "T2 M6",
    ),
    *(
        "T3",
        "M6",
        "G95 F0.2",
        "A#",
        "G0 A# X#",
        "G43 H2",
        "G7",
        "G8",
        "M70",
        "M49",
        "M48",
        "G81 Y# Z-1 R#",
        "F90",
        "R3 X#",
    ),
)
ORACLE = (
    *(
        "G90.1",
        "G91.1",
        "G41 D1",
        "G42 D1",
        "G40",
        "G1 X# Y#",
        "G52 X# Y#",
        "G92.2",
        "G92.3",
        "G64 P0.02",
        "G96 S100 D900",
    ),
    *("G43.2 H2", "G2 I3", "I2 J2"),
)
LATHE = (
    *("G0 X# Z#", "G1 X# Z# F0.3", "X#", "Z#", "U#", "W#", "G2 X# Z# R80", "G3 X# Z# I2 K1", "X# Z# K3", "G90", "G91"),
    *(
        "G94 F100",
        "G95 F0.2",
        "G54",
        "G55",
        "G50 X# Z#",
        "T2 M6",
        "T3",
        "M3 S90",
        "M5",
        "S70",
        "M8",
        "M9",
        "G20",
        "G21",
    ),
)
ELVINTO = (*ANY, "M6 T2", "T3", "M7", "M8", "G81 X# Y# Z-2 R1", "G92 X# Y#", "G28", "W70", "W71", "G0 A#", "W93")
POOLS = {
    "grbl-1.1": (*ANY, *MILL),
    "grblhal": (*ANY, *MILL, *RICH),
    "rs274ngc": (*ANY, *MILL, *RICH, *ORACLE),
    "ncframe-lathe": LATHE,
    "elvinto": ELVINTO,
}


@st.composite
def programs(draw: st.DrawFn, profile: str) -> tuple[list[str], State]:
    """Lines, and the machine that they begin on."""
    lines = ["G90 F100", *(["G0 X1 Z9"] if profile == "ncframe-lathe" else ["G0 X1 Y2 Z9"])]
    if not draw(st.booleans()):
        lines = []
    for template in draw(st.lists(st.sampled_from(POOLS[profile]), min_size=2, max_size=14)):
        while "#" in template:
            template = template.replace("#", draw(numbers), 1)
        lines.append(template)
    state = power_on(load_profile(profile))
    if draw(st.booleans()):
        state.position = [5.0 * row for row in range(len(state.axes))]
    if draw(st.booleans()):
        state.systems = {number: [float(number)] * len(state.axes) for number in range(1, 10)}
        state.homes = {28: [1.0] * len(state.axes)}
    if draw(st.booleans()):
        state.tools = {2: [4.0 if axis == "Z" else 0.0 for axis in state.axes]}
    state.diameters = {1: 2.0}
    state.refresh_frame()
    return lines, state


@pytest.mark.parametrize("profile", PROFILES)
def test_plan_and_rest_cut_what_the_program_cuts(profile: str) -> None:
    reasons: set[str] = set()

    @settings(max_examples=15, deadline=None, derandomize=True, database=None)
    @given(programs(profile), st.integers(0, 2**32), st.booleans())
    def every_line(made: tuple[list[str], State], seed: int, laser: bool) -> None:
        lines, start = made
        for line in range(1, len(lines) + 1):
            case = Case.of(lines, line, profile, start, LASER if laser and profile == "grbl-1.1" else WAY)
            reasons.add(check(case, Random(seed)))

    every_line()
    # Some can be taken up, and what cannot is refused for more than one reason.
    assert {"", "position_unknown"} <= reasons <= {"", *REASONS}


# --- every step is needed -----------------------------------------------------------------------------------------

CUT = "G1 Z-1 F200\nG1 X10 F400\nX20 Y5\nG1 X5 Y9"
DETAILED = {
    "grbl": ("grbl-1.1", "G21 G90\nG55\nT3\nM3 S900\nM8\nG92.1\nG43.1 Z2\nG61\nG0 X0 Y0 Z5\n" + CUT, 12, WAY),
    "shifted": ("grbl-1.1", "G90\nG0 X1 Y2 Z9\nG92 X0 Z3\nM4 S50\nM7\n" + CUT + "\nG91\nX1", 10, WAY),
    "arc": ("grbl-1.1", "G20 G90 G18\nM3 S5\nG0 X1 Y1 Z1\nG2 X2 Z2 I1 K0 F9\nX3 Z3 I1 K0", 5, WAY),
    "inverse": ("grbl-1.1", "G90 M3 S5\nG0 X1 Y1 Z1\nG93\nG1 X2 F4\nX3 F4\nX4 F2", 5, WAY),
    "laser": ("grbl-1.1", "G90\nG0 X1 Y2 Z1\nM4 S100\n" + CUT, 6, LASER),
    "machine": ("grbl-1.1", "G90 M3 S5\nG0 X1 Y1 Z1\n" + CUT, 5, replace(WAY, clearance_is_machine=True)),
    "holes": ("grblhal", "G90 G99 F80 M3 S5 T2 M6\nM49\nT4\nG0 X0 Y0 Z5\nG83 X1 Y1 Z-3 R2 Q1\nX2\nG98 X3", 6, WAY),
    "lathe": ("ncframe-lathe", "G90 G95 F0.2 M3 S90\nG0 X30 Z5\nT1 M6\nG1 Z-5\nX31\nG91\nG1 X1", 7, WAY),
    "diameter": ("grblhal", "G7 G90 F100 M3 S5\nG0 X30 Y0 Z5\nG1 X28\nX20 Z3\nX10 Z1", 4, WAY),
    "rich": (
        "rs274ngc",
        "G90 G64 P0.02 G90.1 M3 S5\nG0 X1 Y1 Z1 A5\nG52 X3\nG96 S60 D900\nG1 X4 F60\nG3 X9 I6 J0",
        6,
        WAY,
    ),
    "suspended": ("rs274ngc", "G90 F9 M3 S5\nG0 X1 Y1 Z1\nG92 X9\nG92.2\nG1 X4\nG92.3\nG1 X5", 6, WAY),
    "circle": ("rs274ngc", "G90 F9 M3 S5\nG0 X1 Y1 Z1\nG1 X2\nG2 X4 I1 J0", 4, WAY),
    "elvinto": ("elvinto", "G90\nW93\nT2 M6\nM3 S500\nG0 X1 Y1 Z1\n" + CUT, 8, WAY),
}


def detailed(name: str) -> Case:
    profile, program, line, way = DETAILED[name]
    known = load_profile(profile)
    state = power_on(known)
    state.systems = {number: [float(number)] * len(state.axes) for number in range(1, 10)}
    state.refresh_frame()
    return Case.of(program, line, profile, state, way)


def test_no_step_is_decoration() -> None:
    """Each kind of step is there for a program that goes wrong without it, from a state that the machine may be in."""
    needed: dict[tuple[str, str], bool] = {}
    for name in DETAILED:
        case = detailed(name)
        plan = case.plan()
        starts = [after_reset(case.past, case.profile, Random(seed)) for seed in range(8)]
        for start in starts:
            assert not list(faults(case, plan, plan.steps, start.copy())), plan.blocks
        for at, step in enumerate(plan.steps):
            kind = (step.purpose, parse_block(step.text).words[0].code if step.text else "")
            if step.purpose != "operator" and not needed.get(kind):
                less = plan.steps[:at] + plan.steps[at + 1 :]
                needed[kind] = any(list(faults(case, plan, less, start.copy())) for start in starts)
    idle = [kind for kind, is_needed in needed.items() if not is_needed]
    assert not idle, idle
    assert len(needed) > 40


# --- what is refused, and what is said ----------------------------------------------------------------------------


def reason(program: str, line: int, profile: str = "rs274ngc", way: Way = WAY, start: State | None = None) -> str:
    with pytest.raises(CannotResumeError) as caught:
        Case.of(program, line, profile, start, way).plan()
    return caught.value.reason


PLACED = "G90 F100 M3 S5\nG0 X1 Y1 Z1 A0\n"


@pytest.mark.parametrize(
    ("wanted", "program", "line"),
    [
        ("compensation", PLACED + "G41.1 D2\nG1 X5\nG1 X9", 5),
        ("compensation", PLACED + "G41.1 D2\nG1 X5\nG1 X9\nG40\nG1 X20 Y9", 7),
        ("ended", "G90\nM30\nG0 X1", 3),
        ("position_unknown", "G91 F100\nG1 X5\nG1 X5", 2),
        ("position_unknown", "G90 F100\nG0 Z5\nG1 X5", 3),
        ("position_unknown", "G90 F100\nG0 X1 Y1 Z1\nG1 X5 A3", 3),
        ("shift_unknown", "G90\nG92 X0 Y0 Z0\nG1 X5 F100\nX9", 4),
        ("tool_unknown", PLACED + "M6\nG1 X5", 4),
        ("length_unknown", PLACED + "T1 M6\nG43\nG0 Z5\nG1 X5", 6),
        ("saved_modes", PLACED + "M70\nG1 X5", 4),
        ("motion_unknown", PLACED + "G5 X5 Y5 I1 J1 P1 Q1\nX9 Y9 P1 Q1", 4),
        ("motion_unknown", PLACED + "G2 X5 Y5 R9\n" + "F99\n" * (AHEAD_BLOCKS + 1) + "X9 Y9 R9", 4),
        ("cycle_moved", PLACED + "G81 X1 Y1 Z-1 R1\nG10 L2 P1 X3\nG28 Z0\nX5", 4),
    ],
)
def test_what_cannot_be_taken_up_says_why(wanted: str, program: str, line: int) -> None:
    assert reason(program, line) == wanted


def test_what_the_machine_cannot_say_is_refused() -> None:
    lost = power_on(load_profile("rs274ngc"))
    lost.absolute = None
    assert reason("G1 X1", 1, start=lost) == "distance_unknown"
    lost = power_on(load_profile("rs274ngc"))
    lost.spindle = None
    assert reason("G1 X1", 1, start=lost) == "spindle_unknown"
    assert reason("G90\nG51 X2\nG0 X1 Y1 Z1\nG1 X1 F5", 4, "grblhal") == "scaling"
    assert reason("G90\nG0 X1", 2, "elvinto", replace(WAY, clearance_is_machine=True)) == "no_code"
    assert reason("G90\nG0 X1", 2, way=replace(WAY, plunge_feed_mm_min=0.0)) == "bad_value"
    assert reason("G90\nG0 X1", 2, "ncframe-lathe", replace(WAY, along="y")) == "bad_value"


EXAMPLE = "G21 G90 G17\nT3\nM3 S12000\nG0 X0 Y0\nG0 Z5\nG1 Z-2 F300\nG2 X60 Y10 I0 J10 F800\nX70 Y20 I10 J0"


def test_the_example_of_the_document() -> None:
    plan = Case.of(EXAMPLE, 8, "grbl-1.1").plan()
    modes = ["G21", "G17", "G90", "G94", "G54", "G92.1", "G49"]
    way = ["G0 Z20", "T3", "G0 X60 Y10", "M3 S12000", "G4 P3", "M9", "G1 Z-2 F150", "F800", "G2X70Y20I10J0"]
    assert list(plan.blocks) == modes + way
    assert (plan.takes_over, plan.place) == (1, {"x": 60.0, "y": 10.0, "z": -2.0})
    assert [step.note for step in plan.steps if not step.text] == ["make sure that tool 3 is in the spindle"]


def test_a_machine_that_stands_high_up_does_not_lift_and_comes_down_by_g0_to_the_clearance_only() -> None:
    plan = Case.of(EXAMPLE, 8, "grbl-1.1").plan({"x": 0.0, "y": 0.0, "z": 60.0})
    purposes = [step.purpose for step in plan.steps]
    assert "lift" not in purposes
    down = [step.text for step in plan.steps if step.purpose in ("approach", "plunge")]
    assert down == ["G0 Z20", "G1 Z-2 F150"]


def test_a_plan_is_plain_data_for_a_dashboard() -> None:
    plan = Case.of(EXAMPLE, 8, "grbl-1.1").plan()
    shown = plan.to_json()
    assert shown["takes_over"] == 1
    assert shown["steps"][-1]["text"] == "G2X70Y20I10J0"
    assert any("Where the machine stands is not known" in warning for warning in shown["warnings"])


def test_the_beam_is_the_last_thing_that_is_said() -> None:
    plan = detailed("laser").plan()
    assert [step.purpose for step in plan.steps][-1] == "spindle"
    assert plan.blocks.index("M5") < plan.blocks.index("G0 Z20")


def test_the_document_names_every_reason_and_purpose() -> None:
    text = (Path(__file__).parents[2] / "docs" / "resume.md").read_text(encoding="utf-8")
    for name, meaning in REASONS.items():
        assert f"| `{name}` | {meaning} |" in text
    for purpose in get_args(Purpose):
        assert f"`{purpose}`" in text, purpose
