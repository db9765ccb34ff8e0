"""What of all that happens is an event for webhooks, and how a message is written and signed. Pure.

Not what waits (webhookqueue.py), not the sending (webhook.py). The one rule: an event is a change; how things stand
when somebody begins to listen is none.
"""

import hashlib
import hmac
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from server.jsontext import dumps
from server.outbound.feed import Notice

JOBS_REMEMBERED = 4096
"""More than may wait; an older one that changes is told once more at worst."""
ENDED = frozenset({"completed", "failed", "cancelled"})


@dataclass(frozen=True, slots=True)
class Happened:
    """An event: a word of `telemetryconfig.EVENTS`."""

    event: str
    machine: str
    at: str
    data: Mapping[str, Any]


class Watcher:
    """Finds the changes. It remembers the status of jobs that have not ended, and of each machine link and alarm."""

    def __init__(self) -> None:
        self._jobs: dict[object, str] = {}
        self._links: dict[str, bool] = {}
        self._alarms: dict[str, object] = {}

    def events(self, notice: Notice) -> Iterator[Happened]:
        """What a message of the hub means."""
        match notice.type:
            case "job":
                yield from self._job(notice)
            case "state":
                yield from self._link(notice)
                if notice.fresh:
                    yield from self._alarm(notice)
            case "alarm":
                yield from self._alarm(notice)
            case _:
                pass

    def _job(self, notice: Notice) -> Iterator[Happened]:
        number, status = notice.data.get("id"), str(notice.data.get("status"))
        before = self._jobs.pop(number, None)
        if status not in ENDED:
            self._jobs[number] = status
            if len(self._jobs) > JOBS_REMEMBERED:
                del self._jobs[next(iter(self._jobs))]
        if before != status and not (before is None and notice.fresh):
            yield Happened(f"job.{status}", notice.machine, notice.at, {"job": notice.data})

    def _link(self, notice: Notice) -> Iterator[Happened]:
        connected = notice.data.get("link") == "connected"
        before = self._links.get(notice.machine)
        self._links[notice.machine] = connected
        if before is not None and before != connected:
            word = "connected" if connected else "disconnected"
            yield Happened(f"machine.{word}", notice.machine, notice.at, {"link": notice.data.get("link")})

    def _alarm(self, notice: Notice) -> Iterator[Happened]:
        alarm, known = notice.data.get("alarm"), notice.machine in self._alarms
        before = self._alarms.get(notice.machine)
        self._alarms[notice.machine] = alarm
        if alarm == before or (notice.fresh and not known):
            return
        word = "cleared" if alarm is None else "raised"
        yield Happened(f"alarm.{word}", notice.machine, notice.at, {"alarm": before if alarm is None else alarm})


def body_of(id: str, happened: Happened) -> str:
    """The message, as it goes out each time and as it is signed."""
    head = {"id": id, "event": happened.event, "machine": happened.machine, "at": happened.at}
    return dumps({**head, "data": happened.data})


def headers_of(id: str, body: str, *, timestamp_s: int, secret: str | None) -> dict[str, str]:
    """Of one attempt: the time is that of the attempt, so that a copy played back later is recognised as old."""
    headers = {
        "Content-Type": "application/json",
        "User-Agent": "millstream",
        "X-Millstream-Id": id,
        "X-Millstream-Timestamp": str(timestamp_s),
    }
    if secret is not None:
        signed = f"{timestamp_s}.{body}".encode()
        headers["X-Millstream-Signature"] = f"sha256={hmac.new(secret.encode(), signed, hashlib.sha256).hexdigest()}"
    return headers
