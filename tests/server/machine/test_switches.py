"""What is pressed at a virtual Grbl: it does it, the answer is what the reports show, and what it ignores is said."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from protocol.commands import RunBlock
from server.machine.switches import Switches
from server.problems import ProblemError
from tests.harness.panelbench import PanelBench, bench, refusal
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import Bench

LONG = "G21G90\nM3S1000\nG1 F300\n" + "".join(f"G1 X{i} Y{i % 7}\n" for i in range(1, 150)) + "M30\n"


def move(world: PanelBench, block: str = "G1X100F300") -> None:
    world.controller.ask(lambda token: RunBlock(token, (block,)))


def test_overrides_come_true_while_a_job_runs(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        job = await world.job(LONG)
        await world.reaches("run")
        answer = world.panel.switches.override({"feed": 187, "rapid": 50, "spindle": 45})
        assert answer == {
            "machine": "router",
            "asked": {"feed": 187, "rapid": 50, "spindle": 45},
            "present": {"feed": 100, "rapid": 100, "spindle": 100},
        }
        await until(lambda: tuple(world.controller.state.overrides.values()) == (187, 50, 45), within_s=4)
        core = world.machine.core
        assert (core.planner.feed_override, core.planner.rapid_override, core.spindle_override) == (187, 50, 45)
        assert (await shop.jobs.get(job["id"]))["status"] == "running"
        await shop.stop()

    run_simulated(main())


def test_coolant_is_switched_to_what_is_wanted_not_toggled_blindly(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, mist=True)
        shop = await world.ready()
        coolant, modal = world.panel.switches.coolant, world.machine.core.modal
        assert await coolant({"flood": True}) == {"machine": "router", "flood": True, "mist": False}
        assert (modal.flood, modal.mist) == (True, False)
        assert await coolant({"flood": True, "mist": True}) == {"machine": "router", "flood": True, "mist": True}
        assert await coolant({"flood": False}) == {"machine": "router", "flood": False, "mist": True}
        assert await coolant({"mist": False}) == {"machine": "router", "flood": False, "mist": False}
        assert (modal.flood, modal.mist) == (False, False)
        await shop.stop()

    run_simulated(main())


def test_two_wishes_at_once_do_not_cancel_each_other_out(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        coolant = world.panel.switches.coolant
        answers = await asyncio.gather(*(coolant({"flood": True}) for _ in range(4)), coolant({"flood": False}))
        assert [answer["flood"] for answer in answers] == [True] * 4 + [False]
        assert not world.machine.core.modal.flood
        await shop.stop()

    run_simulated(main())


def test_coolant_in_a_running_job_and_in_a_hold(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await world.job(LONG)
        await world.reaches("run")
        assert (await world.panel.switches.coolant({"flood": True}))["flood"] is True
        world.controller.pause()
        await world.reaches("hold")
        assert (await world.panel.switches.coolant({"flood": False}))["flood"] is False
        await shop.stop()

    run_simulated(main())


def test_mist_that_is_not_built_in_is_told(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        problem = await refusal(world.panel.switches.coolant({"mist": True}))
        assert (problem.code, "option M" in problem.detail) == ("command_failed", True)
        await shop.stop()

    run_simulated(main())


def test_without_reports_of_what_runs_nothing_is_toggled(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, flavour="grblHAL", dollar={10: 511 - 64})
        shop = await world.connected()
        await world.reaches("idle")
        problem = await refusal(world.panel.switches.coolant({"flood": True}))
        assert (problem.code, "$10" in problem.detail) == ("wrong_state", True)
        assert not world.machine.core.modal.flood
        await shop.stop()

    run_simulated(main())


def test_the_spindle_is_stopped_in_a_hold_and_nowhere_else(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        with pytest.raises(ProblemError, match="state idle"):
            world.panel.switches.spindle_stop()
        await world.job(LONG)
        await world.reaches("run")
        with pytest.raises(ProblemError, match="state run") as refused:
            world.panel.switches.spindle_stop()
        assert refused.value.code == "wrong_state"
        world.controller.pause()
        await world.reaches("hold")
        await until(lambda: "spindle_cw" in world.controller.state.accessories, within_s=10)
        world.panel.switches.spindle_stop()
        await until(lambda: "spindle_cw" not in world.controller.state.accessories, within_s=10)
        world.panel.switches.spindle_stop()
        await until(lambda: "spindle_cw" in world.controller.state.accessories, within_s=10)
        await shop.stop()

    run_simulated(main())


def test_the_door_stops_what_moves(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        move(world)
        await world.reaches("run")
        world.panel.switches.door()
        await world.reaches("door")
        await shop.stop()

    run_simulated(main())


def test_the_doors_byte_goes_out_in_every_state(tmp_path: Path) -> None:
    """What is known of the state may be a poll old."""

    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        await world.panel.check_mode(on=True)
        await world.reaches("check")
        with pytest.raises(ProblemError) as refused:
            world.panel.switches.door()
        assert (refused.value.code, "sent all the same" in refused.value.detail) == ("wrong_state", True)
        assert world.sent()[-1] == "0x84"
        await shop.stop()

    run_simulated(main())


PRESSES: dict[str, Callable[[Switches], Any]] = {
    "overrides": lambda s: s.override({"feed": 110}),
    "coolant": lambda s: s.coolant({"flood": True}),
    "spindle_stop": lambda s: s.spindle_stop(),
    "door": lambda s: s.door(),
}


async def _pressed(press: Callable[[Switches], Any], on: Switches) -> None:
    done = press(on)
    if asyncio.iscoroutine(done):
        await done


@pytest.mark.parametrize("name", PRESSES)
def test_unplugged_and_another_protocol(tmp_path: Path, name: str) -> None:
    async def main() -> None:
        world = bench(tmp_path / "grbl")
        world.cable.plugged = False
        shop = await world.start()
        assert (await refusal(_pressed(PRESSES[name], world.panel.switches))).code == "not_connected"
        await shop.stop()
        other = Bench(tmp_path / "elvinto")
        shop = await other.connected()
        problem = await refusal(_pressed(PRESSES[name], shop.panels["router"].switches))
        assert (problem.code, problem.extra["capability"]) == ("not_supported", name)
        await shop.stop()

    run_simulated(main())


def test_a_cable_pulled_while_the_reports_are_awaited(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        asked = asyncio.ensure_future(world.panel.switches.coolant({"flood": True}))
        await asyncio.sleep(0)
        world.cable.pull()
        with pytest.raises(ProblemError) as refused:
            await asked
        assert refused.value.code == "no_answer"
        await shop.stop()

    run_simulated(main())
