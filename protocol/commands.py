"""What may be asked of an engine. Imperative frozen dataclasses; every dialect takes the ones it knows.

`SendBatch` is a job's traffic and carries the ID under which it stands in the journal; everything else carries a
`token` of the caller's, under which `CommandDone` / `CommandFailed` answer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Position = Mapping[str, float]
"""Coordinates in mm (degrees for rotary axes) by lower-case axis name; an axis that is not known is absent."""


OnError = Literal["hold", "stop", "ignore"]
"""What follows when a controller that has more lines inside refuses one (grbl II.4)."""


@dataclass(frozen=True, slots=True)
class SendBatch:
    """Consecutive blocks of a job, executed by the machine as one command.

    `id` must be the engine's `next_id`. `expected_s` is the estimated run time in seconds.
    `end` is where the machine stands afterwards as far as that is known.
    `locate_after` asks for the position when the batch is done (its effect cannot be computed).
    `ends_program` marks M30/M99, after which the machine forgets its ID memory (elvinto §5.6).
    `on_error`: what follows a refused block where the blocks behind it are inside already (Grbl); `ignore` holds for
    `ignored_errors`, or for every code where none is named; codes that are not ignored are held.
    `reach_mm`: of each block how far it takes one of X, Y, Z at least, 0 where that is not known; empty: of none is it.
    `check`: for the controller's check mode and nowhere else, as every other batch is not for it (Grbl `$C`).
    """

    id: int
    blocks: tuple[str, ...]
    expected_s: float
    end: Position = field(default_factory=dict)
    locate_after: bool = False
    ends_program: bool = False
    on_error: OnError = "hold"
    ignored_errors: frozenset[int] = frozenset()
    check: bool = False
    reach_mm: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class RunBlock:
    """One or more blocks by hand, as one command, outside any job."""

    token: int
    blocks: tuple[str, ...]
    expected_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Locate:
    """Ask where the machine is; a `StateReported` comes before the `CommandDone`."""

    token: int


@dataclass(frozen=True, slots=True)
class SetPosition:
    """Where the machine stands, by somebody's word: for one that cannot say it itself (ncframe). Nothing is sent."""

    token: int
    position: Position


@dataclass(frozen=True, slots=True)
class ClearAlarm:
    """RESETALERT on ElVinto, `$X` on Grbl."""

    token: int


@dataclass(frozen=True, slots=True)
class ListFiles:
    """List the SD card; answered by `FilesListed` and `CommandDone`."""

    token: int


@dataclass(frozen=True, slots=True)
class RunFile:
    """Run a program from the SD card; `CommandDone` when it is accepted, `ProgramEnded` at its end."""

    token: int
    name: str


@dataclass(frozen=True, slots=True)
class AskToolChange:
    """Is a tool change pending? `ToolRequested` if so."""

    token: int


# --- Grbl: lines (grbl II.6, II.7) ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Jog:
    """Move by hand: `target` in mm, from where the machine stands or, with `absolute`, in work coordinates.

    Done means planned; `JogCancel` takes back what has not moved yet.
    """

    token: int
    target: Position
    feed_mm_min: float
    absolute: bool = False


@dataclass(frozen=True, slots=True)
class Home:
    """The homing cycle of all axes, or of those named where the firmware can. No time-out while it lasts."""

    token: int
    axes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ReadFirmware:
    """Version, build options, buffer sizes, help; answered by `FirmwareRead`."""

    token: int


@dataclass(frozen=True, slots=True)
class ReadModal:
    """The parser's modal groups; answered by `ModalRead`."""

    token: int


@dataclass(frozen=True, slots=True)
class ReadOffsets:
    """Work offsets, G28, G30, G92, tool length, last probe; answered by `OffsetsRead`."""

    token: int


@dataclass(frozen=True, slots=True)
class ReadSettings:
    """All settings; answered by `SettingsRead`."""

    token: int


@dataclass(frozen=True, slots=True)
class ReadDescriptions:
    """What a grblHAL says of its own settings (`$ES`); answered by `DescriptionsRead`."""

    token: int


@dataclass(frozen=True, slots=True)
class ReadStartupBlocks:
    """Answered by `StartupBlocksRead`."""

    token: int


@dataclass(frozen=True, slots=True)
class WriteSetting:
    """One setting, verified by reading back; `SettingsRead` comes before the end."""

    token: int
    number: int
    value: str


@dataclass(frozen=True, slots=True)
class WriteInfo:
    """The machine's info text (`$I=`). Grbl drops blanks and case."""

    token: int
    text: str


@dataclass(frozen=True, slots=True)
class WriteStartupBlock:
    """A block that runs after every reset. The controller executes it once now (II.6)."""

    token: int
    index: int
    block: str


@dataclass(frozen=True, slots=True)
class CheckMode:
    """The parser without motion. Off means a reset of the controller, whose banner is awaited."""

    token: int
    on: bool


@dataclass(frozen=True, slots=True)
class Sleep:
    """Motors and spindle off; only a reset wakes it up, in alarm."""

    token: int


@dataclass(frozen=True, slots=True)
class Restore:
    """Defaults instead of what is stored; the controller resets itself."""

    token: int
    what: Literal["settings", "offsets", "all"]


# --- the realtime lane ------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """Realtime lane: goes out before everything else, repeated until the machine has heard it."""

    token: int


@dataclass(frozen=True, slots=True)
class FeedHold:
    """Decelerate and stand still; `CycleStart` goes on."""

    token: int


@dataclass(frozen=True, slots=True)
class CycleStart:
    """Go on after a hold, a closed door, M0, a tool change, a refused block."""

    token: int


@dataclass(frozen=True, slots=True)
class Stop:
    """Come to a stand without losing the position, then drop everything the controller holds."""

    token: int


@dataclass(frozen=True, slots=True)
class SoftReset:
    """Reset the controller at once; in motion it loses its position."""

    token: int


@dataclass(frozen=True, slots=True)
class JogCancel:
    """End all jogs: those that wait, those inside, the one that moves. Done when the machine stands."""

    token: int


@dataclass(frozen=True, slots=True)
class SafetyDoor:
    """What the opened door does."""

    token: int


@dataclass(frozen=True, slots=True)
class Override:
    """`step`: `reset` to 100 %, `+10`, `-10`, `+1`, `-1` of feed and spindle, `50`, `25` of rapids."""

    token: int
    what: Literal["feed", "rapid", "spindle"]
    step: Literal["reset", "+10", "-10", "+1", "-1", "50", "25"]


@dataclass(frozen=True, slots=True)
class CoolantToggle:
    """Flood or mist on and off."""

    token: int
    what: Literal["flood", "mist"]


@dataclass(frozen=True, slots=True)
class SpindleStopToggle:
    """Spindle off and on again while the machine is held."""

    token: int


@dataclass(frozen=True, slots=True)
class ToolAck:
    """The tool change is being done: commands by hand are taken until `CycleStart` (grblHAL)."""

    token: int


@dataclass(frozen=True, slots=True)
class ToggleOption:
    """A switch of grblHAL."""

    token: int
    what: Literal["optional_stop", "single_block", "fan", "mpg", "auto_report", "probe_connected"]


GrblCommand = (
    Jog
    | Home
    | ReadFirmware
    | ReadModal
    | ReadOffsets
    | ReadSettings
    | ReadDescriptions
    | ReadStartupBlocks
    | WriteSetting
    | WriteInfo
    | WriteStartupBlock
    | CheckMode
    | Sleep
    | Restore
)
"""What only a Grbl knows; another engine answers it with `CommandFailed`."""

LineCommand = RunBlock | Locate | SetPosition | ClearAlarm | ListFiles | RunFile | AskToolChange | GrblCommand
Command = SendBatch | LineCommand
RealtimeCommand = (
    EmergencyStop
    | FeedHold
    | CycleStart
    | Stop
    | SoftReset
    | JogCancel
    | SafetyDoor
    | Override
    | CoolantToggle
    | SpindleStopToggle
    | ToolAck
    | ToggleOption
)
