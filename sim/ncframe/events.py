"""What happened inside the virtual lathe, for tests and for the record of `millstream sim`."""

from dataclasses import dataclass
from typing import Literal, TypeAlias


@dataclass(slots=True)
class Executed:
    """A frame that the lathe began to execute. `id` is its number since power-on, from 1; `x`, `z` where it leads, in
    counts from the place at power-on."""

    text: str
    id: int
    at: float
    x: int
    z: int
    ended_at: float | None = None
    """When it was done; stays None for a frame that an abort or a power cut broke off."""

    @property
    def finished(self) -> bool:
        return self.ended_at is not None


@dataclass(frozen=True, slots=True)
class BytesRefused:
    """`why`: check, length, empty, gap (a frame that was not whole), arc, G100, ..."""

    raw: bytes
    why: str
    at: float


@dataclass(frozen=True, slots=True)
class BytesLost:
    """`off`: no power or booting; `busy`: the buffer was full while a frame ran."""

    count: int
    why: Literal["off", "busy"]
    at: float


@dataclass(frozen=True, slots=True)
class Aborted:
    """`why`: host (CAN came), panel, limit, arc."""

    why: Literal["host", "panel", "limit", "arc"]
    at: float


SimEvent: TypeAlias = BytesRefused | BytesLost | Aborted
