"""What went over the wire, for people: the last messages (console), and a dump of the last frames at a fault.

Not the history (jobs/history.py) and not a log file. The one rule: it is bounded, in messages and in characters.
"""

from collections import deque
from collections.abc import Iterable
from datetime import datetime
from itertools import islice
from typing import Any

from protocol.engine import Frame
from server.hub import rfc3339

CONSOLE_MESSAGES = 1000
MESSAGE_CHARS = 1000
"""A batch is 512 bytes by default; what a machine says may be anything."""
DUMPED_FRAMES = 200


class Recorder:
    """The console of one machine. Kept as it came, written out for whoever asks: mostly nobody does."""

    def __init__(self) -> None:
        self._messages: deque[tuple[datetime, str, str]] = deque(maxlen=CONSOLE_MESSAGES)

    def record(self, direction: str, text: str, at: datetime) -> None:
        """Keep a message (protocol.events.MessageSeen)."""
        self._messages.append((at, direction, text[:MESSAGE_CHARS]))

    def newest(self) -> dict[str, Any]:
        """The last message. Raises IndexError before there is one."""
        return _entry(*self._messages[-1])

    def console(self, limit: int) -> list[dict[str, Any]]:
        """The last messages, oldest first."""
        messages = islice(self._messages, max(0, len(self._messages) - max(0, limit)), None)
        return [_entry(*message) for message in messages]


def _entry(at: datetime, direction: str, text: str) -> dict[str, Any]:
    return {"at": rfc3339(at), "direction": direction, "text": text}


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
