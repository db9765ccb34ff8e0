"""The pins of one block with their values, and the events that have not been taken yet.

Decides nothing: handshake.py, estop.py and latch.py put values here, the shell takes the events.
The one rule: whatever changes, changes through `put` or `go`, so that it cannot go unrecorded.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from protocol.iocontrol.events import Event, PinChanged, Transition
from protocol.iocontrol.pins import PINS, Pin, pins_of
from protocol.iocontrol.tables import Region, S, T


@dataclass(frozen=True, slots=True)
class PinState:
    """A pin as people see it. `valid` False: an input of a changer that is not connected."""

    name: str
    type: Literal["bit", "s32"]
    direction: Literal["in", "out"]
    value: bool | int
    since_at: float
    valid: bool = True


class Board:
    """`now` is the time of the input that is being worked on; `step` counts what happens together."""

    def __init__(self, version: int, now: float) -> None:
        self.now = now
        self.step = 0
        self._values: dict[Pin, bool | int] = {pin: False if PINS[pin].type == "bit" else 0 for pin in pins_of(version)}
        self._since = dict.fromkeys(self._values, now)
        self._step_of = dict.fromkeys(self._values, 0)
        self._events: deque[Event] = deque()

    def __contains__(self, pin: Pin) -> bool:
        return pin in self._values

    def __getitem__(self, pin: Pin) -> bool | int:
        """Its value; a pin that the protocol version does not have is never TRUE."""
        return self._values.get(pin, False)

    def next_step(self) -> None:
        """What is put from here on comes after what was put before (a bar in the sheet's sequences)."""
        self.step += 1

    def put(self, pin: Pin, value: bool | int) -> None:
        """Give a pin a value. Nothing happens where it has it already, or where the version has no such pin."""
        if pin not in self._values or self._values[pin] == value:
            return
        self._values[pin] = value
        self._since[pin] = self.now
        self._step_of[pin] = self.step
        self.emit(PinChanged(str(pin), value, self.now, self.step))

    def older(self, pin: Pin, other: Pin) -> bool:
        """A pin has its value for longer than another."""
        return self._step_of[pin] < self._step_of[other]

    def go(self, region: Region[S, T], trigger: T) -> None:
        """Move along one of the tables."""
        before, after = region.move(trigger)
        self.emit(Transition(region.name, before.name.lower(), after.name.lower(), trigger.value, self.now))

    def emit(self, event: Event) -> None:
        self._events.append(event)

    def next_event(self) -> Event | None:
        return self._events.popleft() if self._events else None

    def values(self) -> Mapping[str, bool | int]:
        """All pins by name."""
        return {str(pin): value for pin, value in self._values.items()}

    def states(self, invalid: frozenset[Pin]) -> tuple[PinState, ...]:
        """All pins with all that is known of them."""
        return tuple(
            PinState(str(pin), PINS[pin].type, PINS[pin].direction, value, self._since[pin], pin not in invalid)
            for pin, value in self._values.items()
        )
