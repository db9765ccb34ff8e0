"""An external tool changer over the API, from the first T to every fault: the virtual changer at the other end.

The orders are those of the table in docs/toolchanger.md; what a changer sees is what the WebSocket tells. The truth
about tools is in the virtual changer's magazine.
"""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.api import create_app
from server.app import Workshop
from server.controller import Controller
from sim.changer.changer import VirtualChanger
from sim.changer.settings import ChangerSettings
from tests.harness.asgisocket import AsgiSocket
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

BASE_URL = "http://127.0.0.1:8420"
ROUTER = "/api/v1/machines/router"
PROGRAM = "G21\nG90\nG1 X1 F3000\nT1 M6\nG1 X2\nT2\nM6\nG1 X3\nT3 M6\nX4\nM30\n"
ONE = "G21\nG90\nG1 X1 F3000\nT1 M6\nG1 X2\nM30\n"
ENDED = ("completed", "failed", "cancelled", "interrupted")


class Wired:
    """A virtual changer on a socket of the daemon. `seen`: what changed on its side of the wire, a step an entry."""

    def __init__(self, changer: VirtualChanger, socket: AsgiSocket, app: Any) -> None:
        self.changer, self.socket, self.app = changer, socket, app
        self.seen: list[dict[str, Any]] = []
        self._tasks = [asyncio.ensure_future(self._listen()), asyncio.ensure_future(self._live())]

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        await self.socket.say({"type": "io", "machine": "router", "connect": True, "pins": self.changer.connect()})
        while True:
            message = await self.socket.hear(within_s=90_000)
            if message["type"] == "io":
                self.seen.append(message["data"]["pins"])
                self.changer.see(message["data"]["pins"], loop.time())
            else:
                assert message["type"] == "hello" or message["ok"], message

    async def _live(self) -> None:
        while True:
            self.changer.handle_timer(asyncio.get_running_loop().time())
            if changed := self.changer.changes():
                await self.socket.say({"type": "io", "machine": "router", "pins": changed})
            await asyncio.sleep(0.005)

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()

    def orders(self, *pins: str) -> list[tuple[str, Any]]:
        """What these pins did, in order."""
        return [(pin, value) for step in self.seen for pin, value in step.items() if pin in pins]


class Story:
    def __init__(self, bench: Bench, shop: Workshop, client: httpx.AsyncClient, wired: Wired) -> None:
        self.bench, self.shop, self.client, self.wired = bench, shop, client, wired

    @property
    def router(self) -> Controller:
        return self.shop.machines[MACHINE]

    async def post(self, path: str, status: int = 202, **body: Any) -> Any:
        answer = await self.client.post(f"{ROUTER}/{path}", json=body or None)
        assert answer.status_code == status, answer.text
        return answer.json()

    async def io(self) -> Any:
        return (await self.client.get(f"{ROUTER}/io")).json()

    async def ready(self) -> None:
        await until(lambda: self.router.tools.io.connected, within_s=5)
        await self.post("reset")
        await until(lambda: self.router.tools.io.start_refusal is None, within_s=5)
        await until(lambda: self.router.link_status == "connected", within_s=30)
        await until(lambda: self.router.state.status == "idle", within_s=30)

    async def ended(self, text: str) -> Any:
        job = await self.bench.job(text)
        return await self.bench.status(job["id"], *ENDED, within_s=600)


def told(
    folder: Path,
    story: Callable[[Story], Awaitable[None]],
    *,
    protocol: str = "elvinto",
    changer: ChangerSettings | None = None,
    **toolchanger: Any,
) -> None:
    async def main() -> None:
        options = {"toolchanger": {"kind": "external", **toolchanger}}
        bench = GrblBench(folder, options=options) if protocol == "grbl" else Bench(folder, options=options)
        shop = await bench.connected()
        app = create_app(shop)
        transport = httpx.ASGITransport(app)
        async with (
            httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client,
            AsgiSocket(app, query={"topics": "io", "machines": "router"}) as socket,
        ):
            wired = Wired(VirtualChanger(changer or ChangerSettings()), socket, app)
            one = Story(bench, shop, client, wired)
            await one.ready()
            await story(one)
            wired.close()
        await one.shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("protocol", ["elvinto", "grbl"])
@pytest.mark.parametrize("start_change", [False, True])
def test_a_changer_changes_three_tools(tmp_path: Path, protocol: str, start_change: bool) -> None:
    async def story(s: Story) -> None:
        view = await s.ended(PROGRAM)
        assert view["status"] == "completed", view
        assert s.wired.changer.magazine.spindle == 3
        assert (await s.io())["tool"] == 3
        begun = s.wired.orders("tool-prepare", "start-change", "tool-change", "tool-number")
        started = [("start-change", True), ("start-change", False)] if start_change else []
        last = [
            *(("tool-prepare", True), ("tool-prepare", False), *started),
            *(("tool-change", True), ("tool-change", False), ("tool-number", 3)),
        ]
        assert begun[-len(last) :] == last

    told(tmp_path, story, protocol=protocol, support_start_change=start_change)


@pytest.mark.parametrize(
    ("reason", "status", "message"),
    [(7, "completed", None), (0, "failed", "toolchanger error 0"), (-5, "failed", "toolchanger error -5")],
)
def test_what_a_fault_in_the_change_means(tmp_path: Path, reason: int, status: str, message: str | None) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await asyncio.sleep(0.5)
        s.wired.changer.fault(reason, asyncio.get_running_loop().time())
        view = await s.bench.status(job["id"], *ENDED)
        assert view["status"] == status, view
        error = view["error"]
        assert (None if error is None else (error["code"], error["message"])) == (
            None if message is None else ("tool_change_failed", message)
        )
        assert s.wired.changer.magazine.spindle == 0
        io = await s.io()
        assert (io["tool"], io["faulted"]) == (0, True)
        assert io["parameters"] == {"#5060": 1.0, "#5600": 1.0, "#5601": float(reason)}
        assert ("emc-reason", 101) in s.wired.orders("emc-reason")
        pins = s.wired.orders("tool-change", "emc-abort", "toolchanger-fault-ack")
        assert pins[pins.index(("tool-change", True)) + 1 :][:3] == [
            ("toolchanger-fault-ack", True),
            ("tool-change", False),
            ("emc-abort", True),
        ]
        again = await s.ended(ONE)
        assert again["status"] == status, "the latch aborts the next M6 likewise"
        await asyncio.sleep(1)
        await s.post("tool/clear-fault")
        assert (await s.io())["parameters"]["#5060"] == 0.0
        assert (await s.ended(ONE))["status"] == "completed"
        assert s.wired.changer.magazine.spindle == 1

    told(tmp_path, story)


def test_a_fault_while_idle_aborts_the_next_change_before_anything_moves(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        s.wired.changer.fault(-2, asyncio.get_running_loop().time())
        await asyncio.sleep(1)
        view = await s.ended(ONE)
        assert view["error"]["code"] == "tool_change_failed"
        assert "T1M6" not in s.bench.executed()

    told(tmp_path, story)


def test_done_and_fault_at_once_is_believed_by_nobody(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await asyncio.sleep(30)
        assert (await s.bench.status(job["id"], "waiting"))["status"] == "waiting"
        io = await s.io()
        assert (io["tool"], io["waiting_for"], io["may_confirm"]) == (None, "verdict", True)
        await s.post("tool/confirm")
        await s.bench.status(job["id"], "completed")
        assert (await s.io())["tool"] == 1

    told(tmp_path, story, changer=ChangerSettings(both=1.0))


def test_a_lost_changer_fails_the_change_and_nobody_knows_the_tool(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await asyncio.sleep(0.5)
        s.wired.close()
        await s.wired.socket.disconnect()
        view = await s.bench.status(job["id"], *ENDED)
        assert (view["status"], view["error"]["code"]) == ("failed", "tool_change_failed")
        io = await s.io()
        assert (io["connected"], io["tool"], io["parameters"]["#5601"]) == (False, None, -1000.0)
        refused = await s.client.patch(f"{ROUTER}/io", json={"pins": {"tool-changed": True}})
        assert refused.status_code == 409
        async with AsgiSocket(s.wired.app, query={"topics": "io"}) as socket:
            wired = Wired(s.wired.changer, socket, s.wired.app)
            await until(lambda: s.router.tools.io.connected, within_s=5)
            await asyncio.sleep(1)
            refusal = (await s.io())["refusal"]
            assert refusal == "it is not known which tool is in the spindle"
            await s.post("tool/set", tool=0)
            await s.post("tool/clear-fault")
            assert (await s.ended(ONE))["status"] == "completed"
            wired.close()

    told(tmp_path, story)


def test_a_changer_that_says_nothing_is_waited_for_in_sight(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        view = await s.bench.status(job["id"], "waiting", within_s=60)
        assert view["tool"] == 1
        io = await s.io()
        assert (io["waiting_for"], io["overdue"]) == ("tool-prepared", True)
        await s.post("tool/fail")
        view = await s.bench.status(job["id"], *ENDED)
        assert (view["status"], view["error"]["code"]) == ("failed", "tool_change_failed")
        assert "T1M6" not in s.bench.executed()

    told(tmp_path, story, changer=ChangerSettings(silence=1.0), prepare_timeout=10.0)


def test_cancel_while_a_change_is_pending_is_reason_100(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await s.post("stop")
        await s.bench.status(job["id"], "cancelled")
        await asyncio.sleep(5)
        assert s.wired.orders("emc-reason", "emc-abort")[-3:] == [
            ("emc-reason", 100),
            ("emc-abort", True),
            ("emc-abort", False),
        ]
        assert (await s.ended(ONE))["status"] == "completed"

    told(tmp_path, story)


def test_e_stop_while_a_change_is_pending(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        await s.post("estop")
        view = await s.bench.status(job["id"], "failed")
        assert view["error"]["code"] == "estop"
        await asyncio.sleep(2)
        assert ("user-enable-out", False) in s.wired.orders("user-enable-out")
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 6)
        assert (await s.io())["estop"] == "user"
        await s.post("unlock")
        await asyncio.sleep(2)
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 5)
        assert (await s.ended(ONE))["status"] == "completed"

    told(tmp_path, story)


def test_the_external_chain_stops_machine_and_job(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job("G90\n" + "".join(f"G1 X{i} F600\n" for i in range(1, 60)) + "M30\n")
        await asyncio.sleep(3)
        s.wired.changer.press_estop(asyncio.get_running_loop().time())
        view = await s.bench.status(job["id"], "failed", within_s=5)
        assert view["error"]["code"] == "estop"
        await asyncio.sleep(1)
        assert s.wired.orders("emc-reason")[-1] == ("emc-reason", 2)
        await s.post("unlock")
        await asyncio.sleep(1)
        assert (await s.io())["estop"] == "external", "the chain is still open"
        s.wired.changer.release_estop(asyncio.get_running_loop().time())
        await s.post("reset")
        await until(lambda: s.router.tools.io.start_refusal is None, within_s=5)

    told(tmp_path, story)


def test_a_job_that_waits_for_a_changer_outlives_a_crash_and_stands_still_behind_it(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        job = await s.bench.job(ONE)
        await s.bench.status(job["id"], "waiting")
        s.wired.close()
        s.bench.crash()
        shop = await s.bench.connected()
        router = shop.machines[MACHINE]
        app = create_app(shop)
        async with AsgiSocket(app, query={"topics": "io"}) as socket:
            wired = Wired(VirtualChanger(ChangerSettings()), socket, app)
            await until(lambda: router.tools.io.connected, within_s=5)
            await asyncio.sleep(20)
            assert (await shop.jobs.get(job["id"]))["status"] == "waiting", "no handshake in an e-stop"
            router.tools.estop_reset()
            await s.bench.status(job["id"], "paused", within_s=30)
            assert wired.changer.magazine.spindle == 1
            router.resume()
            await s.bench.status(job["id"], "completed")
            wired.close()
        s.shop = shop

    told(tmp_path, story)


def test_outputs_are_not_driven_from_outside(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        for pins, status in (
            ({"tool-change": True}, 409),
            ({"nonsense": True}, 422),
            ({"tool-changed": 1}, 422),
            ({"tool-prepared": True, "toolchanger-reason": -3}, 200),
        ):
            answer = await s.client.patch(f"{ROUTER}/io", json={"pins": pins})
            assert answer.status_code == status, answer.text

    told(tmp_path, story)


def test_the_tool_table_is_kept_and_a_tool_that_is_not_in_it_fails_the_job(tmp_path: Path) -> None:
    async def story(s: Story) -> None:
        answer = await s.client.put(f"{ROUTER}/tools", json={"text": "T1 P4 D6 ;six\nT9 nonsense\n"})
        assert (answer.status_code, answer.json()["warnings"][0]["line"]) == (200, 2)
        shown = (await s.client.get(f"{ROUTER}/tools")).json()
        assert [(tool["number"], tool["pocket"]) for tool in shown["tools"]] == [(1, 4)]
        back = await s.client.put(f"{ROUTER}/tools", json={"tools": shown["tools"]})
        assert back.json()["text"] == shown["text"]
        view = await s.ended(ONE.replace("T1", "T2"))
        assert view["error"]["code"] == "tool_change_failed"
        s.bench.crash()
        shop = await s.bench.connected()
        assert [tool.number for tool in shop.machines[MACHINE].tools.io.tool_table.tools] == [1]  # type: ignore[union-attr]
        s.shop = shop

    told(tmp_path, story)
