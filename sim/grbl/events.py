"""What happened inside the virtual controller, for tests and for the console of `millstream sim`."""

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from sim.grbl.simsettings import Point

MoveKind: TypeAlias = Literal["rapid", "feed", "arc", "jog", "probe", "home"]


@dataclass(slots=True)
class Move:
    """One block of the planner, machine coordinates. `start` is where it really began."""

    kind: MoveKind
    start: Point
    end: Point
    rate_mm_min: float
    """As programmed; rapids: what the axes allow."""
    began_at: float | None = None
    ended_at: float | None = None


@dataclass(slots=True)
class Executed:
    """A line that the parser took without an error. `id` is its place among all lines since power-on, from 1."""

    text: str
    id: int
    at: float
    moves: list[Move] = field(default_factory=list[Move])

    @property
    def finished(self) -> bool:
        """All of its motion was made to the end."""
        return all(move.ended_at is not None for move in self.moves)

    @property
    def ended_at(self) -> float | None:
        if not self.finished:
            return None
        return max((move.ended_at for move in self.moves if move.ended_at is not None), default=self.at)


@dataclass(frozen=True, slots=True)
class LineAnswered:
    """`error` 0: ok."""

    id: int
    text: str
    error: int


@dataclass(frozen=True, slots=True)
class AlarmRaised:
    num: int


@dataclass(frozen=True, slots=True)
class BytesLost:
    """`why`: "ring" (full), "eeprom" (interrupts off), "reset" (flushed), "off" (no power, or booting)."""

    why: Literal["ring", "eeprom", "reset", "off"]
    count: int


@dataclass(frozen=True, slots=True)
class BannerSaid:
    """The controller has started, or started anew."""


@dataclass(frozen=True, slots=True)
class PowerLost:
    pass


SimEvent: TypeAlias = LineAnswered | AlarmRaised | BytesLost | BannerSaid | PowerLost
