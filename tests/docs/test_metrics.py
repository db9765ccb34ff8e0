"""docs/metrics.md against what the daemon exports."""

from datetime import UTC, datetime
from typing import Any

from prometheus_client.parser import text_string_to_metric_families

from server.live.hub import Hub
from server.metrics import MachineMetrics, Refused, exposition
from tests.harness.docs import page, rows


class Machine:
    """A machine of which everything has been counted once."""

    def __init__(self) -> None:
        self.metrics = MachineMetrics()
        self.metrics.link_errors["checksum"] += 1
        self.metrics.ack_latency.observe(0.1)
        self.metrics.batch_seconds.observe(0.5)
        self.metrics.seconds_left = lambda: 60.0

    def view(self) -> dict[str, Any]:
        return {"link": "connected", "queue_length": 0}


def exported() -> dict[str, tuple[str, set[str]]]:
    hub = Hub(clock=lambda: datetime(2026, 3, 1, tzinfo=UTC))
    hub.publish("state", "router", {})
    refused = Refused({"unauthorized": 1}, {"sockets": 1}, 1)
    text = exposition({"router": Machine()}, hub, {"queued": 1}, refused=refused).decode()
    found = {}
    for family in text_string_to_metric_families(text):
        name = f"{family.name}_total" if family.type == "counter" else family.name
        labels = {label for sample in family.samples for label in sample.labels} - {"le"}
        found[name] = (family.type, labels)
    return found


def test_every_metric_with_type_and_labels_and_no_other() -> None:
    table = rows(page("metrics.md"), "metric", "type", "labels", "meaning")
    documented = {row[0]: (row[1], set(row[2].split(", ")) - {"none"}) for row in table}
    assert documented == exported()
    assert all(row[3] for row in table)
