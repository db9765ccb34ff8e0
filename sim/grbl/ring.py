"""The receive ring: bytes that fit are kept in order, bytes that do not are lost without a word (grbl II.1).

The one rule: nothing here knows about lines; that a lost byte glues two lines together is the sender's trouble.
"""

from collections import deque


class RxRing:
    """`capacity` bytes; what was lost and the most that ever waited are counted."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.dropped_bytes = 0
        self.overflows = 0
        """How often it ran over: bytes lost in a row count once."""
        self.most_bytes = 0
        self._bytes: deque[int] = deque()
        self._over = False

    def __len__(self) -> int:
        return len(self._bytes)

    @property
    def free(self) -> int:
        return self.capacity - len(self._bytes)

    def put(self, data: bytes) -> int:
        """Takes what fits and says how many bytes that were. The rest is still the caller's: see `drop`."""
        taken = min(len(data), self.free)
        if taken:
            self._bytes.extend(data[:taken])
            self._over = False
            self.most_bytes = max(self.most_bytes, len(self._bytes))
        return taken

    def drop(self, count: int) -> None:
        """So many bytes came while it was full."""
        self.dropped_bytes += count
        self.overflows += not self._over
        self._over = True

    def read(self) -> int | None:
        return self._bytes.popleft() if self._bytes else None

    def clear(self) -> None:
        self._bytes.clear()
        self._over = False
