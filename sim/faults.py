"""Wires that do harm, seeded and repeatable; one object is one direction. Pure: bytes and `now` in, bytes out later.

They know of the machine's language only where a message ends and that a check header belongs to what follows.
The one rule: the same seed and the same calls give the same bytes at the same times.
"""

import math
import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Final

BITS_PER_BYTE = 10
"""8N1: a start bit, eight bits, a stop bit."""


@dataclass(frozen=True, slots=True)
class Framing:
    """Where messages end: after `end`, and after every byte of `alone`, which is a message of its own."""

    end: bytes = b";"
    alone: bytes = b""

    def ends(self) -> re.Pattern[bytes]:
        return re.compile(b"[" + re.escape(self.end + self.alone) + b"]")


MESSAGES: Final = Framing()
"""ElVinto."""
LINES: Final = Framing(b"\n", b"?!~\x18\x19" + bytes(range(0x80, 0x100)))
"""Grbl: lines, and realtime bytes that act wherever they stand."""


@dataclass(frozen=True, slots=True)
class Drop:
    """Messages to swallow, each with its check header. `name` is how the message begins (`OK` also covers `OK,ID..`).

    Of the messages that match, number `first` (from 1) and the `count - 1` after it are lost; `count` 0: all of them
    from `first` on.
    """

    name: str = ""
    first: int = 1
    count: int = 1
    match: Callable[[bytes], bool] | None = None

    def covers(self, message: bytes) -> bool:
        if self.match is not None:
            return self.match(message)
        return message.rstrip(b";\r\n").split(b",", 1)[0].strip() == self.name.encode("ascii")


@dataclass(frozen=True, slots=True)
class FaultRates:
    """`loss`, `flip`, `duplicate`: chances per byte. `noise`, `delay`: chances per send; delays keep the order."""

    loss: float = 0.0
    flip: float = 0.0
    duplicate: float = 0.0
    noise: float = 0.0
    noise_bytes: int = 40
    delay: float = 0.0
    delay_s: float = 0.5
    drops: tuple[Drop, ...] = ()
    silences: tuple[tuple[float, float], ...] = ()
    """(from, until): what is sent then is lost."""

    def __post_init__(self) -> None:
        """Raises ValueError for a chance that is none."""
        for name in ("loss", "flip", "duplicate", "noise", "delay"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is a chance from 0 to 1, not {getattr(self, name)}")
        if self.loss + self.flip + self.duplicate > 1.0:
            raise ValueError("loss, flip and duplicate together are more than 1")


class PacedWire:
    """A serial line of `baud` bits a second: bytes arrive one after the other, each when its stop bit is through.

    `baud` 0 is a wire without any time of its own.
    """

    def __init__(self, baud: int = 0, *, framing: Framing = MESSAGES) -> None:
        self._ends = framing.ends()
        self._byte_s = BITS_PER_BYTE / baud if baud else 0.0
        self._flying: deque[tuple[float, bytes]] = deque()
        self._free_at = -math.inf
        self.carried_bytes = 0

    @property
    def free_at(self) -> float:
        """When the last byte sent so far will have arrived."""
        return self._free_at

    def send(self, data: bytes, now: float) -> None:
        """Bytes into the line; they queue behind those that are still going out."""
        if not data:
            return
        start_at = max(now, self._free_at)
        self._flying.append((start_at, data))
        self._free_at = start_at + len(data) * self._byte_s

    def receive(self, now: float) -> bytes:
        """The bytes that have arrived."""
        if not self._flying:
            return b""
        arrived: list[bytes] = []
        while self._flying:
            start_at, data = self._flying[0]
            count = self._arrived(start_at, data, now)
            arrived.append(data[:count])
            if count < len(data):
                if count:
                    self._flying[0] = (start_at + count * self._byte_s, data[count:])
                break
            self._flying.popleft()
        taken = b"".join(arrived)
        self.carried_bytes += len(taken)
        return taken

    def next_timer(self) -> float | None:
        """When the next message is complete: nobody can do anything with half of one."""
        if not self._flying:
            return None
        start_at, data = self._flying[0]
        found = self._ends.search(data)
        return start_at + (found.end() if found else len(data)) * self._byte_s

    def clear(self) -> None:
        """What is on its way is lost."""
        self._flying.clear()
        self._free_at = -math.inf

    def _arrived(self, start_at: float, data: bytes, now: float) -> int:
        if now < start_at:
            return 0
        if not self._byte_s:
            return len(data)
        # A hair more than the quotient: the sum that made a timer must also be enough when it comes back.
        return min(len(data), int((now - start_at) / self._byte_s + 1e-3))


class HostileWire:
    """One direction of a wire with faults, in front of a line of `baud`."""

    def __init__(
        self, seed: int, rates: FaultRates | None = None, *, baud: int = 0, framing: Framing = MESSAGES
    ) -> None:
        self._rates = rates or FaultRates()
        self._random = Random(seed)
        self._line = PacedWire(baud, framing=framing)
        self._message = re.compile(b"[^" + re.escape(framing.end + framing.alone) + b"]*" + framing.ends().pattern)
        self._held = b""
        self._seen = [0] * len(self._rates.drops)
        self._whole_until = self._next_gap()
        self._late_until = -math.inf
        self._cut = False
        self.lost_bytes = 0

    @property
    def carried_bytes(self) -> int:
        return self._line.carried_bytes

    def send(self, data: bytes, now: float) -> None:
        """Bytes into the wire, or what is left of them. Nothing in is nothing out, without noise too."""
        if not data:
            return
        if self._cut or any(start <= now < until for start, until in self._rates.silences):
            self.lost_bytes += len(data)
            return
        data = self._damage(self._sift(data))
        if self._rates.noise and self._random.random() < self._rates.noise:
            at = self._random.randrange(len(data) + 1)
            burst = self._random.randbytes(self._random.randint(1, self._rates.noise_bytes))
            data = data[:at] + burst + data[at:]
        if self._rates.delay and self._random.random() < self._rates.delay:
            now += self._random.random() * self._rates.delay_s
        self._late_until = max(self._late_until, now)
        self._line.send(data, self._late_until)

    def receive(self, now: float) -> bytes:
        return self._line.receive(now)

    def next_timer(self) -> float | None:
        return self._line.next_timer()

    def cut(self) -> None:
        """The plug is pulled: what is on its way is lost, and so is everything until `mend`."""
        self._cut = True
        self._held = b""
        self._late_until = -math.inf
        self._line.clear()

    def mend(self) -> None:
        self._cut = False

    def _next_gap(self) -> int:
        """How many bytes stay whole before the next fault; drawn once a fault, not once a byte."""
        chance = self._rates.loss + self._rates.flip + self._rates.duplicate
        if chance <= 0.0:
            return -1
        if chance >= 1.0:
            return 0
        return int(math.log(1.0 - self._random.random()) / math.log(1.0 - chance))

    def _damage(self, data: bytes) -> bytes:
        if self._whole_until < 0:
            return data
        out: list[bytes] = []
        at = 0
        while self._whole_until < len(data) - at:
            fault_at = at + self._whole_until
            out += (data[at:fault_at], self._spoil(data[fault_at]))
            at = fault_at + 1
            self._whole_until = self._next_gap()
        self._whole_until -= len(data) - at
        out.append(data[at:])
        return b"".join(out)

    def _spoil(self, byte: int) -> bytes:
        rates = self._rates
        kind = self._random.random() * (rates.loss + rates.flip + rates.duplicate)
        if kind < rates.loss:
            self.lost_bytes += 1
            return b""
        if kind < rates.loss + rates.flip:
            return bytes([byte ^ 1 << self._random.randrange(8)])
        return bytes([byte, byte])

    def _sift(self, data: bytes) -> bytes:
        """Takes out what `drops` names. Only with drops: half messages and headers wait for what belongs to them."""
        if not self._rates.drops:
            return data
        came = self._held + data
        whole = self._message.findall(came)
        self._held = came[sum(map(len, whole)) :]
        kept: list[bytes] = []
        header = b""
        for message in whole:
            if message.lstrip().startswith(b"CRC"):
                kept.append(header)
                header = message
                continue
            if not self._falls(message):
                kept += (header, message)
            header = b""
        self._held = header + self._held
        return b"".join(kept)

    def _falls(self, message: bytes) -> bool:
        falls = False
        for index, drop in enumerate(self._rates.drops):
            if drop.covers(message):
                self._seen[index] += 1
                nth = self._seen[index] - drop.first
                falls = falls or (nth >= 0 and (drop.count == 0 or nth < drop.count))
        if falls:
            self.lost_bytes += len(message)
        return falls
