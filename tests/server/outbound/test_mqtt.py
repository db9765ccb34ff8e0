"""The bridge against a broker over a real socket: greeting, states, commands; a broker that breaks, refuses, hangs."""

import asyncio
import json
from collections.abc import Coroutine
from typing import Any

import pytest

from server.config.telemetry import MqttConfig
from server.live.hub import Hub
from server.outbound import mqtt
from server.outbound.feed import Feed, Notice
from server.outbound.mqtt import Bridge, tls_context
from server.problems import ProblemError
from server.waysout import WayOut
from tests.harness.mqttbroker import Broker
from tests.server.outbound.test_shdr import AT, JOB, STATE

pytestmark = pytest.mark.real
STANDING = Notice("state", "router", AT, {**STATE, "status": "idle"}, fresh=True)


class Machine:
    """What was asked of it; `refuses` says that it refuses."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.refuses = False

    def _ask(self, word: str) -> None:
        self.asked.append(word)
        if self.refuses:
            raise ProblemError("wrong_state", "No.")

    def pause(self) -> None:
        self._ask("pause")

    def stop(self) -> None:
        self._ask("stop")

    def estop(self) -> None:
        self._ask("estop")


class Bench:
    """A hub, a machine and a bridge to `broker`."""

    def __init__(self, broker: Broker, **config: Any) -> None:
        self.hub, self.machine, self.counted, self.broker = Hub(), Machine(), WayOut(), broker
        self.audited: list[tuple[str, str, str | None]] = []
        self.config = MqttConfig.model_validate({"host": "127.0.0.1", "port": broker.port, "rate": 50.0, **config})
        bridge = Bridge(
            self.config,
            {"router": self.machine},
            protocols={"router": "grbl"},
            password=self.config.password,
            tls=None,
            counted=self.counted,
            audited=lambda name, word, refused: self.audited.append((name, word, refused and refused.code)),
        )
        self._task = asyncio.create_task(bridge.run(Feed(self.hub, rate_hz=50.0, now_stands=lambda: [STANDING])))

    async def __aenter__(self) -> "Bench":
        await self.broker.until(lambda: "millstream/router/state" in self.broker.retained)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.end()

    async def end(self) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        assert self.hub.readers == 0


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mqtt, "FIRST_WAIT_S", 0.02)
    monkeypatch.setattr(mqtt, "LONGEST_WAIT_S", 0.05)


def run(main: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(main, 10))


def test_a_broker_is_told_everything_and_then_what_happens() -> None:
    async def main() -> None:
        async with Broker() as broker, Bench(broker, username="ms", password="pä") as bench:
            assert (broker.user, broker.password) == ("ms", "pä")
            assert broker.will == ("millstream/availability", "offline")
            assert broker.retained["millstream/availability"] == "online"
            assert broker.retained["millstream/router/availability"] == "online"
            assert json.loads(broker.retained["millstream/router/alarm"])["active"] is False
            assert json.loads(broker.retained["homeassistant/sensor/millstream_router/status/config"])
            assert broker.retained["homeassistant/button/millstream_router/estop/config"] == ""
            bench.hub.publish("job", "router", JOB)
            bench.hub.publish("alarm", "router", {"alarm": {"code": 1, "axis": None, "message": "Hard limit"}})
            await broker.until(lambda: "Hard limit" in broker.retained["millstream/router/alarm"])
            assert json.loads(broker.retained["millstream/router/job"])["id"] == 7
            assert bench.counted.connected == 1
            assert broker.subscribed == [], "nothing is obeyed unless it is allowed"
            broker.send("millstream/router/command", b"estop")
            bench.hub.publish("job", "router", {**JOB, "id": 8})
            await broker.until(lambda: '"id":8' in broker.retained["millstream/router/job"])
            assert bench.machine.asked == []
            await bench.end()
            await broker.until(lambda: broker.retained["millstream/availability"] == "offline")

    run(main())


def test_commands_where_they_are_allowed_and_no_retained_ones(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        async with Broker() as broker, Bench(broker, allow_commands=True, discovery=False) as bench:
            await broker.until(lambda: broker.subscribed == ["millstream/router/command"])
            assert not any(topic.startswith("homeassistant") for topic in broker.retained)
            broker.send("millstream/router/command", b"estop", retain=True)
            broker.send("millstream/router/command", b"M3 S1000")
            bench.machine.refuses = True
            for word in (b"stop", b"pause", b"estop"):
                broker.send("millstream/router/command", word)
            async with asyncio.timeout(5):
                while len(bench.machine.asked) < 3:
                    await asyncio.sleep(0.01)
            assert bench.machine.asked == ["stop", "pause", "estop"], "a refusal ends nothing"
            assert bench.audited == [("router", word, "wrong_state") for word in ("stop", "pause", "estop")]
            bench.machine.refuses = False
            broker.send("millstream/router/command", b"pause")
            async with asyncio.timeout(5):
                while len(bench.audited) < 4:
                    await asyncio.sleep(0.01)
            assert bench.audited[-1] == ("router", "pause", None)

    run(main())
    assert "a retained message at millstream/router/command is not obeyed" in caplog.text
    assert "is no command" in caplog.text


def test_after_a_break_everything_that_was_kept_comes_and_the_newest_state() -> None:
    async def main() -> None:
        broker = Broker()
        async with broker, Bench(broker) as bench:
            broker.cut()
            await broker.until(lambda: broker.retained["millstream/availability"] == "offline")
            for number in range(3):
                bench.hub.publish("job", "router", {**JOB, "id": number, "status": "failed"})
            bench.hub.publish("state", "router", {**STATE, "feed": 77.0})
            await broker.until(lambda: broker.connects == 2 and "77.0" in broker.retained["millstream/router/state"])
            jobs = [json.loads(payload)["id"] for topic, payload in broker.published if topic.endswith("/job")]
            assert jobs == [0, 1, 2]
            assert broker.retained["millstream/availability"] == "online"
            assert bench.counted.failures >= 1

    run(main())


def test_a_broker_that_acknowledges_nothing_costs_a_bounded_queue(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mqtt, "ANSWER_WITHIN_S", 0.2)

    async def main() -> None:
        async with Broker() as broker, Bench(broker, queue_limit=10) as bench:
            broker.silent = True
            loop = asyncio.get_running_loop()
            before = loop.time()
            for number in range(500):
                bench.hub.publish("job", "router", {**JOB, "id": number})
                bench.hub.publish("state", "router", {**STATE, "feed": float(number)})
            assert loop.time() - before < 1.0, "publishing waits for nobody"
            async with asyncio.timeout(5):
                while bench.counted.dropped < 400 or bench.counted.failures < 1:
                    await asyncio.sleep(0.02)
            assert bench.counted.waiting <= 10 + 4
            broker.silent = False
            await broker.until(lambda: "499.0" in broker.retained["millstream/router/state"])
            await broker.until(lambda: '"id":499' in broker.retained.get("millstream/router/job", ""))

    run(main())


def test_a_broker_that_refuses_is_complained_of_once(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        async with Broker(refuse=5) as broker:
            bench = Bench(broker)
            await broker.until(lambda: broker.connects >= 3)
            assert bench.counted.connected == 0
            await bench.end()

    run(main())
    complaints = [record for record in caplog.records if "Trying again" in record.message]
    assert len(complaints) == 1
    assert "authori" in complaints[0].message.lower()


def test_certificates_that_cannot_be_read_are_an_error(tmp_path: Any) -> None:
    assert tls_context(MqttConfig()) is None
    context = tls_context(MqttConfig(tls=True))
    assert context is not None
    assert context.check_hostname
    with pytest.raises(OSError, match="No such file"):
        tls_context(MqttConfig(tls=True, ca_file=tmp_path / "none.pem"))
