"""Drilling cycles of grblHAL, G73 and G81 to G83, in the plane G17 (grbl, "G-code extra").

The one rule: a cycle is nothing but lines and dwells in the queue, with L of them in a row when distances are relative.
"""

from typing import Final

from sim.grbl.core import Core, Task
from sim.grbl.gcodecheck import Plan
from sim.grbl.motion import dwell, line
from sim.grbl.simsettings import Point

CLEARANCE_MM: Final = 0.25
"""G73 backs off so far; G83 stops so far above the last depth."""


def canned_cycle(core: Core, plan: Plan) -> Task[None]:
    modal, values = core.modal, plan.block.values
    scale = 25.4 if plan.units == "G20" else 1.0
    cycle = modal.cycle if modal.motion == plan.motion else {}
    for letter in "RZQ":
        if letter in values:
            cycle[letter] = values[letter] * scale
    if "P" in values:
        cycle["P"] = values["P"]
    modal.cycle = cycle
    x, y, start_z = plan.target[0], plan.target[1], modal.position[2]
    offset_z = modal.offset[2]
    if plan.distance == "G91":
        clear_z = start_z + cycle["R"]
        depth_z = clear_z + cycle["Z"]
    else:
        clear_z, depth_z = cycle["R"] + offset_z, cycle["Z"] + offset_z
    dx, dy = x - modal.position[0], y - modal.position[1]
    back_z = max(start_z, clear_z) if modal.retract == "G98" else clear_z
    place = modal.position
    for nth in range(int(values.get("L", 1)) if plan.distance == "G91" else 1):
        if place[2] < clear_z:
            place = (place[0], place[1], clear_z)
            yield from line(core, place, "rapid", 0.0)
        place = (x + dx * nth, y + dy * nth, place[2])
        yield from line(core, place, "rapid", 0.0)
        yield from line(core, (place[0], place[1], clear_z), "rapid", 0.0)
        yield from _drill(core, plan, (place[0], place[1], clear_z), depth_z, cycle)
        place = (place[0], place[1], back_z)
        yield from line(core, place, "rapid", 0.0)
        if core.abort:
            return
    modal.position = place


def _drill(core: Core, plan: Plan, top: Point, depth_z: float, cycle: dict[str, float]) -> Task[None]:
    x, y, z = top
    peck_mm = cycle["Q"] if plan.motion in ("G73", "G83") else top[2] - depth_z
    while z > depth_z and not core.abort:
        z = max(depth_z, z - peck_mm) if peck_mm > 0 else depth_z
        yield from line(core, (x, y, z), "feed", plan.feed)
        if z <= depth_z:
            break
        up_z = top[2] if plan.motion == "G83" else min(top[2], z + CLEARANCE_MM)
        yield from line(core, (x, y, up_z), "rapid", 0.0)
        if plan.motion == "G83":
            yield from line(core, (x, y, min(up_z, z + CLEARANCE_MM)), "rapid", 0.0)
    if plan.motion == "G82" and not core.abort:
        yield from dwell(core, cycle["P"])
