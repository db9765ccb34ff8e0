"""The HAL component as the changer of a whole daemon: what the one sends is what the other takes, and back."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from integrations.linuxcnc_hal.millstream_hal import IN, OUT, Bridge
from server.app import Workshop
from tests.harness.apps import create_app
from tests.harness.asgisocket import AsgiSocket
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

JUMPERS = {
    "emc-enable-in": "user-enable-out",
    "tool-prepared": "tool-prepare",
    "tool-changed": "tool-change",
    "emc-abort-ack": "emc-abort",
    "start-change-ack": "start-change",
}
"""The net statements of a HAL file without a changer."""


class Component(dict[str, Any]):
    """The pins of HAL with its wires: what is read of an input is what its wire carries."""

    jammed: frozenset[str] = frozenset()

    def __getitem__(self, pin: str) -> Any:
        return super().__getitem__(pin if pin in self.jammed else JUMPERS.get(pin, pin))


@asynccontextmanager
async def hal(shop: Workshop, jammed: frozenset[str] = frozenset()) -> AsyncIterator[Bridge]:
    """A HAL with jumpers, but for `jammed` inputs, which follow nothing."""
    pins = {**OUT, **IN, "heartbeat": "bit"}
    bridge = Bridge(Component({pin: False if kind == "bit" else 0 for pin, kind in pins.items()}), MACHINE)
    bridge._component.jammed = jammed  # type: ignore[attr-defined]
    async with AsgiSocket(create_app(shop), query={"topics": "io", "machines": MACHINE}) as socket:
        await socket.say(json.loads(bridge.greeting()))

        async def listen() -> None:
            while True:
                message = await socket.hear(within_s=90_000)
                assert message["type"] != "result" or message["ok"], message
                bridge.take(json.dumps(message))
                if (changes := bridge.changes()) is not None:
                    await socket.say(json.loads(changes))

        listening = asyncio.ensure_future(listen())
        await until(lambda: shop.machines[MACHINE].tools.io.connected, within_s=5)
        yield bridge
        listening.cancel()
        await asyncio.gather(listening, return_exceptions=True)


def test_a_hal_with_jumpers_changes_the_tools_of_a_job(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, options={"toolchanger": {"kind": "external", "support_start_change": True}})
        shop = await bench.connected()
        router = shop.machines[MACHINE]
        async with hal(shop) as bridge:
            router.tools.estop_reset()
            await until(lambda: router.tools.io.start_refusal is None, within_s=5)
            job = await bench.job("G90\nG1 X1 F3000\nT2 M6\nG1 X2\nT3 M6\nG1 X3\nM30\n")
            view = await bench.status(job["id"], "completed", "failed", within_s=60)
            assert view["status"] == "completed", view
            assert (router.tools.io.tool, bridge._component["tool-number"]) == (3, 3)
        await asyncio.sleep(0.1)
        assert not router.tools.io.connected, "the end of the socket is the end of the changer"
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("way", ["unlock", "reset"])
def test_the_e_stop_behind_a_restart_is_reset_although_a_job_waits_for_its_tool(tmp_path: Path, way: str) -> None:
    """A daemon with an external changer starts in an e-stop, and only behind it the tool is asked for again."""

    async def main() -> None:
        bench = Bench(tmp_path, options={"toolchanger": {"kind": "external"}})
        shop = await bench.connected()
        async with hal(shop, jammed=frozenset({"tool-changed"})):
            router = shop.machines[MACHINE]
            router.tools.estop_reset()
            await until(lambda: router.tools.io.start_refusal is None, within_s=5)
            job = await bench.job("G90\nG1 X1 F3000\nT2 M6\nG1 X2\nM30\n")
            await bench.status(job["id"], "waiting", within_s=60)
            await shop.stop()
        bench.shop = None
        shop = await bench.connected()
        router = shop.machines[MACHINE]
        async with hal(shop):
            assert router.tools.io.start_refusal == "the e-stop is not reset"
            await getattr(router, way)()
            await bench.status(job["id"], "paused", within_s=60)
            assert router.tools.io.tool == 2
            router.resume()
            view = await bench.status(job["id"], "completed", "failed", within_s=60)
            assert (view["status"], bench.executed()[-2:]) == ("completed", ["G1X2", "M30"])
        await shop.stop()

    run_simulated(main())
