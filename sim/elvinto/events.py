"""What happened inside the virtual machine, for tests and for the console of `millstream sim`."""

from dataclasses import dataclass
from typing import Final, TypeAlias

MAX_EVENTS: Final = 10_000
"""Events that nobody took; the oldest are forgotten."""


@dataclass(slots=True)
class Executed:
    """A block that the machine began to execute. `id` is the wire ID of its command (of RUN, for a card's file)."""

    text: str
    id: int
    at: float
    finished: bool = False
    ended_at: float | None = None
    """When it was done; stays None for a block that an alarm or a restart stopped."""


@dataclass(frozen=True, slots=True)
class CommandAccepted:
    id: int
    name: str


@dataclass(frozen=True, slots=True)
class CommandEnded:
    id: int
    error: int | None


@dataclass(frozen=True, slots=True)
class CommandRepeated:
    """An ID that was accepted before came again; `answered` under `reack`."""

    id: int
    answered: bool


@dataclass(frozen=True, slots=True)
class MessageDropped:
    """`reason` is a key of `VirtualElvinto.dropped`."""

    reason: str
    raw: bytes


@dataclass(slots=True)  # not frozen: that doubles the time of making one, and there are two a block
class BlockStarted:
    block: Executed


@dataclass(slots=True)
class BlockFinished:
    block: Executed


@dataclass(frozen=True, slots=True)
class AlarmRaised:
    num: int
    axis: int | None


@dataclass(frozen=True, slots=True)
class AlarmCleared:
    pass


@dataclass(frozen=True, slots=True)
class ToolWanted:
    num: int


@dataclass(frozen=True, slots=True)
class PowerLost:
    pass


@dataclass(frozen=True, slots=True)
class Booted:
    pass


SimEvent: TypeAlias = (
    CommandAccepted
    | CommandEnded
    | CommandRepeated
    | MessageDropped
    | BlockStarted
    | BlockFinished
    | AlarmRaised
    | AlarmCleared
    | ToolWanted
    | PowerLost
    | Booted
)
