"""docs/telemetry.md against the code: every item that an agent is told, every word of EXECUTION."""

import textwrap
import time
from typing import Any

from server.config.telemetry import EVENTS
from server.outbound.announcement import SERVICES, announcements
from server.outbound.feed import Notice
from server.outbound.mqtttopics import COMMANDS, Topics, job_payload
from server.outbound.shdr import _EXECUTION_BY_JOB, _EXECUTION_BY_STATE, Condition, Device
from server.outbound.webhookevents import Happened, body_of, headers_of
from tests.harness.docs import page, rows, section


def test_every_item_that_agents_are_told() -> None:
    table = rows(page("telemetry.md"), "item", "type of the standard", "what it is here")
    documented = {name for row in table for name in row[0].replace("...", "").strip(" ,").split(", ")}
    sent = Device(axes="x").items(emergency=False)
    assert documented == set(sent)
    conditions = {row[0] for row in table if row[1].startswith("condition ")}
    assert conditions == {name for name, value in sent.items() if isinstance(value, Condition)}


def test_every_word_of_execution() -> None:
    table = rows(page("telemetry.md"), "execution", "when")
    assert {row[0] for row in table} == {*_EXECUTION_BY_STATE.values(), *_EXECUTION_BY_JOB.values(), "READY"}


def test_every_topic_and_every_field_of_a_job() -> None:
    table = dict(rows(page("telemetry.md"), "topic", "payload"))
    topics = Topics("millstream")
    leaves = ("availability", "state", "job", "alarm", "command")
    assert set(table) == {topics.availability, *(topics.of("<machine>", leaf) for leaf in leaves)}
    assert table[topics.of("<machine>", "job")].split(", ") == list(job_payload(Notice("job", "m", "t")))
    assert all(word in table[topics.of("<machine>", "command")] for word in COMMANDS)


def test_every_event_and_every_header_of_a_webhook() -> None:
    told = [event for row in rows(page("telemetry.md"), "event", "when", "data") for event in row[0].split(", ")]
    assert told == list(EVENTS)
    documented = {line.split("`")[1] for line in page("telemetry.md").splitlines() if line.startswith("| `X-")}
    sent = headers_of("id", "{}", timestamp_s=0, secret="key")
    assert documented == {name for name in sent if name.startswith("X-")}


def test_the_example_of_a_receiver_believes_us_and_nobody_else() -> None:
    lines = page("telemetry.md").split("    import hashlib")[1].split("\n\n**")[0]
    example: dict[str, Any] = {}
    exec(textwrap.dedent("    import hashlib" + lines), example)
    body = body_of("id", Happened("job.failed", "router", "t", {}))
    now_s = int(time.time())
    for offset_s, key, wanted in ((0, "key", True), (0, "other", False), (-400, "key", False)):
        headers = headers_of("id", body, timestamp_s=now_s + offset_s, secret=key)
        assert example["is_genuine"](headers, body.encode(), b"key") is wanted


def test_what_the_network_is_told() -> None:
    text = section(page("telemetry.md"), "## mDNS")
    (one, _) = announcements(name="", hostname="h", port=1, addresses=["192.0.2.7"], version="1", machines=[])
    assert all(f"`{word}`" in text for word in one.properties)
    assert all(f"`{service.removesuffix('.local.')}`" in text for service in SERVICES)
