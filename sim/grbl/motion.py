"""Lines into the queue, waiting for it, dwelling: what the main loop does about motion (grbl II.3, II.4).

The one rule: every wait looks at the realtime flags, and gives up when a reset has come.
"""

from sim.grbl.arcs import chords
from sim.grbl.core import Core, Flag, State, Task, pause
from sim.grbl.events import Move, MoveKind
from sim.grbl.gcodecheck import Plan
from sim.grbl.modal import PLANES
from sim.grbl.service import realtime
from sim.grbl.simsettings import Point


def auto_start(core: Core) -> None:
    """Motion begins by itself when nothing more is to be read, or nothing more fits (II.4)."""
    if core.planner.blocks and core.resting:
        core.flag(Flag.CYCLE_START)


def synchronize(core: Core) -> Task[None]:
    """Until all motion is done."""
    auto_start(core)
    while True:
        yield from realtime(core)
        if core.abort or not (core.planner.blocks or core.state is State.RUN):
            return
        if not core.attention:
            yield None


def beyond_travel(core: Core, target: Point) -> bool:
    """Machine space is negative: -travel to 0 (II.10)."""
    travel = core.memory.axes(130)
    return any(place > 0 or place < -length for place, length in zip(target, travel, strict=True))


def line(
    core: Core,
    target: Point,
    kind: MoveKind,
    feed_mm_min: float,
    *,
    inverse_time: bool = False,
) -> Task[None]:
    """One straight line into the queue; waits for room."""
    if core.memory.on(20) and core.state is not State.JOG and beyond_travel(core, target):
        yield from _soft_limit(core)
        return
    if core.state is State.CHECK:
        return
    while True:
        yield from realtime(core)
        if core.abort:
            return
        if not core.planner.full:
            break
        auto_start(core)
        if not core.attention:
            yield None
    move = Move(kind, core.planner.position, target, feed_mm_min)
    block = core.planner.add(
        target,
        move,
        feed_mm_min=feed_mm_min,
        inverse_time=inverse_time,
        overridable=kind != "jog",
        line_number=core.modal.line_number,
    )
    if block is not None:
        if core.current is not None:
            core.current.moves.append(move)
        core.stepper.touch(core.now)


def _soft_limit(core: Core) -> Task[None]:
    """ALARM:2: a controlled stop, for the position is still good, then locked until a reset (II.3)."""
    core.soft_limit = True
    if core.state is State.RUN:
        core.flag(Flag.FEED_HOLD)
        while not core.is_in(State.IDLE):
            yield from realtime(core)
            if core.abort:
                return
            if not core.is_in(State.IDLE) and not core.attention:
                yield None
    core.reset()
    core.alarm = 2
    yield from realtime(core)


def arc(core: Core, plan: Plan) -> Task[None]:
    """Chord by chord, each a block of the queue."""
    start = core.modal.position
    ends = chords(
        start,
        plan.target,
        plan.offset,
        PLANES[plan.plane],
        clockwise=plan.motion == "G2",
        tolerance_mm=core.memory[12],
    )
    inverse = plan.feed_mode == "G93"
    feed = plan.feed * len(ends) if inverse else plan.feed
    for end in ends:
        yield from line(core, end, "arc", feed, inverse_time=inverse)
        if core.abort:
            return


def dwell(core: Core, seconds: float) -> Task[None]:
    """G4: after all motion; a hold in it stops the clock."""
    if core.state is State.CHECK:
        return
    yield from synchronize(core)
    left = 0.0 if core.kind.instant else seconds / core.kind.speed_factor
    while left > 1e-9:
        yield from realtime(core)
        if core.abort:
            return
        if not core.attention:
            began = core.now  # time spent held does not count
            yield began + left
            left -= core.now - began


def settle(core: Core, seconds: float) -> Task[None]:
    """The processor waits, as long as motion takes time at all."""
    if not core.kind.instant:
        yield from pause(core, seconds / core.kind.speed_factor)
