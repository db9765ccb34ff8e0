"""Questions and writes to a virtual Grbl: what is read, in which state what is refused, and how silence ends."""

import asyncio
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from protocol.commands import EmergencyStop, FeedHold, RunBlock
from server.machine import enquiries
from server.machine.enquiries import VERBS, Enquiries
from server.machine.verbs import GRBL
from server.problems import ProblemError
from tests.harness.panelbench import PanelBench, bench, refusal
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import Bench

LONG = "G21G90\nG1 F300\n" + "".join(f"G1 X{i} Y{i % 7}\n" for i in range(1, 100)) + "M30\n"

Ask = Callable[[Enquiries], Coroutine[Any, Any, Any]]
READS: dict[str, Ask] = {
    "firmware": Enquiries.firmware,
    "settings": Enquiries.settings,
    "offsets": Enquiries.offsets,
    "modal": Enquiries.modal,
    "startup": Enquiries.startup_blocks,
}
WRITES: dict[str, Ask] = {
    "setting": lambda e: e.write_setting(110, "600"),
    "info": lambda e: e.write_info("MILL"),
    "block": lambda e: e.write_startup_block(0, "G21"),
    "offset": lambda e: e.run_offset_block("G10L20P1X0"),
    "check": lambda e: e.check_mode(on=True),
    "sleep": lambda e: e.sleep(),
    "restore": lambda e: e.restore("settings"),
}
ALL = READS | WRITES

LOCKED_OUT = dict.fromkeys(ALL, "alarm_active")
REFUSED: dict[str, dict[str, str]] = {
    "unplugged": dict.fromkeys(ALL, "not_connected"),
    "idle": {},
    "run": dict.fromkeys(ALL, "wrong_state") | {"modal": ""},
    "hold": dict.fromkeys(ALL, "wrong_state"),
    "job": dict.fromkeys(ALL, "job_active") | {"modal": ""},
    "held job": dict.fromkeys(ALL, "job_active") | {"modal": "wrong_state"},
    "alarm": dict.fromkeys(("block", "offset", "check"), "alarm_active"),
    "hard limit": LOCKED_OUT,
    "check": dict.fromkeys(ALL, "wrong_state") | {"settings": "", "modal": "", "check": ""},
    "sleep": dict.fromkeys(ALL, "wrong_state"),
}
"""What is refused with which code; "" and what is not named is done."""


async def _bring_about(world: PanelBench, situation: str) -> None:
    if situation == "unplugged":
        world.cable.plugged = False
        await world.start()
        return
    shop = await world.ready()
    controller = world.controller
    match situation:
        case "run" | "hold":
            controller.ask(lambda token: RunBlock(token, ("G1X100F300",)))
            await world.reaches("run")
            if situation == "hold":
                controller.press(FeedHold)
                await world.reaches("hold")
        case "job" | "held job":
            await world.job(LONG)
            await world.reaches("run")
            if situation == "held job":
                controller.pause()
                await world.reaches("hold")
        case "alarm" | "hard limit":
            if situation == "alarm":
                controller.ask(lambda token: RunBlock(token, ("G1X100F300",)))
                await world.reaches("run")
                controller.press(EmergencyStop)
            else:
                controller.ask(lambda token: RunBlock(token, ("G1X160F30000",)))
            await world.reaches("alarm")
            await asyncio.sleep(2.0)
        case "check":
            await shop.panels[world.controller.name].check_mode(on=True)
            await world.reaches("check")
        case "sleep":
            await Enquiries(controller).sleep()
            await world.reaches("sleep")


@pytest.mark.parametrize("situation", REFUSED)
def test_every_refusal_has_its_word_and_says_what_to_do(tmp_path: Path, situation: str) -> None:
    async def main() -> None:
        for name, asking in ALL.items():
            world = bench(tmp_path / name, dollar={21: 1})
            await _bring_about(world, situation)
            code = REFUSED[situation].get(name, "")
            asked = asyncio.wait_for(asking(Enquiries(world.controller)), 30)
            if code:
                problem = await refusal(asked)
                assert problem.code == code, f"{name}: {problem}"
                assert len(problem.detail.split()) > 4
            else:
                await asked
            assert world.shop is not None
            await world.shop.stop()

    run_simulated(main())


def test_every_verb_is_a_capability_of_grbl() -> None:
    assert {verb.capability for verb in VERBS} <= set(GRBL.capabilities)


def test_another_protocol_has_none_of_it(tmp_path: Path) -> None:
    async def main() -> None:
        world = Bench(tmp_path)
        shop = await world.connected()
        for name, asking in ALL.items():
            problem = await refusal(asking(Enquiries(shop.machines["router"])))
            assert problem.code == "not_supported", name
            assert "elvinto" in problem.detail
            assert problem.extra["capability"] in GRBL.capabilities
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize(
    ("asking", "code", "controller_code", "words"),
    [
        (lambda e: e.write_setting(999, "1"), "command_failed", 3, "unknown $ command"),
        (lambda e: e.descriptions(), "command_failed", 2, "missing or bad"),
        (lambda e: e.write_setting(20, "1"), "command_failed", 10, "switch homing on"),
        (lambda e: e.write_setting(0, "1"), "command_failed", 6, "step pulse"),
        (lambda e: e.run_offset_block("G10L20P9X0"), "command_failed", 29, "coordinate system"),
        (lambda e: e.write_startup_block(0, "G1X1"), "command_failed", 22, "F word"),
    ],
)
def test_an_error_of_the_controller_is_told_with_its_number_meaning_and_remedy(
    tmp_path: Path, asking: Ask, code: str, controller_code: int, words: str
) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        problem = await refusal(asking(Enquiries(world.controller)))
        assert (problem.code, problem.extra["controller_code"]) == (code, controller_code)
        assert f"error:{controller_code}" in problem.detail
        assert words in problem.detail
        assert problem.extra["remedy"] in problem.detail
        await shop.stop()

    run_simulated(main())


def test_a_write_that_reads_back_otherwise_has_failed(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        problem = await refusal(Enquiries(world.controller).write_setting(1, "25.7"))
        assert problem.code == "command_failed"
        assert "$1 was set to 25.7 and reads back as 25" in problem.detail
        await shop.stop()

    run_simulated(main())


def test_a_cable_pulled_while_asking_is_no_answer(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        asked = asyncio.ensure_future(Enquiries(world.controller).settings())
        await asyncio.sleep(0)
        world.cable.pull()
        with pytest.raises(ProblemError) as refused:
            await asked
        assert refused.value.code == "no_answer"
        await shop.stop()

    run_simulated(main())


def test_a_controller_that_falls_silent_is_no_answer(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        asked = asyncio.ensure_future(Enquiries(world.controller).settings())
        world.machine.power_off(asyncio.get_running_loop().time())
        with pytest.raises(ProblemError) as refused:
            await asked
        assert refused.value.code == "no_answer"
        await shop.stop()

    run_simulated(main())


def test_what_was_not_handed_over_in_time_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        engine = world.controller._link.engine  # type: ignore[union-attr]
        with monkeypatch.context() as context:
            context.setattr(engine, "free", lambda: 0)
            began = asyncio.get_running_loop().time()
            problem = await refusal(Enquiries(world.controller).settings())
            assert asyncio.get_running_loop().time() - began == pytest.approx(enquiries.HANDED_OVER_WITHIN_S)
            assert (problem.code, "nothing was sent" in problem.detail) == ("machine_busy", True)
        before = world.sent()
        await asyncio.sleep(5)
        assert world.sent() == before, "it must not go out later"
        await shop.stop()

    run_simulated(main())


def test_what_waits_with_the_controller_may_still_be_done(tmp_path: Path) -> None:
    """A hold right behind the question: the engine waits with it until the machine goes on."""

    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        world.controller.ask(lambda token: RunBlock(token, ("G1X150F100",)))
        problem = await refusal(Enquiries(world.controller).settings())
        assert problem.code == "no_answer"
        assert "may still" in problem.detail
        await until(lambda: "$$" in world.sent()[-3:], within_s=120)
        await shop.stop()

    run_simulated(main())


def test_a_pendant_keeps_everybody_else_out(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path, flavour="grblHAL")
        shop = await world.ready()
        world.machine.set_mpg(True, asyncio.get_running_loop().time())
        world.cable.touch()
        await until(lambda: world.controller.state.pendant, within_s=10)
        problem = await refusal(Enquiries(world.controller).settings())
        assert (problem.code, "pendant" in problem.detail) == ("machine_busy", True)
        await shop.stop()

    run_simulated(main())


def test_modal_groups_are_read_in_the_middle_of_a_job(tmp_path: Path) -> None:
    async def main() -> None:
        world = bench(tmp_path)
        shop = await world.ready()
        job = await world.job(LONG)
        await world.reaches("run")
        for _ in range(5):
            assert "G1" in (await Enquiries(world.controller).modal()).words
        await world.status(job["id"], "completed")
        assert world.executed()[: len(LONG.split())] != []
        await shop.stop()

    run_simulated(main())
