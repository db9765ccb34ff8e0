"""The wire side of an engine: frames out, verified messages in, the recorder. Knows bytes and their time on the
line, nothing of what a message means.

The one rule: a frame is handed out whole, and frames of the realtime lane before all others.
"""

from collections import deque
from collections.abc import Iterator

from protocol.elvinto.codec import Decoder, Message, frame
from protocol.elvinto.dialect import Dialect
from protocol.engine import Frame
from protocol.events import ProtocolFault

BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit
RECORDED_FRAMES = 200
"""Frames kept for the job's events at a fault: some ten batches back, 100 KB at most."""


class Wire:
    """One connection's frames. `baud` 0 means that bytes take no time (a network port)."""

    def __init__(self, dialect: Dialect, baud: int) -> None:
        self._dialect = dialect
        self._baud = baud
        self._decoder = Decoder(dialect)
        self._urgent: list[bytes] = []
        self._queue: list[bytes] = []
        self._frames: deque[tuple[float, str, bytes]] = deque(maxlen=RECORDED_FRAMES)

    def send(self, message: bytes, id: int, *, urgent: bool = False) -> float:
        """Queue a frame; answers the seconds that its bytes take on the line."""
        data = frame(message, id, self._dialect)
        (self._urgent if urgent else self._queue).append(data)
        return self.seconds(len(data))

    def seconds(self, count_bytes: int) -> float:
        """How long so many bytes take at the line rate."""
        return count_bytes * BITS_PER_BYTE / self._baud if self._baud else 0.0

    def drop_unsent(self) -> None:
        """Forget frames that were not handed out yet."""
        self._queue.clear()

    def data_to_send(self, now: float) -> bytes:
        """Everything that is to go out, whole frames, the realtime lane first."""
        if not self._urgent and not self._queue:
            return b""
        frames = [*self._urgent, *self._queue]
        self._urgent.clear()
        self._queue.clear()
        self._frames.extend((now, ">", data) for data in frames)
        return b"".join(frames)

    def receive_data(self, data: bytes, now: float) -> Iterator[Message | ProtocolFault]:
        """The verified messages and the faults in `data`, as they come."""
        self._decoder.receive_data(data)
        while (item := self._decoder.next_item()) is not None:
            text = item.text if isinstance(item, Message) else f"!{item.kind}: {item.detail}"
            self._frames.append((now, "<", text.encode("utf-8", "replace")))
            yield item

    def recent_frames(self) -> tuple[Frame, ...]:
        """What the recorder holds, oldest first."""
        return tuple(Frame(*kept) for kept in self._frames)
