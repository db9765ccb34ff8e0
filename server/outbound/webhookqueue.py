"""What waits for one address: in order, with back-off, bounded in number and age, and as text for a file. Pure.

Not the sending (webhook.py). The one rule: a message leaves it delivered or counted as dropped, never otherwise.
"""

import json
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from server.jsontext import dumps
from server.waysout import WayOut

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 600.0


@dataclass(frozen=True, slots=True)
class Waiting:
    """A message. `since_s`: when it was made, seconds of the clock for people."""

    id: str
    body: str
    since_s: float


class Queue:
    """See the head of this file. Times are seconds of the clock for people, but `due_at` is the loop's."""

    def __init__(self, *, limit: int, give_up_after_s: float, counted: WayOut) -> None:
        self._limit = limit
        self._give_up_after_s = give_up_after_s
        self._counted = counted
        self._waiting: deque[Waiting] = deque()
        self._failed = 0
        self.due_at = 0.0
        self.changed = False
        """Whether it is not as it was when it was last written down."""

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, message: Waiting) -> None:
        """The newest. Where there are too many the oldest goes."""
        self._waiting.append(message)
        self._counted.waiting += 1
        self.changed = True
        if len(self._waiting) > self._limit:
            self._drop()

    def head(self, now_s: float) -> Waiting | None:
        """What is to be sent next; those that are too old are dropped on the way."""
        while self._waiting and now_s - self._waiting[0].since_s > self._give_up_after_s:
            self._drop()
        return self._waiting[0] if self._waiting else None

    def delivered(self, message: Waiting) -> None:
        """It has arrived."""
        self._counted.sent += 1
        self._failed = 0
        self.due_at = 0.0
        self._remove(message)

    def failed(self, now: float) -> float:
        """The attempt did not succeed; seconds until the next one."""
        wait_s = min(FIRST_WAIT_S * 2.0**self._failed, LONGEST_WAIT_S)
        self._failed = min(self._failed + 1, 32)
        self._counted.failures += 1
        self.due_at = now + wait_s
        return wait_s

    def refused(self, message: Waiting) -> None:
        """Nobody wants it, now or ever."""
        self._counted.failures += 1
        self._counted.dropped += 1
        self._remove(message)

    def _remove(self, message: Waiting) -> None:
        if self._waiting and self._waiting[0] is message:  # it may have been dropped meanwhile
            self._waiting.popleft()
            self._counted.waiting -= 1
            self.changed = True

    def _drop(self) -> None:
        self._waiting.popleft()
        self._counted.waiting -= 1
        self._counted.dropped += 1
        self.changed = True

    # --- over a restart ---------------------------------------------------------------------------------------

    def snapshot(self) -> tuple[Waiting, ...]:
        """What waits."""
        return tuple(self._waiting)

    def restore(self, before: Sequence[Waiting]) -> None:
        """What waited in the daemon before, ahead of what is new. Where there are too many the oldest go."""
        room = self._limit - len(self._waiting)
        kept = before[-room:] if room > 0 else ()
        self._waiting.extendleft(reversed(kept))
        self._counted.waiting += len(kept)
        self._counted.dropped += len(before) - len(kept)


def text_of(messages: Iterable[Waiting]) -> str:
    """For a file."""
    return dumps([{"id": one.id, "body": one.body, "since_s": one.since_s} for one in messages])


def messages_of(text: str) -> list[Waiting]:
    """Of a file. Raises ValueError when it is none of ours."""
    read = json.loads(text)
    if not isinstance(read, list):
        raise ValueError("not a list")
    return [_message(one) for one in read]


def _message(one: object) -> Waiting:
    match one:
        case {"id": str(name), "body": str(body), "since_s": float() | int() as since_s}:
            return Waiting(name, body, float(since_s))
        case _:
            raise ValueError("not a message")
