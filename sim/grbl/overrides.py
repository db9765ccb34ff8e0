"""Overrides and toggles by realtime bytes: feed, rapids, spindle, spindle stop, coolant (grbl II.2).

The one rule: an override that changes nothing is not reported either.
"""

from typing import Final

from sim.grbl.core import Core, State
from sim.grbl.realtime import Realtime

_FEED: Final = {
    Realtime.FEED_100: 0,
    Realtime.FEED_PLUS_10: 10,
    Realtime.FEED_MINUS_10: -10,
    Realtime.FEED_PLUS_1: 1,
    Realtime.FEED_MINUS_1: -1,
}
_SPINDLE: Final = {
    Realtime.SPINDLE_100: 0,
    Realtime.SPINDLE_PLUS_10: 10,
    Realtime.SPINDLE_MINUS_10: -10,
    Realtime.SPINDLE_PLUS_1: 1,
    Realtime.SPINDLE_MINUS_1: -1,
}
_RAPID: Final = {Realtime.RAPID_100: 100, Realtime.RAPID_50: 50, Realtime.RAPID_25: 25}
ALL: Final = frozenset({*_FEED, *_SPINDLE, *_RAPID, Realtime.SPINDLE_STOP, Realtime.FLOOD, Realtime.MIST})

LEAST_PERCENT: Final = 10
MOST_PERCENT: Final = 200


def apply(core: Core) -> None:
    """Everything that was asked for since the last look, in order."""
    asked, core.asked = core.asked, []
    feed, rapid, spindle = core.planner.feed_override, core.planner.rapid_override, core.spindle_override
    for wish in asked:
        if not isinstance(wish, Realtime):
            continue
        if wish in _FEED:
            feed = _step(feed, _FEED[wish])
        elif wish in _RAPID:
            rapid = _RAPID[wish]
        elif wish in _SPINDLE:
            spindle = _step(spindle, _SPINDLE[wish])
        elif wish is Realtime.SPINDLE_STOP:
            _spindle_stop(core)
        else:
            _coolant(core, wish)
    if core.stepper.running:
        core.stepper.touch(core.now)
    if core.planner.override(feed=feed, rapid=rapid):
        core.overrides_in = 0
        core.stepper.touch(core.now)
    if spindle != core.spindle_override:
        core.spindle_override = spindle
        if core.spindle != "M5":
            core.set_spindle(core.spindle, core.modal.speed_rpm)
        core.overrides_in = 0


def _step(percent: int, by: int) -> int:
    return min(max(percent + by, LEAST_PERCENT), MOST_PERCENT) if by else 100


def _spindle_stop(core: Core) -> None:
    """Only while held; the suspension does the rest."""
    if core.state is not State.HOLD:
        return
    if not core.spindle_stop:
        core.spindle_stop = "stop"
    elif core.spindle_stop == "stopped":
        core.spindle_stop = "restore"


def _coolant(core: Core, wish: Realtime) -> None:
    """Changes what $G says, too."""
    if core.state not in (State.IDLE, State.RUN, State.HOLD, State.JOG):
        return
    modal = core.modal
    if wish is Realtime.MIST:
        if not core.kind.mist:
            return
        modal.mist = not modal.mist
    else:
        modal.flood = not modal.flood
    core.set_coolant(flood=modal.flood, mist=modal.mist)
