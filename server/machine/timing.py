"""How long the machine takes to acknowledge and to execute: samples for the metrics, the newest for the plots.

Not the estimate (gcode) and not a deadline (the engine has those). The one rule: what was sent more than once says
nothing about latency, for nobody knows which copy was answered.
"""

from protocol.events import BatchDone, BatchFailed, BatchReceived, BatchSent, Event
from server.metrics import MachineMetrics

MOST_IN_FLIGHT = 256
"""Batches whose beginning is remembered: more than any machine takes at once; the oldest go first."""


class AckTimer:
    """Watches the batches in flight: one with an ElVinto machine, several with a Grbl."""

    def __init__(self, metrics: MachineMetrics) -> None:
        self._metrics = metrics
        self._sent_at: dict[int, float] = {}
        self._ack_s: float | None = None
        self._batch_s: float | None = None

    def handle(self, event: Event, now: float) -> None:
        """An event of the engine, in the loop's time."""
        match event:
            case BatchSent(id=id, attempt=1):
                self._sent_at[id] = now
                if len(self._sent_at) > MOST_IN_FLIGHT:
                    del self._sent_at[next(iter(self._sent_at))]
            case BatchSent(id=id) | BatchFailed(id=id):
                self._sent_at.pop(id, None)
            case BatchReceived(id=id) if id in self._sent_at:
                self._ack_s = now - self._sent_at[id]
                self._metrics.ack_latency.observe(self._ack_s)
            case BatchDone(id=id, inferred=inferred):
                sent_at = self._sent_at.pop(id, None)
                if sent_at is not None and not inferred:
                    self._batch_s = now - sent_at
                    self._metrics.batch_seconds.observe(self._batch_s)
            case _:
                pass

    @property
    def in_flight(self) -> int:
        """Batches that were sent once and of which nothing final was heard."""
        return len(self._sent_at)

    def break_off(self) -> None:
        """The link is gone: what comes of the batches in flight is found out later, and says nothing about latency."""
        self._sent_at.clear()

    def view(self) -> dict[str, float | None]:
        """The newest of both, s; null before the first."""
        return {name: value and round(value, 4) for name, value in (("ack_s", self._ack_s), ("batch_s", self._batch_s))}
