"""What a broker is told: topics and payloads, those of Home Assistant's discovery too, and words that are obeyed. Pure.

Not the connection (mqtt.py), not what waits for it (mqttoutbox.py). The one rule: payloads are JSON made by
`server.jsontext`, so no text of a machine or a file is ever a topic, a template or a word of command.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from server.jsontext import dumps
from server.outbound.feed import Notice

ONLINE, OFFLINE = "online", "offline"
COMMANDS = ("pause", "stop", "estop")
"""What a broker may ask for, where it may. All of them end motion."""
MOST_COMMAND_BYTES = 16


@dataclass(frozen=True, slots=True)
class Post:
    """A message for the broker, retained. `kept`: each of them counts; of the others only the newest of its topic."""

    topic: str
    payload: str
    kept: bool = False


@dataclass(frozen=True, slots=True)
class Topics:
    """The names. `prefix` is what all of them begin with."""

    prefix: str

    @property
    def availability(self) -> str:
        """Of the daemon: the last will."""
        return f"{self.prefix}/availability"

    def of(self, machine: str, leaf: str) -> str:
        """`state`, `job`, `alarm`, `availability` or `command` of a machine."""
        return f"{self.prefix}/{machine}/{leaf}"

    def command(self, topic: str, payload: object, machines: Sequence[str]) -> tuple[str, str] | None:
        """The machine and the command that a message means; None: nothing that is obeyed."""
        machine = next((name for name in machines if topic == self.of(name, "command")), None)
        if machine is None or not isinstance(payload, bytes) or len(payload) > MOST_COMMAND_BYTES:
            return None
        word = payload.decode("ascii", "replace").strip()
        return (machine, word) if word in COMMANDS else None


class Teller:
    """What follows for the broker from what happens. It remembers of each machine only its link, job and alarm."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._links: dict[str, str] = {}
        self._jobs: dict[str, tuple[Any, Any]] = {}
        self._alarms: dict[str, object] = {}

    def posts(self, notice: Notice) -> Iterator[Post]:
        """The messages that say it."""
        name, of = notice.machine, self._topics.of
        match notice.type:
            case "state":
                link = ONLINE if notice.data.get("link") == "connected" else OFFLINE
                if self._links.get(name) != link:
                    self._links[name] = link
                    yield Post(of(name, "availability"), link)
                yield Post(of(name, "state"), dumps({**notice.data, "at": notice.at}))
                if notice.fresh:
                    yield from self._alarm(name, notice.data.get("alarm"), notice.at)
            case "alarm":
                yield from self._alarm(name, notice.data.get("alarm"), notice.at)
            case "job":
                step = notice.data.get("id"), notice.data.get("status")
                yield Post(of(name, "job"), dumps(job_payload(notice)), kept=self._jobs.get(name) != step)
                self._jobs[name] = step
            case _:
                pass

    def _alarm(self, name: str, alarm: Mapping[str, Any] | None, at: str) -> Iterator[Post]:
        if name in self._alarms and self._alarms[name] == alarm:
            return
        self._alarms[name] = alarm
        payload = {"active": alarm is not None, **(alarm or {"code": None, "axis": None, "message": ""}), "at": at}
        yield Post(self._topics.of(name, "alarm"), dumps(payload), kept=True)


def job_payload(notice: Notice) -> dict[str, Any]:
    """A job as a broker is told it: flat, for automations."""
    job, progress = notice.data, notice.data.get("progress") or {}
    first, last, done = job.get("start_line") or 1, progress.get("lines") or 0, progress.get("acknowledged_lines") or 0
    percent = round(100 * done / max(1, last - first + 1), 1)
    error = job.get("error") or {}
    return {
        "id": job.get("id"),
        "status": job.get("status"),
        "program": job.get("program_name"),
        "percent": min(100.0, max(0.0, percent)),
        "line": progress.get("line"),
        "lines": progress.get("lines"),
        "seconds_elapsed": progress.get("seconds_elapsed"),
        "seconds_left": progress.get("seconds_left"),
        "error_code": error.get("code"),
        "error_message": error.get("message"),
        "at": notice.at,
    }


# --- Home Assistant -------------------------------------------------------------------------------------------

_SENSORS: tuple[tuple[str, str, str, str, dict[str, str]], ...] = (
    ("sensor", "status", "Status", "state", {"value_template": "{{ value_json.status }}", "icon": "mdi:state-machine"}),
    ("sensor", "job", "Job", "job", {"value_template": "{{ value_json.status }}", "icon": "mdi:playlist-play"}),
    (
        "sensor",
        "progress",
        "Job progress",
        "job",
        {
            "value_template": "{{ value_json.percent }}",
            "unit_of_measurement": "%",
            "state_class": "measurement",
            "icon": "mdi:progress-wrench",
        },
    ),
    (
        "sensor",
        "remaining",
        "Job remaining",
        "job",
        {
            "value_template": "{{ value_json.seconds_left }}",
            "unit_of_measurement": "s",
            "device_class": "duration",
        },
    ),
    (
        "binary_sensor",
        "alarm",
        "Alarm",
        "alarm",
        {
            "value_template": "{{ 'ON' if value_json.active else 'OFF' }}",
            "device_class": "problem",
        },
    ),
)
_WITH_ATTRIBUTES = frozenset({"job", "alarm"})


def discovery(
    topics: Topics, machine: str, protocol: str, *, prefix: str, version: str, commands: bool
) -> Iterator[Post]:
    """The configurations by which Home Assistant finds a machine. Without `commands` its buttons are taken away."""
    node = re.sub(r"[^A-Za-z0-9_-]", "_", f"{topics.prefix}_{machine}")
    common: dict[str, Any] = {
        "availability": [{"topic": topics.availability}, {"topic": topics.of(machine, "availability")}],
        "availability_mode": "all",
        "device": {
            "identifiers": [node],
            "name": machine,
            "manufacturer": "millstream",
            "model": protocol,
            "sw_version": version,
        },
        "origin": {"name": "millstream", "sw_version": version},
    }
    for kind, key, name, leaf, more in _SENSORS:
        topic = topics.of(machine, leaf)
        attributes = {"json_attributes_topic": topic} if key in _WITH_ATTRIBUTES else {}
        payload = {**common, "name": name, "unique_id": f"{node}_{key}", "state_topic": topic, **more, **attributes}
        yield Post(f"{prefix}/{kind}/{node}/{key}/config", dumps(payload))
    for word in COMMANDS:
        button = {
            **common,
            "name": "E-stop" if word == "estop" else word.capitalize(),
            "unique_id": f"{node}_{word}",
            "command_topic": topics.of(machine, "command"),
            "payload_press": word,
        }
        yield Post(f"{prefix}/button/{node}/{word}/config", dumps(button) if commands else "")
