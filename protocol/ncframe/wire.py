"""The wire side of an engine: bytes out, the recorder, the time of bytes on the line. Knows nothing of their meaning.

The one rule: CAN goes out before everything else, and what has not gone out yet does not go out behind it.
"""

from collections import deque

from protocol.engine import Frame as Recorded

BITS_PER_BYTE = 10
"""A start bit, eight data bits, a stop bit: frames are binary, so seven bits or XON/XOFF in the driver spoil them."""
RECORDED = 400
"""Frames and answers kept for the job's events at a fault: the last hundred frames with their answers, 10 KB."""


class Wire:
    """One connection. `baud` 0 means that bytes take no time (a network port)."""

    def __init__(self, baud: int) -> None:
        self._baud = baud
        self._queue: list[bytes] = []
        self._recorded: deque[Recorded] = deque(maxlen=RECORDED)

    def send(self, data: bytes) -> float:
        """Queue bytes; answers the seconds that they take on the line."""
        self._queue.append(data)
        return self.seconds(len(data))

    def send_alone(self, data: bytes) -> None:
        """Instead of everything that has not gone out."""
        self._queue = [data]

    def seconds(self, count_bytes: int) -> float:
        """How long so many bytes take at the line rate."""
        return count_bytes * BITS_PER_BYTE / self._baud if self._baud else 0.0

    @property
    def pending(self) -> bool:
        """Something has not been handed out yet."""
        return bool(self._queue)

    def data_to_send(self, now: float) -> bytes:
        """Everything that is to go out."""
        if not self._queue:
            return b""
        self._recorded.extend(Recorded(now, ">", data) for data in self._queue)
        data = b"".join(self._queue)
        self._queue.clear()
        return data

    def heard(self, data: bytes, now: float) -> None:
        """Bytes that came in, for the recorder."""
        self._recorded.append(Recorded(now, "<", data))

    def recent_frames(self) -> tuple[Recorded, ...]:
        """What the recorder holds, oldest first."""
        return tuple(self._recorded)
