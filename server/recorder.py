"""What went over the wire, for people: the last messages (console), and a dump of the last frames at a fault.

Not the history (jobs/history.py) and not a log file. The one rule: it is bounded, in messages and in characters.
"""

from collections import deque
from collections.abc import Callable, Iterable
from datetime import datetime, timedelta
from itertools import islice
from typing import Any

from protocol.engine import Frame
from server.hub import rfc3339

CONSOLE_MESSAGES = 1000
MESSAGE_CHARS = 1000
"""A batch is 512 bytes by default; what a machine says may be anything."""
DUMPED_FRAMES = 200


class Recorder:
    """The console of one machine. Kept as it came, written out for whoever asks: mostly nobody does. `wall` is the time
    for people, `time` that of the loop, by which messages are kept: it costs a fifth."""

    def __init__(self, wall: Callable[[], datetime], time: Callable[[], float]) -> None:
        self._wall = wall
        self._time = time
        self._messages: deque[tuple[float, str, str]] = deque(maxlen=CONSOLE_MESSAGES)

    def record(self, messages: Iterable[tuple[str, str]], now: float) -> None:
        """Keep messages (protocol.events.MessagesSeen)."""
        self._messages += [(now, direction, text[:MESSAGE_CHARS]) for direction, text in messages]

    def newest(self) -> dict[str, Any]:
        """The last message. Raises IndexError before there is one."""
        return self._entry(self._wall(), self._time(), self._messages[-1])

    def console(self, limit: int) -> list[dict[str, Any]]:
        """The last messages, oldest first."""
        messages = islice(self._messages, max(0, len(self._messages) - max(0, limit)), None)
        wall, now = self._wall(), self._time()
        return [self._entry(wall, now, message) for message in messages]

    def _entry(self, wall: datetime, now: float, message: tuple[float, str, str]) -> dict[str, Any]:
        at, direction, text = message
        return {"at": rfc3339(wall - timedelta(seconds=now - at)), "direction": direction, "text": text}


def dump(frames: Iterable[Frame], *, now: float) -> dict[str, Any]:
    """The last frames for the history: seconds before the fault, direction, text."""
    kept = list(frames)[-DUMPED_FRAMES:]
    return {
        "frames": [
            {"seconds_ago": round(now - frame.at, 4), "direction": frame.direction, "text": _text(frame.data)}
            for frame in kept
        ]
    }


def _text(data: bytes) -> str:
    return data[:MESSAGE_CHARS].decode("ascii", "backslashreplace")
