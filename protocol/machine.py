"""MachineState and `reduce(state, event)`: the one reading of what a machine is doing, for every dialect.

Everything that people see of a machine comes from here. A state is never edited, it is replaced.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from protocol.events import (
    Alarm,
    BatchReceived,
    Event,
    LinkLost,
    LinkReady,
    MachineRestarted,
    StateReported,
    Status,
    ToolRequested,
)

OVERRIDE_NEUTRAL_PERCENT = 100


@dataclass(frozen=True, slots=True)
class MachineState:
    """The last known state of a machine. `position` in mm; `seq` rises with every change, `at` is its time."""

    status: Status = "offline"
    position: Mapping[str, float] = field(default_factory=dict)
    work_position: Mapping[str, float] = field(default_factory=dict)
    feed_mm_min: float | None = None
    spindle_rpm: float | None = None
    absolute: bool | None = None
    alarm: Alarm | None = None
    tool: int | None = None
    tool_requested: int | None = None
    inputs: Mapping[str, bool] = field(default_factory=dict)
    overrides: Mapping[str, int] = field(default_factory=dict)


def reduce(state: MachineState, event: Event) -> MachineState:
    """The state after `event`; the same object when the event says nothing about it."""
    match event:
        case StateReported():
            return _reported(state, event)
        case LinkReady() if state.status == "offline":
            return replace(state, status="idle")
        case LinkLost():
            return replace(state, status="offline")
        case MachineRestarted():
            # Position, tool and modes of a restarted machine are unknown until it reports them.
            return MachineState(status=state.status)
        case BatchReceived() if state.status == "idle":
            return replace(state, status="run")
        case ToolRequested(number=number):
            return replace(state, status="tool", tool_requested=number)
        case _:
            return state


def _reported(state: MachineState, report: StateReported) -> MachineState:
    position = {**state.position, **report.position}
    # A pending tool request outlives the idle reports that follow it; an alarm or a new run ends it.
    status: Status = report.status
    requested = state.tool_requested
    if requested is not None and status == "idle":
        status = "tool"
    elif status in ("run", "alarm"):
        requested = None
    return replace(
        state,
        status=status,
        position=position,
        work_position=position,
        feed_mm_min=state.feed_mm_min if report.feed_mm_min is None else report.feed_mm_min,
        spindle_rpm=state.spindle_rpm if report.spindle_rpm is None else report.spindle_rpm,
        absolute=state.absolute if report.absolute is None else report.absolute,
        alarm=report.alarm,
        tool_requested=requested,
    )


def tool_confirmed(state: MachineState) -> MachineState:
    """The operator has put in the requested tool."""
    if state.tool_requested is None:
        return state
    status: Status = "idle" if state.status == "tool" else state.status
    return replace(state, status=status, tool=state.tool_requested, tool_requested=None)
