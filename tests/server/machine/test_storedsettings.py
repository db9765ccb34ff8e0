"""Settings of a virtual Grbl: judged before, kept before, written one by one, told also when it ends half-way."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from protocol.setting import SettingDescription
from server.machine.enquiries import Enquiries
from server.problems import ProblemError
from tests.harness.panelbench import PanelBench, bench, refusal
from tests.harness.simloop import run_simulated
from tests.harness.workshop import Bench


def writes(world: PanelBench) -> list[str]:
    """The settings that were sent, in order."""
    return [line for line in world.sent() if line.startswith("$") and "=" in line]


def statuses(answer: dict[str, Any]) -> dict[int, str]:
    return {one["number"]: one["status"] for one in answer["results"]}


def test_every_setting_with_what_it_means(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, dollar={3: 5})
        shop = await world.ready()
        shown = await world.panel.settings.all()
        by_number = {one["number"]: one for one in shown["settings"]}
        assert list(by_number) == sorted(world.machine.core.memory.table)
        assert by_number[110] == {
            "number": 110,
            "value": "500.000",
            "name": "X-axis maximum rate",
            "unit": "mm/min",
            "min": 0,
            "max": None,
            "meaning": "speed of rapids; feeds are limited to it",
            "kind": "number",
            "bits": [],
            "choices": [],
        }
        assert [(bit["name"], bit["on"]) for bit in by_number[3]["bits"]] == [("X", True), ("Y", False), ("Z", True)]
        assert [bit["name"] for bit in by_number[10]["bits"]] == ["machine position", "buffer state"]
        await shop.stop()

    run_simulated(main())


def test_a_grblhal_shows_its_own_and_what_is_in_no_table(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, flavour="grblHAL")
        shop = await world.ready()
        by_number = {one["number"]: one for one in (await world.panel.settings.all())["settings"]}
        assert by_number[341]["name"] == "Tool change mode", "its own words"
        assert by_number[341]["meaning"].startswith("0 normal"), "ours say what it is for"
        await world.panel.settings.all()
        await world.panel.settings.change({110: "600"}, by="ann")
        assert world.sent().count("$ES") == 1, "that it has said once"
        await shop.stop()

    run_simulated(main())


def test_a_grblhal_that_says_nothing_of_its_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        world = bench(tmp_path, flavour="grblHAL")
        shop = await world.ready()
        asked = []

        async def refuse(_: Enquiries) -> tuple[SettingDescription, ...]:
            asked.append(1)
            raise ProblemError("command_failed", "error:3.")

        monkeypatch.setattr(Enquiries, "descriptions", refuse)
        for _ in range(2):
            by_number = {one["number"]: one for one in (await world.panel.settings.all())["settings"]}
            assert by_number[341]["name"] == "tool change mode"
        assert asked == [1]
        await shop.stop()

    run_simulated(main())


def test_a_change_is_written_read_back_and_kept_before(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        settings = world.panel.settings
        answer = await settings.change({110: "600", 11: "0.02", 24: "25"}, by="ann")
        assert statuses(answer) == {110: "written", 11: "written", 24: "unchanged"}
        assert (world.stored(110), world.stored(11)) == ("600.000", "0.020")
        assert writes(world) == ["$110=600", "$11=0.02"]
        assert answer["results"][0] == {
            "number": 110,
            "name": "X-axis maximum rate",
            "asked": "600",
            "before": "500.000",
            "value": "600.000",
            "status": "written",
        }
        kept = await settings.backup(answer["backup"])
        assert (kept["values"]["110"], kept["made_by"], kept["why"]) == ("500.000", "ann", "change")
        assert [(one["number"], one["before"], one["value"]) for one in kept["differences"]] == [
            (11, "0.010", "0.020"),
            (110, "500.000", "600.000"),
        ]
        changed = {"110": ["500.000", "600.000"], "11": ["0.010", "0.020"]}
        assert world.history("settings_changed") == [
            {"by": "ann", "values": changed, "failed": [], "backup": answer["backup"]}
        ]
        await shop.stop()

    run_simulated(main())


def test_what_is_so_already_is_not_written(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        answer = await world.panel.settings.change({110: "500", 11: "0.010"}, by="ann")
        assert (statuses(answer), answer["backup"]) == ({110: "unchanged", 11: "unchanged"}, None)
        assert (writes(world), await world.panel.settings.backups()) == ([], [])
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize(
    ("values", "fields"),
    [
        ({110: "-5"}, ["values.110"]),
        ({110: "fast", 111: "600"}, ["values.110"]),
        ({0: "2", 999: "1"}, ["values.0", "values.999"]),
        ({22: "2"}, ["values.22"]),
        ({20: "1"}, ["values.20"]),
        ({20: "1", 22: "0"}, ["values.20"]),
        ({110: "5?0"}, ["values.110"]),
    ],
)
def test_all_is_judged_before_the_first_is_written(tmp_path: Path, values: dict[int, str], fields: list[str]) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        problem = await refusal(world.panel.settings.change({112: "777", **values}, by="ann"))
        assert problem.code == "invalid_request"
        assert [error["field"] for error in problem.extra["errors"]] == fields
        assert "Nothing was written" in problem.detail
        assert (writes(world), world.stored(112)) == ([], "500.000")
        assert await world.panel.settings.backups() == []
        await shop.stop()

    run_simulated(main())


def test_homing_is_switched_on_before_the_soft_limits(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        answer = await world.panel.settings.change({20: "1", 22: "1"}, by="ann")
        assert statuses(answer) == {20: "written", 22: "written"}
        assert writes(world) == ["$22=1", "$20=1"]
        await shop.stop()

    run_simulated(main())


def test_what_the_controller_changes_with_it_is_told(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, dollar={20: 1, 22: 1}, homing_lock=False)
        shop = await world.ready()
        answer = await world.panel.settings.change({22: "0"}, by="ann")
        assert [(one["number"], one["before"], one["value"]) for one in answer["also_changed"]] == [(20, "1", "0")]
        await shop.stop()

    run_simulated(main())


def test_the_first_failure_ends_it_and_says_what_was_written(tmp_path: Path) -> None:
    """error:12, which only the controller knows: the step rate would be too high."""

    async def main() -> None:
        world = bench(tmp_path, max_step_rate_hz=10_000)
        shop = await world.ready()
        problem = await refusal(world.panel.settings.change({120: "50", 110: "60000", 111: "700", 24: "25"}, by="ann"))
        assert (problem.code, problem.extra["controller_code"]) == ("command_failed", 12)
        assert {one["number"]: one["status"] for one in problem.extra["results"]} == {
            120: "written",
            110: "failed",
            111: "not_written",
            24: "unchanged",
        }
        assert "$110=60000" in problem.detail
        assert "Written before it: $120." in problem.detail
        assert (world.stored(120), world.stored(110), world.stored(111)) == ("50.000", "500.000", "500.000")
        kept = await world.panel.settings.backup(problem.extra["backup"])
        assert [one["number"] for one in kept["differences"]] == [120]
        assert world.history("settings_changed")[0]["failed"] == [110]
        await shop.stop()

    run_simulated(main())


def test_a_cable_pulled_half_way(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        asked = asyncio.ensure_future(world.panel.settings.change({110: "600", 111: "600", 112: "600"}, by="ann"))
        while "$111=600" not in world.sent():
            await asyncio.sleep(0.001)
        world.cable.pull()
        with pytest.raises(ProblemError) as refused:
            await asked
        assert refused.value.code == "no_answer"
        assert [one["status"] for one in refused.value.extra["results"]] == ["written", "failed", "not_written"]
        await shop.stop()

    run_simulated(main())


def test_a_backup_is_put_back_where_it_differs_and_can_be_taken_back(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        settings = world.panel.settings
        first = (await settings.change({110: "600", 22: "1"}, by="ann"))["backup"]
        await settings.change({111: "700", 20: "1"}, by="ann")
        before = len(writes(world))
        answer = await settings.restore(first, by="bob")
        assert statuses(answer) == {22: "written", 20: "written", 110: "written", 111: "written"}
        assert answer["left_out"] == []
        assert [world.stored(number) for number in (20, 22, 110, 111)] == ["0", "0", "500.000", "500.000"]
        assert len(writes(world)) == before + 4
        assert (await settings.backup(first))["differences"] == []
        again = await settings.restore(answer["backup"], by="bob")
        assert [world.stored(number) for number in (20, 22, 110, 111)] == ["1", "1", "600.000", "700.000"]
        assert statuses(again)[20] == "written"
        assert [one["why"] for one in await settings.backups()] == ["restore", "restore", "change", "change"]
        await shop.stop()

    run_simulated(main())


def test_a_backup_can_be_seen_without_the_machine(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        id = (await world.panel.settings.change({110: "600"}, by="ann"))["backup"]
        world.cable.pull()
        shown = await world.panel.settings.backup(id)
        assert shown["values"]["110"] == "500.000"
        assert (shown["differences"], "Check the cable" in shown["not_compared"]) == (None, True)
        await shop.stop()

    run_simulated(main())


def test_backups_of_another_machine_and_of_nobody(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path / "grbl")
        shop = await world.ready()
        for asked in (world.panel.settings.backup(7), world.panel.settings.restore(7, by="ann")):
            assert (await refusal(asked)).code == "unknown_backup"
        await shop.stop()
        other = Bench(tmp_path / "elvinto")
        shop = await other.connected()
        settings = shop.panels["router"].settings
        for asked in (settings.all(), settings.backups(), settings.backup(1), settings.change({1: "1"}, by="a")):
            assert (await refusal(asked)).code == "not_supported"
        await shop.stop()

    run_simulated(main())


def test_two_changes_at_once_come_one_after_the_other(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        change = world.panel.settings.change
        one, other = await asyncio.gather(change({110: "600"}, by="ann"), change({110: "700"}, by="bob"))
        assert one["results"][0]["value"] == other["results"][0]["before"] == "600.000"
        assert world.stored(110) == "700.000"
        await shop.stop()

    run_simulated(main())
