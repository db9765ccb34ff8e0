"""What a controller holds is asked for; what it does not say is not known, and nobody waits for it for ever."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from gcode.held import Held
from server.app import Workshop
from server.machine.controller import Controller
from server.machine.modes import ANSWERED_WITHIN_S, STARTED_IN, began_in, held_by
from tests.harness.grblworkshop import GrblBench
from tests.harness.simloop import run_simulated, until
from tests.harness.workshop import MACHINE, Bench

Story = Callable[[GrblBench, Workshop, Controller], Awaitable[None]]


def told(folder: Path, story: Story) -> None:
    async def main() -> None:
        bench = GrblBench(folder)
        shop = await bench.connected()
        await story(bench, shop, shop.machines[MACHINE])
        await shop.stop()

    run_simulated(main())


def test_modes_offsets_and_place_as_they_are_now(tmp_path: Path) -> None:
    async def story(_bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await router.run_blocks(["G10 L2 P2 X5 Y0 Z0", "G55 G91 F250", "G92 Y3"])
        held = await held_by(router)
        assert held is not None
        assert {"G55", "G91", "F250"} <= set(held.modal)
        assert held.offsets is not None
        assert (held.offsets["G55"]["x"], held.offsets["G92"]["y"]) == (5.0, -3.0)
        await until(lambda: router.program_position.get("y") == 3.0, within_s=10)
        held = await held_by(router)
        assert held is not None
        assert held.position == {"x": -5.0, "y": 3.0, "z": 0.0}

    told(tmp_path, story)


def test_what_the_history_says_of_the_start_of_a_job(tmp_path: Path) -> None:
    async def story(bench: GrblBench, shop: Workshop, router: Controller) -> None:
        await router.run_blocks(["G56 G20"])
        job = await bench.job("G90\nG1 X1 F10\nM30\n")
        await bench.status(job["id"], "completed")
        row = await shop.jobs.row(job["id"])
        began = await began_in(shop.db, row)
        assert began is not None
        assert {"G56", "G20"} <= set(began.modal)
        assert began.position == {"x": 0.0, "y": 0.0, "z": 0.0}
        # Where the machine stood is the place before the first line of the program, and of no other.
        later = await began_in(shop.db, {**row, "start_line": 2})
        assert later is not None
        assert (later.modal, later.position) == (began.modal, {})
        assert await began_in(shop.db, {**row, "id": 99}) is None
        kinds = [event["type"] for event in await shop.jobs.events(job["id"])]
        assert kinds.count(STARTED_IN) == 1

    told(tmp_path, story)


def test_a_controller_that_moves_or_is_gone_is_not_asked(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        await router.jog({"x": 20.0}, 600)
        await until(lambda: router.state.status == "jog", within_s=5)
        assert await held_by(router) == Held((), None, dict(router.program_position))
        await until(lambda: router.state.status == "idle", within_s=30)
        bench.cable.pull()
        held = await held_by(router)
        assert held is not None
        assert (held.modal, held.offsets) == ((), None)

    told(tmp_path, story)


def test_an_answer_that_does_not_come_is_not_waited_for(tmp_path: Path) -> None:
    async def story(bench: GrblBench, _shop: Workshop, router: Controller) -> None:
        loop = asyncio.get_running_loop()
        bench.cable.drop()  # nobody tells the daemon: its questions go nowhere
        began = loop.time()
        held = await held_by(router)
        assert held is not None
        assert (held.modal, held.offsets) == ((), None)
        assert loop.time() - began <= 2 * ANSWERED_WITHIN_S + 0.1

    told(tmp_path, story)


def test_elsewhere_there_is_no_such_question(tmp_path: Path) -> None:
    async def main() -> None:
        bench = Bench(tmp_path)
        shop = await bench.connected()
        assert await held_by(shop.machines[MACHINE]) is None
        await shop.stop()

    run_simulated(main())
