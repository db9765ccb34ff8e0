"""The realtime part of the main loop: alarms, reports, holds, doors, resumes, overrides (grbl II.2 to II.5).

`realtime` is run wherever Grbl looks at its flags; while the machine is held it does not come back. The one rule: flags
are looked at together, so a hold wins over a cycle start that came with it.
"""

from typing import Final

from sim.grbl.core import NOT_SUSPENDED, Core, Flag, State, Suspend, Task, pause
from sim.grbl.overrides import apply as apply_overrides
from sim.grbl.reports import parser_state, status

_HOLDS: Final = Flag.MOTION_CANCEL | Flag.FEED_HOLD | Flag.DOOR | Flag.SLEEP
_CRITICAL: Final = (1, 2)


def realtime(core: Core) -> Task[None]:
    """One look at the flags; parked as long as the machine is held."""
    if core.attention:
        yield from service(core)
    if core.suspend:
        yield from _parked(core)


def service(core: Core) -> Task[None]:
    """Act on the flags once."""
    if core.alarm:
        yield from _alarm(core)
    flags = core.flags
    if flags & Flag.RESET:
        core.abort = True
        return
    _reports(core, flags)
    if flags & _HOLDS:
        _begin_hold(core, flags)
    if flags & Flag.TOOL_ACK:
        core.unflag(Flag.TOOL_ACK)
        if core.state is State.TOOL:
            core.suspend &= ~Suspend.TOOL
            core.begin_second_stream()
    if flags & Flag.CYCLE_START:
        core.unflag(Flag.CYCLE_START)
        if not flags & (Flag.FEED_HOLD | Flag.MOTION_CANCEL | Flag.DOOR):
            _cycle_start(core)
    if flags & Flag.CYCLE_STOP:
        core.unflag(Flag.CYCLE_STOP)
        _cycle_stop(core)
    if core.asked:
        apply_overrides(core)


def _alarm(core: Core) -> Task[None]:
    """ALARM:N, half a second of nothing, and after a limit nothing at all until a reset (II.3, II.4)."""
    num = core.alarm
    core.state = State.ALARM
    core.note_alarm(num)
    core.say(f"ALARM:{num}")
    yield from pause(core, core.kind.alarm_s)
    if num in _CRITICAL:
        core.message("Reset to continue")
        core.unflag(Flag.RESET)
        while not core.flags & Flag.RESET:
            yield None
    core.alarm = 0


def _reports(core: Core, flags: Flag) -> None:
    if flags & (Flag.STATUS | Flag.FULL_STATUS):
        core.unflag(Flag.STATUS | Flag.FULL_STATUS)
        core.say(status(core, full=bool(flags & Flag.FULL_STATUS)))
    if flags & Flag.PARSER_STATE:
        core.unflag(Flag.PARSER_STATE)
        core.say(parser_state(core))


def _begin_hold(core: Core, flags: Flag) -> None:
    core.unflag(_HOLDS)
    if core.state not in (State.ALARM, State.CHECK):
        if core.state in (State.RUN, State.JOG) and not core.suspend & (Suspend.MOTION_CANCEL | Suspend.JOG_CANCEL):
            core.stepper.hold(core.now)
            if core.state is State.JOG and not flags & Flag.SLEEP:
                core.suspend |= Suspend.JOG_CANCEL
        if core.state is State.IDLE:
            core.suspend = Suspend.HELD
        if flags & Flag.MOTION_CANCEL and core.state is not State.JOG:
            core.suspend |= Suspend.MOTION_CANCEL
        if flags & Flag.FEED_HOLD and core.state not in (State.DOOR, State.JOG, State.SLEEP, State.TOOL):
            core.state = State.HOLD
        if flags & Flag.DOOR:
            _door(core)
    if flags & Flag.SLEEP:
        if core.state is State.ALARM:
            core.suspend |= Suspend.RETRACTED | Suspend.HELD
        core.state = State.SLEEP


def _door(core: Core) -> None:
    core.message("Check Door")
    if not core.suspend & Suspend.JOG_CANCEL:
        if core.state is State.DOOR and core.suspend & Suspend.RESTORING:
            core.suspend &= ~(Suspend.RETRACTED | Suspend.RESTORING | Suspend.RESTORED)
        if core.state is not State.SLEEP:
            core.state = State.DOOR
    core.suspend |= Suspend.DOOR_AJAR


def _cycle_start(core: Core) -> None:
    if core.state is State.TOOL and not core.planner.blocks:
        core.end_second_stream()
        core.state = State.IDLE
        core.suspend = NOT_SUSPENDED
        core.modal.tool_in_spindle = core.modal.tool
        return
    if core.state is State.DOOR and not core.suspend & Suspend.DOOR_AJAR:
        if core.suspend & Suspend.RESTORED:
            core.state = State.IDLE
        elif core.suspend & Suspend.RETRACTED:
            core.suspend |= Suspend.RESTORING
    held = core.state is State.HOLD and core.suspend & Suspend.HELD
    if not core.resting and not held:
        return
    if core.state is State.HOLD and core.spindle_stop:
        core.spindle_stop = "resume"
        return
    moves = core.planner.blocks and not core.suspend & Suspend.MOTION_CANCEL
    core.suspend = NOT_SUSPENDED
    core.state = State.RUN if moves else core.resting_state
    if moves:
        core.stepper.start(core.now)


def _cycle_stop(core: Core) -> None:
    stays = core.state in (State.HOLD, State.DOOR, State.SLEEP)
    if stays and not core.soft_limit and not core.suspend & Suspend.JOG_CANCEL:
        core.suspend |= Suspend.HELD
        core.stepper.touch(core.now)
        return
    if core.suspend & Suspend.JOG_CANCEL:
        core.forget_motion()
    if core.suspend & Suspend.DOOR_AJAR:
        core.suspend = (core.suspend & ~Suspend.JOG_CANCEL) | Suspend.HELD
        core.state = State.DOOR
    else:
        core.suspend = NOT_SUSPENDED
        core.state = core.resting_state


def _parked(core: Core) -> Task[None]:
    """The main loop goes no further; only realtime bytes act (II.4)."""
    while core.suspend:
        if core.abort:
            return
        if core.suspend & Suspend.HELD:
            if core.state in (State.DOOR, State.SLEEP):
                yield from _powered_down(core)
            elif core.spindle_stop:
                yield from _spindle_stop(core)
        if core.attention:
            yield from service(core)
        elif core.suspend:
            yield None


def _powered_down(core: Core) -> Task[None]:
    """Door and sleep: outputs off; a closed door may be resumed, from sleep only a reset leads away."""
    if not core.suspend & Suspend.RETRACTED:
        core.spindle_stop = ""
        core.stop_outputs()
        core.suspend |= Suspend.RETRACTED
    if core.state is State.SLEEP:
        core.message("Sleeping")
        core.stop_outputs()
        while not core.abort:
            if core.attention:
                yield from service(core)
            else:
                yield None
        return
    if not core.door_open:
        core.suspend &= ~Suspend.DOOR_AJAR
    if core.suspend & Suspend.RESTORING and not core.suspend & Suspend.RESTORED:
        yield from _restore(core)


def _restore(core: Core) -> Task[None]:
    """Door:3: spindle and coolant come back before motion does."""
    modal = core.modal
    if modal.spindle != "M5":
        core.set_spindle(modal.spindle, modal.speed_rpm)
        if not core.memory.on(32):
            yield from _watchful(core, core.kind.spindle_delay_s)
    if (modal.flood or modal.mist) and core.suspend & Suspend.RESTORING:
        core.set_coolant(flood=modal.flood, mist=modal.mist)
        yield from _watchful(core, core.kind.coolant_delay_s)
    if core.suspend & Suspend.RESTORING and not core.abort:
        core.suspend |= Suspend.RESTORED
        core.flag(Flag.CYCLE_START)


def _watchful(core: Core, seconds: float) -> Task[None]:
    """A delay within a suspension: realtime bytes act; a door that opens again ends it."""
    until = core.now + seconds
    while core.now < until and core.suspend & (Suspend.RESTORING | Suspend.HELD) and not core.abort:
        if core.attention:
            yield from service(core)
        else:
            yield until
        if core.state is State.DOOR and not core.suspend & Suspend.RESTORING:
            return


def _spindle_stop(core: Core) -> Task[None]:
    """0x9E in Hold:0: off, and on again by a second one or by the resume, which waits for the spindle on a grblHAL and
    does not on Grbl 1.1 (seen on the firmware)."""
    modal = core.modal
    if core.spindle_stop == "stop":
        core.spindle_stop = "stopped" if modal.spindle != "M5" else ""
        core.set_spindle("M5", 0.0)
    elif core.spindle_stop in ("restore", "resume"):
        if modal.spindle != "M5":
            core.message("Restoring spindle")
            core.set_spindle(modal.spindle, modal.speed_rpm)
        resumes = core.spindle_stop == "resume"
        if resumes:
            if core.kind.hal:
                yield from _watchful(core, core.kind.spindle_delay_s)
            core.flag(Flag.CYCLE_START)
        core.spindle_stop = ""
