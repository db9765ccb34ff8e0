"""What Prometheus can ask: plain counters where things happen, read when somebody scrapes.

Not a monitoring system and not the state of a machine (`/api/v1/machines`). The one rule: counting costs an addition,
never a lock, a label look-up or a wait; the names of metrics are put together here alone.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector as Base

from server.live.hub import Hub
from server.waysout import Counters, WayOut

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"

ACK_LATENCY_BUCKETS_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0)
"""0.2 to 0.4 s is where the standard's retransmission begins (elvinto §5): the buckets are fine below it."""
BATCH_BUCKETS_S = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)


class Histogram:
    """Counts of samples by upper bound, in seconds."""

    def __init__(self, bounds: Sequence[float]) -> None:
        self._bounds = tuple(bounds)
        self._counts = [0] * (len(self._bounds) + 1)
        self.total = 0.0

    def observe(self, value_s: float) -> None:
        """One sample."""
        self._counts[bisect_left(self._bounds, value_s)] += 1
        self.total += value_s

    @property
    def count(self) -> int:
        """How many samples there were."""
        return sum(self._counts)

    def cumulative(self) -> list[tuple[str, float]]:
        """Upper bound and how many samples are not above it, as Prometheus wants them."""
        running = 0
        buckets = []
        for bound, count in zip((*map(str, self._bounds), "+Inf"), self._counts, strict=True):
            running += count
            buckets.append((bound, float(running)))
        return buckets


class MachineMetrics:
    """What a machine's controller counts."""

    def __init__(self) -> None:
        self.link_errors: Counter[str] = Counter()
        """By kind: `protocol.events.ProtocolFault.kind`, and `lost` for each broken epoch."""
        self.retries = 0
        self.connects = 0
        self.batches = 0
        self.blocks = 0
        self.inferred = 0
        self.pace_factor = 1.0
        """What planned seconds are multiplied with, by the runs so far."""
        self.seconds_left: Callable[[], float | None] = lambda: None
        """Of the job under way; None without one, and while it is not known."""
        self.ack_latency = Histogram(ACK_LATENCY_BUCKETS_S)
        """First byte handed to the wire → RECEIVED."""
        self.batch_seconds = Histogram(BATCH_BUCKETS_S)
        """First byte handed to the wire → OK."""


@dataclass(frozen=True, slots=True)
class Refused:
    """What the doors have turned away since the daemon began, by the code or the limit that stood against it, and the
    rows of the audit that could not be kept."""

    tokens: Mapping[str, int] = field(default_factory=dict)
    sockets: Mapping[str, int] = field(default_factory=dict)
    audit_lost: int = 0


class CountedMachine(Protocol):
    """What is read of a machine."""

    @property
    def metrics(self) -> MachineMetrics: ...
    def view(self) -> dict[str, Any]: ...


class Collector(Base):
    """Reads the counters when Prometheus comes."""

    def __init__(
        self,
        machines: Mapping[str, CountedMachine],
        hub: Hub,
        jobs_by_status: Mapping[str, int],
        outbound: Counters,
        refused: Refused,
    ) -> None:
        self._machines = machines
        self._hub = hub
        self._jobs_by_status = jobs_by_status
        self._outbound = outbound
        self._refused = refused

    def collect(self) -> Iterator[Metric]:
        """The families, for prometheus-client."""
        yield from self._link()
        yield from self._batches()
        yield from self._gauges()
        yield from self._fan_out()
        yield from self._doors()
        yield from self._ways_out()

    def _link(self) -> Iterator[Metric]:
        errors = CounterMetricFamily(
            "millstream_link_errors", "What went wrong on the wire.", labels=("machine", "kind")
        )
        for name, machine in self._machines.items():
            for kind, count in sorted(machine.metrics.link_errors.items()):
                errors.add_metric((name, kind), count)
        yield errors
        yield self._counter("link_retries", "Messages sent again.", lambda counted: counted.retries)
        yield self._counter("link_connects", "Connections that became ready.", lambda counted: counted.connects)

    def _batches(self) -> Iterator[Metric]:
        yield self._counter("batches", "Batches executed.", lambda counted: counted.batches)
        yield self._counter("blocks", "Blocks of G-code executed.", lambda counted: counted.blocks)
        yield self._counter(
            "batches_inferred", "Batches whose end was concluded from other evidence.", lambda counted: counted.inferred
        )
        yield self._histogram("ack_latency_seconds", "Sent until RECEIVED.", lambda counted: counted.ack_latency)
        yield self._histogram("batch_seconds", "Sent until OK.", lambda counted: counted.batch_seconds)

    def _gauges(self) -> Iterator[Metric]:
        connected = GaugeMetricFamily("millstream_connected", "1 while the link is connected.", labels=("machine",))
        queue = GaugeMetricFamily("millstream_queue_length", "Jobs that wait.", labels=("machine",))
        for name, machine in self._machines.items():
            view = machine.view()
            connected.add_metric((name,), float(view["link"] == "connected"))
            queue.add_metric((name,), view["queue_length"])
        pace = GaugeMetricFamily("millstream_pace_factor", "Seconds taken by planned seconds.", labels=("machine",))
        left = GaugeMetricFamily("millstream_job_seconds_left", "Until the job will be done.", labels=("machine",))
        for name, machine in self._machines.items():
            pace.add_metric((name,), machine.metrics.pace_factor)
            seconds = machine.metrics.seconds_left()
            if seconds is not None:
                left.add_metric((name,), seconds)
        jobs = GaugeMetricFamily("millstream_jobs", "Jobs by status.", labels=("status",))
        for status, count in sorted(self._jobs_by_status.items()):
            jobs.add_metric((status,), count)
        yield from (connected, queue, pace, left, jobs)

    def _fan_out(self) -> Iterator[Metric]:
        events = CounterMetricFamily("millstream_events", "Events announced.", labels=("type",))
        for type_, count in sorted(self._hub.published.items()):
            events.add_metric((type_,), count)
        yield events
        yield GaugeMetricFamily("millstream_websocket_clients", "WebSocket readers connected.", self._hub.readers)
        yield CounterMetricFamily(
            "millstream_websocket_clients_dropped",
            "WebSocket readers cut because they did not read.",
            self._hub.cut_readers,
        )
        yield CounterMetricFamily(
            "millstream_console_lines_left_out",
            "Console lines that WebSocket readers did not get.",
            self._hub.console_left_out,
        )

    def _doors(self) -> Iterator[Metric]:
        tokens = CounterMetricFamily("millstream_tokens_refused", "Tokens that were not good.", labels=("code",))
        for code, count in sorted(self._refused.tokens.items()):
            tokens.add_metric((code,), count)
        sockets = CounterMetricFamily(
            "millstream_websocket_clients_refused", "WebSockets beyond a limit.", labels=("limit",)
        )
        for limit, count in sorted(self._refused.sockets.items()):
            sockets.add_metric((limit,), count)
        lost = CounterMetricFamily(
            "millstream_audit_rows_lost", "Rows of the audit that could not be kept.", self._refused.audit_lost
        )
        yield from (tokens, sockets, lost)

    def _ways_out(self) -> Iterator[Metric]:
        gauge, counter = GaugeMetricFamily, CounterMetricFamily
        yield self._way_out(gauge, "connected", "Who is told now.", lambda way: way.connected)
        yield self._way_out(gauge, "waiting", "Messages that are not sent yet.", lambda way: way.waiting)
        yield self._way_out(counter, "sent", "Messages sent.", lambda way: way.sent)
        yield self._way_out(counter, "dropped", "Messages or readers given up.", lambda way: way.dropped)
        yield self._way_out(counter, "failures", "Attempts that failed.", lambda way: way.failures)

    def _way_out(
        self,
        family: type[GaugeMetricFamily] | type[CounterMetricFamily],
        name: str,
        text: str,
        read: Callable[[WayOut], int],
    ) -> Metric:
        made = family(f"millstream_telemetry_{name}", text, labels=("to",))
        for to, way in self._outbound.each():
            made.add_metric((to,), read(way))
        return made

    def _counter(self, name: str, text: str, read: Callable[[MachineMetrics], int]) -> Metric:
        family = CounterMetricFamily(f"millstream_{name}", text, labels=("machine",))
        for machine, control in self._machines.items():
            family.add_metric((machine,), read(control.metrics))
        return family

    def _histogram(self, name: str, text: str, read: Callable[[MachineMetrics], Histogram]) -> Metric:
        family = HistogramMetricFamily(f"millstream_{name}", text, labels=("machine",))
        for machine, control in self._machines.items():
            histogram = read(control.metrics)
            family.add_metric((machine,), histogram.cumulative(), histogram.total)
        return family


def exposition(
    machines: Mapping[str, CountedMachine],
    hub: Hub,
    jobs_by_status: Mapping[str, int],
    outbound: Counters = Counters(),  # noqa: B008 - nothing counts in this one
    refused: Refused = Refused(),
) -> bytes:
    """The text that GET /metrics answers. The registry lives for this one answer: nothing is global."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(Collector(machines, hub, jobs_by_status, outbound, refused))
    return generate_latest(registry)
