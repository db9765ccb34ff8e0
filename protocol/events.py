"""What an engine reports: frozen dataclasses, past tense or nouns. The same vocabulary for every dialect.

A peer's misbehaviour is an event here, never an exception. Wire texts inside events are hostile: bounded in
length by the codec, to be escaped by whoever shows them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from protocol.commands import Position
from protocol.setting import SettingDescription

Status = Literal["offline", "idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep", "tool"]


@dataclass(frozen=True, slots=True)
class Alarm:
    """`code` as the controller numbers it (None: it gave none), `axis` lower-case or None, `message` for people.
    `emergency`: the controller says that its emergency stop is pressed."""

    code: int | None
    axis: str | None
    message: str
    emergency: bool = False


# --- the link -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LinkReady:
    """Handshake (and settling, where something was open) is over: the machine takes commands."""


@dataclass(frozen=True, slots=True)
class LinkLost:
    """The peer does not answer any more; the shell closes the port and tries again later."""

    reason: str


@dataclass(frozen=True, slots=True)
class MachineRestarted:
    """The machine has lost its memory (unasked READY, a restart probe that was executed, a banner)."""

    evidence: str


@dataclass(frozen=True, slots=True)
class ControllerReset:
    """A reset that was asked for is over. `position_kept`: it stood still, so its position is good (grbl II.2)."""

    position_kept: bool


@dataclass(frozen=True, slots=True)
class ProtocolFault:
    """Something on the wire was not as the standard demands; it was skipped. `kind` is a metric label."""

    kind: Literal[
        "checksum",
        "malformed",
        "too_long",
        "no_header",
        "unknown_id",
        "unknown_message",
        "unasked_answer",
        "lost_answer",
    ]
    detail: str


@dataclass(frozen=True, slots=True)
class MessageSeen:
    """A message for the console. `direction`: `>` to the machine, `<` from it."""

    direction: Literal[">", "<"]
    text: str


@dataclass(slots=True)  # not frozen: that doubles the time of making one, and there is one for every line of a Grbl
class MessagesSeen:
    """Messages for the console in their order: when (the shell's clock), direction and text. What nobody waits for may
    be told some at once."""

    messages: Sequence[tuple[float, Literal[">", "<"], str]]


# --- state ----------------------------------------------------------------------------------------------------


class StateReported(NamedTuple):  # of all events the one that comes most: a frozen dataclass takes ten times as long
    """The machine's own account of itself. Absent values (None) were not in the report.

    `frame` tells what `position` is: machine coordinates, work coordinates, or both where a machine knows no
    difference. `work_offset` is machine less work position. `complete`: axes that are not in `position` are not known
    any more; else nothing new was said of them.
    """

    status: Status
    position: Position
    feed_mm_min: float | None = None
    spindle_rpm: float | None = None
    absolute: bool | None = None
    alarm: Alarm | None = None
    frame: Literal["both", "machine", "work"] = "both"
    work_offset: Position | None = None
    substate: int | None = None
    tool: int | None = None
    homed: bool | None = None
    complete: bool = False


@dataclass(frozen=True, slots=True)
class PinsChanged:
    """The inputs that are active now, by name; all others are not."""

    active: frozenset[str]


@dataclass(frozen=True, slots=True)
class OverridesChanged:
    """In percent of what was programmed."""

    feed: int
    rapid: int
    spindle: int


@dataclass(frozen=True, slots=True)
class AccessoriesChanged:
    """What runs: spindle_cw, spindle_ccw, flood, mist, ..."""

    active: frozenset[str]


@dataclass(frozen=True, slots=True)
class PendantChanged:
    """`active`: a pendant (MPG) owns the stream and nothing of ours is sent."""

    active: bool


@dataclass(frozen=True, slots=True)
class Homed:
    """A homing cycle has succeeded; `axes` empty: all."""

    axes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ProbeReported:
    """A probing move has ended at `position` (machine coordinates)."""

    position: Position
    succeeded: bool


@dataclass(frozen=True, slots=True)
class Announced:
    """A message of the controller for people, as it says it."""

    text: str


@dataclass(frozen=True, slots=True)
class StartupBlockRun:
    """A start-up block was executed after a reset; `code` None: without an error."""

    block: str
    code: int | None


# --- what was read from a controller (token None: unasked, at the handshake) -------------------------------------


@dataclass(frozen=True, slots=True)
class FirmwareRead:
    """`planner_blocks`, `rx_bytes`: what the controller says it has; `facts`: its other lines by name."""

    token: int | None
    flavour: Literal["grbl", "grblhal"]
    version: str
    build: str
    info: str
    options: str
    planner_blocks: int | None
    rx_bytes: int | None
    axes: tuple[str, ...]
    facts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ModalRead:
    """The words of the active modal groups, as G0, G54, ..., T0, F0, S0."""

    token: int | None
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class OffsetsRead:
    """By name, G54 to G59.3, G28, G30, G92, TLO, in mm; `probe` is the last probing."""

    token: int | None
    offsets: Mapping[str, Position]
    probe: ProbeReported | None = None


@dataclass(frozen=True, slots=True)
class SettingsRead:
    """Every setting by number, its value as the controller prints it."""

    token: int | None
    values: Mapping[int, str]


@dataclass(frozen=True, slots=True)
class DescriptionsRead:
    """In the order of the controller."""

    token: int
    descriptions: tuple[SettingDescription, ...]


@dataclass(frozen=True, slots=True)
class StartupBlocksRead:
    """In their order."""

    token: int
    blocks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ToolRequested:
    """The program in the machine needs tool `number`."""

    number: int


@dataclass(frozen=True, slots=True)
class ProgramEnded:
    """A program that ran from the SD card has ended."""


@dataclass(frozen=True, slots=True)
class FilesListed:
    """The SD card. `card` is None without one; `readable` False: `names` is empty and `problem` says why."""

    token: int
    names: tuple[str, ...]
    readable: bool
    card: str | None = None
    problem: str | None = None


# --- batches of a job -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BatchSent:
    """Its bytes were handed to the wire; `attempt` counts from 1."""

    id: int
    attempt: int


@dataclass(frozen=True, slots=True)
class BatchReceived:
    """The machine has accepted it. `begins`: and executes it now, for it has nothing else to do."""

    id: int
    begins: bool = True


@dataclass(frozen=True, slots=True)
class BatchDone:
    """Executed completely. `inferred`: concluded from other evidence than its own OK (elvinto §5.3)."""

    id: int
    inferred: bool = False
    position: Position | None = None


@dataclass(frozen=True, slots=True)
class BatchFailed:
    """It did not run to its end: the machine's error, an alarm, the emergency stop. Its lines are in doubt.

    Where it is known: the first `lines_done` are executed, those from `lines_touched` on certainly not, and only what
    lies between is in doubt. `position`: where the machine stands, if nothing is.
    """

    id: int
    reason: Literal["error", "alarm", "estop", "restart", "stop", "link"]
    code: int | None
    message: str
    lines_done: int | None = None
    lines_touched: int | None = None
    position: Position | None = None


@dataclass(frozen=True, slots=True)
class LineRefused:
    """The controller has refused line `index` (from 0) of batch `id` and goes on with those behind it (grbl II.4).

    `inside`: the lines, as (batch, index), that it had by then and executes if it is not stopped.
    """

    id: int
    index: int
    block: str
    code: int | None
    message: str
    action: Literal["held", "stopped", "ignored"]
    inside: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class FateUnknown:
    """Nobody knows whether these batches arrived; the engine has begun to find out."""

    ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FateSettled:
    """It is known which of the open batches were executed. `undone` never arrived and must go out again."""

    done: tuple[int, ...]
    undone: tuple[int, ...]
    position: Position = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FateInDoubt:
    """It cannot be known. `done` are certain all the same, `doubtful` may or may not have been executed."""

    done: tuple[int, ...]
    doubtful: tuple[int, ...]
    reason: str
    position: Position = field(default_factory=dict)


# --- commands by hand -----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class CommandDone:
    """The command of this token is executed."""

    token: int


@dataclass(frozen=True, slots=True)
class CommandFailed:
    """The command of this token was refused or got no answer; `code` as the controller numbers it."""

    token: int
    code: int | None
    message: str


Detail = (
    ProtocolFault
    | MessageSeen
    | MessagesSeen
    | PinsChanged
    | OverridesChanged
    | AccessoriesChanged
    | PendantChanged
    | Homed
    | ProbeReported
    | Announced
    | StartupBlockRun
    | FirmwareRead
    | ModalRead
    | OffsetsRead
    | SettingsRead
    | DescriptionsRead
    | StartupBlocksRead
    | ProgramEnded
    | FilesListed
    | BatchSent
    | BatchReceived
    | BatchDone
    | BatchFailed
    | LineRefused
    | FateUnknown
    | FateSettled
    | FateInDoubt
    | CommandDone
    | CommandFailed
)
"""Events that change no more than what they name."""

Event = LinkReady | LinkLost | MachineRestarted | ControllerReset | StateReported | ToolRequested | Detail
