"""What may be asked of an engine. Imperative frozen dataclasses; every dialect takes the ones it knows.

`SendBatch` is a job's traffic and carries the ID under which it stands in the journal; everything else carries a
`token` of the caller's, under which `CommandDone` / `CommandFailed` answer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

Position = Mapping[str, float]
"""Coordinates in mm (degrees for rotary axes) by lower-case axis name; an axis that is not known is absent."""


@dataclass(frozen=True, slots=True)
class SendBatch:
    """Consecutive blocks of a job, executed by the machine as one command.

    `id` must be the engine's `next_id`. `expected_s` is the estimated run time in seconds.
    `end` is where the machine stands afterwards as far as that is known.
    `locate_after` asks for the position when the batch is done (its effect cannot be computed).
    `ends_program` marks M30/M99, after which the machine forgets its ID memory (elvinto §5.6).
    """

    id: int
    blocks: tuple[str, ...]
    expected_s: float
    end: Position = field(default_factory=dict)
    locate_after: bool = False
    ends_program: bool = False


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


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """Realtime lane: goes out before everything else, repeated until the machine has heard it."""

    token: int


Command = SendBatch | RunBlock | Locate | ClearAlarm | ListFiles | RunFile | AskToolChange
RealtimeCommand = EmergencyStop
