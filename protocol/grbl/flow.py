"""The way of nearly every line and every ok, each in one piece: a plain line in the middle of a batch.

Nothing is decided here that `traffic.py` does not decide as well, call by call; what a Grbl answers 800 times a second
is what the processor's time goes into. The one rule: where anything is not as it nearly always is, nothing is done and
the long way is taken; a test goes both ways side by side.
"""

from math import inf
from typing import Final

from protocol.events import Status
from protocol.grbl.phases import CLOSED, READY
from protocol.grbl.traffic import Traffic

FLOWING: Final[frozenset[Status | None]] = frozenset({"run", "idle"})
"""States that shut no gate, and in which an ok proves nothing by itself."""


class Flow(Traffic):
    """The short way through `Traffic`, and the verb that nearly always goes it."""

    def _plain_ok(self, now: float) -> bool:
        """`_answered` for the ok of a plain line of a batch that is not its last one; what it proves is told when
        somebody asks (`_executed`). False: nothing was done."""
        window, least_mm = self._window, self._blocks.least_mm
        entries = window.entries
        if not entries or self._phase is not READY or self._by_hand is not None or self._status not in FLOWING:
            return False
        errand, index, line = entries[0]
        reach_mm = errand.reach_mm
        if not line.plain or errand.failed or not reach_mm or index + 1 == len(reach_mm) or least_mm == inf:
            return False
        entries.popleft()
        window.used_bytes -= len(line.data)
        errand.answered += 1
        self._flowing = errand
        self._poll.quiet_since = self._progress_at = now
        self._seen.append((now, "<", "ok"))
        return True

    def data_to_send(self, now: float) -> bytes:
        """What is to go out now: the real-time lane, then lines as the window has room. Everything is taken at once:
        there is no more before something comes in, is submitted, or is due.

        In one piece: of the batch that went last the next lines, as long as they are plain and there is room. Every
        gate is looked at, and where more is to be done `_write` does it."""
        if self._quiet:
            return b""
        self._quiet = True
        window = self._window
        entries = window.entries
        if (
            not entries
            or self._phase is not READY
            or self._status not in FLOWING
            or not self._lane.idle
            or self._hand
            or self._by_hand is not None
            or self._held_at is not None
            or self._refused
            or self._pendant
            or self._jogging
            or self._card.running
            or window.one_by_one
        ):
            return b"" if self._phase is CLOSED else self._write(now)
        errand, _, line = entries[-1]
        if not line.plain or errand.failed:
            return self._write(now)
        lines, index, used = errand.lines, errand.sent, window.used_bytes
        out, end = b"", len(lines)
        while index < end and (line := lines[index]).plain:
            data = line.data
            used += len(data)
            if used > window.capacity:
                return out
            entries.append((errand, index, line))
            index += 1
            errand.sent, window.used_bytes = index, used
            self._seen.append((now, ">", line.text))
            out = out + data if out else data
        return out + self._write(now)
