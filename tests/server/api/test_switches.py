"""Modes and what is pressed, over HTTP, on a whole daemon with a virtual Grbl."""

from pathlib import Path
from typing import Any

import httpx
import pytest

from server.api.grblmodels import CoolantResult, DefaultsResult, OverridesResult
from tests.harness.apps import create_app
from tests.harness.fakeworkshop import BASE_URL
from tests.harness.panelbench import API, api, ask, bench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import Bench

LONG = "G21G90\nM3S1000\nG1 F300\n" + "".join(f"G1 X{i} Y{i % 7}\n" for i in range(1, 100)) + "M30\n"


def test_modes(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            accepted = {"machine": "router", "accepted": "check_mode"}
            assert await ask(client, "POST", "/check-mode", {"on": True}) == (202, accepted)
            await world.reaches("check")
            assert await ask(client, "POST", "/check-mode", {"on": False}) == (202, accepted)
            await world.reaches("idle")
            assert (await ask(client, "POST", "/sleep"))[0] == 202
            await world.reaches("sleep")
            status, body = await ask(client, "POST", "/check-mode", {"on": True})
            assert (status, body["code"]) == (409, "wrong_state")
            assert "reset wakes it up" in body["detail"]

    run_simulated(main())


def test_defaults_need_the_machines_name(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, dollar={110: 600})
        async with api(world) as client:
            body: dict[str, Any]
            for body in ({"what": "all"}, {"what": "all", "confirm": "lathe"}, {"what": "x", "confirm": "router"}):
                status, answer = await ask(client, "POST", "/restore", body)
                assert (status, answer["code"]) == (422, "invalid_request")
            assert world.stored(110) == "600.000"
            status, answer = await ask(client, "POST", "/restore", {"what": "settings", "confirm": "router"})
            assert (status, DefaultsResult.model_validate(answer).restored) == (200, "settings")
            assert world.stored(110) == "500.000"
            await until(lambda: world.controller.state.status == "idle", within_s=20)
            kept = (await ask(client, "GET", f"/settings/backups/{answer['backup']}"))[1]
            assert kept["values"]["110"] == "600.000"

    run_simulated(main())


def test_overrides_and_coolant_beside_a_job(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            await world.job(LONG)
            await world.reaches("run")
            status, body = await ask(client, "PATCH", "/overrides", {"feed": 110, "rapid": 25})
            assert (status, OverridesResult.model_validate(body).asked) == (202, {"feed": 110, "rapid": 25})
            status, body = await ask(client, "POST", "/coolant", {"flood": True})
            assert (status, CoolantResult.model_validate(body).flood) == (200, True)
            await until(lambda: world.controller.state.overrides["feed"] == 110, within_s=5)
            shown = (await client.get(f"{API}/state")).json()
            assert shown["overrides"] == {"feed": 110, "rapid": 25, "spindle": 100}

    run_simulated(main())


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/overrides", {}),
        ("/overrides", {"feed": 9}),
        ("/overrides", {"feed": 201}),
        ("/overrides", {"rapid": 75}),
        ("/overrides", {"spindle": 110.5}),
        ("/overrides", {"coolant": 110}),
        ("/coolant", {}),
        ("/coolant", {"flood": "wet"}),
        ("/check-mode", {}),
    ],
)
def test_what_cannot_be_pressed(tmp_path: Path, path: str, body: Any) -> None:
    async def main() -> None:
        async with api(bench(tmp_path)) as client:
            method = "PATCH" if path == "/overrides" else "POST"
            status, answer = await ask(client, method, path, body)
            assert (status, answer["code"]) == (422, "invalid_request")

    run_simulated(main())


def test_door_and_spindle_stop(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            assert (await ask(client, "POST", "/spindle-stop"))[1]["code"] == "wrong_state"
            await world.job(LONG)
            await world.reaches("run")
            await client.post(f"{API}/pause")
            await world.reaches("hold")
            assert (await ask(client, "POST", "/spindle-stop"))[0] == 202
            await until(lambda: "spindle_cw" not in world.controller.state.accessories, within_s=10)
            assert (await ask(client, "POST", "/door"))[0] == 202
            await world.reaches("door")

    run_simulated(main())


VERBS: tuple[tuple[str, str, Any], ...] = (
    ("GET", "/firmware", None),
    ("PUT", "/firmware/info", {"info": "x"}),
    ("GET", "/settings", None),
    ("PATCH", "/settings", {"values": {"1": "1"}}),
    ("GET", "/settings/backups", None),
    ("GET", "/settings/backups/1", None),
    ("POST", "/settings/backups/1/restore", None),
    ("GET", "/offsets", None),
    ("PATCH", "/offsets", {"system": "G54", "x": 0}),
    ("DELETE", "/offsets/G92", None),
    ("GET", "/modal", None),
    ("GET", "/startup-blocks", None),
    ("PUT", "/startup-blocks", {"blocks": []}),
    ("POST", "/check-mode", {"on": True}),
    ("POST", "/sleep", None),
    ("POST", "/restore", {"what": "all", "confirm": "router"}),
    ("POST", "/door", None),
    ("PATCH", "/overrides", {"feed": 110}),
    ("POST", "/coolant", {"flood": True}),
    ("POST", "/spindle-stop", None),
)


def test_another_protocol_has_none_of_it_and_says_so(tmp_path: Path) -> None:
    async def main() -> None:
        world = Bench(tmp_path)
        shop = await world.connected()
        transport = httpx.ASGITransport(create_app(shop))
        async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client:
            for method, path, body in VERBS:
                status, answer = await ask(client, method, path, body)
                assert (status, answer["code"]) == (409, "not_supported"), path
                assert "elvinto" in answer["detail"]
        await shop.stop()

    run_simulated(main())
