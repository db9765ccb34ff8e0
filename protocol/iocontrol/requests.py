"""What is asked for: T and M6, the ones under way and those that wait their turn.

It moves no pin and emits nothing. The one rule: the list is bounded, for a T replaces a T that waits, and there is
never a second M6: at most T, M6, T.
"""

from dataclasses import dataclass

from protocol.iocontrol.events import Cause
from protocol.iocontrol.tooltable import Place


@dataclass(frozen=True, slots=True)
class Prepare:
    """A T word. `line` of the program, where there is one."""

    place: Place
    line: int | None


@dataclass(frozen=True, slots=True)
class Change:
    """An M6. `at_position`: the machine stands at the change position."""

    line: int | None
    at_position: bool


@dataclass(frozen=True, slots=True)
class Failure:
    """Why requests come to nothing. `goes_on`: the program does, so only the M6 and the T under way end."""

    cause: Cause
    message: str
    reason: int | None = None
    goes_on: bool = False


class Requests:
    """`preparing` and `change` are under way; `change` can be so for long, while T before it is being prepared."""

    def __init__(self) -> None:
        self.preparing: Prepare | None = None
        self.change: Change | None = None
        self._queue: list[Prepare | Change] = []

    def __bool__(self) -> bool:
        """Something is open."""
        return self.preparing is not None or self.change is not None or bool(self._queue)

    @property
    def change_open(self) -> bool:
        return self.change is not None or any(isinstance(request, Change) for request in self._queue)

    def add(self, request: Prepare | Change) -> Prepare | None:
        """It waits its turn. Returns the T that is not asked of the changer any more, since a later one came."""
        superseded = None
        if isinstance(request, Prepare) and self._queue and isinstance(last := self._queue[-1], Prepare):
            superseded = last
            del self._queue[-1]
        self._queue.append(request)
        return superseded

    def arrive(self) -> None:
        """The machine stands at the change position already when the turn of the M6 comes."""
        self._queue = [
            Change(request.line, True) if isinstance(request, Change) else request for request in self._queue
        ]

    def take(self) -> Prepare | Change | None:
        return self._queue.pop(0) if self._queue else None

    def end(self, *, goes_on: bool, keep_change: bool) -> list[Prepare | Change]:
        """Take out what comes to nothing, in order: all, or with `goes_on` nothing behind the M6."""
        requests: list[Prepare | Change] = [r for r in (self.preparing, self.change) if r is not None]
        requests += self._queue
        last = len(requests)
        if goes_on:
            first = 0 if self.preparing is None else 1
            last = next((at for at, r in enumerate(requests, start=1) if isinstance(r, Change)), first)
        kept = self.change if keep_change else None
        self.preparing, self.change = None, kept
        self._queue = requests[last:]
        return [request for request in requests[:last] if request is not kept]
