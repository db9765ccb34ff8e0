"""Drilling cycles of grblHAL, G73 and G81 to G83, in the plane G17 (grbl, "G-code extra").

Not LinuxCNC's: a peck of G83 goes back to where the cycle goes back to, and is fed from there. The one rule: a cycle is
nothing but lines and dwells in the queue, L of them in a row: at the same place, or each further on under G91.
"""

from typing import Final

from sim.grbl.core import Core, Task
from sim.grbl.gcodecheck import Plan
from sim.grbl.motion import dwell, line
from sim.grbl.simsettings import Point

BACK_OFF_MM: Final = 0.1
"""So far G73 backs off; grblHAL keeps it in $28."""
PECK_DWELL_S: Final = 0.25
"""At the bottom of each peck, to break the chip."""


def canned_cycle(core: Core, plan: Plan) -> Task[None]:
    modal = core.modal
    cycle = modal.cycle = plan.cycle
    top_z = cycle["R"]
    x, y = plan.target[0], plan.target[1]
    dx, dy = (x - modal.position[0], y - modal.position[1]) if plan.distance == "G91" else (0.0, 0.0)
    place = modal.position
    if place[2] < top_z:
        place = (place[0], place[1], top_z)
        yield from line(core, place, "rapid", 0.0)
    back_z = place[2] if modal.retract == "G98" else top_z
    for nth in range(int(plan.block.values.get("L", 1))):
        place = (x + dx * nth, y + dy * nth, place[2])
        yield from line(core, place, "rapid", 0.0)
        if place[2] > top_z:
            yield from line(core, (place[0], place[1], top_z), "rapid", 0.0)
        yield from _drill(core, plan, (place[0], place[1], top_z), back_z)
        place = (place[0], place[1], back_z)
        if core.abort:
            return
    modal.position = place


def _drill(core: Core, plan: Plan, top: Point, back_z: float) -> Task[None]:
    x, y, z = top
    cycle = plan.cycle
    bottom_z, pecks = cycle["Z"], plan.motion in ("G73", "G83")
    peck_mm = cycle["Q"] if pecks else z - bottom_z
    dwell_s = PECK_DWELL_S if pecks else cycle["P"] if plan.motion == "G82" else 0.0
    while z > bottom_z:
        z = max(bottom_z, z - peck_mm) if peck_mm > 0 else bottom_z
        yield from line(core, (x, y, z), "feed", plan.feed)
        if dwell_s and not core.abort:
            yield from dwell(core, dwell_s)
        if core.abort:
            return
        up_z = z + BACK_OFF_MM if plan.motion == "G73" and z > bottom_z else back_z
        yield from line(core, (x, y, up_z), "rapid", 0.0)
