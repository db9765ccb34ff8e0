"""The workshop with a virtual Grbl (grblworkshop.py), its panel, and the API on top where a test wants it.

The one rule: what the controller has stored is read from the controller, never from an answer.
"""

from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from server.app import Workshop
from server.machine.controller import Controller
from server.machine.panel import Panel
from server.problems import ProblemError
from sim.grbl.simsettings import SimSettings
from tests.harness.apps import create_app
from tests.harness.fakeworkshop import BASE_URL
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import until
from tests.harness.workshop import MACHINE

API = f"/api/v1/machines/{MACHINE}"


@dataclass
class PanelBench(GrblBench):
    """The world around a daemon with one Grbl."""

    @property
    def controller(self) -> Controller:
        assert self.shop is not None
        return self.shop.machines[MACHINE]

    @property
    def panel(self) -> Panel:
        assert self.shop is not None
        return self.shop.panels[MACHINE]

    def stored(self, number: int) -> str:
        """A setting as the controller has it."""
        shown: str = self.machine.core.memory.show(number)
        return shown

    def sent(self) -> list[str]:
        """What the daemon has sent, in order, but for status questions."""
        return [line["text"] for line in self.controller.console(1000) if line["direction"] == ">"]

    async def ready(self) -> Workshop:
        """A daemon whose controller is idle and has told its overrides."""
        shop = await self.connected()
        await self.reaches("idle")
        await until(lambda: bool(self.controller.state.overrides), within_s=30)
        return shop

    async def reaches(self, *statuses: str, within_s: float = 30.0) -> None:
        """The machine is in one of these states."""
        await until(lambda: self.controller.state.status in statuses, within_s=within_s)

    def history(self, kind: str) -> list[dict[str, Any]]:
        """What of this kind stands in the history."""
        import json

        self.databases[-1].commit()
        rows = self.databases[-1].db.query("select data from events where type = ? order by id", [kind])
        return [json.loads(row["data"]) for row in rows]


def bench(folder: Path, **settings: Any) -> PanelBench:
    """A bench whose controller is of this kind (sim/grbl/simsettings.py)."""
    return PanelBench(folder, settings=SimSettings(**settings))


@asynccontextmanager
async def api(world: PanelBench) -> AsyncIterator[httpx.AsyncClient]:
    """A client of the bench's daemon, without a network. The daemon is stopped at the end."""
    shop = await world.ready()
    transport = httpx.ASGITransport(create_app(shop))
    async with httpx.AsyncClient(transport=transport, base_url=BASE_URL, timeout=None) as client:
        yield client
    await shop.stop()


async def ask(client: httpx.AsyncClient, method: str, path: str, body: Any = None) -> tuple[int, Any]:
    """Status and JSON of a request about the machine."""
    answer = await client.request(method, f"{API}{path}", json=body)
    return answer.status_code, answer.json()


async def refusal(asked: Coroutine[Any, Any, Any]) -> ProblemError:
    """The problem that it ends with."""
    try:
        await asked
    except ProblemError as problem:
        return problem
    raise AssertionError("it was not refused")
