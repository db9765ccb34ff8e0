"""The ways out as one: what is wrong is told before the start and leaves nothing open; all at one workshop."""

import asyncio
import logging
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from server.config.model import Config
from server.live.hub import Hub
from server.outbound import errors, service
from server.outbound.errors import OutboundError
from server.outbound.service import Outbound
from server.waysout import Counters
from tests.harness.mqttbroker import Broker
from tests.server.outbound.test_shdr import JOB, STATE


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as there:
        yield there.getsockname()[1]


def config(folder: Path, **sections: Any) -> Config:
    machine = {"name": "router", "port": "sim:"}
    return Config.model_validate({"server": {"data_dir": str(folder)}, "machine": [machine], **sections})


def test_nothing_is_opened_that_is_not_switched_on(tmp_path: Path) -> None:
    made = Outbound.prepare(config(tmp_path))
    assert made._agents is None
    made.close()


def test_a_port_that_is_taken_is_told(taken: int, tmp_path: Path) -> None:
    with pytest.raises(OutboundError, match=rf"mtconnect: 127\.0\.0\.1:{taken}: Address already in use"):
        Outbound.prepare(config(tmp_path, mtconnect={"enabled": True, "port": taken}))


@pytest.mark.parametrize(
    ("sections", "told"),
    [
        ({"mqtt": {"enabled": True, "password_file": "/nonexistent/x"}}, r"mqtt\.password_file: .*No such file"),
        ({"mqtt": {"enabled": True, "tls": True, "ca_file": "/nonexistent/x"}}, r"mqtt\.ca_file: .*No such file"),
        ({"webhook": [{"url": "http://h/", "secret_file": "/nonexistent/x"}]}, r"webhook\[0\]\.secret_file: .*No such"),
    ],
)
def test_what_cannot_be_read_is_told_and_the_port_is_given_back(
    sections: dict[str, Any], told: str, tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(OutboundError, match=told):
        Outbound.prepare(config(tmp_path, mtconnect={"enabled": True, "port": port}, **sections))
    socket.create_server(("127.0.0.1", port)).close()


@pytest.mark.parametrize("extra", ["mqtt", "mdns"])
def test_an_extra_that_is_not_installed_is_told(extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(errors, "find_spec", lambda _name: None)
    with pytest.raises(OutboundError, match=rf"pip install 'millstream\[{extra}\]'"):
        Outbound.prepare(config(tmp_path, **{extra: {"enabled": True}}))


class Stream:
    def view(self) -> dict[str, Any]:
        return JOB


class Machine:
    """As far as the ways out look at one."""

    stream = Stream()
    unheard_stop = None

    class state:
        alarm = None

    def view(self) -> dict[str, Any]:
        return {"state": STATE, "link": "connected"}


class Workshop:
    def __init__(self) -> None:
        self.hub, self.outbound, self.machines = Hub(), Counters(), {"router": Machine()}


@pytest.mark.real
def test_all_at_once_at_one_workshop_and_nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.append(await reader.readuntil(b"}}}"))
        writer.write(b"HTTP/1.1 204 X\r\nConnection: close\r\n\r\n")
        writer.close()

    async def main() -> None:
        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/"
        async with Broker() as broker:
            made = Outbound.prepare(
                config(
                    tmp_path,
                    mtconnect={"enabled": True, "port": 0},
                    mqtt={"enabled": True, "host": "127.0.0.1", "port": broker.port},
                    webhook=[{"url": url, "events": ["alarm.raised"]}],
                    mdns={"enabled": True},
                )
            )
            assert made._agents is not None
            shop: Any = Workshop()
            where = made._agents.getsockname()
            with socket.create_server(("127.0.0.1", 0)) as listening:
                async with made.running(shop, listening):
                    reader, writer = await asyncio.open_connection(*where)
                    await reader.readuntil(b"comms|NORMAL||||\n")
                    await broker.until(lambda: "millstream/router/job" in broker.retained)
                    assert shop.hub.readers == 3
                    alarm = {"code": 1, "axis": None, "message": "Hard limit"}
                    shop.hub.publish("alarm", "router", {"alarm": alarm})
                    async with asyncio.timeout(5):
                        while shop.outbound.webhook.sent < 1:
                            await asyncio.sleep(0.01)
                    assert [way.connected for _, way in shop.outbound.each()] == [1, 1, 0, 0]
            assert shop.hub.readers == 0
            assert [way.connected for _, way in shop.outbound.each()] == [0, 0, 0, 0]
            writer.close()
        server.close()

    asyncio.run(asyncio.wait_for(main(), 10))
    assert b'"event":"alarm.raised"' in asked[0]


def test_a_bug_in_a_way_out_ends_that_way_alone(caplog: pytest.LogCaptureFixture) -> None:
    async def broken() -> None:
        raise KeyError("x")

    with caplog.at_level(logging.ERROR):
        asyncio.run(service._watched("MQTT", broken()))
    assert "MQTT has ended; the machines are not concerned" in caplog.text
