"""What is an event and what is not; the message, and its signature as a receiver checks it."""

import hashlib
import hmac
import json
from typing import Any

from server.config.telemetry import EVENTS
from server.outbound import webhookevents
from server.outbound.feed import Notice
from server.outbound.webhookevents import Happened, Watcher, body_of, headers_of
from tests.server.outbound.test_shdr import AT, JOB, STATE

ALARM = {"code": 1, "axis": "x", "message": "Hard limit"}


def told(watcher: Watcher, type_: str, data: dict[str, Any], **more: Any) -> list[str]:
    events = list(watcher.events(Notice(type_, "router", AT, data, **more)))
    assert all(one.event in EVENTS and one.machine == "router" and one.at == AT for one in events)
    return [one.event for one in events]


def test_each_change_of_a_job_once() -> None:
    watcher = Watcher()
    found = [
        told(watcher, "job", {**JOB, "status": status})
        for status in (
            "queued",
            "checking",
            "running",
            "running",
            "paused",
            "running",
            "waiting",
            "running",
            "completed",
        )
    ]
    assert [event for each in found for event in each] == [
        f"job.{word}"
        for word in ("queued", "checking", "running", "paused", "running", "waiting", "running", "completed")
    ]
    assert told(watcher, "job", {**JOB, "id": 9, "status": "interrupted"}) == ["job.interrupted"]


def test_every_event_of_the_configuration_can_happen() -> None:
    watcher = Watcher()
    words = [event.removeprefix("job.") for event in EVENTS if event.startswith("job.")]
    found = [each for n, word in enumerate(words) for each in told(watcher, "job", {**JOB, "id": n, "status": word})]
    for alarm in (ALARM, None):
        found += told(watcher, "alarm", {"alarm": alarm})
    for link in ("connecting", "connected", "disconnected"):
        found += told(watcher, "state", {**STATE, "link": link})
    assert found == list(EVENTS)


def test_how_things_stand_is_no_event_but_what_was_missed_is() -> None:
    watcher = Watcher()
    assert told(watcher, "state", {**STATE, "alarm": ALARM}, fresh=True) == []
    assert told(watcher, "job", JOB, fresh=True) == []
    assert told(watcher, "job", JOB) == []
    assert told(watcher, "state", {**STATE, "link": "connecting", "alarm": None}, fresh=True) == [
        "machine.disconnected",
        "alarm.cleared",
    ]
    assert told(watcher, "job", {**JOB, "status": "paused"}, fresh=True) == ["job.paused"]


def test_another_alarm_is_raised_and_the_one_that_goes_is_named() -> None:
    watcher = Watcher()
    other = {**ALARM, "code": 2}
    events = [
        list(watcher.events(Notice("alarm", "router", AT, {"alarm": alarm}))) for alarm in (ALARM, ALARM, other, None)
    ]
    assert [[one.event for one in each] for each in events] == [
        ["alarm.raised"],
        [],
        ["alarm.raised"],
        ["alarm.cleared"],
    ]
    assert events[3][0].data == {"alarm": other}


def test_jobs_that_are_remembered_are_bounded(monkeypatch: Any) -> None:
    monkeypatch.setattr(webhookevents, "JOBS_REMEMBERED", 10)
    watcher = Watcher()
    for number in range(100):
        told(watcher, "job", {**JOB, "id": number, "status": "queued"})
    assert len(watcher._jobs) == 10
    for number in range(100):
        told(watcher, "job", {**JOB, "id": number, "status": "cancelled"})
    assert watcher._jobs == {}


def test_the_message_and_its_signature() -> None:
    body = body_of("abc", Happened("job.failed", "router", AT, {"job": {"note": 'ж"\n'}}))
    assert json.loads(body) == {
        "id": "abc",
        "event": "job.failed",
        "machine": "router",
        "at": AT,
        "data": {"job": {"note": 'ж"\n'}},
    }
    headers = headers_of("abc", body, timestamp_s=1772355600, secret="пароль")
    wanted = hmac.new("пароль".encode(), b"1772355600." + body.encode(), hashlib.sha256).hexdigest()
    assert headers["X-Millstream-Signature"] == f"sha256={wanted}"
    assert (headers["X-Millstream-Id"], headers["X-Millstream-Timestamp"]) == ("abc", "1772355600")
    assert "X-Millstream-Signature" not in headers_of("abc", body, timestamp_s=1, secret=None)


def test_a_signature_that_was_made_by_another_hand() -> None:
    # printf '1700000000.{}' | openssl dgst -sha256 -hmac key
    wanted = "9d713ed406bb7076d4123f0dc2c39d2df5c654ed4b0cd56b52c8b4c940bd63ae"
    assert (
        headers_of("x", "{}", timestamp_s=1_700_000_000, secret="key")["X-Millstream-Signature"] == f"sha256={wanted}"
    )
