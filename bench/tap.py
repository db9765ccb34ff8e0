"""Listens where a wire ends: when which message left or arrived, and from that where the time between batches went.

It reads messages with a few lines of its own, neither the engine's nor the machine's. The one rule: times are those
of one clock, the loop's, on which the machine lives too.
"""

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from statistics import median

from sim.elvinto.events import Executed
from sim.faults import BITS_PER_BYTE

_ID = re.compile(rb"\bID<#(\d+)")


class Messages:
    """Bytes in any pieces to messages, each with its check header."""

    def __init__(self) -> None:
        self._rest = b""
        self._header = b""

    def feed(self, data: bytes) -> Iterator[tuple[bytes, bytes]]:
        """(header, message), whole ones."""
        *whole, self._rest = (self._rest + data).split(b";")
        for text in whole:
            message = text + b";"
            if message.startswith(b"CRC"):
                self._header = message
            else:
                yield self._header, message
                self._header = b""


@dataclass(slots=True)
class Passage:
    """One command on the wire. Bytes count the check headers; `written_at` is its first time."""

    command_bytes: int = 0
    received_bytes: int = 0
    ok_bytes: int = 0
    written_at: float | None = None
    ok_at: float | None = None


@dataclass(slots=True)
class Tap:
    """Both directions of one wire, by wire ID."""

    passages: dict[int, Passage] = field(default_factory=dict)
    down_bytes: int = 0
    up_bytes: int = 0
    _down: Messages = field(default_factory=Messages)
    _up: Messages = field(default_factory=Messages)

    def down(self, data: bytes, now: float) -> None:
        """The daemon has written this."""
        self.down_bytes += len(data)
        for header, message in self._down.feed(data):
            if message.startswith(b"GCODE") and (found := _ID.search(header)):
                passage = self.passages.setdefault(int(found[1]), Passage())
                passage.command_bytes = len(header) + len(message)
                if passage.written_at is None:
                    passage.written_at = now

    def up(self, data: bytes, now: float) -> None:
        """This has arrived for the daemon."""
        self.up_bytes += len(data)
        for header, message in self._up.feed(data):
            passage = self.passages.get(int(found[1])) if (found := _ID.search(message)) else None
            if passage is None:
                continue
            if message.startswith(b"RECEIVED"):
                passage.received_bytes = len(header) + len(message)
            elif message.startswith(b"OK"):
                passage.ok_bytes = len(header) + len(message)
                passage.ok_at = now


@dataclass(frozen=True, slots=True)
class DeadTime:
    """Seconds, summed over the gaps between the batches of a program.

    `unhidden_s`, `answer_wait_s`, `turnaround_s` and `command_wait_s` together are `dead_s`.
    """

    batches: int
    blocks: int
    total_s: float
    executing_s: float
    bound_s: float
    """Wire time of header + data + RECEIVED + OK (elvinto §7)."""
    unhidden_s: float
    """The same without RECEIVED, which passes while the machine executes already."""
    answer_wait_s: float
    """OK was late: it waited for other messages (STATE), or the machine's timer was late."""
    turnaround_s: float
    """OK was there, the next command not yet on the wire: the daemon."""
    median_turnaround_s: float
    command_wait_s: float
    """The next command took longer than its bytes."""

    @property
    def dead_s(self) -> float:
        return self.total_s - self.executing_s

    @property
    def dead(self) -> float:
        """1 - executing / total."""
        return self.dead_s / self.total_s

    @property
    def bound(self) -> float:
        """The same if nothing but the wire took time."""
        return self.bound_s / (self.executing_s + self.bound_s)

    @property
    def ratio(self) -> float:
        return self.dead / self.bound


def dead_time(tap: Tap, executed: Iterable[Executed], baud: int) -> DeadTime:
    """What the machine did against what the wire carried. `executed` are the program's blocks, all ended."""
    byte_s = BITS_PER_BYTE / baud
    spans: dict[int, tuple[float, float]] = {}
    blocks = 0
    for block in executed:
        assert block.ended_at is not None, f"{block.text} has not ended"
        spans[block.id] = (spans.get(block.id, (block.at, 0.0))[0], block.ended_at)
        blocks += 1
    bound_bytes = unhidden_bytes = 0
    answer_wait_s = command_wait_s = 0.0
    turnarounds_s: list[float] = []
    ids = list(spans)
    for before, after in itertools.pairwise(ids):
        one, other = tap.passages[before], tap.passages[after]
        assert one.ok_at is not None
        assert other.written_at is not None
        unhidden_bytes += one.ok_bytes + other.command_bytes
        bound_bytes += one.ok_bytes + other.command_bytes + other.received_bytes
        answer_wait_s += one.ok_at - spans[before][1] - one.ok_bytes * byte_s
        turnarounds_s.append(other.written_at - one.ok_at)
        command_wait_s += spans[after][0] - other.written_at - other.command_bytes * byte_s
    return DeadTime(
        batches=len(ids),
        blocks=blocks,
        total_s=spans[ids[-1]][1] - spans[ids[0]][0],
        executing_s=sum(end - begin for begin, end in spans.values()),
        bound_s=bound_bytes * byte_s,
        unhidden_s=unhidden_bytes * byte_s,
        answer_wait_s=answer_wait_s,
        turnaround_s=sum(turnarounds_s),
        median_turnaround_s=median(turnarounds_s),
        command_wait_s=command_wait_s,
    )
