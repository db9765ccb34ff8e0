"""MachineState and `reduce(state, event)`: the one reading of what a machine is doing, for every dialect.

Everything that people see of a machine comes from here. A state is never edited, it is replaced.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple, assert_never

from protocol.events import (
    AccessoriesChanged,
    Alarm,
    Announced,
    BatchDone,
    BatchFailed,
    BatchReceived,
    BatchSent,
    CommandDone,
    CommandFailed,
    ControllerReset,
    DescriptionsRead,
    Detail,
    Event,
    FateInDoubt,
    FateSettled,
    FateUnknown,
    FilesListed,
    FirmwareRead,
    Homed,
    LineRefused,
    LinkLost,
    LinkReady,
    MachineRestarted,
    MessageSeen,
    MessagesSeen,
    ModalRead,
    OffsetsRead,
    OverridesChanged,
    PendantChanged,
    PinsChanged,
    ProbeReported,
    ProgramEnded,
    ProtocolFault,
    SettingsRead,
    StartupBlockRun,
    StartupBlocksRead,
    StateReported,
    Status,
    ToolRequested,
)

OVERRIDE_NEUTRAL_PERCENT = 100
NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})


class MachineState(NamedTuple):  # a frozen dataclass of so many fields takes ten times as long to make
    """The last known state of a machine. `position` in mm; `seq` rises with every change, `at` is its time."""

    status: Status = "offline"
    position: Mapping[str, float] = NOTHING
    work_position: Mapping[str, float] = NOTHING
    feed_mm_min: float | None = None
    spindle_rpm: float | None = None
    absolute: bool | None = None
    alarm: Alarm | None = None
    tool: int | None = None
    tool_requested: int | None = None
    inputs: Mapping[str, bool] = NOTHING
    overrides: Mapping[str, int] = NOTHING
    work_offset: Mapping[str, float] = NOTHING
    accessories: frozenset[str] = frozenset()
    pendant: bool = False
    homed: bool | None = None
    modal: tuple[str, ...] = ()
    substate: int | None = None

    @property
    def emergency(self) -> bool:
        """The machine's own emergency stop is pressed."""
        return self.alarm is not None and self.alarm.emergency


def reduce(state: MachineState, event: Event) -> MachineState:
    """The state after `event`; the same object when the event says nothing about it."""
    match event:
        case StateReported():
            return _reported(state, event)
        case LinkReady():
            return state._replace(status="idle") if state.status == "offline" else state
        case LinkLost():
            # Who has homed it, or has not, while nobody listened is not known.
            return state._replace(status="offline", homed=None)
        case MachineRestarted():
            # Position, tool and modes of a restarted machine are unknown until it reports them.
            return MachineState(status=state.status)
        case ControllerReset(position_kept=kept):
            return _reset(state, kept=kept)
        case BatchReceived(begins=True):
            return state._replace(status="run") if state.status == "idle" else state
        case ToolRequested(number=number):
            return state._replace(status="tool", tool_requested=number)
        case _:
            return _told(state, event)


def _told(state: MachineState, event: Detail) -> MachineState:
    """What a machine says of itself besides its position."""
    match event:
        case PinsChanged(active=active):
            return state._replace(inputs={**dict.fromkeys(state.inputs, False), **dict.fromkeys(active, True)})
        case OverridesChanged(feed=feed, rapid=rapid, spindle=spindle):
            return state._replace(overrides={"feed": feed, "rapid": rapid, "spindle": spindle})
        case AccessoriesChanged(active=active):
            return state._replace(accessories=active)
        case PendantChanged(active=active):
            return state._replace(pendant=active)
        case Homed(axes=axes):
            # One axis alone makes no homed machine of one that was not.
            return state if axes else state._replace(homed=True)
        case ModalRead(words=words):
            return state._replace(modal=words, absolute=_absolute(words, state.absolute))
        case (
            ProtocolFault()
            | MessageSeen()
            | MessagesSeen()
            | ProbeReported()
            | Announced()
            | StartupBlockRun()
            | FirmwareRead()
            | OffsetsRead()
            | SettingsRead()
            | DescriptionsRead()
            | StartupBlocksRead()
            | ProgramEnded()
            | FilesListed()
            | BatchSent()
            | BatchReceived()
            | BatchDone()
            | BatchFailed()
            | LineRefused()
            | FateUnknown()
            | FateSettled()
            | FateInDoubt()
            | CommandDone()
            | CommandFailed()
        ):
            return state
        case _:
            assert_never(event)


def _absolute(words: Iterable[str], before: bool | None) -> bool | None:
    return {"G90": True, "G91": False}.get(next((word for word in words if word in ("G90", "G91")), ""), before)


def _reset(state: MachineState, *, kept: bool) -> MachineState:
    """A reset that was asked for: modes and overrides are as at power-up, the position is good or it is not."""
    return state._replace(
        position=state.position if kept else {},
        work_position=state.work_position if kept else {},
        overrides=dict.fromkeys(state.overrides, OVERRIDE_NEUTRAL_PERCENT),
        accessories=frozenset(),
        modal=(),
        tool_requested=None,
        homed=state.homed if kept else False,
        alarm=None,
    )


def _reported(state: MachineState, report: StateReported) -> MachineState:
    offset = state.work_offset if report.work_offset is None else report.work_offset
    position, work_position = _positions(state, report, offset)
    # A pending tool request outlives the idle reports that follow it; an alarm or a new run ends it.
    status: Status = report.status
    requested = state.tool_requested
    if requested is not None and status == "idle" and report.frame == "both":
        status = "tool"
    elif status in ("run", "alarm") or (status != "tool" and report.frame != "both"):
        requested = None
    return MachineState(  # `_replace` would take twice as long
        status=status,
        position=position,
        work_position=work_position,
        feed_mm_min=state.feed_mm_min if report.feed_mm_min is None else report.feed_mm_min,
        spindle_rpm=state.spindle_rpm if report.spindle_rpm is None else report.spindle_rpm,
        absolute=state.absolute if report.absolute is None else report.absolute,
        alarm=report.alarm,
        tool=state.tool if report.tool is None else report.tool,
        tool_requested=requested,
        inputs=state.inputs,
        overrides=state.overrides,
        work_offset=offset,
        accessories=state.accessories,
        pendant=state.pendant,
        homed=state.homed if report.homed is None else report.homed,
        modal=state.modal,
        substate=report.substate,
    )


def _positions(
    state: MachineState, report: StateReported, offset: Mapping[str, float]
) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Machine and work position. Grbl tells one of the two and now and then their difference (grbl II.5): an axis whose
    difference is not known yet has only the one that was told."""
    if report.frame == "both":
        position = dict(report.position) if report.complete else {**state.position, **report.position}
        return position, position
    if report.frame == "machine":
        position = {**state.position, **report.position}
        return position, {axis: round(at - offset[axis], 6) for axis, at in position.items() if axis in offset}
    work = {**state.work_position, **report.position}
    return {axis: round(at + offset[axis], 6) for axis, at in work.items() if axis in offset}, work


def tool_confirmed(state: MachineState) -> MachineState:
    """The operator has put in the requested tool."""
    return state if state.tool_requested is None else tool_is(state, state.tool_requested)


def tool_is(state: MachineState, number: int | None) -> MachineState:
    """This is the tool in the spindle, None: nobody knows; nothing is asked for any more."""
    status: Status = "idle" if state.status == "tool" else state.status
    return state._replace(status=status, tool=number, tool_requested=None)
