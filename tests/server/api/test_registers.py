"""Firmware, modal state, offsets and start-up blocks over HTTP, on a whole daemon with a virtual Grbl."""

from pathlib import Path
from typing import Any

import pytest

from server.api.grblmodels import FirmwareView, ModalView, OffsetsView, StartupView
from tests.harness.fakeworkshop import FakeWorkshop
from tests.harness.panelbench import API, api, ask, bench
from tests.harness.simloop import run_simulated

LONG = "G21G90\nG1 F300\n" + "".join(f"G1 X{i} Y{i % 7}\n" for i in range(1, 100)) + "M30\n"


def test_what_is_read_fits_the_models(tmp_path: Path) -> None:
    async def main() -> None:
        async with api(bench(tmp_path)) as client:
            for path, model in (
                ("/firmware", FirmwareView),
                ("/modal", ModalView),
                ("/offsets", OffsetsView),
                ("/startup-blocks", StartupView),
            ):
                status, body = await ask(client, "GET", path)
                assert status == 200, body
                assert model.model_validate(body).machine == "router"

    run_simulated(main())


def test_the_info_text(tmp_path: Path) -> None:
    async def main() -> None:
        async with api(bench(tmp_path)) as client:
            status, body = await ask(client, "PUT", "/firmware/info", {"info": "my mill"})
            assert (status, body["info"]) == (200, "MYMILL")
            assert "drops blanks" in FirmwareView.model_validate(body).warnings[0]
            for info in ("x" * 81, "x" * 77, "why?", None):
                status, body = await ask(client, "PUT", "/firmware/info", {"info": info})
                assert (status, body["code"]) == (422, "invalid_request")

    run_simulated(main())


def test_offsets_are_set_and_answered(tmp_path: Path) -> None:
    async def main() -> None:
        async with api(bench(tmp_path)) as client:
            await client.post(f"{API}/commands", json={"blocks": ["G21", "G0 X10"]})
            status, body = await ask(client, "PATCH", "/offsets", {"system": "G55", "x": 0})
            assert status == 200
            assert OffsetsView.model_validate(body).offsets["G55"]["x"] == 10.0
            body = (await ask(client, "PATCH", "/offsets", {"system": "G55", "mode": "absolute", "z": -5}))[1]
            assert body["offsets"]["G55"] == {"x": 10.0, "y": 0.0, "z": -5.0}
            assert (await ask(client, "PATCH", "/offsets", {"system": "G30"}))[1]["offsets"]["G30"]["x"] == 10.0
            await client.post(f"{API}/commands", json={"blocks": ["G92 X0"]})
            assert (await ask(client, "DELETE", "/offsets/G92"))[1]["offsets"]["G92"]["x"] == 0.0

    run_simulated(main())


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"system": "G54"},
        {"system": "G60", "x": 0},
        {"system": "G54", "mode": "there", "x": 0},
        {"system": "G28", "x": 0},
        {"system": "G28", "mode": "absolute"},
        {"system": "G54", "x": 1e9},
        {"system": "G54", "q": 1},
        {"system": "G54", "x": "one"},
    ],
)
def test_offsets_that_are_none(tmp_path: Path, body: Any) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            status, answer = await ask(client, "PATCH", "/offsets", body)
            assert (status, answer["code"]) == (422, "invalid_request")
            assert (await ask(client, "DELETE", "/offsets/G54"))[0] == 422
            assert not [line for line in world.sent() if line.startswith("G")]

    run_simulated(main())


def test_startup_blocks_need_force_where_they_move(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            status, body = await ask(client, "PUT", "/startup-blocks", {"blocks": ["G21", "G28"]})
            assert (status, body["code"], body["warnings"]) == (409, "needs_force", ["N1: G28 moves the machine"])
            status, body = await ask(client, "PUT", "/startup-blocks", {"blocks": ["G21"]})
            assert (status, StartupView.model_validate(body).blocks) == (200, ["G21", ""])
            status, body = await ask(client, "PUT", "/startup-blocks", {"blocks": ["G21", "G4P0"], "force": True})
            assert (status, body["blocks"]) == (200, ["G21", "G4P0"])
            for blocks in (["G21"] * 3, ["G21"] * 11, ["x" * 121], "G21", [7]):
                status, body = await ask(client, "PUT", "/startup-blocks", {"blocks": blocks})
                assert (status, body["code"]) == (422, "invalid_request")

    run_simulated(main())


def test_beside_a_job_only_the_modal_state_is_told(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            await world.job(LONG)
            await world.reaches("run")
            assert (await ask(client, "GET", "/modal"))[0] == 200
            for path in ("/firmware", "/offsets", "/settings", "/startup-blocks"):
                status, body = await ask(client, "GET", path)
                assert (status, body["code"]) == (409, "job_active")

    run_simulated(main())


def test_a_machine_that_does_not_exist_comes_before_everything() -> None:
    async def main() -> None:
        async with FakeWorkshop() as workshop, workshop.client() as client:
            for path in ("firmware", "settings", "offsets", "modal", "startup-blocks"):
                answer = await client.get(f"/api/v1/machines/router2/{path}")
                assert (answer.status_code, answer.json()["code"]) == (404, "unknown_machine")

    run_simulated(main())
