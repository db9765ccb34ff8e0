"""What waits for a broker: of each topic the newest, and what must not be left out, in order, up to a limit. Pure.

Not the connection (mqtt.py). The one rule: it never grows beyond the topics and the limit; what it drops it counts.
"""

from collections import deque

from server.outbound.mqtttopics import Post
from server.waysout import WayOut


class Outbox:
    """`limit` bounds the messages that are kept one by one."""

    def __init__(self, limit: int, counted: WayOut) -> None:
        self._limit = limit
        self._counted = counted
        self._kept: deque[Post] = deque()
        self._newest: dict[str, Post] = {}

    def put(self, post: Post) -> None:
        """A message. One that is kept makes an older unsent one of its topic, that need not be, superfluous."""
        if not post.kept:
            self._newest[post.topic] = post
        else:
            self._newest.pop(post.topic, None)
            self._kept.append(post)
            if len(self._kept) > self._limit:
                self._kept.popleft()
                self._counted.dropped += 1
        self._count()

    def take(self) -> Post | None:
        """The next one to send: those that are kept first. It is with the caller now."""
        if self._kept:
            post = self._kept.popleft()
        elif self._newest:
            post = self._newest.pop(next(iter(self._newest)))
        else:
            return None
        self._count()
        return post

    def give_back(self, post: Post) -> None:
        """It could not be sent, or nobody knows: the next time, unless there is a newer one."""
        if not post.kept:
            later = any(kept.topic == post.topic for kept in self._kept)
            if not later:
                self._newest.setdefault(post.topic, post)
        elif len(self._kept) >= self._limit:
            self._counted.dropped += 1
        else:
            self._kept.appendleft(post)
        self._count()

    def _count(self) -> None:
        self._counted.waiting = len(self._kept) + len(self._newest)
