"""The rest of the panel on a virtual Grbl: info text, offsets, start-up blocks, modes, defaults."""

import asyncio
from pathlib import Path

import pytest

from protocol.commands import RunBlock
from tests.harness.panelbench import PanelBench, bench, refusal
from tests.harness.simloop import run_simulated, until


def test_the_firmware_is_explained(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, mist=True, homing_lock=False, door_pin=True)
        shop = await world.ready()
        shown = await world.panel.firmware()
        assert (shown["flavour"], shown["version"], shown["planner_blocks"], shown["rx_bytes"]) == (
            "grbl", "1.1h", 15, 128
        )  # fmt: skip
        assert shown["axes"] == ["x", "y", "z"]
        meanings = {option["code"]: option["meaning"] for option in shown["options"]}
        assert meanings["M"] == "mist coolant (M7)"
        assert None not in meanings.values()
        assert "$$" in shown["help"]
        await shop.stop()

    run_simulated(main())


def test_the_firmware_of_a_grblhal(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, flavour="grblHAL")
        shop = await world.ready()
        shown = await world.panel.firmware()
        assert (shown["flavour"], shown["axes"]) == ("grblhal", ["x", "y", "z"])
        assert {"ENUMS", "TC"} <= {option["code"] for option in shown["options"]}
        assert "NEWOPT" not in shown["facts"]
        assert shown["facts"]["FIRMWARE"] == "grblHAL"
        await shop.stop()

    run_simulated(main())


def test_the_info_text_and_what_became_of_it(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        shown = await world.panel.write_info("my mill (old)", by="ann")
        assert (shown["info"], world.machine.core.memory.build_info) == ("MYMILL", "MYMILL")
        assert shown["warnings"][0].startswith("it is stored as 'MYMILL'")
        assert (await world.panel.write_info("MILL2", by="ann"))["warnings"] == []
        assert (await world.panel.write_info("", by="ann"))["info"] == ""
        assert [one["text"] for one in world.history("info_changed")] == ["my mill (old)", "MILL2", ""]
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("text", ["x" * 77, "why?", "Fräse", "a\nb"])
def test_an_info_text_that_cannot_be_stored(tmp_path: Path, text: str) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        before = world.sent()
        assert (await refusal(world.panel.write_info(text, by="ann"))).code == "invalid_request"
        assert world.sent() == before
        await shop.stop()

    run_simulated(main())


async def _at(world: PanelBench, block: str) -> None:
    await world.controller.run_blocks([block])


def test_offsets_are_set_where_the_machine_stands_and_where_it_is_said(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await _at(world, "G21 G90 G0 X10 Y20 Z-3")
        shown = await world.panel.set_offset("G54", "here", {"x": 0.0, "y": 5.0}, by="ann")
        assert shown["offsets"]["G54"] == {"x": 10.0, "y": 15.0, "z": 0.0}
        assert world.machine.core.memory.coords["G54"] == (10.0, 15.0, 0.0)
        shown = await world.panel.set_offset("G59", "absolute", {"z": -30.25}, by="ann")
        assert shown["offsets"]["G59"]["z"] == -30.25
        shown = await world.panel.set_offset("active", "here", {"z": 1.0}, by="ann")
        assert shown["offsets"]["G54"]["z"] == -4.0
        shown = await world.panel.set_offset("G28", "here", {}, by="ann")
        assert shown["offsets"]["G28"] == {"x": 10.0, "y": 20.0, "z": -3.0}
        assert {one["by"] for one in world.history("offset_changed")} == {"ann"}
        assert [one["block"] for one in world.history("offset_changed")] == [
            "G10L20P1X0Y5", "G10L2P6Z-30.25", "G10L20P0Z1", "G28.1"
        ]  # fmt: skip
        await shop.stop()

    run_simulated(main())


def test_offsets_are_millimetres_also_where_the_controller_reads_inches(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await _at(world, "G20")
        shown = await world.panel.set_offset("G55", "absolute", {"x": 25.4}, by="ann")
        assert shown["offsets"]["G55"]["x"] == pytest.approx(25.4, abs=0.001)
        assert world.machine.core.memory.coords["G55"][0] == pytest.approx(25.4, abs=0.001)
        assert (await world.panel.modal())["groups"]["units"] == "G20", "its modes are left alone"
        await shop.stop()

    run_simulated(main())


def test_offsets_that_are_not_stored_are_cleared(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await _at(world, "G92 X5")
        await _at(world, "G43.1 Z2")
        shown = await world.panel.offsets()
        assert (shown["offsets"]["G92"]["x"], shown["offsets"]["TLO"]["z"]) == (-5.0, 2.0)
        assert (await world.panel.clear_offset("G92", by="ann"))["offsets"]["G92"]["x"] == 0.0
        assert (await world.panel.clear_offset("TLO", by="ann"))["offsets"]["TLO"]["z"] == 0.0
        await shop.stop()

    run_simulated(main())


def test_a_system_that_the_controller_lacks(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        problem = await refusal(world.panel.set_offset("G59.3", "here", {"x": 0.0}, by="ann"))
        assert problem.code == "command_failed"
        assert "error:" in problem.detail
        await shop.stop()

    run_simulated(main())


def test_startup_blocks_are_stored_and_the_rest_is_emptied(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        shown = await world.panel.write_startup_blocks(["g21 g90", "G94"], force=False, by="ann")
        assert shown["blocks"] == world.machine.core.memory.startup == ["G21G90", "G94"]
        assert shown["warnings"] == ["executed once while written: N0, N1"]
        before = len(world.sent())
        assert (await world.panel.write_startup_blocks(["G21G90", "G94"], force=False, by="ann"))["warnings"] == []
        assert not [line for line in world.sent()[before:] if line.startswith("$N") and "=" in line]
        assert (await world.panel.write_startup_blocks(["G21"], force=False, by="ann"))["blocks"] == ["G21", ""]
        assert world.history("startup_blocks_changed")[0] == {
            "by": "ann",
            "before": ["", ""],
            "after": ["G21G90", "G94"],
        }
        await shop.stop()

    run_simulated(main())


def test_a_startup_block_that_moves_needs_force(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        before = world.sent()
        problem = await refusal(world.panel.write_startup_blocks(["G21", "G0 X5"], force=False, by="ann"))
        assert problem.code == "needs_force"
        assert problem.extra["warnings"] == ["N1: G0 moves the machine"]
        assert [line for line in world.sent()[len(before) :] if "=" in line] == []
        shown = await world.panel.write_startup_blocks(["G21", "G0 X5"], force=True, by="ann")
        assert (shown["blocks"], "N1: G0 moves the machine" in shown["warnings"]) == (["G21", "G0X5"], True)
        assert world.machine.position["X"] == pytest.approx(5.0), "it was executed when it was written"
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("blocks", [["G21"] * 3, ["G21!"], ["x" * 90]])
def test_startup_blocks_that_cannot_be_stored(tmp_path: Path, blocks: list[str]) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        assert (await refusal(world.panel.write_startup_blocks(blocks, force=True, by="ann"))).code == "invalid_request"
        assert world.machine.core.memory.startup == ["", ""]
        await shop.stop()

    run_simulated(main())


def test_the_check_mode_and_back(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await world.panel.check_mode(on=True)
        await world.reaches("check")
        await world.panel.check_mode(on=True)
        await world.panel.check_mode(on=False)
        await world.reaches("idle")
        await until(lambda: world.controller.check_by_hand() is None, within_s=10)
        await _at(world, "G0 X1")
        await shop.stop()

    run_simulated(main())


def test_sleep_ends_with_a_reset(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await world.panel.sleep(by="ann")
        await world.reaches("sleep")
        await world.controller.reset()
        await world.reaches("alarm")
        await asyncio.sleep(2.0)
        await world.controller.unlock()
        await world.reaches("idle")
        await shop.stop()

    run_simulated(main())


def test_defaults_come_back_and_everything_is_kept_before(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        panel = world.panel
        await panel.settings.change({110: "600"}, by="ann")
        await panel.write_startup_blocks(["G21"], force=False, by="ann")
        await panel.write_info("MILL", by="ann")
        await panel.set_offset("G54", "absolute", {"x": 7.0}, by="ann")
        assert (await refusal(panel.restore("all", "lathe", by="ann"))).code == "invalid_request"
        assert world.stored(110) == "600.000"
        answer = await panel.restore("all", "router", by="ann")
        assert world.stored(110) == "500.000"
        await until(lambda: world.controller.state.status == "idle" and not world.controller.manual.busy, within_s=20)
        kept = await panel.settings.backup(answer["backup"])
        assert (kept["why"], kept["info"], kept["startup_blocks"]) == ("defaults", "MILL", ["G21", ""])
        assert kept["offsets"]["G54"]["x"] == 7.0
        assert [one["number"] for one in kept["differences"]] == [110]
        await panel.settings.restore(answer["backup"], by="ann")
        assert world.stored(110) == "600.000"
        assert world.history("defaults_restored") == [{"by": "ann", "what": "all", "backup": answer["backup"]}]
        await shop.stop()

    run_simulated(main())


def test_nothing_is_restored_while_something_moves(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        world.controller.ask(lambda token: RunBlock(token, ("G1X100F300",)))
        await world.reaches("run")
        assert (await refusal(world.panel.restore("all", "router", by="ann"))).code == "wrong_state"
        await shop.stop()

    run_simulated(main())
