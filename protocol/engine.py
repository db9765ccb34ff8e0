"""The contract of every protocol engine: five verbs, and the verbs of its domain. No I/O, no clock.

An engine lives for one connection epoch. The shell writes `data_to_send`, drains `next_event`, re-arms one timer
from `next_timer`, and does so after every input. Time comes in as `now` (seconds, monotonic); deadlines go out.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

from protocol.commands import Command, Position, RealtimeCommand, SendBatch
from protocol.events import Event


@dataclass(frozen=True, slots=True)
class Frame:
    """One message on the wire as the recorder keeps it: `at` seconds of the shell's clock, `<` or `>`."""

    at: float
    direction: str
    data: bytes


@dataclass(frozen=True, slots=True)
class OpenWork:
    """What a new epoch inherits from the one before: batches in the journal without a durable end, in order.

    `start` is where the machine stood before the first of them. `batches` may be empty: a job is under way but
    everything sent is known to be done. Without OpenWork nothing is under way and the machine is initialised.
    `move_until` (the shell's clock): up to then a batch that may never have arrived may be sent again to settle its
    fate; afterwards nothing that could move the machine goes out (elvinto §5.5).
    `executed`: where a batch has the ID of its first block, the ID of the last block known to be executed (ncframe §4).
    """

    batches: tuple[SendBatch, ...]
    start: Position = field(default_factory=dict)
    move_until: float = -math.inf
    executed: int | None = None


class Engine(Protocol):
    """One epoch of one link, seen by the shell."""

    @property
    def next_id(self) -> int:
        """The ID that the next `SendBatch` must carry."""

    def receive_data(self, data: bytes, now: float) -> None:
        """Bytes that came in. Any bytes, in any pieces; never raises."""

    def data_to_send(self, now: float) -> bytes:
        """What is to go out now; empty when nothing is."""

    def next_event(self) -> Event | None:
        """What happened, oldest first."""

    @property
    def news(self) -> bool:
        """Behind an input and what was sent for it: whether anybody has to be told. If not, `next_id`, `free` and
        `next_timer` are as they were, and what `next_event` would tell can wait for the next time."""

    def next_timer(self) -> float | None:
        """The earliest deadline, in the shell's seconds."""

    def handle_timer(self, now: float) -> None:
        """That deadline has come (calling early is harmless)."""

    def submit(self, command: Command, now: float) -> None:
        """Take a command. Raises LocalError when not free or when the ID is not `next_id`."""

    def realtime(self, command: RealtimeCommand, now: float) -> None:
        """Take a command of the realtime lane: never refused, never queued behind data."""

    def free(self) -> int:
        """How many commands it can take now."""

    def recent_frames(self) -> tuple[Frame, ...]:
        """The last frames both ways, oldest first, bounded."""
