"""What a broker is told: topics, payloads, discovery; and which words are commands."""

import json
from typing import Any

import pytest

from server.outbound.feed import Notice
from server.outbound.mqtttopics import Post, Teller, Topics, discovery
from tests.server.outbound.test_shdr import AT, JOB, STATE

TOPICS = Topics("shop/ms")
ALARM = {"code": 1, "axis": "x", "message": "Hard limit"}


def told(teller: Teller, type_: str, data: dict[str, Any], **more: Any) -> dict[str, tuple[Any, bool]]:
    posts = teller.posts(Notice(type_, "router", AT, data, **more))
    return {post.topic: (_read(post), post.kept) for post in posts}


def _read(post: Post) -> Any:
    return json.loads(post.payload) if post.payload.startswith("{") else post.payload


def test_a_state_and_whether_the_machine_is_there() -> None:
    teller = Teller(TOPICS)
    assert told(teller, "state", STATE) == {
        "shop/ms/router/availability": ("online", False),
        "shop/ms/router/state": ({**STATE, "at": AT}, False),
    }
    assert told(teller, "state", STATE).keys() == {"shop/ms/router/state"}
    gone = told(teller, "state", {**STATE, "link": "connecting"})
    assert gone["shop/ms/router/availability"] == ("offline", False)


def test_each_step_of_a_job_is_kept_and_of_its_progress_the_newest() -> None:
    teller = Teller(TOPICS)
    job = {
        **JOB,
        "start_line": 11,
        "progress": {"line": 60, "lines": 110, "acknowledged_lines": 50, "seconds_left": 9.5},
    }
    payload, kept = told(teller, "job", job)["shop/ms/router/job"]
    assert kept
    assert payload == {
        "id": 7,
        "status": "running",
        "program": "part.nc",
        "percent": 50.0,
        "line": 60,
        "lines": 110,
        "seconds_elapsed": None,
        "seconds_left": 9.5,
        "error_code": None,
        "error_message": None,
        "at": AT,
    }
    assert not told(teller, "job", job)["shop/ms/router/job"][1]
    assert told(teller, "job", {**job, "status": "completed"})["shop/ms/router/job"][1]
    error = {"code": "alarm", "message": "Hard limit"}
    failed = told(teller, "job", {**JOB, "id": 8, "status": "failed", "error": error})["shop/ms/router/job"][0]
    assert (failed["error_code"], failed["error_message"], failed["percent"]) == ("alarm", "Hard limit", 0.0)


def test_an_alarm_is_told_when_it_comes_and_when_it_goes() -> None:
    teller = Teller(TOPICS)
    assert told(teller, "alarm", {"alarm": ALARM}) == {
        "shop/ms/router/alarm": ({"active": True, **ALARM, "at": AT}, True)
    }
    over = told(teller, "alarm", {"alarm": None})["shop/ms/router/alarm"][0]
    assert over == {"active": False, "code": None, "axis": None, "message": "", "at": AT}


def test_how_things_stand_says_whether_there_is_an_alarm_but_once() -> None:
    teller = Teller(TOPICS)
    assert told(teller, "state", STATE, fresh=True)["shop/ms/router/alarm"][0]["active"] is False
    assert "shop/ms/router/alarm" not in told(teller, "state", STATE, fresh=True)
    assert "shop/ms/router/alarm" in told(teller, "state", {**STATE, "alarm": ALARM}, fresh=True)


def test_hostile_text_is_a_value_and_nothing_else() -> None:
    teller = Teller(TOPICS)
    name = '{{ states("x") }}"}\n\x00+/#'
    ((post,),) = [list(teller.posts(Notice("job", "router", AT, {**JOB, "program_name": name})))]
    assert post.topic == "shop/ms/router/job"
    assert json.loads(post.payload)["program"] == name
    assert "\n" not in post.payload
    assert post.payload.isascii()


@pytest.mark.parametrize(
    ("topic", "payload", "wanted"),
    [
        ("shop/ms/router/command", b"pause", ("router", "pause")),
        ("shop/ms/router/command", b" stop\n", ("router", "stop")),
        ("shop/ms/router/command", b"estop", ("router", "estop")),
        ("shop/ms/lathe/command", b"estop", ("lathe", "estop")),
        ("shop/ms/router/command", b"resume", None),
        ("shop/ms/router/command", b"home", None),
        ("shop/ms/router/command", b"G0 X10", None),
        ("shop/ms/router/command", b"PAUSE", None),
        ("shop/ms/router/command", b"", None),
        ("shop/ms/router/command", b"\xff\xfe", None),
        ("shop/ms/router/command", b"pause" + b" " * 100, None),
        ("shop/ms/router/command", "pause", None),
        ("shop/ms/router/commands", b"pause", None),
        ("shop/ms/mill/command", b"pause", None),
        ("router/command", b"pause", None),
    ],
)
def test_what_is_a_command(topic: str, payload: object, wanted: tuple[str, str] | None) -> None:
    assert TOPICS.command(topic, payload, ("router", "lathe")) == wanted


def configs(*, commands: bool) -> dict[str, Any]:
    found = discovery(TOPICS, "router", "grbl", prefix="homeassistant", version="1.2", commands=commands)
    return {post.topic: json.loads(post.payload) if post.payload else None for post in found}


def test_home_assistant_finds_sensors_of_topics_that_are_told() -> None:
    found = {topic: one for topic, one in configs(commands=False).items() if one is not None}
    node = "homeassistant/{}/shop_ms_router/{}/config"
    assert set(found) == {
        *(node.format("sensor", key) for key in ("status", "job", "progress", "remaining")),
        node.format("binary_sensor", "alarm"),
    }
    assert {one["state_topic"] for one in found.values()} == {TOPICS.of("router", k) for k in ("state", "job", "alarm")}
    assert len({one["unique_id"] for one in found.values()}) == len(found)
    for one in found.values():
        assert one["device"]["identifiers"] == ["shop_ms_router"]
        assert [entry["topic"] for entry in one["availability"]] == [
            "shop/ms/availability",
            "shop/ms/router/availability",
        ]
    payload = json.loads(next(iter(Teller(TOPICS).posts(Notice("job", "router", AT, JOB)))).payload)
    for key, field in (("job", "status"), ("progress", "percent"), ("remaining", "seconds_left")):
        assert found[node.format("sensor", key)]["value_template"] == f"{{{{ value_json.{field} }}}}"
        assert field in payload


def test_buttons_are_there_only_where_commands_are_allowed() -> None:
    def buttons(*, commands: bool) -> dict[str, Any]:
        return {topic: one for topic, one in configs(commands=commands).items() if "/button/" in topic}

    assert set(buttons(commands=False).values()) == {None}, "an empty one takes an earlier one away"
    allowed = buttons(commands=True)
    assert allowed.keys() == buttons(commands=False).keys()
    for one in allowed.values():
        payload = one["payload_press"].encode()
        assert TOPICS.command(one["command_topic"], payload, ("router",)) == ("router", one["payload_press"])


COMMON = frozenset({"availability", "availability_mode", "device", "origin", "name", "unique_id", "icon"})
KEYS = {
    "sensor": {
        "state_topic",
        "value_template",
        "unit_of_measurement",
        "state_class",
        "device_class",
        "json_attributes_topic",
    },
    "binary_sensor": {"state_topic", "value_template", "device_class", "json_attributes_topic"},
    "button": {"command_topic", "payload_press"},
}
"""Of what the pages of Home Assistant's MQTT integrations allow, what is used; another key would be refused there."""
NEEDED = {"sensor": {"state_topic"}, "binary_sensor": {"state_topic"}, "button": {"command_topic"}}
DEVICE = {"identifiers", "name", "manufacturer", "model", "sw_version"}


def test_discovery_has_the_keys_that_home_assistant_knows() -> None:
    posts = list(discovery(TOPICS, "router", "grbl", prefix="homeassistant", version="1", commands=True))
    assert len(posts) == 8
    for post in posts:
        prefix, kind, node, key, last = post.topic.split("/")
        assert (prefix, last) == ("homeassistant", "config")
        said = json.loads(post.payload)
        assert said.keys() <= COMMON | KEYS[kind], post.topic
        assert said.keys() >= NEEDED[kind] | {"unique_id", "name", "device", "origin"}
        assert said["device"].keys() <= DEVICE
        assert "name" in said["origin"]
        assert {"topic"} == set().union(*said["availability"])
        assert said["unique_id"] == f"{node}_{key}"
    assert len({json.loads(post.payload)["unique_id"] for post in posts}) == len(posts)
