"""Sequence numbers of commands (elvinto §5): which comes next, and what is proven of the machine's memory of them.

The header that carries the ID is covered by no checksum. So a digit may flip on the wire: upwards, and the machine
remembers an ID that was never given; downwards, and it refuses the command, *if* its memory is the ID just before.
The one rule: whoever sends something that must not run twice asks `proven` first.
"""

from collections.abc import Sequence

FIRST_ID = 1000
"""IDs of commands start here, so that the probes' IDs stay below them even with a digit doubled on the wire."""
LAST_PROBE_ID = 99
HIGHEST_ID = 2_000_000_000
"""A machine may keep the ID in 32 bits, signed."""
TRIES_BEFORE_LEAP = 3
"""Queries of one kind under the next IDs; if none is accepted, the memory may hold a higher ID: leap a digit. A digit
doubled on the wire makes two leaps needed; both fit into the tries of a query."""


def came_of(heard: int, given: Sequence[int]) -> bool:
    """Whether an ID that nobody gave came of the first of `given` by one digit that was changed, added or lost, and of
    none of the others: those are questions, which may be executed as often as they like."""
    return _one_digit(str(heard), str(given[0])) and not any(_one_digit(str(heard), str(id)) for id in given[1:])


def _one_digit(heard: str, given: str) -> bool:
    long, short = max(heard, given, key=len), min(given, heard, key=len)
    if len(long) == len(short):
        return sum(a != b for a, b in zip(long, short, strict=True)) == 1
    return any(long[:at] + long[at + 1 :] == short for at in range(len(long)))


class Ids:
    """`next`: the ID of the next command. `proven`: the machine remembers exactly the ID before it."""

    def __init__(self, first_id: int) -> None:
        self._next = max(first_id, FIRST_ID)
        self._memory: int | None = None
        self._probe = 0

    @property
    def next(self) -> int:
        return self._next

    @property
    def memory(self) -> int | None:
        """The ID that the machine remembers, where that is proven."""
        return self._memory

    @property
    def proven(self) -> bool:
        return self._memory == self._next - 1

    def take(self, in_vain: int = 0) -> int:
        """The next ID; `in_vain` is how often the same question was not executed, as far as one can tell."""
        if in_vain and in_vain % TRIES_BEFORE_LEAP == 0:
            leap = 10 ** len(str(self._next))
            self._next = leap if leap <= HIGHEST_ID else self._next
        self._next += 1
        return self._next - 1

    def probe(self) -> int:
        """An ID that only a machine without memory accepts, a higher one each time."""
        self._probe = self._probe % LAST_PROBE_ID + 1
        return self._probe

    def given(self, id: int) -> bool:
        """Whether a command or probe may have gone out under this ID."""
        return id < self._next

    def prove(self, id: int) -> None:
        """The machine executed the command `id`, and it was the last one sent."""
        self._memory = id

    def doubt(self) -> None:
        """The machine may remember any ID."""
        self._memory = None

    def rise_above(self, id: int) -> None:
        """The machine acknowledged an ID that was never given: its memory is at least that."""
        self._next = max(self._next, min(id + 1, HIGHEST_ID))
        self._memory = None
