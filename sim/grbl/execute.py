"""A checked block is executed, in Grbl's order (grbl II.3, II.10). Nothing can be refused here any more, but jogs.

The one rule: whatever changes the spindle, coolant or offsets waits for all motion that was planned before it.
"""

from sim.grbl.canned import canned_cycle
from sim.grbl.core import Core, Flag, State, Suspend, Task, eeprom
from sim.grbl.errors import Refused
from sim.grbl.gcodecheck import ARCS, CYCLES, PROBES, Plan, check
from sim.grbl.gcodewords import read_block
from sim.grbl.motion import arc, beyond_travel, dwell, line, synchronize
from sim.grbl.probing import probe
from sim.grbl.service import realtime
from sim.grbl.simsettings import ORIGIN


def gcode(core: Core, text: str) -> Task[None]:
    """A line of G-code. Raises Refused with nothing done."""
    plan = check(read_block(text, core.kind), core.modal, core.memory, core.kind)
    yield from _modes(core, plan)
    if not core.abort:
        yield from _offsets(core, plan)
    if not core.abort:
        yield from _nonmodal(core, plan)
    if not core.abort:
        yield from _motion(core, plan)
    if not core.abort:
        yield from _flow(core, plan)


def jog(core: Core, text: str) -> Task[None]:
    """What stands after `$J=`; the modes of the program are not touched (II.7). Raises Refused."""
    block = read_block(text, core.kind)
    plan = check(block, core.modal, core.memory, core.kind, jog=True)
    if set(block.codes) - {"units", "distance", "nonmodal"} or block.code("nonmodal") not in ("", "G53"):
        raise Refused(16)
    if not plan.moves:
        # Grbl 1.1 asks for no axis here, and its target has then never been worked out: it goes to machine zero.
        if core.kind.hal:
            raise Refused(26)
        plan.target = ORIGIN
    if core.memory.on(20) and beyond_travel(core, plan.target):
        raise Refused(15)
    yield from line(core, plan.target, "jog", plan.feed)
    if core.abort:
        return
    if core.resting and core.planner.blocks:
        core.state = State.JOG
        core.stepper.start(core.now)
    core.modal.position = plan.target


def _modes(core: Core, plan: Plan) -> Task[None]:
    modal, block, values = core.modal, plan.block, plan.block.values
    modal.line_number = int(values.get("N", 0))
    modal.feed_mode = plan.feed_mode
    modal.feed = plan.feed
    spindle = block.code("spindle") or modal.spindle
    if plan.speed_rpm != modal.speed_rpm:
        if modal.spindle != "M5" and not core.memory.on(32):
            yield from _spindle(core, modal.spindle, plan.speed_rpm)
        modal.speed_rpm = plan.speed_rpm
    # Grbl 1.1 forgets T with the next block that does not say it (seen on the firmware).
    modal.tool = int(values.get("T", modal.tool if core.kind.hal else 0))
    if core.abort:
        return
    if spindle != modal.spindle:
        yield from _spindle(core, spindle, modal.speed_rpm)
        modal.spindle = spindle
    if block.code("tool") and not core.abort:
        yield from _tool(core, plan)
    if (code := block.code("coolant")) and not core.abort:
        flood = code == "M8" or (modal.flood and code != "M9")
        mist = code == "M7" or (modal.mist and code != "M9")
        if (flood, mist) != (modal.flood, modal.mist):
            yield from _coolant(core, flood=flood, mist=mist)
            modal.flood, modal.mist = flood, mist
    if block.code("nonmodal") == "G4" and not core.abort:
        yield from dwell(core, values["P"])


def _spindle(core: Core, code: str, rpm: float) -> Task[None]:
    if core.state is State.CHECK:
        return
    yield from synchronize(core)
    if not core.abort:
        core.set_spindle(code, rpm)


def _coolant(core: Core, *, flood: bool, mist: bool) -> Task[None]:
    if core.state is State.CHECK:
        return
    yield from synchronize(core)
    if not core.abort:
        core.set_coolant(flood=flood, mist=mist)


def _tool(core: Core, plan: Plan) -> Task[None]:
    """grblHAL: M6 is answered at once, then the machine waits in `Tool`; M61 just says which tool is in."""
    modal = core.modal
    if plan.block.code("tool") == "M61":
        modal.tool_in_spindle = modal.tool = int(plan.block.values.get("Q", 0))
        return
    if core.state is State.CHECK or not core.kind.tool_change or core.memory[341] == 4:
        return
    yield from synchronize(core)
    if core.abort:
        return
    core.set_spindle("M5", 0.0)
    core.set_coolant(flood=False, mist=False)
    modal.spindle, modal.flood, modal.mist = "M5", False, False
    core.state = State.TOOL
    core.suspend = Suspend.TOOL
    core.overrides_in = 0


def _offsets(core: Core, plan: Plan) -> Task[None]:
    modal, block = core.modal, plan.block
    modal.plane, modal.units = plan.plane, plan.units
    modal.retract = block.code("retract") or modal.retract
    if code := block.code("length"):
        modal.length = "G49" if code == "G49" else "G43" if code == "G43" else "G43.1"
        scale = 25.4 if plan.units == "G20" else 1.0
        length = block.values.get("Z", 0.0) * scale if code == "G43.1" else 0.0
        if length != modal.tool_length:
            modal.tool_length = length
            yield from _wco_changed(core)
    if plan.system != modal.system:
        modal.system, modal.system_offset = plan.system, plan.system_offset
        yield from _wco_changed(core)
    modal.distance = plan.distance


def _wco_changed(core: Core) -> Task[None]:
    """The queue runs dry so that reports of work positions are right (II.3)."""
    yield from synchronize(core)
    core.wco_in = 0


def _nonmodal(core: Core, plan: Plan) -> Task[None]:
    modal, code = core.modal, plan.block.code("nonmodal")
    match code:
        case "G10":
            assert plan.stored is not None
            name, value = plan.stored
            yield from eeprom(core, core.memory.store_coord(name, value))
            if name == modal.system:
                modal.system_offset = value
                yield from _wco_changed(core)
        case "G28" | "G30":
            if plan.way_point is not None:
                yield from line(core, plan.way_point, "rapid", 0.0)
            if not core.abort:
                yield from line(core, plan.home, "rapid", 0.0)
            modal.position = plan.home
        case "G28.1" | "G30.1":
            yield from synchronize(core)
            yield from eeprom(core, core.memory.store_coord(code[:3], modal.position))
        case "G92":
            modal.g92 = plan.home
            yield from _wco_changed(core)
        case "G92.1":
            modal.g92 = ORIGIN
            yield from _wco_changed(core)


def _motion(core: Core, plan: Plan) -> Task[None]:
    modal = core.modal
    if plan.motion in CYCLES and plan.block.axis_user == "motion":
        yield from canned_cycle(core, plan)
        modal.motion = plan.motion
        return
    if plan.motion != modal.motion:
        modal.motion = plan.motion
        modal.cycle.clear()
    if not plan.moves or plan.motion == "G80":
        return
    if plan.motion == "G0":
        yield from line(core, plan.target, "rapid", 0.0)
    elif plan.motion == "G1":
        yield from line(core, plan.target, "feed", plan.feed, inverse_time=plan.feed_mode == "G93")
    elif plan.motion in ARCS:
        yield from arc(core, plan)
    elif plan.motion in PROBES:
        yield from probe(core, plan)
        return  # the probe knows where it ended
    if not core.abort:
        modal.position = plan.target


def _flow(core: Core, plan: Plan) -> Task[None]:
    modal, code = core.modal, plan.block.code("flow")
    if code in ("", "M1"):
        return  # there is no optional stop
    modal.flow = code
    yield from synchronize(core)
    if core.abort:
        return
    if code == "M0":
        if core.state is not State.CHECK:
            core.flag(Flag.FEED_HOLD)
            yield from realtime(core)
    else:
        _program_end(core)
    modal.flow = ""


def _program_end(core: Core) -> None:
    """M2, M30: most modes go back, the position and F stay; spindle and coolant off; overrides back (II.3)."""
    modal = core.modal
    modal.motion, modal.plane, modal.distance, modal.feed_mode = "G1", "G17", "G90", "G94"
    modal.system, modal.spindle = "G54", "M5"
    modal.flood = modal.mist = False
    core.planner.override(feed=100, rapid=100)
    core.spindle_override = 100
    if core.state is not State.CHECK:
        modal.system_offset = core.memory.coords["G54"]
        core.wco_in = 0
        core.stop_outputs()
    core.message("Pgm End")
    core.file = None
