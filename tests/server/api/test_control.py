"""The control of a machine over HTTP and WebSocket: who is which client, what needs it, and what never does."""

import asyncio
import re
from collections.abc import AsyncIterator
from typing import Any

import httpx

from server.access.lease import LEASE_S
from server.api.routing import BY_HAND_ATTRIBUTE
from server.problems import ProblemError
from tests.harness.asgisocket import AsgiSocket
from tests.harness.fakeworkshop import FakeServerSettings, FakeWorkshop, bearer
from tests.harness.simloop import run_simulated as run

CONTROL = "/api/v1/machines/router/control"
JSON = {"Content-Type": "application/json"}
JOG = {"type": "jog", "x": 1, "feed": 600}
HOME = "/api/v1/machines/router/home"
ON_THE_LAN = FakeServerSettings(host="0.0.0.0")

BY_HAND = {
    ("POST", "/api/v1/machines/{m}/home"),
    ("POST", "/api/v1/machines/{m}/unlock"),
    ("POST", "/api/v1/machines/{m}/reset"),
    ("POST", "/api/v1/machines/{m}/commands"),
    ("POST", "/api/v1/machines/{m}/jog"),
    ("POST", "/api/v1/machines/{m}/sd/run"),
    ("POST", "/api/v1/machines/{m}/check-mode"),
    ("POST", "/api/v1/machines/{m}/sleep"),
    ("POST", "/api/v1/machines/{m}/spindle-stop"),
    ("PATCH", "/api/v1/machines/{m}/offsets"),
    ("DELETE", "/api/v1/machines/{m}/offsets/{name}"),
    ("PUT", "/api/v1/machines/{m}/startup-blocks"),
}
OPEN = ("estop", "pause", "resume", "stop")


class Shop(FakeWorkshop):
    """Anna and Bert, at one application."""

    def __init__(self) -> None:
        super().__init__("router", "lathe", settings=ON_THE_LAN)
        self.the_app = self.app()

    async def person(self, name: str) -> httpx.AsyncClient:
        secret = (await self.tokens.create(name, "operator"))["token"]
        return httpx.AsyncClient(
            transport=httpx.ASGITransport(self.the_app), base_url="http://127.0.0.1:8420", headers=bearer(secret)
        )


def test_what_needs_the_control() -> None:
    async def main() -> set[tuple[str, str]]:
        async with FakeWorkshop() as workshop:
            return {
                (method, str(getattr(route, "path", "")))
                for route in workshop.app().routes
                if getattr(getattr(route, "endpoint", None), BY_HAND_ATTRIBUTE, False)
                for method in getattr(route, "methods", ())
            }

    assert run(main()) == BY_HAND


def test_one_alone_never_notices_it() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            for _ in range(3):
                assert (await client.post(HOME)).status_code == 202
            assert workshop.router.control is not None
            assert workshop.router.control["name"] == "local user"
            view = (await client.get(CONTROL)).json()
            assert (view["yours"], view["holder"]) == (True, workshop.router.control)

    run(main())


def test_the_other_is_refused_and_told_by_whom_and_how_to_take_over() -> None:
    async def main() -> None:
        async with Shop() as shop, await shop.person("Anna") as anna, await shop.person("Bert") as bert:
            assert (await anna.post(HOME)).status_code == 202
            refused = await bert.post(HOME)
            assert (refused.status_code, refused.json()["code"]) == (409, "control_held")
            assert refused.json()["holder"]["name"] == "Anna"
            assert shop.router.names() == ["home"]
            for verb in OPEN:
                assert (await bert.post(f"/api/v1/machines/router/{verb}")).status_code == 202
            assert (await bert.delete("/api/v1/machines/router/jog")).status_code == 202
            assert (await bert.post("/api/v1/machines/lathe/home")).status_code == 202
            assert (await bert.post(CONTROL)).status_code == 409
            assert (await bert.delete(CONTROL)).status_code == 409
            taken = await bert.post(CONTROL, json={"takeover": True})
            assert (taken.status_code, taken.json()["yours"]) == (200, True)
            assert (await bert.post(HOME)).status_code == 202
            assert (await anna.post(HOME)).json()["holder"]["name"] == "Bert"
            assert (await bert.delete(CONTROL)).status_code == 204
            assert (await anna.post(HOME)).status_code == 202

    run(main())


def test_a_takeover_is_told_to_everybody_and_audited_and_keeping_it_is_not() -> None:
    async def main() -> None:
        async with Shop() as shop, await shop.person("Anna") as anna, await shop.person("Bert") as bert:
            viewer = bearer(await shop.token("viewer"))
            async with AsgiSocket(shop.the_app, headers=viewer) as socket:
                for _ in range(5):
                    await anna.post(CONTROL)
                await bert.post(CONTROL, json={"takeover": True})
                said = (await socket.hear_type("log"))["data"]
                assert said["message"] == "Bert has taken the control of router from Anna."
            rows = shop.database.db.query("select name, route, target from audit order by id")
            assert [tuple(row.values()) for row in rows] == [
                ("Anna", "/api/v1/machines/{m}/control", None),
                ("Bert", "/api/v1/machines/{m}/control", "from Anna"),
            ]

    run(main())


def test_what_is_refused_takes_nothing() -> None:
    async def main() -> None:
        async with Shop() as shop, await shop.person("Anna") as anna, await shop.person("Bert") as bert:
            shop.router.refusals["home"] = ProblemError("alarm_active", "No.")
            assert (await anna.post(HOME)).status_code == 409
            assert (await anna.post("/api/v1/machines/router/jog", json={"x": "far"})).status_code == 422
            assert (await bert.get(CONTROL)).json()["holder"] is None
            assert (await anna.post("/api/v1/machines/nothing/home")).json()["code"] == "unknown_machine"

    run(main())


def test_a_request_that_is_wrong_or_still_on_its_way_takes_nothing_and_keeps_nothing() -> None:
    async def main() -> None:
        async with Shop() as shop:
            anna, bert = await shop.person("anna"), await shop.person("bert")
            shown: list[Any] = []
            shop.router.show_control = shown.append  # type: ignore[method-assign]
            for body in (b"{", b"{}", b'{"x": 1, "feed": "fast"}', b'{"x": 1}', b"[" * 100_000):
                answer = await anna.post("/api/v1/machines/router/jog", content=body, headers=JSON)
                assert answer.status_code in (400, 422)
            assert shown == [], "it is not even seen for a moment"
            come = asyncio.Event()

            async def slowly() -> AsyncIterator[bytes]:
                yield b'{"x": 1,'
                await come.wait()
                yield b'"feed": 600}'

            waiting = asyncio.create_task(anna.post("/api/v1/machines/router/jog", content=slowly(), headers=JSON))
            await asyncio.sleep(1)
            assert (await bert.post(HOME)).status_code == 202
            come.set()
            assert (await waiting).json()["code"] == "control_held"
            await asyncio.sleep(LEASE_S - 1)
            assert (await bert.post("/api/v1/machines/router/jog", json={"x": "1"})).status_code == 422
            await asyncio.sleep(2)
            assert (await anna.post(HOME)).status_code == 202, "what is wrong does not keep it either"

    run(main())


def test_who_shares_a_token_is_told_apart_by_session_or_name() -> None:
    async def main() -> None:
        async with Shop() as shop, await shop.person("shop") as desk:
            named = {"Millstream-Client": "tablet-2"}
            assert (await desk.post(HOME)).status_code == 202
            assert (await desk.post(HOME, headers=named)).json()["holder"]["client"] == "127.0.0.1"
            assert (await desk.post(HOME, headers={"Millstream-Client": "a b"})).status_code == 422
            assert (await desk.get(CONTROL, headers=named)).json()["yours"] is False
            secret = desk.headers["authorization"].removeprefix("Bearer ")
            async with httpx.AsyncClient(transport=httpx.ASGITransport(shop.the_app), base_url=desk.base_url) as tab:
                await tab.post("/api/v1/session", json={"token": secret})
                assert (await tab.post(HOME)).json()["code"] == "control_held"
                await tab.post(CONTROL, json={"takeover": True})
                cookie = "; ".join(f"{name}={value}" for name, value in tab.cookies.items())
                async with AsgiSocket(shop.the_app, headers={"cookie": cookie}) as socket:
                    assert (await socket.ask({**JOG, "machine": "router"}))["ok"], "one browser is one client"
                assert (await desk.post(HOME)).status_code == 202, "free with its last socket"

    run(main())


def test_jogs_over_the_websocket() -> None:
    async def main() -> None:
        async with Shop() as shop, await shop.person("Anna") as anna, await shop.person("Bert") as bert:
            headers = {"authorization": bert.headers["authorization"]}
            hold: dict[str, Any] = {**JOG, "machine": "router", "hold": True}
            async with AsgiSocket(shop.the_app, headers=headers) as socket:
                assert (await socket.ask(hold))["ok"]
                assert (await anna.post(HOME)).json()["code"] == "control_held"
                await anna.post(CONTROL, json={"takeover": True})
                assert (await socket.ask(hold))["error"]["code"] == "control_held"
                assert (await socket.ask({"type": "jog_stop", "machine": "router"}))["ok"]
                assert (await socket.ask({"type": "estop"}))["ok"]

    run(main())


def test_a_name_over_the_websocket() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop:
            app = workshop.app()
            async with AsgiSocket(app, query={"client": "a b"}) as socket:
                assert socket.problem["code"] == "invalid_request"
            async with AsgiSocket(app, query={"client": "pendant"}) as socket:
                assert (await socket.ask({**JOG, "machine": "router"}))["ok"]
                assert workshop.router.control is not None
                assert workshop.router.control["client"] == "pendant"
            assert workshop.router.control is None

    run(main())


def test_it_is_free_after_a_while() -> None:
    async def main() -> None:
        async with Shop() as shop, await shop.person("Anna") as anna, await shop.person("Bert") as bert:
            await anna.post(HOME)
            await asyncio.sleep(LEASE_S + 1)
            assert (await bert.post(HOME)).status_code == 202
            assert re.match(r"\d{4}-", (await bert.get(CONTROL)).json()["holder"]["since"])

    run(main())
