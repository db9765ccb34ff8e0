"""What an engine reports: frozen dataclasses, past tense or nouns. The same vocabulary for every dialect.

A peer's misbehaviour is an event here, never an exception. Wire texts inside events are hostile: bounded in
length by the codec, to be escaped by whoever shows them.
"""

from dataclasses import dataclass, field
from typing import Literal

from protocol.commands import Position

Status = Literal["offline", "idle", "run", "hold", "jog", "alarm", "home", "check", "door", "sleep", "tool"]


@dataclass(frozen=True, slots=True)
class Alarm:
    """`code` as the controller numbers it (None: it gave none), `axis` lower-case or None, `message` for people."""

    code: int | None
    axis: str | None
    message: str


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
class ProtocolFault:
    """Something on the wire was not as the standard demands; it was skipped. `kind` is a metric label."""

    kind: Literal["checksum", "malformed", "too_long", "no_header", "unknown_id", "unknown_message"]
    detail: str


@dataclass(frozen=True, slots=True)
class MessageSeen:
    """A message for the console. `direction`: `>` to the machine, `<` from it."""

    direction: Literal[">", "<"]
    text: str


# --- state ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class StateReported:
    """The machine's own account of itself. Absent values (None) were not in the report."""

    status: Status
    position: Position
    feed_mm_min: float | None = None
    spindle_rpm: float | None = None
    absolute: bool | None = None
    alarm: Alarm | None = None


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
    """The machine has accepted it and begins to execute."""

    id: int


@dataclass(frozen=True, slots=True)
class BatchDone:
    """Executed completely. `inferred`: concluded from other evidence than its own OK (elvinto §5.3)."""

    id: int
    inferred: bool = False
    position: Position | None = None


@dataclass(frozen=True, slots=True)
class BatchFailed:
    """It did not run to its end: the machine's error, an alarm, the emergency stop. Its lines are in doubt."""

    id: int
    reason: Literal["error", "alarm", "estop", "restart"]
    code: int | None
    message: str


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


Event = (
    LinkReady
    | LinkLost
    | MachineRestarted
    | ProtocolFault
    | MessageSeen
    | StateReported
    | ToolRequested
    | ProgramEnded
    | FilesListed
    | BatchSent
    | BatchReceived
    | BatchDone
    | BatchFailed
    | FateUnknown
    | FateSettled
    | FateInDoubt
    | CommandDone
    | CommandFailed
)
