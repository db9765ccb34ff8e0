"""G38.2 to G38.5 (grbl II.3): toward contact or away from it, with an alarm when it fails or without.

The one rule: what is reported is where contact was made; where motion ends is a little further.
"""

from sim.grbl.core import Core, Flag, State, Task
from sim.grbl.gcodecheck import Plan
from sim.grbl.motion import line, synchronize
from sim.grbl.planner import PlanBlock
from sim.grbl.reports import probe as probe_report
from sim.grbl.reports import probe_closed
from sim.grbl.service import realtime
from sim.grbl.stepper import Contact


def probe(core: Core, plan: Plan) -> Task[None]:
    """One probing cycle; the parser goes on from where the machine stands afterwards."""
    if core.is_in(State.CHECK):
        core.modal.position = plan.target
        return
    yield from synchronize(core)
    if core.aborted():
        return
    core.probe_found = False
    core.probe_away = plan.motion in ("G38.4", "G38.5")
    if probe_closed(core) != core.probe_away:
        core.alarm = 4
        yield from realtime(core)
        return
    yield from line(core, plan.target, "probe", plan.feed, inverse_time=plan.feed_mode == "G93")
    if core.aborted():
        return
    core.probing = True
    core.flag(Flag.CYCLE_START)
    while True:
        yield from realtime(core)
        if core.aborted():
            return
        if core.resting:
            break
        if not core.attention:
            yield None
    core.probing = False
    if not core.probe_found:
        if plan.motion in ("G38.3", "G38.5"):
            core.probe_position = core.position()
        else:
            core.alarm = 5
    yield from realtime(core)
    core.forget_motion()
    core.say(probe_report(core))


def touched(core: Core) -> None:
    """The probe input has changed, or the tool has come to the plate: note the place and slow down."""
    if core.probing and not core.probe_found and probe_closed(core) != core.probe_away:
        core.probe_found = True
        core.probe_position = core.position()
        core.flag(Flag.MOTION_CANCEL)


def contact(core: Core, block: PlanBlock) -> list[Contact]:
    """Where on its way the block meets the plate, or leaves it."""
    plate_z = core.kind.probe_z
    if not core.probing or core.probe_found or plate_z is None:
        return []
    start_z = block.start[2] + core.true_shift[2]
    down = block.unit[2] < 0
    if block.unit[2] == 0 or down == core.probe_away:
        return []
    done_mm = (plate_z - start_z) / block.unit[2]
    # A hair beyond the plate: at its very height the probe does not leave it yet.
    return [Contact("probe", done_mm + 1e-6)] if 0 <= done_mm <= block.length_mm else []
