"""What the words of a block mean together: targets in machine millimetres, and Grbl's errors in Grbl's order (II.8).

Nothing is done here and nothing of the parser's memory changes: a line with an error has no effect at all. The one
rule: the order of the checks is the firmware's, for it decides which of two errors is said.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from sim.grbl.errors import Refused
from sim.grbl.gcodewords import Block
from sim.grbl.modal import PLANES, Modal
from sim.grbl.nonvolatile import Nonvolatile
from sim.grbl.simsettings import AXES, ORIGIN, Point, SimSettings

INCH_MM: Final = 25.4
MAX_LINE_NUMBER: Final = 9_999_999
PROBES: Final = frozenset({"G38.2", "G38.3", "G38.4", "G38.5"})
ARCS: Final = frozenset({"G2", "G3"})
CYCLES: Final = frozenset({"G73", "G81", "G82", "G83"})
RADIUS_OFF_MM: Final = 0.005
"""Start and end radius of an arc may differ so much without any question."""


@dataclass(slots=True)
class Plan:
    """A block that may be executed: everything resolved."""

    block: Block
    motion: str
    units: str
    plane: str
    distance: str
    feed_mode: str
    system: str
    feed: float
    speed_rpm: float
    target: Point
    moves: bool = False
    """The motion group has axis words (or implied ones) to follow."""
    system_offset: Point = ORIGIN
    stored: tuple[str, Point] | None = None
    """G10: which coordinate system gets which value."""
    way_point: Point | None = None
    """G28, G30: where to pass; None with no axis words."""
    home: Point = ORIGIN
    offset: tuple[float, float] = (0.0, 0.0)
    """Centre of an arc from its start, in its plane."""
    radius: float = 0.0
    cycle: dict[str, float] = field(default_factory=dict[str, float])
    """grblHAL: what holds of a canned cycle from here on; R and Z as places."""
    jog: bool = False
    unused: set[str] = field(default_factory=set[str])


def check(block: Block, modal: Modal, memory: Nonvolatile, kind: SimSettings, *, jog: bool = False) -> Plan:
    """Raises Refused with the code that Grbl says first."""
    values = block.values
    if block.axes() and block.axis_user is None:
        block.axis_user = "motion"
    if values.get("N", 0) > MAX_LINE_NUMBER:
        raise Refused(27)
    plan = _begin(block, modal, jog=jog)
    _feed(plan, modal)
    plan.unused = set(values) - {"N", "F", "S", "T"}
    if jog:
        plan.unused = set(values) - {"N", "F"}
    _dwell(plan)
    _tool(plan)
    scale = INCH_MM if plan.units == "G20" else 1.0
    _length(plan, kind)
    _system(plan, modal, memory)
    _nonmodal(plan, modal, memory, scale, kind)
    _motion(plan, modal, scale, kind)
    if block.axis_user is not None:
        plan.unused -= set(AXES)
    if plan.unused:
        raise Refused(36)
    return plan


def _begin(block: Block, modal: Modal, *, jog: bool) -> Plan:
    feed_mode = "G94" if jog else block.code("feed mode") or modal.feed_mode
    motion = "G1" if jog else block.code("motion") or modal.motion
    return Plan(
        block,
        motion=motion,
        units=block.code("units") or modal.units,
        plane=block.code("plane") or modal.plane,
        distance=block.code("distance") or modal.distance,
        feed_mode=feed_mode,
        system=block.code("system") or modal.system,
        feed=0.0,
        speed_rpm=block.values.get("S", modal.speed_rpm),
        target=modal.position,
        system_offset=modal.system_offset,
        jog=jog,
    )


def _feed(plan: Plan, modal: Modal) -> None:
    """F of this block in mm/min. Under G93 it must stand in every block with a feed motion, in a jog always (II.7)."""
    given = plan.block.values.get("F")
    if plan.feed_mode == "G93":
        if given is None and plan.block.axis_user == "motion" and plan.motion not in ("G0", "G80"):
            raise Refused(22)
        plan.feed = given or 0.0
        return
    if plan.jog and given is None:
        raise Refused(22)
    if given is not None:
        plan.feed = given * (INCH_MM if plan.units == "G20" else 1.0)
    elif modal.feed_mode == "G94":
        plan.feed = modal.feed


def _dwell(plan: Plan) -> None:
    if plan.block.code("nonmodal") == "G4":
        if "P" not in plan.block.values:
            raise Refused(28)
        plan.unused.discard("P")


def _tool(plan: Plan) -> None:
    """grblHAL: M61 takes its tool from Q."""
    if plan.block.code("tool") == "M61":
        if "Q" not in plan.block.values:
            raise Refused(28)
        plan.unused.discard("Q")


def _length(plan: Plan, kind: SimSettings) -> None:
    code = plan.block.code("length")
    if code == "G43.1" and plan.block.axis_user == "length" and plan.block.axes() != ["Z"]:
        raise Refused(37)
    if code == "G43" and kind.hal:
        plan.unused.discard("H")


def _system(plan: Plan, modal: Modal, memory: Nonvolatile) -> None:
    if plan.system != modal.system:
        plan.system_offset = memory.coords[plan.system]


def _scaled(plan: Plan, scale: float) -> dict[int, float]:
    return {at: plan.block.values[axis] * scale for at, axis in enumerate(AXES) if axis in plan.block.values}


def _nonmodal(plan: Plan, modal: Modal, memory: Nonvolatile, scale: float, kind: SimSettings) -> None:
    code = plan.block.code("nonmodal")
    if code == "G10":
        _g10(plan, modal, memory, scale, kind)
        return
    words = _scaled(plan, scale)
    if code == "G92":
        if not words:
            raise Refused(26)
        base = [s + (modal.tool_length if at == 2 else 0.0) for at, s in enumerate(plan.system_offset)]
        plan.home = _point(
            modal.position[at] - base[at] - words[at] if at in words else modal.g92[at] for at in range(3)
        )
        return
    if plan.block.axis_user != "length":
        _target(plan, modal, words, machine=code == "G53")
    if code in ("G28", "G30"):
        plan.home = memory.coords[code]
        if words:
            plan.way_point = plan.target
            plan.home = _point(plan.home[at] if at in words else modal.position[at] for at in range(3))
    elif code == "G53" and plan.motion not in ("G0", "G1"):
        raise Refused(30)


def _target(plan: Plan, modal: Modal, words: dict[int, float], *, machine: bool) -> None:
    target = list(modal.position)
    offset = [s + g for s, g in zip(plan.system_offset, modal.g92, strict=True)]
    offset[2] += modal.tool_length
    for at, value in words.items():
        if machine:
            target[at] = value
        elif plan.distance == "G90":
            target[at] = value + offset[at]
        else:
            target[at] += value
    plan.target = _point(target)


def _g10(plan: Plan, modal: Modal, memory: Nonvolatile, scale: float, kind: SimSettings) -> None:
    values = plan.block.values
    if not plan.block.axes():
        raise Refused(26)
    # One of the two is enough for Grbl 1.1: without P it is the present system, without L it is L0, which nobody knows.
    missing = {"P", "L"} - values.keys()
    if len(missing) > (0 if kind.hal else 1):
        raise Refused(28)
    number, what = int(values.get("P", 0.0)), values.get("L", 0.0)
    if number > len(memory.systems):
        raise Refused(29)
    if what not in (2, 20) or (what == 2 and "R" in values):
        raise Refused(20)
    plan.unused -= {"L", "P"}
    name = memory.systems[number - 1] if number else plan.system
    stored = list(memory.coords[name])
    for at, value in _scaled(plan, scale).items():
        if what == 20:
            stored[at] = modal.position[at] - modal.g92[at] - (modal.tool_length if at == 2 else 0.0) - value
        else:
            stored[at] = value
    plan.stored = (name, _point(stored))


def _motion(plan: Plan, modal: Modal, scale: float, kind: SimSettings) -> None:
    axes = plan.block.axes()
    if plan.motion == "G80":
        if axes and plan.block.axis_user == "motion":
            raise Refused(31)
        return
    if plan.block.axis_user != "motion":
        return
    plan.moves = bool(axes)
    if plan.motion == "G0":
        return
    if plan.feed == 0.0:
        raise Refused(22)
    if plan.motion in ARCS:
        _arc(plan, modal, scale)
    elif plan.motion in PROBES:
        if not axes:
            raise Refused(26)
        if plan.target == modal.position:
            raise Refused(33)
    elif plan.motion in CYCLES and kind.hal:
        _cycle(plan, modal, scale)


def _cycle(plan: Plan, modal: Modal, scale: float) -> None:
    """grblHAL: R and Z are wanted by the first block of a cycle and stay; G73 and G83 want Q.

    Under G91 R counts from where Z stands in the block that says it, Z from R; further holes keep both places.
    """
    cycle = dict(modal.cycle) if modal.motion == plan.motion else {}
    values, at_z, offset_z = plan.block.values, modal.position[2], plan.system_offset[2] + modal.g92[2]
    if plan.plane != "G17":
        raise Refused(42)
    if not {"R", "Z"} <= cycle.keys() | values.keys():
        raise Refused(28)
    relative = plan.distance == "G91"
    if "R" in values:
        cycle["R"] = values["R"] * scale + (at_z if relative else offset_z + modal.tool_length)
    if "Z" in values:
        cycle["Z"] = cycle["R"] + values["Z"] * scale if relative else plan.target[2]
    if cycle["R"] < cycle["Z"]:
        raise Refused(54)
    for letter, cycles in (("Q", ("G73", "G83")), ("P", ("G82",))):
        if letter in values:
            cycle[letter] = values[letter] * (scale if letter == "Q" else 1.0)
        elif plan.motion in cycles and letter not in cycle:
            raise Refused(28)
    plan.cycle = cycle
    plan.unused -= {"R", "Q", "P", "L"}


def _arc(plan: Plan, modal: Modal, scale: float) -> None:
    values = plan.block.values
    first, second, _ = PLANES[plan.plane]
    if not plan.block.axes():
        raise Refused(26)
    if AXES[first] not in values and AXES[second] not in values:
        raise Refused(32)
    dx = plan.target[first] - modal.position[first]
    dy = plan.target[second] - modal.position[second]
    if "R" in values:
        plan.unused.discard("R")
        _arc_by_radius(plan, modal, dx, dy, values["R"] * scale)
        return
    letters = "IJK"[first], "IJK"[second]
    if letters[0] not in values and letters[1] not in values:
        raise Refused(35)
    plan.unused -= {"I", "J", "K"}
    i, j = (values.get(letter, 0.0) * scale for letter in letters)
    end = math.hypot(dx - i, dy - j)
    plan.offset, plan.radius = (i, j), math.hypot(i, j)
    apart = abs(end - plan.radius)
    if apart > RADIUS_OFF_MM and (apart > 0.5 or apart > 0.001 * plan.radius):
        raise Refused(33)


def _arc_by_radius(plan: Plan, modal: Modal, dx: float, dy: float, radius: float) -> None:
    """Centre from R: two circles go through both ends; a negative R asks for the longer way round."""
    if plan.target == modal.position:
        raise Refused(33)
    chord = math.hypot(dx, dy)
    square = radius * radius - chord * chord / 4
    if square < 0 or chord == 0:
        raise Refused(34)
    left = (plan.motion == "G3") == (radius > 0)
    height = math.sqrt(square) * (1.0 if left else -1.0)
    plan.offset = dx / 2 - dy / chord * height, dy / 2 + dx / chord * height
    plan.radius = abs(radius)


def _point(values: Iterable[float]) -> Point:
    x, y, z = values
    return x, y, z
