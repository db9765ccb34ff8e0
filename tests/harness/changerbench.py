"""A daemon of each protocol with a tool changer and its whole HTTP, in simulated time: stories are told to `told`.

The changer is either the virtual one on a WebSocket (`Wired`) or the test itself, by PATCH. One application serves all
stories of a process, for making it takes longer than a story. The one rule: what happened is read from the machine,
the changer's magazine, and what the API says.
"""

import asyncio
from collections.abc import Awaitable, Callable
from functools import cache
from pathlib import Path
from typing import Any

import httpx
from fastapi import FastAPI

from server.app import Workshop
from server.config.model import Config
from server.machine.controller import Controller
from sim.changer.changer import VirtualChanger
from sim.changer.settings import ChangerSettings
from tests.harness.apps import create_app
from tests.harness.asgisocket import AsgiSocket
from tests.harness.grblworkshop import GrblBench
from tests.harness.ncworkshop import HERE, NcBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

BASE_URL = "http://127.0.0.1:8420"
ROUTER = f"/api/v1/machines/{MACHINE}"
ENDED = ("completed", "failed", "cancelled", "interrupted")
BENCHES: dict[str, type[Bench]] = {"elvinto": Bench, "grbl": GrblBench, "ncframe": NcBench}
AT_THE_PLACE = frozenset({"M5", "T1M6", "M6", "M6 T1", "T5M6", "M6 T5"})
"""What a machine executes to stand where tools are changed: M5 is what a Grbl is sent in the place of M6."""


def bench_of(protocol: str, folder: Path, **toolchanger: Any) -> Bench:
    return BENCHES[protocol](folder, options={"toolchanger": toolchanger})


class Desk:
    """The services of whichever daemon runs now."""

    config = Config()
    shop: Workshop | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.shop, name)


@cache
def desk() -> tuple[Desk, FastAPI]:
    services = Desk()
    return services, create_app(services)


class Wired:
    """A virtual changer on a socket of the daemon. `seen`: what changed on its side of the wire, a step an entry."""

    def __init__(self, changer: VirtualChanger, socket: AsgiSocket) -> None:
        self.changer, self.socket = changer, socket
        self.seen: list[dict[str, Any]] = []
        self._changed = asyncio.Event()
        self._tasks = [asyncio.ensure_future(self._listen()), asyncio.ensure_future(self._live())]

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        await self.socket.say({"type": "io", "machine": MACHINE, "connect": True, "pins": self.changer.connect()})
        while True:
            message = await self.socket.hear(within_s=90_000)
            if message["type"] == "io":
                self.seen.append(message["data"]["pins"])
                self.changer.see(message["data"]["pins"], loop.time())
                self._changed.set()
            else:
                assert message["type"] == "hello" or message["ok"], message

    async def _live(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self.changer.handle_timer(loop.time())
            if changed := self.changer.changes():
                await self.socket.say({"type": "io", "machine": MACHINE, "pins": changed})
            at = self.changer.next_timer()
            timer = None if at is None else loop.call_at(max(at, loop.time()), self._changed.set)
            await self._changed.wait()
            self._changed.clear()
            if timer is not None:
                timer.cancel()

    def fault(self, reason: int) -> None:
        """The changer has a fault now."""
        self.changer.fault(reason, asyncio.get_running_loop().time())
        self._changed.set()

    def press_estop(self) -> None:
        self.changer.press_estop(asyncio.get_running_loop().time())
        self._changed.set()

    def release_estop(self) -> None:
        self.changer.release_estop(asyncio.get_running_loop().time())
        self._changed.set()

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()

    def orders(self, *pins: str) -> list[tuple[str, Any]]:
        """What these pins did, in order."""
        return [(pin, value) for step in self.seen for pin, value in step.items() if pin in pins]


class Story:
    """A daemon and what people say to it over HTTP. `wired` where the changer is on a socket."""

    wired: Wired

    def __init__(self, bench: Bench, client: httpx.AsyncClient) -> None:
        self.bench, self.client = bench, client

    @property
    def shop(self) -> Workshop:
        shop = self.bench.shop
        assert shop is not None
        return shop

    @property
    def router(self) -> Controller:
        return self.shop.machines[MACHINE]

    async def post(self, path: str, status: int = 202, **body: Any) -> Any:
        answer = await self.client.post(f"{ROUTER}/{path}", json=body or None)
        assert answer.status_code == status, (path, answer.text)
        return answer.json()

    async def drive(self, levels: dict[str, bool | int], status: int = 200) -> Any:
        answer = await self.client.patch(f"{ROUTER}/io", json={"pins": levels})
        assert answer.status_code == status, answer.text
        return answer.json()

    async def get(self, path: str) -> Any:
        answer = await self.client.get(f"{ROUTER}/{path}")
        assert answer.status_code == 200, answer.text
        return answer.json()

    async def io(self) -> Any:
        return await self.get("io")

    def pin(self, name: str) -> bool | int:
        return next(pin.value for pin in self.router.tools.io.pins() if pin.name == name)

    async def rises(self, name: str, *, within_s: float = 60.0) -> None:
        await until(lambda: self.pin(name), within_s=within_s)

    async def ended(self, text: str) -> Any:
        job = await self.bench.job(text)
        return await self.bench.status(job["id"], *ENDED, within_s=600)

    async def at_rest(self) -> None:
        """Connected, idle, and a lathe knows where it stands."""
        await until(lambda: self.router.link_status == "connected", within_s=30)
        await until(lambda: self.router.state.status == "idle", within_s=30)
        if isinstance(self.bench, NcBench):
            assert (await self.router.run_blocks([HERE]))[0]["ok"]

    @property
    def went_to_the_place(self) -> bool:
        """The machine has executed what brings it to where tools are changed."""
        return bool(AT_THE_PLACE & {text.replace(" F240", "") for text in self.bench.executed()})

    async def restarted(self) -> Workshop:
        """kill -9, and another daemon."""
        self.bench.crash()
        desk()[0].shop = shop = await self.bench.connected()
        return shop


Telling = Callable[[Any], Awaitable[None]]


def told(folder: Path, story: Telling, *, protocol: str = "elvinto", **toolchanger: Any) -> None:
    """A story with whoever changes the tools behind HTTP."""

    async def main() -> None:
        bench = bench_of(protocol, folder, **toolchanger)
        services, app = desk()
        services.shop = await bench.connected()
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=BASE_URL) as client:
            one = Story(bench, client)
            await one.at_rest()
            await story(one)
        if bench.shop is not None:
            await bench.shop.stop()

    run_simulated(main())


def told_wired(
    folder: Path,
    story: Telling,
    *,
    protocol: str = "elvinto",
    changer: ChangerSettings | None = None,
    **toolchanger: Any,
) -> None:
    """A story with the virtual changer on a WebSocket: connected, its e-stop reset, ready."""

    async def wired(s: Story) -> None:
        async with AsgiSocket(desk()[1], query={"topics": "io", "machines": MACHINE}) as socket:
            s.wired = Wired(VirtualChanger(changer or ChangerSettings()), socket)
            await until(lambda: s.router.tools.io.connected, within_s=5)
            await s.post("unlock" if protocol == "ncframe" else "reset")
            await until(lambda: s.router.tools.io.start_refusal is None, within_s=5)
            await s.at_rest()
            await story(s)
            s.wired.close()

    told(folder, wired, protocol=protocol, kind="external", **toolchanger)
