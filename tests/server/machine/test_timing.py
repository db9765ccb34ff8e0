"""Latency samples: only of what was sent once and answered by the machine itself."""

from protocol.events import BatchDone, BatchFailed, BatchReceived, BatchSent
from server.machine.timing import MOST_IN_FLIGHT, AckTimer
from server.metrics import MachineMetrics


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


def test_each_of_several_batches_in_flight_is_timed() -> None:
    metrics = MachineMetrics()
    timer = AckTimer(metrics)
    assert timer.view() == {"ack_s": None, "batch_s": None}
    for id in (1, 2, 3):
        timer.handle(BatchSent(id, 1), 10.0 + id)
    for id in (1, 2, 3):
        timer.handle(BatchReceived(id), 15.0)
    timer.handle(BatchDone(1), 16.25)
    assert (metrics.ack_latency.count, metrics.ack_latency.total) == (3, 4.0 + 3.0 + 2.0)
    assert timer.view() == {"ack_s": 2.0, "batch_s": 5.25}


def test_what_failed_or_was_in_flight_at_a_break_is_forgotten() -> None:
    metrics = MachineMetrics()
    timer = AckTimer(metrics)
    for id in (1, 2, 3):
        timer.handle(BatchSent(id, 1), 10.0)
    timer.handle(BatchFailed(1, "stop", None, "stopped by hand"), 11.0)
    assert timer.in_flight == 2
    timer.break_off()
    assert timer.in_flight == 0
    for id in (1, 2, 3):
        timer.handle(BatchReceived(id), 70.0)
        timer.handle(BatchDone(id), 71.0)
    assert (metrics.ack_latency.count, metrics.batch_seconds.count) == (0, 0)


def test_not_more_are_remembered_than_any_machine_takes() -> None:
    metrics = MachineMetrics()
    timer = AckTimer(metrics)
    for id in range(MOST_IN_FLIGHT + 1):
        timer.handle(BatchSent(id, 1), 0.0)
    for id in range(MOST_IN_FLIGHT + 1):
        timer.handle(BatchDone(id), 1.0)
    assert metrics.batch_seconds.count == MOST_IN_FLIGHT
