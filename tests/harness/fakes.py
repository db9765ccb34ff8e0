"""Small stand-ins for the neighbours of a part under test: batches, a source of them, an engine that does as told.

Not the virtual machine (sim/) and not the real planner. The one rule: they do nothing by themselves.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any

from jobs.batch import PlannedBatch
from protocol.commands import Command, Position, RealtimeCommand
from protocol.engine import Frame
from protocol.errors import LocalError
from protocol.events import Event


def batch(line: int, count: int = 2, **changes: Any) -> PlannedBatch:
    """Lines `line` to `line + count - 1`, which end at x = the last line."""
    last = line + count - 1
    fields: dict[str, Any] = {
        "first_line": line,
        "last_line": last,
        "blocks": tuple(f"X{number}" for number in range(line, last + 1)),
        "seconds": 0.5,
        "start": {"x": float(line - 1)},
        "end": {"x": float(last)},
        "barrier": False,
        "locate_after": False,
        "ends_program": False,
        "tool": None,
        "motion": True,
    }
    return PlannedBatch(**(fields | changes))


class ListSource:
    """Yields batches, or raises the exceptions that stand among them."""

    def __init__(self, items: Sequence[PlannedBatch | Exception]) -> None:
        self._items = deque(items)
        self.relocated: list[Position] = []
        self.reading = False
        self.forgotten = 0

    def next(self, *, aside: bool = False) -> PlannedBatch | None:
        if not self._items:
            return None
        item = self._items.popleft()
        if isinstance(item, Exception):
            raise item
        return item

    def read(self) -> None:
        self.reading = False

    def forget(self) -> None:
        self.forgotten += 1

    def relocate(self, position: Position) -> None:
        self.relocated.append(dict(position))


class ScriptedEngine:
    """Takes commands one at a time; the test says what happens to them."""

    def __init__(self, first_id: int = 1000) -> None:
        self.next_id = first_id
        self.taken: list[Command] = []
        self.urgent: list[RealtimeCommand] = []
        self.heard: list[bytes] = []
        self.events: deque[Event] = deque()
        self.outgoing = bytearray()
        self.due_at: float | None = None
        self.ticks: list[float] = []
        self.is_free = True
        self.news = True

    def receive_data(self, data: bytes, now: float) -> None:
        self.heard.append(data)

    def data_to_send(self, now: float) -> bytes:
        data, self.outgoing = bytes(self.outgoing), bytearray()
        return data

    def next_event(self) -> Event | None:
        return self.events.popleft() if self.events else None

    def next_timer(self) -> float | None:
        return self.due_at

    def handle_timer(self, now: float) -> None:
        self.ticks.append(now)
        self.due_at = None

    def submit(self, command: Command, now: float) -> None:
        if not self.is_free:
            raise LocalError("not free")
        self.taken.append(command)
        self.is_free = False
        self.next_id += 1
        self.outgoing += b"command;"

    def realtime(self, command: RealtimeCommand, now: float) -> None:
        self.urgent.append(command)
        self.outgoing += b"urgent;"

    def free(self) -> int:
        return int(self.is_free)

    def recent_frames(self) -> tuple[Frame, ...]:
        return ()
