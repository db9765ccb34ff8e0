"""The row of a command that came through the broker, in the audit of a real workshop."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from server.access.audit import Wanted
from server.app import build
from server.config.model import Config
from server.config.telemetry import MqttConfig
from server.outbound.mqttaudit import asked_by_broker
from server.outbound.service import Outbound
from server.problems import ProblemError
from tests.harness.mqttbroker import Broker


def test_it_names_the_broker_and_says_what_became_of_it() -> None:
    config = MqttConfig(host="broker.lan", port=8883)
    row = asked_by_broker(config, "router", "estop", None)
    assert (row.via, row.token, row.address, row.method) == ("mqtt", None, "broker.lan:8883", "MQTT")
    assert (row.route, row.machine, row.status, row.code) == ("estop", "router", 202, None)
    refused = asked_by_broker(config, "router", "pause", ProblemError("wrong_state", "No job."))
    assert (refused.status, refused.code) == (409, "wrong_state")


@pytest.mark.real
def test_each_command_is_a_row(tmp_path: Path) -> None:
    async def main() -> list[dict[str, Any]]:
        async with Broker() as broker:
            mqtt = {"enabled": True, "host": "127.0.0.1", "port": broker.port, "allow_commands": True}
            machine = {"name": "router", "port": "sim:", "autoconnect": False}
            config = Config.model_validate({"server": {"data_dir": str(tmp_path)}, "machine": [machine], "mqtt": mqtt})
            workshop = build(config)
            await workshop.start()
            listening: Any = type("Listening", (), {"getsockname": staticmethod(lambda: ("127.0.0.1", 8420))})()
            try:
                async with Outbound.prepare(config).running(workshop, listening):
                    await broker.until(lambda: broker.subscribed == ["millstream/router/command"])
                    for word in (b"estop", b"pause", b"M3 S1000"):
                        broker.send("millstream/router/command", word)
                    async with asyncio.timeout(5):
                        while len(rows := await workshop.audit.find(Wanted(method="MQTT"), None, 10)) < 2:
                            await asyncio.sleep(0.01)
                    return rows
            finally:
                await workshop.stop()

    rows = asyncio.run(asyncio.wait_for(main(), 10))
    assert [(row["route"], row["machine"], row["code"]) for row in rows] == [
        ("pause", "router", "wrong_state"),
        ("estop", "router", "not_connected"),
    ]
    assert {row["via"] for row in rows} == {"mqtt"}
