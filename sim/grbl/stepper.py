"""Time passes here: the first block of the queue is executed with trapezoids, holds and contacts (grbl II.2, II.4).

The profile of what is left of a block is three pieces of constant acceleration at most, worked out anew whenever the
queue or an override changes. The one rule: positions are exact functions of the time; nothing is sampled.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from sim.grbl.planner import PlanBlock, Planner
from sim.grbl.simsettings import ORIGIN, Point

_NOTHING_MM: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Piece:
    """So long, from such a speed on, with such a change of it (mm/s, mm/s²)."""

    seconds: float
    speed: float
    acceleration: float

    @property
    def length_mm(self) -> float:
        return self.covered(self.seconds)

    def covered(self, seconds: float) -> float:
        return self.speed * seconds + self.acceleration * seconds**2 / 2

    def when(self, length_mm: float) -> float:
        """Seconds until `length_mm` are covered; they are within this piece."""
        if abs(self.acceleration) < _NOTHING_MM:
            return length_mm / self.speed if self.speed else 0.0
        root = math.sqrt(max(0.0, self.speed**2 + 2 * self.acceleration * length_mm))
        return (root - self.speed) / self.acceleration


def profile(length_mm: float, speed: float, nominal: float, leave: float, acceleration: float) -> list[Piece]:
    """From `speed` to `leave` over `length_mm`, no faster than `nominal`; what cannot be reached is approached."""
    pieces: list[Piece] = []
    if speed > nominal:  # an override has lowered the speed
        slower = _ramp(length_mm, speed, nominal, acceleration)
        pieces.append(slower)
        length_mm -= slower.length_mm
        if length_mm <= _NOTHING_MM:
            return pieces
        speed = nominal
    peak = math.sqrt(max(0.0, min(nominal**2, (speed**2 + leave**2) / 2 + acceleration * length_mm)))
    if speed**2 - leave**2 > 2 * acceleration * length_mm:
        return [*pieces, _ramp(length_mm, speed, leave, acceleration)]
    peak = max(peak, speed)
    if peak < leave:
        faster = math.sqrt(speed**2 + 2 * acceleration * length_mm)
        return [*pieces, Piece((faster - speed) / acceleration, speed, acceleration)]
    up = (peak**2 - speed**2) / (2 * acceleration)
    down = (peak**2 - leave**2) / (2 * acceleration)
    cruise = max(0.0, length_mm - up - down)
    pieces += [
        Piece((peak - speed) / acceleration, speed, acceleration),
        Piece(cruise / peak if peak else 0.0, peak, 0.0),
        Piece((peak - leave) / acceleration, peak, -acceleration),
    ]
    return [piece for piece in pieces if piece.seconds > 0]


def _ramp(length_mm: float, speed: float, leave: float, acceleration: float) -> Piece:
    """Slowing down to `leave`, or as far as the length goes."""
    end = math.sqrt(max(leave**2, speed**2 - 2 * acceleration * length_mm))
    return Piece((speed - end) / acceleration, speed, -acceleration)


@dataclass(frozen=True, slots=True)
class Contact:
    """Something the tool runs into after `done_mm` of a block: "probe" or "limit"."""

    what: str
    done_mm: float


class Stepper:
    """`on_stop` is called when motion has ended, `on_contact` when something was run into; both with the time."""

    def __init__(self, planner: Planner, *, speed_factor: float = 1.0, instant: bool = False) -> None:
        self.planner = planner
        self.running = False
        self.holding = False
        self.rest: Point = ORIGIN
        """Position while nothing is being executed, machine coordinates."""
        self.glide: Callable[[float], Point] | None = None
        """Homing moves the axes by itself, past the queue: where they are at a time."""
        self.watch: Callable[[PlanBlock], list[Contact]] = lambda _: []
        self.on_stop: Callable[[float], None] = lambda _: None
        self.on_contact: Callable[[str, float], None] = lambda _what, _at: None
        self._factor = speed_factor
        self._instant = instant
        self._since = 0.0
        self._speed = 0.0
        """At `_since`."""
        self._pieces: list[Piece] = []
        self._ends_at = 0.0
        self._contacts: list[Contact] = []

    # Seen from outside.

    def position(self, now: float) -> Point:
        if not self.running:
            return self.rest if self.glide is None else self.glide(now)
        block = self.planner.blocks[0]
        return block.at(block.done_mm + self._covered(now)[0])

    def speed_mm_s(self, now: float) -> float:
        return self._covered(now)[1] if self.running else 0.0

    def next_at(self) -> float | None:
        if not self.running:
            return None
        if self._contacts:
            return min(self._ends_at, self._contact_at(self._contacts[0]))
        return self._ends_at

    # What happens to it.

    def start(self, now: float) -> None:
        """Begin with the first block of the queue."""
        if self.running or not self.planner.blocks:
            return
        self.running = True
        self.holding = False
        self._speed = 0.0
        self._begin(now)

    def hold(self, now: float) -> None:
        """Slow down to a stop along the path; the rest stays in the queue."""
        if self.running and not self.holding:
            self._settle(now)
            self.holding = True
            self._plan()

    def touch(self, now: float) -> None:
        """The queue or an override has changed."""
        if self.running:
            self._settle(now)
            self._plan()
        else:
            self.planner.plan(0.0)

    def kill(self, now: float) -> None:
        """No slowing down: where it is now is where it stands."""
        if self.running:
            self._settle(now)
            block = self.planner.blocks[0]
            self.rest = block.at(block.done_mm)
        elif self.glide is not None:
            self.rest, self.glide = self.glide(now), None
        self.running = self.holding = False
        self._speed = 0.0

    def advance(self, now: float) -> None:
        """Do what is due at `now`: the end of a block, a stop, a contact."""
        if not self.running:
            return
        if self._contacts and self._contact_at(self._contacts[0]) <= now and self._contacts[0].done_mm <= self._reach():
            contact = self._contacts.pop(0)
            self._settle(self._contact_at(contact))
            self.planner.blocks[0].done_mm = contact.done_mm
            self._plan()
            self.on_contact(contact.what, now)
        elif self._ends_at <= now:
            self._end(self._ends_at)

    # Within.

    def _begin(self, now: float) -> None:
        block = self.planner.blocks[0]
        self._since = now
        if block.move.began_at is None:
            block.move.began_at = now
            block.move.start = block.start
        self._contacts = [found for found in self.watch(block) if found.done_mm >= block.done_mm]
        self._contacts.sort(key=lambda found: found.done_mm)
        # A block that is entered as it was planned leaves the rest of the plan as it is.
        self._plan(anew=abs(self._speed**2 - block.entry_sqr) > _NOTHING_MM)

    def _plan(self, *, anew: bool = True) -> None:
        block = self.planner.blocks[0]
        if self.holding:
            stop_mm = self._speed**2 / (2 * block.acceleration)
            self._pieces = [_ramp(min(stop_mm, block.left_mm), self._speed, 0.0, block.acceleration)]
        else:
            if anew:
                self.planner.plan(self._speed)
            self._pieces = profile(
                block.left_mm, self._speed, block.nominal_mm_s, self.planner.exit_mm_s(), block.acceleration
            )
        seconds = 0.0 if self._instant else sum(piece.seconds for piece in self._pieces) / self._factor
        self._ends_at = self._since + seconds

    def _reach(self) -> float:
        """How far along its block it will be when the present profile ends."""
        block = self.planner.blocks[0]
        if self.holding and not self._instant:
            return block.done_mm + sum(piece.length_mm for piece in self._pieces)
        return block.done_mm if self.holding else block.length_mm

    def _contact_at(self, contact: Contact) -> float:
        if contact.done_mm > self._reach() + _NOTHING_MM:
            return math.inf
        if self._instant:
            return self._since
        length_mm = contact.done_mm - self.planner.blocks[0].done_mm
        seconds = 0.0
        for piece in self._pieces:
            if length_mm <= piece.length_mm:
                return self._since + (seconds + piece.when(length_mm)) / self._factor
            length_mm -= piece.length_mm
            seconds += piece.seconds
        return self._ends_at

    def _covered(self, now: float) -> tuple[float, float]:
        """Millimetres since the profile began, and the speed."""
        if self._instant:
            return 0.0, 0.0  # all of it happens in `_end`
        seconds = (now - self._since) * self._factor
        length_mm, speed = 0.0, self._speed
        for piece in self._pieces:
            part = min(seconds, piece.seconds)
            length_mm += piece.covered(part)
            speed = piece.speed + piece.acceleration * part
            seconds -= part
            if seconds <= 0:
                break
        return length_mm, max(0.0, speed)

    def _settle(self, now: float) -> None:
        """Make what was covered until `now` part of the past."""
        block = self.planner.blocks[0]
        length_mm, self._speed = self._covered(now)
        block.done_mm = min(block.length_mm, block.done_mm + length_mm)
        self._since = now

    def _end(self, at: float) -> None:
        block = self.planner.blocks[0]
        if self.holding:
            length_mm, self._speed = self._covered(at)
            block.done_mm = min(block.length_mm, block.done_mm + length_mm)
            self._since = at
            if block.left_mm > _NOTHING_MM or self._speed <= 1e-6:
                self._stop(at)
                return
        else:
            self._speed = 0.0 if self._instant else self._covered(at)[1]
            block.done_mm = block.length_mm
        block.move.ended_at = at
        self.rest = block.end
        self.planner.blocks.popleft()
        if self.planner.blocks:
            self._begin(at)
        else:
            self._finish(at)

    def _stop(self, at: float) -> None:
        """Held: the block keeps its rest, unless nothing is left of it."""
        block = self.planner.blocks[0]
        self.rest = block.at(block.done_mm)
        if block.left_mm <= _NOTHING_MM:
            block.move.ended_at = at
            self.planner.blocks.popleft()
        self._finish(at)

    def _finish(self, at: float) -> None:
        self.running = self.holding = False
        self._speed = 0.0
        self.on_stop(at)
