"""What went over the wire, for people: the last messages (console), and a dump of the last frames at a fault.

Not the history (jobs/history.py) and not a log file. The one rule: it is bounded, in messages and in characters.
"""

from collections import deque
from collections.abc import Iterable
from typing import Any

from protocol.engine import Frame
from protocol.events import MessageSeen

CONSOLE_MESSAGES = 1000
MESSAGE_CHARS = 1000
"""A batch is 512 bytes by default; what a machine says may be anything."""
DUMPED_FRAMES = 200


class Recorder:
    """The console of one machine."""

    def __init__(self) -> None:
        self._messages: deque[dict[str, Any]] = deque(maxlen=CONSOLE_MESSAGES)

    def record(self, message: MessageSeen, at: str) -> dict[str, Any]:
        """Keep a message; the entry as it is shown."""
        entry = {"at": at, "direction": message.direction, "text": message.text[:MESSAGE_CHARS]}
        self._messages.append(entry)
        return entry

    def console(self, limit: int) -> list[dict[str, Any]]:
        """The last messages, oldest first."""
        if limit <= 0:
            return []
        return list(self._messages)[-limit:]


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
