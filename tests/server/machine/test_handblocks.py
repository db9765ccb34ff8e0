"""Blocks by hand: nothing of a request goes out after a stop, or once somebody else has the machine."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from protocol.events import CommandDone, Event
from server.machine.controller import Controller
from server.problems import ProblemError
from tests.harness.grblworkshop import GrblBench
from tests.harness.ncworkshop import HERE, NcBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, OURS, Bench

KINDS = (Bench, GrblBench, NcBench)
ANNA, BERT = ({"name": name, "client": "10.0.0.1", "since": "2026-03-01T09:30:00.000Z"} for name in ("Anna", "Bert"))

Story = Callable[[Bench, Controller], Any]


def told(bench: Bench, story: Story) -> None:
    async def main() -> None:
        shop = await bench.connected()
        controller = shop.machines[MACHINE]
        if isinstance(bench, NcBench):
            await controller.run_blocks([HERE])
        await controller.run_blocks(["G21 G91"])
        await story(bench, controller)
        await shop.stop()

    run_simulated(main())


def moves(controller: Controller) -> "asyncio.Task[list[dict[str, Any]]]":
    """Four of some seconds each."""
    return asyncio.ensure_future(controller.run_blocks([f"G1 X{way} F100" for way in (5, 6, 7, 8)]))


def after_the_first(controller: Controller, do: Callable[[], None]) -> None:
    """Do something in the moment in which the machine has nothing: the first block has ended, nobody knows it yet."""
    heard, handle = list[Event](), controller.manual.handle

    def watch(event: Event) -> None:
        handle(event)
        if isinstance(event, CommandDone) and not heard:
            heard.append(event)
            do()

    controller.manual.handle = watch  # type: ignore[method-assign]


async def ended(work: "asyncio.Task[list[dict[str, Any]]]") -> tuple[str, int]:
    """The word for the end of the request, and how many blocks were done."""
    try:
        results = await work
    except ProblemError as problem:
        return problem.code, len(problem.extra["results"])
    return "answered", sum(result["ok"] for result in results)


async def nothing_follows(bench: Bench, controller: Controller) -> None:
    await until(lambda: not controller.manual.busy, within_s=60)
    before = len(bench.machine.executed), controller.program_position
    await asyncio.sleep(10)
    assert [block for block in bench.machine.executed[before[0] :] if block.text not in OURS] == []
    assert controller.program_position in (before[1], {}), "a lathe that was stopped does not know"


@pytest.mark.parametrize("kind", KINDS)
def test_all_of_them(tmp_path: Path, kind: type[Bench]) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        assert await ended(moves(controller)) == ("answered", 4)
        assert controller.program_position["x"] == pytest.approx(26.0, abs=0.01)

    told(kind(tmp_path), story)


@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_ends_the_rest(tmp_path: Path, kind: type[Bench]) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        work = moves(controller)
        await asyncio.sleep(1.0)
        controller.stop()
        # A machine that can drop what it has says so; another one ends the block that it executes.
        assert await ended(work) in {("command_failed", 1), ("answered", 0)}
        await nothing_follows(bench, controller)

    told(kind(tmp_path), story)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("verb", ["stop", "estop"])
def test_a_stop_between_two_blocks_ends_the_rest(tmp_path: Path, kind: type[Bench], verb: str) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        after_the_first(controller, getattr(controller, verb))
        assert await ended(moves(controller)) == ("command_failed", 1)
        await nothing_follows(bench, controller)

    told(kind(tmp_path), story)


def test_a_pause_between_two_blocks_holds_the_next(tmp_path: Path) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        after_the_first(controller, controller.pause)
        work = moves(controller)
        await until(lambda: controller.state.status == "hold", within_s=30)
        place = controller.program_position["x"]
        await asyncio.sleep(10)
        assert controller.program_position["x"] == pytest.approx(place, abs=0.1)
        controller.resume()
        assert await ended(work) == ("answered", 4)

    told(GrblBench(tmp_path), story)


@pytest.mark.parametrize("kind", KINDS)
def test_whoever_takes_over_has_the_machine_alone(tmp_path: Path, kind: type[Bench]) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        controller.show_control(ANNA)
        work = moves(controller)
        await asyncio.sleep(1.0)
        controller.show_control(BERT)
        assert await ended(work) == ("control_held", 1)
        await nothing_follows(bench, controller)

    told(kind(tmp_path), story)


def test_between_two_blocks_no_job_begins(tmp_path: Path) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        refused: list[str] = []

        def begin() -> None:
            try:
                controller.check_can_start()
            except ProblemError as problem:
                refused.append(problem.code)

        after_the_first(controller, begin)
        assert await ended(moves(controller)) == ("answered", 4)
        assert refused == ["machine_busy"]

    told(Bench(tmp_path), story)


@pytest.mark.parametrize("kind", KINDS)
def test_digits_of_other_scripts_are_no_g_code_but_may_stand_in_a_comment(kind: type[Bench], tmp_path: Path) -> None:
    async def story(bench: Bench, controller: Controller) -> None:
        before = len(bench.machine.executed)
        with pytest.raises(ProblemError, match=r"\\u0661.* no G-code") as caught:
            await controller.run_blocks(["G1 X5 F100", "G1 X\u0661"])
        assert caught.value.code == "invalid_request"
        assert len(bench.machine.executed) == before
        asked = await controller.run_blocks(["G1 X1 F100 (шаг \u0661)"])
        assert len(asked) == 1, "what a comment is, the controller decides"

    told(kind(tmp_path), story)
