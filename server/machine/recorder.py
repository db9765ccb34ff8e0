"""What went over the wire, for people: the last messages (console), and a dump of the last frames at a fault.

Not the history (jobs/history.py) and not a log file. The one rule: it is bounded, in messages and in characters.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import Any

from protocol.engine import Frame
from server.clock import rfc3339

CONSOLE_MESSAGES = 1000
MESSAGE_CHARS = 1000
"""As many are shown. A batch is 512 bytes by default; of what a machine says each engine cuts the rest off itself."""
DUMPED_FRAMES = 200
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MICROSECOND = timedelta(microseconds=1)


class Recorder:
    """The console of one machine. Kept as it came, written out for whoever asks: mostly nobody does. `wall` is the time
    for people, `time` that of the loop, by which messages are kept: it costs a fifth."""

    def __init__(self, wall: Callable[[], datetime], time: Callable[[], float]) -> None:
        self._wall = wall
        self._time = time
        self._pieces: deque[Sequence[tuple[float, str, str]]] = deque()
        """As they were told: when, which way, what."""
        self._kept = 0

    def record(self, messages: Sequence[tuple[float, str, str]]) -> None:
        """Keep messages, which nobody changes any more (protocol.events.MessagesSeen)."""
        pieces = self._pieces
        pieces.append(messages)
        self._kept += len(messages)
        while self._kept - len(pieces[0]) >= CONSOLE_MESSAGES:
            self._kept -= len(pieces.popleft())

    def newest(self) -> dict[str, Any]:
        """The last message. Raises IndexError before there is one."""
        at, direction, text = self._pieces[-1][-1]
        wall = self._wall() - timedelta(seconds=self._time() - at)
        return {"at": rfc3339(wall), "direction": direction, "text": text[:MESSAGE_CHARS]}

    def console(self, limit: int) -> list[dict[str, Any]]:
        """The last messages, oldest first."""
        return list(self.each(limit))

    def each(self, limit: int) -> Iterator[dict[str, Any]]:
        """The same one by one, as they were at the first: a thousand take a millisecond."""
        stamp = self._stamps()
        kept = (message for messages in tuple(self._pieces) for message in messages)
        left_out = self._kept - min(max(0, limit), CONSOLE_MESSAGES)
        for at, direction, text in islice(kept, max(0, left_out), None):
            yield {"at": stamp(at), "direction": direction, "text": text[:MESSAGE_CHARS]}

    def _stamps(self) -> Callable[[float], str]:
        """From the loop's time to that of people. A thousand messages are of a few seconds: each second is written
        once, for made as a `datetime` the time of a message costs more than all the rest of it, and the loop waits."""
        begun_us = (self._wall() - EPOCH) // MICROSECOND - round(self._time() * 1e6)
        seconds: dict[int, str] = {}

        def stamp(at: float) -> str:
            second, us = divmod(begun_us + round(at * 1e6), 1_000_000)
            text = seconds.get(second)
            if text is None:
                text = seconds[second] = rfc3339(EPOCH + timedelta(seconds=second)).removesuffix("000Z")
            return f"{text}{us // 1000:03d}Z"

        return stamp


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
