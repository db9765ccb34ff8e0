"""What people ask of a machine: in which state it is refused, and with which word."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from server.app import Workshop
from server.machine.controller import Controller
from server.problems import ProblemError
from sim.elvinto.settings import SimSettings
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

LONG = "G90\n" + "".join(f"G1 X{i} Y{i % 7} F600\n" for i in range(1, 100)) + "M30\n"

Ask = Callable[[Controller], Any]
VERBS: dict[str, Ask] = {
    "pause": lambda c: c.pause(),
    "resume": lambda c: c.resume(),
    "stop": lambda c: c.stop(),
    "home": lambda c: c.home(),
    "unlock": lambda c: c.unlock(),
    "reset": lambda c: c.reset(),
    "disconnect": lambda c: c.disconnect(),
    "run_blocks": lambda c: c.run_blocks(["G0 X0"]),
    "jog": lambda c: c.jog({"x": 1.0}, 600),
    "list_files": lambda c: c.list_files(),
    "run_file": lambda c: c.run_file("a.nc"),
    "confirm_tool": lambda c: c.confirm_tool(),
}

BY_HAND = ("home", "run_blocks", "jog", "list_files", "run_file")

REFUSED: dict[str, dict[str, str]] = {
    "unplugged": dict.fromkeys((*BY_HAND, "unlock", "reset"), "not_connected")
    | dict.fromkeys(("pause", "resume", "stop", "confirm_tool"), "wrong_state"),
    "idle": dict.fromkeys(("pause", "resume", "stop", "confirm_tool"), "wrong_state"),
    "job": dict.fromkeys((*BY_HAND, "unlock", "reset", "disconnect"), "job_active")
    | dict.fromkeys(("resume", "confirm_tool"), "wrong_state"),
    "alarm": dict.fromkeys(BY_HAND, "alarm_active")
    | dict.fromkeys(("pause", "resume", "stop", "confirm_tool"), "wrong_state"),
}


async def bring_about(bench: Bench, situation: str) -> Workshop:
    if situation == "unplugged":
        bench.cable.plugged = False
        return await bench.start()
    shop = await bench.connected()
    if situation == "job":
        await bench.job(LONG)
        await until(lambda: len(bench.executed()) > 3, within_s=30)
    if situation == "alarm":
        bench.machine.press_emergency(asyncio.get_running_loop().time())
        bench.cable.touch()
        await until(lambda: shop.machines[MACHINE].state.status == "alarm", within_s=10)
    return shop


async def ask(controller: Controller, verb: str) -> str | None:
    try:
        answer = VERBS[verb](controller)
        if isinstance(answer, Awaitable):
            await answer
    except ProblemError as problem:
        return problem.code
    return None


@pytest.mark.parametrize("situation", REFUSED)
def test_every_refusal_has_its_word(tmp_path: Path, situation: str) -> None:
    async def main() -> None:
        shop: Workshop | None = None
        for verb in VERBS:
            bench = Bench(tmp_path / verb, SimSettings(sd_files={"a.nc": b"G90\nM30\n"}))
            shop = await bring_about(bench, situation)
            refused = await asyncio.wait_for(ask(shop.machines[MACHINE], verb), 60)
            assert refused == REFUSED[situation].get(verb), verb
            await shop.stop()

    run_simulated(main())


def test_home_lifts_and_goes_to_the_corner(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        await shop.machines[MACHINE].home()
        await until(lambda: bench.executed() == ["G28"], within_s=10)
        await until(lambda: not shop.machines[MACHINE].manual.busy, within_s=60)
        await shop.stop()

    run_simulated(main())


def test_a_reset_clears_an_alarm_and_greets_anew(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bring_about(bench, "alarm")
        controller = shop.machines[MACHINE]
        await controller.reset()
        await until(lambda: controller.link_status == "connected", within_s=30)
        await until(lambda: controller.state.status == "idle", within_s=30)
        texts = [entry["text"] for entry in controller.console(100)]
        assert texts.index("RESETALERT;") < len(texts) - 1 - texts[::-1].index("INIT;")
        assert bench.cable.opened == 1, "the port stays open"
        await controller.run_blocks(["G0 X1"])
        await shop.stop()

    run_simulated(main())


def test_a_reset_gives_up_what_an_interrupted_job_left_open(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path, options={"resume_within": 0})
        shop = await bring_about(bench, "job")
        bench.cable.pull()
        view = await bench.status(1, "interrupted")
        bench.cable.plugged = True
        await until(lambda: bench.cable.opened == 2, within_s=10, step_s=0.001)
        controller = shop.machines[MACHINE]
        assert controller.link_status == "connecting", "the fate of the batch is not settled yet"
        await controller.reset()
        await until(lambda: controller.link_status == "connected", within_s=60)
        now = await shop.jobs.get(1)
        assert (now["error"]["line_from"], now["error"]["line_to"]) == (
            view["error"]["line_from"],
            view["error"]["line_to"],
        )
        report = await shop.jobs.report(1)
        assert [row["status"] for row in report["doubtful"]] == ["doubtful"]
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("verb", ["stop", "estop"])
def test_a_stop_sweeps_what_waits_by_hand(tmp_path: Path, verb: str) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        await controller.jog({"x": 50.0}, 600)
        await controller.jog({"x": 50.0}, 600)
        assert await ask(controller, "jog") == "machine_busy", "one waits already"
        await asyncio.sleep(1.0)
        getattr(controller, verb)()
        assert not controller.manual.waiting
        await until(lambda: not controller.manual.busy, within_s=60)
        assert [block for block in bench.executed() if block.startswith("G1")] == ["G1 X50 F600"]
        await shop.stop()

    run_simulated(main())


def test_a_jog_that_waits_can_be_taken_back(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        await controller.jog({"x": 5.0}, 600)
        await controller.jog({"y": 5.0}, 600)
        controller.cancel_jog()
        await until(lambda: not controller.manual.busy, within_s=60)
        assert [block for block in bench.executed() if block.startswith("G1")] == ["G1 X5 F600"]
        await shop.stop()

    run_simulated(main())


@pytest.mark.parametrize("block", ["", "  ", "G0 X1|G0 X2", "G0 X1;G0 X2", "G0 X1\nG0 X2", "G0\x00X1"])
def test_what_is_not_one_block(tmp_path: Path, block: str) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        with pytest.raises(ProblemError) as refused:
            await shop.machines[MACHINE].run_blocks(["G0 X1", block])
        assert refused.value.code == "invalid_request"
        assert bench.executed() == [], "nothing is run of a request that is wrong"
        await shop.stop()

    run_simulated(main())


def test_numbers_are_written_as_controllers_read_them(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        await shop.machines[MACHINE].jog({"x": 0.00001, "y": -1e-3, "z": 10.0}, 1e5)
        await until(lambda: len(bench.executed()) == 4, within_s=10)
        assert bench.executed()[2] == "G1 X0 Y-0.001 Z10 F100000"
        await shop.stop()

    run_simulated(main())


def test_an_emergency_stop_while_a_program_is_read_keeps_the_job_from_beginning(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        controller.stream.beginning.reserve(7)
        controller.estop()
        assert not controller.stream.beginning.release()
        controller.stream.beginning.reserve(8)
        controller.stop()
        assert not controller.stream.beginning.release()
        controller.stream.beginning.reserve(9)
        assert controller.stream.beginning.release()
        await shop.stop()

    run_simulated(main())


def test_an_emergency_stop_that_was_not_heard_is_the_first_word_of_the_next_connection(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        machine = shop.machines[MACHINE]
        job = await bench.job(LONG)
        await bench.status(job["id"], "running")
        machine._port.write = lambda _data: None  # type: ignore[method-assign, union-attr]
        machine.estop()
        bench.cable.pull()
        assert "W98" not in [block.text for block in bench.machine.executed]
        bench.cable.plugged = True
        await until(lambda: machine.link_status == "connected", within_s=60)
        assert machine.state.status == "alarm"
        assert "W98" in [block.text for block in bench.machine.executed]
        await machine.unlock()
        await machine.home()
        assert (await shop.jobs.get(job["id"]))["status"] == "failed"
        await shop.stop()

    run_simulated(main())


def test_what_the_machine_refuses_is_told_with_its_number_once(tmp_path: Path) -> None:
    async def main() -> None:
        shop = await Bench(tmp_path).connected()
        with pytest.raises(ProblemError) as refused:
            await shop.machines[MACHINE].run_file("no-such.nc")
        assert (refused.value.code, refused.value.detail.count("8")) == ("command_failed", 1)
        await shop.stop()

    run_simulated(main())
