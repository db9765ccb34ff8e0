#!/usr/bin/env python3
"""The tool changer of a LinuxCNC HAL for a millstream daemon: its I/O control pins as a HAL component.

A HAL file that was written for LinuxCNC's own iocontrol finds the same pins under the same names. Nothing is decided
here: levels go from the daemon to HAL and back. One file without parts of millstream: copy it to the HAL machine.
The one rule: while the daemon does not answer, no request stands on a pin, and the abort line is up.
"""

import argparse
import asyncio
import importlib
import json
import logging
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlencode

logger = logging.getLogger("millstream_hal")

OUT: dict[str, str] = {
    "coolant-flood": "bit",
    "coolant-mist": "bit",
    "user-enable-out": "bit",
    "user-request-enable": "bit",
    "tool-prepare": "bit",
    "tool-prep-number": "s32",
    "tool-prep-pocket": "s32",
    "tool-prep-index": "s32",
    "tool-change": "bit",
    "tool-number": "s32",
    "emc-abort": "bit",
    "emc-reason": "s32",
    "start-change": "bit",
    "toolchanger-fault-ack": "bit",
    "toolchanger-faulted": "bit",
    "state": "s32",
}
"""What the daemon drives: outputs of the component."""
IN: dict[str, str] = {
    "emc-enable-in": "bit",
    "tool-prepared": "bit",
    "tool-changed": "bit",
    "emc-abort-ack": "bit",
    "start-change-ack": "bit",
    "toolchanger-fault": "bit",
    "toolchanger-reason": "s32",
    "toolchanger-clear-fault": "bit",
}
"""What HAL drives: inputs of the component."""
HEARTBEAT = "heartbeat"
"""Of the component itself: toggles in every period, so that a watchdog in HAL notices when the component is no more."""

ALONE: dict[str, bool | int] = {
    "tool-prepare": False,
    "tool-change": False,
    "start-change": False,
    "user-request-enable": False,
    "emc-reason": 1,
    "emc-abort": True,
}
"""On the pins while the daemon does not answer: an abort. Coolant and enable stay, for a job may be cutting."""

PULSE = "user-request-enable"
PULSE_S = 0.02
"""The pulse is at least so long, however near to each other its two messages arrive: a thread of HAL has to see it."""
S32 = range(-(2**31), 2**31)
PERIOD_S = 0.01
"""How often the inputs are read: quicker than a person, slower than a network."""
RETRY_S = 1.0
SILENT_S = 5.0
"""A ping is sent so often; without an answer within as long the connection is given up."""


class Component(Protocol):
    """As much of `hal.component` as is used."""

    def __getitem__(self, pin: str) -> bool | int: ...

    def __setitem__(self, pin: str, value: bool | int) -> None: ...


def _fits(value: object, kind: str) -> bool:
    if isinstance(value, bool):
        return kind == "bit"
    return kind == "s32" and isinstance(value, int) and value in S32


class Bridge:
    """Levels both ways, for one machine. `clock` tells seconds."""

    def __init__(self, component: Component, machine: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._component = component
        self._machine = machine
        self._clock = clock
        self._said: dict[str, bool | int] = {}
        self._pulse_until: float | None = None
        """The pulse stands on its pin until then at least."""
        self._pulse_is_over = False
        """It is over for the daemon."""
        self.alone()

    def alone(self) -> None:
        """The daemon does not answer."""
        self._pulse_until = None
        self._pulse_is_over = False
        for pin, value in ALONE.items():
            self._component[pin] = value

    def beat(self) -> None:
        """The component runs."""
        self._component[HEARTBEAT] = not self._component[HEARTBEAT]

    def greeting(self) -> str:
        """The first message of a connection: all inputs, and that a changer is there."""
        self._said = self._inputs()
        return self._message({"connect": True, "pins": self._said})

    def changes(self) -> str | None:
        """The inputs that have changed since they were told last, all in one message; None: none. To be asked in every
        period: what has to fall later falls here."""
        self._end_pulse()
        now = self._inputs()
        changed = {pin: value for pin, value in now.items() if value != self._said[pin]}
        self._said = now
        return self._message({"pins": changed}) if changed else None

    def take(self, text: str | bytes) -> None:
        """A message of the daemon. What is not about the pins of this machine, or no level, is passed over."""
        try:
            message = json.loads(text)
        except ValueError:
            logger.warning("not JSON: %.80r", text)
            return
        if not isinstance(message, dict):
            return
        if message.get("type") == "result" and message.get("ok") is False:
            logger.error("the daemon refuses: %.200s", message.get("error"))
        if message.get("type") != "io" or message.get("machine") != self._machine:
            return
        data = message.get("data")
        pins = data.get("pins") if isinstance(data, dict) else None
        if isinstance(pins, dict):
            self._drive(pins)

    def _drive(self, pins: Mapping[str, Any]) -> None:
        """In the order of the message: the daemon sets a number before the line that says it is good."""
        for pin, value in pins.items():
            if pin == PULSE and isinstance(value, bool):
                self._pulse(high=value)
            elif pin in OUT and _fits(value, OUT[pin]):
                self._component[pin] = value
            elif pin not in IN:
                logger.warning("no level of a pin: %.40r = %.40r", pin, value)

    def _pulse(self, *, high: bool) -> None:
        self._pulse_is_over = not high
        if high:
            self._component[PULSE] = True
            self._pulse_until = self._clock() + PULSE_S
        self._end_pulse()

    def _end_pulse(self) -> None:
        if self._pulse_is_over and (self._pulse_until is None or self._clock() >= self._pulse_until):
            self._component[PULSE] = False
            self._pulse_until = None
            self._pulse_is_over = False

    def _inputs(self) -> dict[str, bool | int]:
        return {
            pin: bool(self._component[pin]) if kind == "bit" else int(self._component[pin]) for pin, kind in IN.items()
        }

    def _message(self, more: Mapping[str, object]) -> str:
        return json.dumps({"type": "io", "machine": self._machine, **more})


async def serve(bridge: Bridge, connection: Any, period_s: float) -> None:
    """One connection, until it breaks (raises what websockets raises)."""
    await connection.send(bridge.greeting())
    reading = asyncio.ensure_future(_read(bridge, connection))
    try:
        while not reading.done():
            await asyncio.wait({reading}, timeout=period_s)
            if (text := bridge.changes()) is not None:
                await connection.send(text)
        await reading
    finally:
        reading.cancel()
        bridge.alone()


async def _read(bridge: Bridge, connection: Any) -> None:
    async for text in connection:
        bridge.take(text)


def address(url: str, machine: str) -> str:
    """The WebSocket of a daemon given as http(s):// or ws(s)://, for the pins of one machine."""
    base = url.rstrip("/").replace("http", "ws", 1) if url.startswith("http") else url.rstrip("/")
    return f"{base}/api/v1/events?{urlencode({'topics': 'io', 'machines': machine})}"


def connect_options(token: str | None, version: str) -> dict[str, Any]:
    """`websockets` has changed the name of its header argument in version 14; distributions have older ones."""
    options: dict[str, Any] = {"ping_interval": SILENT_S, "ping_timeout": SILENT_S, "max_size": 16 * 1024 * 1024}
    if token:
        name = "additional_headers" if int(version.split(".", maxsplit=1)[0]) >= 14 else "extra_headers"
        options[name] = {"Authorization": f"Bearer {token}"}
    return options


async def run(
    bridge: Bridge, url: str, token: str | None, *, period_s: float = PERIOD_S, retry_s: float = RETRY_S
) -> None:
    """Connect, and again after every break, for ever."""
    import websockets
    from websockets.exceptions import WebSocketException
    from websockets.version import version

    options = connect_options(token, version)
    told = ""
    beating = asyncio.ensure_future(_beat(bridge, period_s))
    while not beating.done():
        try:
            async with websockets.connect(url, **options) as connection:
                logger.info("connected to %s", url)
                told = ""
                await serve(bridge, connection, period_s)
                logger.warning("the daemon has closed the connection")
        except (OSError, TimeoutError, WebSocketException) as error:
            if str(error) != told:  # once, not in every second of a night
                logger.warning("no connection to %s: %s", url, error)
            told = str(error)
        await asyncio.wait({beating}, timeout=retry_s)
    await beating


async def _beat(bridge: Bridge, period_s: float) -> None:
    while True:
        bridge.beat()
        await asyncio.sleep(period_s)


def make_component(hal: Any, name: str) -> Any:
    """The component with all its pins, not ready yet."""
    component = hal.component(name)
    types = {"bit": hal.HAL_BIT, "s32": hal.HAL_S32}
    for pins, direction in ((OUT, hal.HAL_OUT), (IN, hal.HAL_IN)):
        for pin, kind in pins.items():
            component.newpin(pin, types[kind], direction)
    component.newpin(HEARTBEAT, hal.HAL_BIT, hal.HAL_OUT)
    return component


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="The I/O control pins of a millstream daemon in a LinuxCNC HAL.")
    parser.add_argument("--url", required=True, help="the daemon, as http://mill.local:8420")
    parser.add_argument("--machine", required=True, help="the machine's name in the daemon")
    parser.add_argument("--token-file", type=Path, help="a file with a token of the role operator")
    parser.add_argument("--name", default="iocontrol.0", help="of the component; the default takes iocontrol's place")
    parser.add_argument("--period", type=float, default=PERIOD_S, help="seconds between two looks at the inputs")
    return parser.parse_args(argv)


def main(argv: list[str] | None = None, hal: Any = None) -> int:
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    given = arguments(argv)
    token = given.token_file.read_text(encoding="utf-8").strip() if given.token_file else None
    if hal is None:
        hal = importlib.import_module("hal")  # only there on a machine with LinuxCNC
    try:
        component = make_component(hal, given.name)
    except hal.error as error:
        logger.error(
            "HAL takes no component %s (%s): is one loaded, or was one killed? `halrun -U` ends a HAL",
            given.name,
            error,
        )
        return 1
    bridge = Bridge(component, given.machine)
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # so halrun ends its components
    component.ready()  # loadusr -W waits for this
    try:
        asyncio.run(run(bridge, address(given.url, given.machine), token, period_s=given.period))
    except KeyboardInterrupt:
        pass
    finally:
        component.exit()
        signal.signal(signal.SIGTERM, before)
    return 0


if __name__ == "__main__":
    sys.exit(main())
