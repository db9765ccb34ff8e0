"""The HAL component against a HAL and a daemon that are played here."""

import asyncio
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import websockets

from integrations.linuxcnc_hal import millstream_hal
from integrations.linuxcnc_hal.millstream_hal import (
    ALONE,
    HEARTBEAT,
    IN,
    OUT,
    PULSE,
    PULSE_S,
    Bridge,
    address,
    connect_options,
    make_component,
    run,
)
from protocol.iocontrol.config import IoConfig
from protocol.iocontrol.control import IoControl
from protocol.iocontrol.events import Event, PinChanged, Snapshot
from protocol.iocontrol.pins import PINS

SCRIPT = Path(millstream_hal.__file__)


class FakeComponent:
    """`hal.component`: pins with a type and a direction that it insists on."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.pins: dict[str, tuple[str, str]] = {}
        self.values: dict[str, bool | int] = {}
        self.is_ready = self.has_exited = False
        self.history: list[tuple[str, bool | int]] = []

    def newpin(self, name: str, type_: str, direction: str) -> None:
        assert name not in self.pins
        self.pins[name] = (type_, direction)
        self.values[name] = False if type_ == "bit" else 0

    def ready(self) -> None:
        self.is_ready = True

    def exit(self) -> None:
        self.has_exited = True

    def __getitem__(self, pin: str) -> bool | int:
        return self.values[pin]

    def __setitem__(self, pin: str, value: bool | int) -> None:
        type_, direction = self.pins[pin]
        assert direction == "out", "HAL does not let a component write its inputs"
        assert isinstance(value, bool) == (type_ == "bit")
        self.values[pin] = value
        self.history.append((pin, value))


HAL = SimpleNamespace(component=FakeComponent, HAL_BIT="bit", HAL_S32="s32", HAL_OUT="out", HAL_IN="in")


def bridge() -> tuple[Bridge, FakeComponent]:
    component = make_component(HAL, "iocontrol.0")
    return Bridge(component, "router"), component


def io(pins: dict[str, Any], machine: str = "router") -> str:
    return json.dumps({"seq": 1, "type": "io", "machine": machine, "at": "now", "data": {"pins": pins}})


def test_the_pins_are_those_of_the_protocol() -> None:
    assert {pin: spec.type for pin, spec in PINS.items() if spec.direction == "out"} == OUT
    assert {pin: spec.type for pin, spec in PINS.items() if spec.direction == "in"} == IN
    assert set(ALONE) <= set(OUT)
    _, component = bridge()
    ours = {**{p: (t, "out") for p, t in OUT.items()}, **{p: (t, "in") for p, t in IN.items()}}
    assert component.pins == {**ours, HEARTBEAT: ("bit", "out")}
    assert HEARTBEAT not in ours, "the daemon has nothing to do with it"


def test_without_a_daemon_the_abort_line_is_up() -> None:
    _, component = bridge()
    assert {pin: component[pin] for pin in ALONE} == ALONE


def test_the_greeting_tells_all_inputs_and_then_only_what_changes() -> None:
    made, component = bridge()
    component.values.update({"tool-prepared": True, "toolchanger-reason": -4})
    greeting = json.loads(made.greeting())
    assert (greeting["type"], greeting["machine"], greeting["connect"]) == ("io", "router", True)
    assert greeting["pins"] == {
        **{pin: False if kind == "bit" else 0 for pin, kind in IN.items()},
        "tool-prepared": True,
        "toolchanger-reason": -4,
    }
    assert made.changes() is None
    component.values.update({"tool-prepared": False, "toolchanger-fault": True})
    assert json.loads(made.changes() or "") == {
        "type": "io",
        "machine": "router",
        "pins": {"tool-prepared": False, "toolchanger-fault": True},
    }
    assert made.changes() is None


def test_the_daemons_levels_are_driven_in_their_order() -> None:
    made, component = bridge()
    component.history.clear()
    made.take(io({"tool-prep-number": 5, "tool-prep-pocket": 12, "tool-prepare": True}))
    assert component.history == [("tool-prep-number", 5), ("tool-prep-pocket", 12), ("tool-prepare", True)]


@pytest.mark.parametrize(
    "text",
    [
        "no JSON",
        b"\xff\xfe",
        "[]",
        "17",
        '{"type": "io"}',
        '{"type": "io", "machine": "router"}',
        '{"type": "io", "machine": "router", "data": {"pins": []}}',
        '{"type": "hello", "machine": null, "data": {"pins": {"tool-change": true}}}',
        '{"type": "result", "ok": false, "error": {"code": "forbidden"}}',
        io({"tool-change": True}, machine="lathe"),
        io({"tool-change": 1, "tool-number": True, "state": 2**31, "emc-reason": 1.5, "x": True, "tool-changed": True}),
    ],
)
def test_what_is_no_level_of_ours_moves_no_pin(text: str | bytes) -> None:
    made, component = bridge()
    component.history.clear()
    made.take(text)
    assert component.history == []


def test_the_pulse_of_a_reset_is_long_enough_for_a_thread_of_hal() -> None:
    """Its two messages may come together, for networks collect; what came late already is not made longer."""
    now = 100.0
    component = make_component(HAL, "iocontrol.0")
    made = Bridge(component, "router", clock=lambda: now)
    made.greeting()
    made.take(io({"user-request-enable": True}))
    made.take(io({"user-request-enable": False}))
    now += PULSE_S * 0.9
    made.changes()
    assert component[PULSE] is True
    now += PULSE_S * 0.2
    made.changes()
    assert component[PULSE] is False

    made.take(io({"user-request-enable": True}))
    now += PULSE_S * 5
    made.changes()
    assert component[PULSE] is True, "the daemon wants it to be longer"
    made.take(io({"user-request-enable": False}))
    assert component[PULSE] is False

    made.take(io({"user-request-enable": True}))
    made.alone()
    assert component[PULSE] is False


def test_the_heart_beats_while_the_daemon_does_not_answer() -> None:
    made, component = bridge()

    async def alone() -> None:
        running = asyncio.ensure_future(run(made, "ws://127.0.0.1:1/", None, period_s=0.001, retry_s=60))
        await until(lambda: len([value for pin, value in component.history if pin == HEARTBEAT]) > 4)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    asyncio.run(alone())
    beats = [value for pin, value in component.history if pin == HEARTBEAT]
    assert beats[:4] == [True, False, True, False]


def test_a_name_that_hal_does_not_give_is_said(monkeypatch: pytest.MonkeyPatch, caplog: Any) -> None:
    class HalError(Exception):
        pass

    def taken(name: str) -> FakeComponent:
        raise HalError("Invalid argument")

    hal = SimpleNamespace(**{**vars(HAL), "component": taken, "error": HalError})
    assert millstream_hal.main(["--url", "http://mill:8420", "--machine", "router"], hal) == 1
    assert "iocontrol.0" in caplog.text
    assert "halrun -U" in caplog.text


def test_the_address_and_the_token() -> None:
    assert (
        address("http://mill.local:8420/", "router 2")
        == "ws://mill.local:8420/api/v1/events?topics=io&machines=router+2"
    )
    assert address("https://mill.local", "router").startswith("wss://mill.local/api/v1/events?")
    assert address("ws://mill.local", "router").startswith("ws://mill.local/api")
    assert connect_options("t", "15.0.1")["additional_headers"] == {"Authorization": "Bearer t"}
    assert connect_options("t", "10.4")["extra_headers"] == {"Authorization": "Bearer t"}
    assert not [name for name in connect_options(None, "15.0") if "headers" in name]


class PlayedDaemon:
    """A block of the real protocol behind a real WebSocket, as the daemon's would be."""

    def __init__(self) -> None:
        self.io = IoControl(IoConfig(kind="external", start_in_estop=False, ack_timeout_s=0.0), None, 0.0)
        self.seen: list[Event] = []
        self.connections: list[Any] = []
        self.authorization: str | None = None

    async def serve(self, connection: Any) -> None:
        self.authorization = connection.request.headers.get("Authorization")
        assert connection.request.path == "/api/v1/events?topics=io&machines=router"
        self.connections.append(connection)
        try:
            async for text in connection:
                message = json.loads(text)
                if message.get("connect"):
                    self.io.connect(message["pins"], 0.0)
                else:
                    self.io.set_inputs(message["pins"], 0.0)
                await self.pump()
        finally:
            self.connections.remove(connection)
            self.io.disconnect(0.0)

    async def pump(self) -> None:
        while (event := self.io.next_event()) is not None:
            self.seen.append(event)
            pins = dict(event.pins) if isinstance(event, Snapshot) else {}
            if isinstance(event, PinChanged):
                pins = {event.pin: event.value}
            for connection in self.connections if pins else []:
                await connection.send(io(pins))


async def until(condition: Any) -> None:
    async with asyncio.timeout(10.0):
        while not condition():
            await asyncio.sleep(0.005)


async def a_whole_change() -> None:
    daemon = PlayedDaemon()
    made, component = bridge()
    component.values.update({"emc-enable-in": True})
    async with websockets.serve(daemon.serve, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        running = asyncio.ensure_future(
            run(made, address(f"http://127.0.0.1:{port}", "router"), "secret", period_s=0.002, retry_s=0.01)
        )
        try:
            await until(lambda: daemon.io.connected)
            assert daemon.authorization == "Bearer secret"
            component.values["emc-abort-ack"] = True  # the changer takes note of the start
            await until(lambda: component["emc-abort"] is False)
            assert component["emc-reason"] == 7
            component.values["emc-abort-ack"] = False
            daemon.io.prepare(5, 0.0)
            await daemon.pump()
            await until(lambda: component["tool-prepare"] is True)
            assert component["tool-prep-number"] == 5
            component.values["tool-prepared"] = True
            await until(lambda: component["tool-prepare"] is False)
            component.values["tool-prepared"] = False
            daemon.io.change(0.0)
            await daemon.pump()
            await until(lambda: component["tool-change"] is True)
            component.values["tool-changed"] = True
            await until(lambda: component["tool-number"] == 5)
            assert daemon.io.tool == 5

            component.values["tool-changed"] = False
            daemon.io.prepare(7, 0.0)
            await daemon.pump()
            await until(lambda: component["tool-prepare"] is True)
            await daemon.connections[0].close()  # the daemon goes, and comes back
            await until(lambda: component["tool-prepare"] is False and component["emc-abort"] is True)
            await until(lambda: len(daemon.connections) == 1 and daemon.io.connected)
            component.values["emc-abort-ack"] = True
            await until(lambda: component["emc-abort"] is False)
            assert component["toolchanger-faulted"] is True
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
    assert {pin: component[pin] for pin in ALONE} == ALONE


@pytest.mark.real
def test_a_whole_change_over_a_real_socket() -> None:
    asyncio.run(a_whole_change())


def test_the_script_makes_its_component_ready_and_takes_it_away(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made: list[FakeComponent] = []
    hal = SimpleNamespace(**{**vars(HAL), "component": lambda name: made.append(FakeComponent(name)) or made[-1]})
    token = tmp_path / "token"
    token.write_text("secret\n", encoding="utf-8")
    called: list[tuple[str, str | None]] = []

    async def stop(bridge: Bridge, url: str, token: str | None, **_: float) -> None:
        assert made[0].is_ready
        called.append((url, token))
        raise KeyboardInterrupt

    monkeypatch.setattr(millstream_hal, "run", stop)
    argv = ["--url", "http://mill:8420", "--machine", "router", "--token-file", str(token)]
    assert millstream_hal.main(argv, hal) == 0
    assert called == [("ws://mill:8420/api/v1/events?topics=io&machines=router", "secret")]
    assert (made[0].name, made[0].has_exited) == ("iocontrol.0", True)


def test_the_one_file_runs_by_itself() -> None:
    """It is copied to a machine that has nothing of ours."""
    answer = subprocess.run(
        [sys.executable, "-I", str(SCRIPT), "--help"], capture_output=True, text=True, timeout=30, check=False
    )
    assert answer.returncode == 0
    readme = (SCRIPT.parent / "README.md").read_text(encoding="utf-8")
    for option in ("--url", "--machine", "--token-file", "--name", "--period"):
        assert option in answer.stdout
        assert f"`{option}`" in readme
