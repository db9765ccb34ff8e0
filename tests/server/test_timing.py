"""Latency samples: only of what was sent once and answered by the machine itself."""

from protocol.events import BatchDone, BatchReceived, BatchSent
from server.metrics import MachineMetrics
from server.timing import AckTimer


def test_acknowledgement_and_run_time_are_counted() -> None:
    metrics = MachineMetrics()
    timer = AckTimer(metrics)
    timer.handle(BatchSent(1, 1), 10.0)
    timer.handle(BatchReceived(1), 10.5)
    timer.handle(BatchDone(1), 12.0)
    assert (metrics.ack_latency.count, metrics.ack_latency.total) == (1, 0.5)
    assert (metrics.batch_seconds.count, metrics.batch_seconds.total) == (1, 2.0)


def test_what_was_repeated_or_inferred_or_belongs_to_another_says_nothing() -> None:
    metrics = MachineMetrics()
    timer = AckTimer(metrics)
    timer.handle(BatchSent(1, 1), 10.0)
    timer.handle(BatchSent(1, 2), 10.3)
    timer.handle(BatchReceived(1), 10.4)
    timer.handle(BatchDone(1), 11.0)
    timer.handle(BatchSent(2, 1), 12.0)
    timer.handle(BatchReceived(1), 12.1)
    timer.handle(BatchDone(2, inferred=True), 13.0)
    assert (metrics.ack_latency.count, metrics.batch_seconds.count) == (0, 0)
