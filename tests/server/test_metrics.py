from hypothesis import given
from hypothesis import strategies as st
from prometheus_client.parser import text_string_to_metric_families

from server.live.hub import Hub
from server.live.subscription import Filter
from server.metrics import BATCH_BUCKETS_S, Histogram, MachineMetrics, exposition
from tests.harness.fakeworkshop import FakeMachine
from tests.harness.simloop import run_simulated as run


def samples(machines: dict[str, FakeMachine], hub: Hub, jobs: dict[str, int]) -> dict[tuple[str, str], float]:
    """(name, labels) → value of everything that a scrape gives."""
    text = exposition(machines, hub, jobs).decode()
    return {
        (sample.name, ",".join(f"{key}={value}" for key, value in sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_everything_that_is_counted_is_exposed() -> None:
    async def main() -> None:
        machine, hub = FakeMachine("router"), Hub(first_seq=0)
        counted = machine.metrics
        counted.link_errors.update({"checksum": 3, "lost": 1})
        counted.retries, counted.connects, counted.batches, counted.blocks, counted.inferred = 2, 4, 5, 60, 1
        counted.ack_latency.observe(0.015)
        counted.batch_seconds.observe(0.7)
        counted.pace_factor, counted.seconds_left = 1.25, lambda: 90.5
        reader = hub.subscribe(Filter())
        hub.publish("job", "router", {})
        gone = hub.subscribe(Filter())
        gone.left_out = 3
        gone.cut("slow")
        hub.unsubscribe(gone)
        found = samples({"router": machine}, hub, {"running": 1, "completed": 4})
        expected = {
            ("millstream_link_errors_total", "kind=checksum,machine=router"): 3,
            ("millstream_link_errors_total", "kind=lost,machine=router"): 1,
            ("millstream_link_retries_total", "machine=router"): 2,
            ("millstream_link_connects_total", "machine=router"): 4,
            ("millstream_batches_total", "machine=router"): 5,
            ("millstream_blocks_total", "machine=router"): 60,
            ("millstream_batches_inferred_total", "machine=router"): 1,
            ("millstream_ack_latency_seconds_bucket", "le=0.01,machine=router"): 0,
            ("millstream_ack_latency_seconds_bucket", "le=0.02,machine=router"): 1,
            ("millstream_ack_latency_seconds_count", "machine=router"): 1,
            ("millstream_batch_seconds_bucket", "le=1.0,machine=router"): 1,
            ("millstream_batch_seconds_sum", "machine=router"): 0.7,
            ("millstream_connected", "machine=router"): 1,
            ("millstream_queue_length", "machine=router"): 2,
            ("millstream_pace_factor", "machine=router"): 1.25,
            ("millstream_job_seconds_left", "machine=router"): 90.5,
            ("millstream_jobs", "status=running"): 1,
            ("millstream_jobs", "status=completed"): 4,
            ("millstream_events_total", "type=job"): 1,
            ("millstream_websocket_clients", ""): 1,
            ("millstream_websocket_clients_dropped_total", ""): 1,
            ("millstream_console_lines_left_out_total", ""): 3,
        }
        assert {key: found.get(key) for key in expected} == expected
        hub.unsubscribe(reader)

    run(main())


def test_each_scrape_stands_alone() -> None:
    machine, hub = FakeMachine("router"), Hub(first_seq=0)
    assert exposition({"router": machine}, hub, {}) == exposition({"router": machine}, hub, {})


@given(st.lists(st.floats(0, 1000)))
def test_a_histogram_counts_every_sample_once(values: list[float]) -> None:
    histogram = Histogram(BATCH_BUCKETS_S)
    for value in values:
        histogram.observe(value)
    buckets = dict(histogram.cumulative())
    assert buckets["+Inf"] == histogram.count == len(values)
    assert all(buckets[str(bound)] == sum(value <= bound for value in values) for bound in BATCH_BUCKETS_S)


def test_nothing_is_shared_between_machines() -> None:
    one, other = MachineMetrics(), MachineMetrics()
    one.link_errors["checksum"] += 1
    one.ack_latency.observe(1)
    assert not other.link_errors
    assert other.ack_latency.count == 0
