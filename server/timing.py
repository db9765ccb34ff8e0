"""How long the machine takes to acknowledge and to execute: samples for the metrics.

Not the estimate (gcode) and not a deadline (the engine has those). The one rule: what was sent more than once says
nothing about latency, for nobody knows which copy was answered.
"""

from protocol.events import BatchDone, BatchReceived, BatchSent, Event
from server.metrics import MachineMetrics


class AckTimer:
    """Watches the one batch in flight."""

    def __init__(self, metrics: MachineMetrics) -> None:
        self._metrics = metrics
        self._id: int | None = None
        self._sent_at = 0.0
        self._repeated = False

    def handle(self, event: Event, now: float) -> None:
        """An event of the engine, in the loop's time."""
        match event:
            case BatchSent(id=id, attempt=1):
                self._id, self._sent_at, self._repeated = id, now, False
            case BatchSent():
                self._repeated = True
            case BatchReceived(id=id) if id == self._id and not self._repeated:
                self._metrics.ack_latency.observe(now - self._sent_at)
            case BatchDone(id=id, inferred=False) if id == self._id and not self._repeated:
                self._metrics.batch_seconds.observe(now - self._sent_at)
            case _:
                pass
