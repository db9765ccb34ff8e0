"""Settings over HTTP, on a whole daemon with a virtual Grbl."""

from pathlib import Path
from typing import Any

import pytest

from server.api.settingmodels import (
    BackupHead,
    BackupView,
    RestoreResult,
    SettingsRequest,
    SettingsResult,
    SettingsView,
)
from tests.harness.fakeworkshop import bearer
from tests.harness.panelbench import API, api, ask, bench
from tests.harness.simloop import run_simulated


def test_a_change_from_reading_to_putting_it_back(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            status, body = await ask(client, "GET", "/settings")
            assert status == 200
            assert len(SettingsView.model_validate(body).settings) == 34
            status, body = await ask(client, "PATCH", "/settings", {"values": {"110": "600", "22": True, "11": 0.02}})
            assert status == 200
            result = SettingsResult.model_validate(body)
            assert [one.status for one in result.results] == ["written"] * 3
            assert [world.stored(number) for number in (110, 22, 11)] == ["600.000", "1", "0.020"]
            status, body = await ask(client, "GET", "/settings/backups")
            assert (status, [BackupHead.model_validate(one).id for one in body]) == (200, [result.backup])
            status, body = await ask(client, "GET", f"/settings/backups/{result.backup}")
            assert status == 200
            assert len(BackupView.model_validate(body).differences or ()) == 3
            status, body = await ask(client, "POST", f"/settings/backups/{result.backup}/restore")
            assert (status, len(RestoreResult.model_validate(body).results)) == (200, 3)
            assert world.stored(110) == "500.000"

    run_simulated(main())


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"values": {}},
        {"values": {"abc": "1"}},
        {"values": {"-1": "1"}},
        {"values": {"110": None}},
        {"values": {"110": [1]}},
        {"values": {"110": "x" * 81}},
        {"values": {"110": "1"}, "forse": True},
        {"values": {"110": "fast"}},
        {"values": {"4242": "1"}},
    ],
)
def test_changes_that_are_none(tmp_path: Path, body: Any) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            status, answer = await ask(client, "PATCH", "/settings", body)
            assert (status, answer["code"]) == (422, "invalid_request")
            assert not [line for line in world.sent() if "=" in line]

    run_simulated(main())


def test_a_failure_half_way_is_a_problem_with_the_results(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, max_step_rate_hz=10_000)
        async with api(world) as client:
            status, answer = await ask(client, "PATCH", "/settings", {"values": {"120": 50, "110": 60000, "111": 700}})
            assert (status, answer["code"], answer["controller_code"]) == (409, "command_failed", 12)
            assert [one["status"] for one in answer["results"]] == ["written", "failed", "not_written"]
            assert answer["remedy"].startswith("lower the maximum rate")
            assert (await ask(client, "GET", f"/settings/backups/{answer['backup']}"))[0] == 200

    run_simulated(main())


def test_a_backup_that_does_not_exist(tmp_path: Path) -> None:
    async def main() -> None:
        async with api(bench(tmp_path)) as client:
            status, answer = await ask(client, "GET", "/settings/backups/99")
            assert (status, answer["code"]) == (404, "unknown_backup")
            assert (await ask(client, "POST", "/settings/backups/99/restore"))[1]["code"] == "unknown_backup"
            assert (await ask(client, "GET", "/settings/backups/x"))[0] == 422

    run_simulated(main())


def test_who_changed_it_is_kept_and_only_an_admin_may(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        async with api(world) as client:
            assert world.shop is not None
            tokens = {
                role: (await world.shop.tokens.create(f"a {role}", role))["token"] for role in ("operator", "admin")
            }
            body = {"values": {"110": "600"}}
            refused = await client.patch(f"{API}/settings", json=body, headers=bearer(tokens["operator"]))
            assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
            done = await client.patch(f"{API}/settings", json=body, headers=bearer(tokens["admin"]))
            assert done.status_code == 200
            listed = await client.get(f"{API}/settings/backups", headers=bearer(tokens["operator"]))
            assert [one["made_by"] for one in listed.json()] == ["a admin"]

    run_simulated(main())


@pytest.mark.parametrize(
    ("given", "text"),
    [("600", "600"), (" 600 ", "600"), (600, "600"), (600.0, "600"), (0.01, "0.01"), (1e-5, "0.00001"), (True, "1"),
     (False, "0"), (-3, "-3"), (1e7, "10000000")],
)  # fmt: skip
def test_values_as_the_controller_is_sent_them(given: Any, text: str) -> None:
    assert SettingsRequest.model_validate({"values": {"110": given}}).texts() == {110: text}
